/**
 * The few ways in which this page changes what is seen. Text is always set as text, never as HTML.
 */

type Attributes = Record<string, string>;

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** The element of index.html with this id, which must be of this kind. */
export function the<T extends HTMLElement>(id: string, kind: new () => T): T {
  const element = document.getElementById(id);
  if (!(element instanceof kind)) throw new Error(`index.html has no ${kind.name} "${id}"`);
  return element;
}

export const button = (id: string) => the(id, HTMLButtonElement);
export const input = (id: string) => the(id, HTMLInputElement);
export const select = (id: string) => the(id, HTMLSelectElement);

/** A field for a number. Not one of type "number": that drops a comma, and turns with the wheel. */
export const numberField = (value: string) =>
  make("input", { inputmode: "decimal", autocomplete: "off", size: "5", value });

/** What is written in it, with a point or a comma; nothing if that is no number in this range. */
export function numberIn(
  field: HTMLInputElement,
  least: number,
  most: number,
  isWhole = false,
): number | undefined {
  const text = field.value.trim().replace(",", ".").replace("−", "-");
  const value = /^[-+]?\d+(\.\d+)?$/.test(text) ? Number(text) : NaN;
  return value >= least && value <= most && (!isWhole || Number.isInteger(value))
    ? value
    : undefined;
}

/** Sets a text, and leaves the page alone if it is there already. */
export function say(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** A part of the page that is there or not. */
export function show(element: HTMLElement, isShown: boolean): void {
  if (element.hidden === isShown) element.hidden = !isShown;
}

export const message = (error: unknown): string =>
  error instanceof Error ? error.message : String(error);

export const count = (n: number): string => n.toLocaleString("en");
export const counted = (n: number, one: string, many = `${one}s`): string =>
  `${count(n)} ${n === 1 ? one : many}`;

/** Offers data to the user as a file. */
export function download(name: string, parts: BlobPart[], type: string): void {
  const url = URL.createObjectURL(new Blob(parts, { type }));
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}
