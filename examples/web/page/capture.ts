/**
 * The second view: a file is decoded, listed, filtered, plotted and exported. Nothing of it leaves
 * this computer.
 */
import { isShown, remember, settings, view } from "./address.ts";
import { CaptureFile, type Contents } from "./capture_file.ts";
import {
  button,
  count,
  counted,
  download,
  input,
  make,
  message,
  say,
  select,
  show,
  the,
} from "./dom.ts";
import { cells, details, GAPS, reasonWords } from "./frames.ts";
import * as plot from "./plot.ts";
import { Rows } from "./rows.ts";

const TYPING_MS = 250;
/** Of a long gap, so many bytes are shown. */
const MOST_BYTES = 256;

const drop = the("capture-drop", HTMLElement);
const words = the("capture-words", HTMLElement);
const progress = the("capture-progress", HTMLProgressElement);
const opened = the("capture-opened", HTMLElement);
const tables = the("capture-tables", HTMLElement);
const shown = the("capture-shown", HTMLElement);
const list = the("capture-rows", HTMLElement);
const detail = the("capture-detail", HTMLElement);

let capture: CaptureFile | undefined;
let contents: Contents | undefined;
let shownRows = 0;
let filtered = 0;
let typing: ReturnType<typeof setTimeout> | undefined;

const rows = new Rows(
  list,
  async (from, count) => (await capture?.ask("lines", { from, count })) ?? [],
  cells,
  choose,
);

/** Ends what takes long. It ends the worker, so a capture that was open is decoded again. */
function cancel(ready: Promise<WebAssembly.Module>): void {
  const again = contents && capture;
  capture?.end();
  if (again) void ready.then((module) => open(module, again.file));
}

/** Nothing: it is found out. */
function chosenProtocol(): string | undefined {
  const { value } = select("capture-protocol");
  return value === "auto" ? undefined : value;
}

async function open(module: WebAssembly.Module, file: File): Promise<void> {
  capture?.end();
  contents = undefined;
  const mine = new CaptureFile(file, module, chosenProtocol(), working);
  capture = mine;
  show(opened, false);
  say(words, `${file.name} is being decoded …`);
  working(0);
  try {
    contents = await mine.contents;
    say(words, sentence(file.name, contents));
    show(opened, true);
    await showContents(mine, contents);
  } catch (error) {
    // The tool's sentence; here the option is a choice.
    const why = message(error).replace(/use --protocol/, "choose the protocol");
    if (capture === mine) say(words, `${file.name}: ${why}`);
  } finally {
    if (capture === mine) idle();
  }
}

/** Lists and plots what the address says. */
async function showContents(capture: CaptureFile, contents: Contents): Promise<void> {
  offerTables(contents);
  await filter(Number.parseInt(settings().get("row") ?? "", 10));
  plot.open(capture, contents);
}

function working(share: number): void {
  show(progress, true);
  show(button("capture-cancel"), true);
  progress.value = share;
}

function idle(): void {
  show(progress, false);
  show(button("capture-cancel"), false);
}

function sentence(name: string, { summary: all, tables, rows }: Contents): string {
  const { summary, cut, notes } = all;
  const protocol = tables.find(({ table }) => table !== GAPS)?.table.split(".")[0] ?? "no frames";
  const reasons = Object.entries(summary.skipped_by)
    .filter(([, bytes]) => bytes > 0)
    .map(([reason, bytes]) => `${count(bytes)} for ${reason}`);
  const skipped =
    summary.skipped > 0
      ? `, ${counted(summary.skipped, "byte")} skipped (${reasons.join(", ")})`
      : ", nothing skipped";
  const back = summary.times_back
    ? ` The times go back ${counted(summary.times_back, "time")}.`
    : "";
  return `${name}: ${protocol}, ${counted(summary.received, "byte")}, ${counted(summary.frames, "frame")}${skipped}. ${counted(rows, "row")}.${back}${[...notes, cut ?? ""].map((note) => ` ${note}`).join("")}`.trim();
}

/** A box for each table, and the same tables for the export. */
function offerTables(contents: Contents): void {
  const wanted = settings().get("tables")?.split(",") ?? [];
  const filled = contents.tables.filter(({ rows }) => rows > 0);
  tables.replaceChildren(
    ...filled.map(({ table, rows }) => {
      const box = make("input", { type: "checkbox", value: table });
      box.checked = wanted.includes(table);
      return make("label", {}, box, ` ${table} (${count(rows)})`);
    }),
  );
  select("export-table").replaceChildren(...filled.map(({ table }) => make("option", {}, table)));
}

