/** A frame or gap of a capture or of a line, from its JSON to words. */
import type { Column, Fields, Table } from "./contract.ts";
import { make } from "./dom.ts";

export const GAPS = "skipped";

const REASON_WORDS: Record<string, string> = {
  header: "no frame starts here",
  length: "a length that no frame has",
  id: "whole, but for a node that cannot exist",
  crc: "damaged, or not a frame",
  idle: "the line went quiet in the middle of it",
};

export const reasonWords = (reason: string): string =>
  `${reason}: ${REASON_WORDS[reason] ?? "skipped"}`;

/** Fields that have a place of their own. */
const PLACED = new Set([
  "event",
  "protocol",
  "message",
  "bytes",
  "t",
  "offset",
  "length",
  "direction",
  "interface",
  "reason",
  "reasons",
]);

/** Fields that the heading and the line of bytes say. */
const SAID = new Set(["event", "protocol", "message", "bytes"]);

export const tableOf = (fields: Fields): string =>
  fields.event === GAPS ? GAPS : `${fields.protocol}.${fields.message}`;

/** `08:00:00.004814` (UTC) where there are times, otherwise the place in the file. */
export function when(fields: Fields): string {
  if (typeof fields.t !== "number") return `byte ${fields.offset}`;
  return clock(fields.t, 6);
}

/** The time of day (UTC) with so many digits of a second. */
export function clock(seconds: number, digits: number): string {
  const whole = Math.floor(seconds);
  const date = new Date(whole * 1000);
  if (Number.isNaN(date.getTime())) return `${seconds} s`;
  const part = Math.min(1 - 10 ** -digits, seconds - whole)
    .toFixed(digits)
    .slice(1);
  return date.toISOString().slice(11, 19) + part;
}

/** The cells of a row. */
export function cells(line: string): HTMLElement[] {
  const fields = JSON.parse(line) as Fields;
  const isGap = fields.event === GAPS;
  const what = isGap ? "(skipped)" : String(fields.message);
  const cell = (kind: string, text: string) => make("span", { class: kind }, text);
  return [
    cell("when", when(fields)),
    cell("way", typeof fields.direction === "string" ? fields.direction : ""),
    cell(isGap ? "what gap" : "what", what),
    cell(
      "contents",
      isGap ? `${fields.length} bytes, ${reasonWords(String(fields.reason))}` : contents(fields),
    ),
  ];
}

function contents(fields: Fields): string {
  return Object.entries(fields)
    .filter(([name]) => !PLACED.has(name))
    .map(([name, value]) => `${name} ${text(value)}`)
    .join("  ");
}

function text(value: unknown): string {
  if (Array.isArray(value)) return value.join(" ");
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

/** All fields of a row with unit and meaning, and its bytes. */
export function details(
  line: string,
  bytes: { offset: number; hex: string },
  tables: Table[],
): HTMLElement[] {
  const fields = JSON.parse(line) as Fields;
  const name = tableOf(fields);
  const columns = new Map(
    (tables.find(({ table }) => table === name)?.columns ?? []).map((column) => [
      column.name,
      column,
    ]),
  );
  const entries = Object.entries(fields).filter(([field]) => !SAID.has(field));
  const ordered = [
    ...entries.filter(([field]) => !PLACED.has(field)),
    ...entries.filter(([field]) => PLACED.has(field)),
  ];
  const rows = ordered.flatMap(([field, value]) => detail(field, value, columns));
  const parts: HTMLElement[] = [make("h3", {}, name === GAPS ? "Skipped bytes" : name)];
  if (name === GAPS) parts.push(make("p", {}, `${reasonWords(String(fields.reason))}.`));
  const head = make(
    "thead",
    {},
    make(
      "tr",
      {},
      ...["Field", "Value", "Meaning"].map((title) => make("th", { scope: "col" }, title)),
    ),
  );
  parts.push(make("table", {}, head, make("tbody", {}, ...rows)));
  parts.push(
    make(
      "p",
      { class: "hex" },
      bytes.hex === "" ? `From byte ${bytes.offset} of the file.` : bytes.hex,
    ),
  );
  return parts;
}

function detail(name: string, value: unknown, columns: Map<string, Column>): HTMLElement[] {
  if (Array.isArray(value))
    return value.flatMap((item, at) => detail(`${name}_${at}`, item, columns));
  if (typeof value === "object" && value !== null) {
    return Object.entries(value).flatMap(([key, item]) => detail(`${name}_${key}`, item, columns));
  }
  const { unit = "", meaning = "" } = columns.get(name) ?? {};
  const tail = [unit === "none" || unit === "" ? String(value) : `${value} ${unit}`, meaning].map(
    (text) => make("td", {}, text),
  );
  return [make("tr", {}, make("th", { scope: "row" }, name), ...tail)];
}
