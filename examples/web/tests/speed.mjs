// What the page costs: ratios of one run.
//
//   node tests/speed.mjs AXLE SCRATCH
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";

import { decode, initSync } from "../pkg/axlewire_web.js";

const [, , axle, scratch, page] = process.argv;
const wasm = readFileSync(new URL("../pkg/axlewire_web_bg.wasm", import.meta.url));
initSync({ module: wasm });
mkdirSync(scratch, { recursive: true });

const captures = new URL("../../captures/", import.meta.url).pathname;
const drive = decode(once(readFileSync(join(captures, "drive.pcapng"))), undefined);
const lines = drive
  .lines(0, drive.rows())
  .split("\n")
  .filter(Boolean)
  .map((line) => JSON.parse(line));
const reports = Buffer.concat(
  lines.filter((line) => line.message === "report").map((line) => Buffer.from(line.bytes, "hex")),
);
const bytes = Buffer.concat(Array(Math.floor(100e6 / reports.length)).fill(reports));
const path = join(scratch, "reports.bin");
writeFileSync(path, bytes);

function once(all) {
  let at = 0;
  return (most) => all.subarray(at, (at += most));
}

function fastest(call, runs = 3) {
  let best = Infinity;
  for (let run = 0; run < runs; run += 1) {
    const begin = performance.now();
    call();
    best = Math.min(best, performance.now() - begin);
  }
  return best / 1e3;
}

let rows = 0;
const listing = fastest(() => {
  const capture = decode(once(bytes), "ucp");
  rows = capture.rows();
  assert.equal(capture.lines(rows - 1, 1).startsWith('{"event":"frame"'), true);
  capture.free();
});
assert.equal(rows, bytes.length / 44);
const native = fastest(() => {
  const run = spawnSync(axle, ["decode", "-P", "ucp", "--summary", "--jobs", "1", path], {
    encoding: "utf8",
  });
  assert.ok(run.stdout.includes(`${rows} frames`), run.stdout + run.stderr);
});
const capture = decode(once(bytes), "ucp");
const plot = fastest(() =>
  assert.ok(capture.series("ucp.report", ["rpm_0"], NaN, NaN, 4000)[0].length > 100),
);
const search = fastest(() => assert.equal(capture.filter([], '"index":7,') > 1000, true), 1);

console.log(
  `wasm, kB compressed with gzip: ${(gzipSync(wasm, { level: 9 }).length / 1e3).toFixed(0)}`,
);
if (page)
  console.log(
    `page, kB: ${(statSync(page).size / 1e3).toFixed(0)}, compressed ${(gzipSync(readFileSync(page), { level: 9 }).length / 1e3).toFixed(0)}`,
  );
console.log(`a capture of 100 MB is listed in, s: ${listing.toFixed(2)}`);
console.log(`listing in wasm / counting in the tool on one core: ${(native / listing).toFixed(2)}`);
console.log(`a plot of all of it, s: ${plot.toFixed(2)}`);
console.log(`a search in all of it, s: ${search.toFixed(1)}`);
