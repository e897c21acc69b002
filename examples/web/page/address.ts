/** The address of the page, such as `#capture?text=crc&tables=skipped`: a view and what it shows. */
import { the } from "./dom.ts";

export const VIEWS = ["try", "capture", "line"] as const;
export type View = (typeof VIEWS)[number];

export function view(): View {
  const name = location.hash.slice(1).split("?")[0];
  return VIEWS.find((view) => view === name) ?? "try";
}

export function settings(): URLSearchParams {
  return new URLSearchParams(location.hash.split("?")[1] ?? "");
}

/** The link to a view leads to what the view showed last. */
const link = () => the(`to-${view()}`, HTMLAnchorElement);

/** The address says what the view shows already, because the view has written it. */
export const isShown = (): boolean => link().hash === location.hash;

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
  link().hash = location.hash;
}
