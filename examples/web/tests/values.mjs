// What the page shows is what the tool prints: every vector, every capture, noise, and whatever
// the fuzzers were given to begin with.
//
//   node tests/values.mjs AXLE SCRATCH
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";

import { decode, guess, initSync, Listener } from "../pkg/axlewire_web.js";

const [, , axle, scratch] = process.argv;
const repo = new URL("../../..", import.meta.url).pathname;
initSync({ module: readFileSync(new URL("../pkg/axlewire_web_bg.wasm", import.meta.url)) });
mkdirSync(scratch, { recursive: true });

/** Gives these bytes in pieces of different lengths. */
function reader(bytes) {
  let [at, piece] = [0, 1];
  return (most) => {
    piece = Math.min((piece * 7) % 65_537, most);
    const part = bytes.subarray(at, at + Math.max(piece, 1));
    at += part.length;
    return part;
  };
}

/** The lines of the tool, or why there are none. */
function printed(path, protocol) {
  const args = ["decode", "--json", ...(protocol ? ["-P", protocol] : []), path];
  const run = spawnSync(axle, args, { encoding: "utf8", maxBuffer: 2 ** 31 });
  return { lines: run.stdout.split("\n").filter(Boolean), failure: run.stderr };
}

function crc16(bytes) {
  let crc = 0xffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit += 1) crc = crc & 1 ? (crc >> 1) ^ 0xa001 : crc >> 1;
  }
  return crc;
}

/** Two lists of lines are the same; only the first difference is told. */
function same(seen, expected, name) {
  const at = expected.findIndex((line, at) => line !== seen[at]);
  assert.equal(seen[at], expected[at], `${name}, line ${at + 1}`);
  assert.equal(seen.length, expected.length, name);
}

let [files, compared] = [0, 0];

