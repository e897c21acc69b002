// Leaves the page with its simulated bus of eight motors alone, with noise, and watches its memory
// and its processor.
//
//   node tests/soak.mjs INDEX_HTML [MINUTES]
import assert from "node:assert/strict";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [html, minutes = "30"] = process.argv.slice(2);
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
const page = await browser.newPage();
const wrong = [];
page.on("pageerror", (error) => wrong.push(String(error)));
await page.goto(pathToFileURL(resolve(html)).href);
await page.getByText("Motor 1 is running").waitFor();
await page.evaluate(() => {
  window.pictures = 0;
  const count = () => void (window.pictures++, requestAnimationFrame(count));
  count();
  const noise = document.getElementById("try-noise");
  noise.value = "2";
  noise.dispatchEvent(new Event("input", { bubbles: true }));
  // Somebody who asks for another speed now and then.
  const forms = document.querySelectorAll("#try-cards form");
  setInterval(() => forms[Math.floor(Math.random() * forms.length)]?.requestSubmit(), 500);
});
const inspector = await page.context().newCDPSession(page);
await inspector.send("Performance.enable");

async function measured() {
  await inspector.send("HeapProfiler.collectGarbage");
  const { metrics } = await inspector.send("Performance.getMetrics");
  const of = (name) => metrics.find((it) => it.name === name).value;
  return {
    heap: of("JSHeapUsedSize"),
    nodes: of("Nodes"),
    busy: of("TaskDuration"),
    at: of("Timestamp"),
  };
}

await page.waitForTimeout(30_000);
const first = await measured();
let last = first;
for (let minute = 1; minute <= Number(minutes); minute += 1) {
  await page.waitForTimeout(60_000);
  last = await measured();
  console.log(`minute ${minute}: heap ${(last.heap / 1e6).toFixed(2)} MB, ${last.nodes} nodes`);
}
const seconds = last.at - first.at;
const pictures = await page.evaluate(() => window.pictures);
console.log(`main thread busy: ${((last.busy - first.busy) / seconds).toFixed(2)} of a core`);
console.log(`pictures per second: ${(pictures / (seconds + 30)).toFixed(0)}`);
await browser.close();
assert.deepEqual(wrong, []);
assert.ok(last.heap < first.heap + 1e6 && last.nodes < first.nodes + 1000, "memory grows");
