/** The address of the page, such as `#capture?text=crc&table=skipped`: a view and what it shows. */

export const VIEWS = ["try", "capture", "line"] as const;
export type View = (typeof VIEWS)[number];

export function view(): View {
  const name = location.hash.slice(1).split("?")[0];
  return VIEWS.find((view) => view === name) ?? "try";
}

export function settings(): URLSearchParams {
  return new URLSearchParams(location.hash.split("?")[1] ?? "");
}

/**
 * Writes what the view shows into the address, without a new step in the history. Empty values are
 * left out.
 */
export function remember(changes: Record<string, string>): void {
  const all = settings();
  for (const [name, value] of Object.entries(changes)) {
    if (value === "") all.delete(name);
    else all.set(name, value);
  }
  const query = all.toString();
  history.replaceState(null, "", `#${view()}${query && `?${query}`}`);
}