/** Compares a capture with what the tool prints of it. */
function compare(name, bytes, protocol) {
  const path = join(scratch, "capture");
  writeFileSync(path, bytes);
  const { lines, failure } = printed(path, protocol);
  files += 1;
  let capture;
  try {
    capture = decode(reader(bytes), protocol);
  } catch (error) {
    const has_rows = lines.some((line) => /^\{"event":"(frame|skipped)"/.test(line));
    assert.ok(failure !== "" || !has_rows, `${name}: ${error.message}, says the page alone`);
    assert.ok(!(error instanceof WebAssembly.RuntimeError), `${name}: ${error}`);
    return;
  }
  const rows = lines.filter((line) => /^\{"event":"(frame|skipped)"/.test(line));
  const shown = capture.lines(0, capture.rows()).split("\n").filter(Boolean);
  same(shown, rows, name);
  const { summary } = JSON.parse(capture.summary());
  const last = lines.map((line) => JSON.parse(line)).find((it) => it.event === "summary");
  if (last) assert.deepEqual(summary, last, name);
  // Every row by itself, and those of a filter.
  const some = Math.max(1, Math.floor(rows.length / 50));
  for (let row = 0; row < rows.length; row += some) {
    assert.equal(capture.lines(row, 1), `${rows[row]}\n`, `${name}, row ${row}`);
    const frame = JSON.parse(rows[row]);
    const { offset, hex } = JSON.parse(capture.bytes(row));
    assert.equal(offset, frame.offset, name);
    assert.equal(hex.replaceAll(" ", "").toLowerCase(), frame.bytes ?? "", name);
  }
  for (const table of JSON.parse(capture.tables())) {
    const [protocolOf, message] = table.table.split(".");
    const of = rows.filter((line) => {
      const it = JSON.parse(line);
      return message
        ? it.protocol === protocolOf && it.message === message
        : it.event === "skipped";
    });
    assert.equal(table.rows, of.length, `${name}, ${table.table}`);
    assert.equal(capture.filter([table.table], ""), of.length, name);
    const chosen = capture.lines(0, of.length).split("\n").filter(Boolean);
    same(chosen, of, `${name}, ${table.table}`);
    const numeric = table.columns.find((it) => it.numeric && it.name !== "t");
    const [times, values] = capture.series(table.table, [numeric.name], NaN, NaN, 1e9);
    const { has_times } = JSON.parse(capture.summary());
    const drawn = of.filter((line) => !has_times || JSON.parse(line).t !== undefined);
    assert.equal(times.length, drawn.length, name);
    assert.equal(values.length, drawn.length, name);
  }
  capture.filter([], "");
  compared += rows.length;
  capture.free();
}

/** The tables of the tool as CSV. */
function compareCsv(path, protocol) {
  const folder = join(scratch, "tables.csv");
  execFileSync(axle, ["export", "--force", "-P", protocol ?? "auto", "-o", folder, path], {
    stdio: "pipe",
  });
  const capture = decode(reader(readFileSync(path)), protocol);
  for (const { table, rows } of JSON.parse(capture.tables())) {
    const parts = [];
    for (let from = 0; from === 0 || from < rows; from += 97)
      parts.push(capture.csv(table, from, 97));
    assert.equal(parts.join(""), readFileSync(join(folder, `${table}.csv`), "utf8"), table);
  }
}

const captures = join(repo, "examples/captures");
for (const name of readdirSync(captures).filter((it) => /\.(bin|pcapng)$/.test(it))) {
  const protocol = { "ucp.bin": "ucp", "ikeya.bin": "ikeya" }[name];
  compare(name, readFileSync(join(captures, name)), protocol);
  if (!name.startsWith("motors")) compareCsv(join(captures, name), protocol);
}

const vectors = { ucp: [], ikeya: [], "ikeya-3": [] };
const names = { ucp: "ucp", "ikeya-md": "ikeya", "ikeya-md-3motor": "ikeya-3" };
for (const file of readdirSync(join(repo, "tests/vectors"))) {
  for (const line of readFileSync(join(repo, "tests/vectors", file), "utf8")
    .split("\n")
    .filter(Boolean)) {
    const vector = JSON.parse(line);
    vectors[names[vector.protocol]].push(Buffer.from(vector.hex, "hex"));
  }
}
let seed = 35;
const random = (below) => {
  seed = (Math.imul(seed, 1_103_515_245) + 12_345) >>> 0;
  return (seed >>> 8) % below;
};
for (const [protocol, all] of Object.entries(vectors)) {
  assert.ok(all.length > 10, protocol);
  compare(`vectors of ${protocol}`, Buffer.concat(all), protocol);
  const noise = [];
  for (let piece = 0; piece < 4000; piece += 1) {
    const bytes = Buffer.from(random(4) ? all[random(all.length)] : [random(256)]);
    if (random(5) === 0) bytes[random(bytes.length)] ^= 1 << random(8);
    noise.push(random(9) === 0 ? bytes.subarray(0, random(bytes.length + 1)) : bytes);
  }
  compare(`noise of ${protocol}`, Buffer.concat(noise), protocol);
}

// Seeds of the fuzzers, and damaged captures: no failure but a sentence.
const seeds = join(repo, "fuzz/seeds");
const hostile = existsSync(seeds)
  ? readdirSync(seeds, { recursive: true, withFileTypes: true })
  : [];
for (const entry of hostile.filter((it) => it.isFile())) {
  compare(`seed ${entry.name}`, readFileSync(join(entry.parentPath, entry.name)), "ucp");
}
const whole = readFileSync(join(captures, "drive.pcapng"));
for (let at = 0; at < 400; at += 1) {
  const bytes = Buffer.from(whole.subarray(0, 1 + random(4000)));
  for (let flips = random(4); flips > 0; flips -= 1) bytes[random(bytes.length)] = random(256);
  compare(`damaged capture ${at}`, bytes);
}

// A plot of many rows: the smallest and the largest value of each node are in it, and no row is made
// up; the times go forward, whatever the clock of the capture did.
const rows = [];
const readings = new Map();
for (let at = 0; at < 30_000; at += 1) {
  const node = 1 + (at % 3);
  const rps = Math.fround(10 * node + Math.sin(at / 500) + (random(3000) === 0 ? 3 : 0));
  const frame = Buffer.from([0x55, node, 0, 0, 0, 0, 0, 0]);
  frame.writeFloatLE(rps, 2);
  frame.writeUInt16LE(crc16(frame.subarray(0, 6)), 6);
  rows.push(frame);
  readings.set(node, [...(readings.get(node) ?? []), rps]);
}
const many = decode(reader(Buffer.concat(rows)), "ikeya");
const [{ table }] = JSON.parse(many.tables());
const [times, rps, nodes] = many.series(table, ["rps", "node"], NaN, NaN, 600);
assert.ok(times.length > 100 && times.length <= 1300, `${times.length} points`);
for (const [node, all] of readings) {
  const drawn = [...rps].filter((_, at) => nodes[at] === node);
  assert.equal(Math.min(...drawn), Math.min(...all));
  assert.equal(Math.max(...drawn), Math.max(...all));
}
assert.ok(
  [...times].every((time, at) => rows[time / 8][1] === nodes[at] && !(time < times[at - 1])),
);

// A line that is listened to: its lines are those of its recording.
const line = new Listener("ucp", 115_200, 1_700_000_000_000, 0);
const recording = [];
const heard = [];
const live = readFileSync(join(captures, "ucp.bin"));
for (let [at, now] = [0, 0]; at < live.length; at += 61, now += 5) {
  line.receive(live.subarray(at, at + 61), now);
  heard.push(line.lines());
  recording.push(line.recording());
}
const recorded = decode(reader(Buffer.concat(recording)));
const listed = heard.join("").replaceAll(',"interface":0', "");
const again = recorded.lines(0, recorded.rows()).replaceAll(',"interface":0', "");
assert.ok(
  listed.length > 1000 && again.startsWith(listed),
  "what was listed live is in the recording",
);
assert.equal(JSON.parse(guess(live))[0].protocol, "ucp");

console.log(`${files} captures, ${compared} rows: the same as the tool`);
assert.ok(compared > 20_000 && files > 400);
