/** Decodes a capture beside the page, and answers its questions about it. */
import init, { type Capture, decode } from "../pkg/axlewire_web.js";
import type { FromCapture, Questions, ToCapture } from "./capture_file.ts";

const PROGRESS_MS = 100;
const CSV_ROWS = 20_000;
const JSON_ROWS = 10_000;

let capture: Capture | undefined;

const tell = (news: FromCapture, transfer: Transferable[] = []) => postMessage(news, { transfer });

async function open(
  module: WebAssembly.Module,
  file: File,
  protocol: string | undefined,
): Promise<void> {
  await init({ module_or_path: module });
  const reader = new FileReaderSync();
  let [at, toldAt] = [0, 0];
  const read = (most: number): Uint8Array => {
    const bytes = new Uint8Array(reader.readAsArrayBuffer(file.slice(at, at + most)));
    at += bytes.length;
    if (performance.now() - toldAt > PROGRESS_MS) {
      toldAt = performance.now();
      tell({ progress: file.size > 0 ? at / file.size : 1 });
    }
    return bytes;
  };
  capture = decode(read, protocol);
  tell({
    opened: {
      summary: JSON.parse(capture.summary()),
      tables: JSON.parse(capture.tables()),
      rows: capture.rows(),
    },
  });
}

/** A long text in pieces: each becomes a Blob, which the browser may keep on disk. */
function inPieces(
  rows: number,
  atOnce: number,
  type: string,
  piece: (from: number) => string,
): Blob {
  const parts: Blob[] = [];
  for (let from = 0; from < rows; from += atOnce) {
    parts.push(new Blob([piece(from)], { type }));
    tell({ progress: from / rows });
  }
  return new Blob(parts, { type });
}

type Answers = {
  [Q in keyof Questions]: (
    capture: Capture,
    question: Questions[Q]["question"],
  ) => Questions[Q]["answer"];
};

const answers: Answers = {
  filter: (capture, { tables, text }) => capture.filter(tables, text),
  lines: (capture, { from, count }) =>
    capture
      .lines(from, count)
      .split("\n")
      .filter((line) => line !== ""),
  bytes: (capture, row) => JSON.parse(capture.bytes(row)),
  series: (capture, { table, columns, from, to, points }) =>
    capture.series(table, columns, from, to, points),
  csv: (capture, { table, rows }) =>
    inPieces(Math.max(rows, 1), CSV_ROWS, "text/csv", (from) => capture.csv(table, from, CSV_ROWS)),
  jsonLines: (capture, { rows }) =>
    inPieces(rows, JSON_ROWS, "application/jsonl", (from) => {
      const lines = capture.lines(from, Math.min(JSON_ROWS, rows - from));
      return lines === "" || lines.endsWith("\n") ? lines : `${lines}\n`;
    }),
};

onmessage = ({ data }: MessageEvent<ToCapture>) => {
  if ("open" in data) {
    open(data.module, data.open, data.protocol).catch((error: unknown) =>
      tell({ failed: error instanceof Error ? error.message : String(error) }),
    );
    return;
  }
  const { id, name, question } = data;
  try {
    if (!capture) throw new Error("No capture is open.");
    const answer = (answers[name] as (capture: Capture, question: unknown) => unknown)(
      capture,
      question,
    );
    tell({ id, answer });
  } catch (error) {
    tell({ id, refused: error instanceof Error ? error.message : String(error) });
  }
};