async function filter(selected = -1): Promise<void> {
  const names = [...tables.querySelectorAll("input")]
    .filter(({ checked }) => checked)
    .map(({ value }) => value);
  const text = input("capture-text").value;
  remember({ tables: names.join(","), text, row: selected >= 0 ? String(selected) : "" });
  if (!capture) return;
  const mine = ++filtered;
  list.setAttribute("aria-busy", "true");
  button("export-json").disabled = true;
  say(shown, "Searching …");
  try {
    const found = await capture.ask("filter", { tables: names, text });
    if (mine !== filtered) return;
    shownRows = found;
    say(shown, `${counted(found, "row")} of ${count(contents?.rows ?? 0)} shown`);
    rows.reset(found, selected);
    if (selected >= 0 && selected < found) await choose(selected);
    else detail.replaceChildren(make("p", {}, "Choose a row to see its fields and bytes."));
  } catch (error) {
    say(shown, message(error));
  } finally {
    if (mine === filtered) {
      list.removeAttribute("aria-busy");
      button("export-json").disabled = false;
    }
  }
}

async function choose(row: number): Promise<void> {
  remember({ row: String(row) });
  if (!capture || !contents) return;
  const [[line], bytes] = await Promise.all([
    capture.ask("lines", { from: row, count: 1 }),
    capture.ask("bytes", row),
  ]);
  if (line === undefined) return;
  if (bytes.hex === "") bytes.hex = await rawBytes(capture.file, contents, bytes.offset, line);
  detail.replaceChildren(...details(line, bytes, contents.tables));
}

/** The bytes of a gap, where the file is the bytes of the line and nothing else. */
async function rawBytes(
  file: File,
  { summary: { summary } }: Contents,
  offset: number,
  line: string,
): Promise<string> {
  if (summary.received !== file.size) return "";
  const { length } = JSON.parse(line) as { length: number };
  const bytes = new Uint8Array(
    await file.slice(offset, offset + Math.min(length, MOST_BYTES)).arrayBuffer(),
  );
  const hex = Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0").toUpperCase()).join(
    " ",
  );
  return length > MOST_BYTES ? `${hex} …` : hex;
}

async function save(kind: "csv" | "jsonl"): Promise<void> {
  if (!capture || !contents) return;
  const mine = capture;
  const both = [button("export-csv"), button("export-json")];
  for (const it of both) it.disabled = true;
  const name = mine.file.name.replace(/\.(gz|pcapng|pcap|bin)$/g, "");
  const table = select("export-table").value;
  try {
    if (kind === "csv") {
      const rows = contents.tables.find((one) => one.table === table)?.rows ?? 0;
      download(`${name}.${table}.csv`, [await mine.ask("csv", { table, rows })], "text/csv");
    } else {
      download(
        `${name}.jsonl`,
        [await mine.ask("jsonLines", { rows: shownRows })],
        "application/jsonl",
      );
    }
  } catch (error) {
    if (capture === mine) say(words, message(error));
  } finally {
    if (capture === mine) idle();
    for (const it of both) it.disabled = false;
  }
}

/** Obeys the address: the one that the page was opened with, or one that was edited since. */
function obeyAddress(): void {
  if (view() !== "capture") return;
  const [choice, wanted] = [select("capture-protocol"), settings().get("protocol") ?? ""];
  choice.value = [...choice.options].some(({ value }) => value === wanted) ? wanted : "auto";
  input("capture-text").value = settings().get("text") ?? "";
  remember({ protocol: chosenProtocol() ?? "" });
}

/** What was looked for in one file means nothing in the next. */
function forget(): void {
  remember({ text: "", tables: "", row: "", plot: "", columns: "", from: "", to: "" });
  input("capture-text").value = "";
}

export function start(ready: Promise<WebAssembly.Module>): void {
  const take = (files: FileList | null | undefined) => {
    const file = files?.[0];
    if (file && capture) forget();
    if (file) void ready.then((module) => open(module, file));
  };
  const file = input("capture-file");
  file.addEventListener("change", () => take(file.files));
  const again = () => {
    if (capture) void ready.then((module) => capture && open(module, capture.file));
  };
  obeyAddress();
  addEventListener("hashchange", () => {
    if (view() !== "capture" || isShown()) return;
    const protocol = chosenProtocol();
    obeyAddress();
    if (chosenProtocol() !== protocol) again();
    else if (capture && contents) void showContents(capture, contents);
  });
  select("capture-protocol").addEventListener("change", () => {
    remember({ protocol: chosenProtocol() ?? "" });
    again();
  });
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event: DragEvent) => {
    event.preventDefault();
    if (!drop.closest("section")?.hidden) take(event.dataTransfer?.files);
  });
  button("capture-cancel").addEventListener("click", () => cancel(ready));
  input("capture-text").addEventListener("input", () => {
    clearTimeout(typing);
    typing = setTimeout(() => void filter(), TYPING_MS);
  });
  tables.addEventListener("change", () => void filter());
  button("export-csv").addEventListener("click", () => void save("csv"));
  button("export-json").addEventListener("click", () => void save("jsonl"));
  const legend = the("capture-reasons", HTMLElement);
  legend.replaceChildren(
    ...["header", "length", "id", "crc", "idle"].map((reason) =>
      make("li", {}, reasonWords(reason)),
    ),
  );
  plot.start();
}
