// Films the first view of the built page in headless Chromium, for the README: a motor whose cable is
// pulled runs on behind a STOP, the page says so, and it is stopped when the cable is back.
//   node film.mjs INDEX_HTML OUT.webp
// It needs img2webp (Debian package "webp"), Liberation Sans, and in the environment perhaps CHROMIUM.
// It fails if a step of the story does not happen.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { setTimeout as wait } from "node:timers/promises";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [html, out] = process.argv.slice(2);
if (!html || !out) throw new Error("which index.html, and where to put the film?");
const FRAME_MS = 100;
const STYLE = `
  header, #try > :not(#try-cards), .card:nth-child(n + 3) { display: none !important }
  body { padding: 0 1rem; font-family: "Liberation Sans"; border: 1px solid #c9ced3; height: 100vh }
  #stop-bar { border: 1px solid #c9ced3; border-top: 2px solid var(--stop); height: 6rem }
  #caption { display: flex; align-items: baseline; margin: .7rem 0 .6rem; font: bold 1.3rem "Liberation Sans" }
  #caption::after { content: "simulated; 2 of 8 motors shown"; margin-left: auto; font: .85rem "Liberation Sans"; color: var(--soft) }
  #pointer { position: fixed; z-index: 99; pointer-events: none; transition: left .6s, top .6s; left: 60%; top: 62% }
  #pointer svg { display: block; position: relative }
  #pointer.down::before { content: ""; position: absolute; left: -21px; top: -21px; width: 44px; height: 44px;
    border: 4px solid #e08a00; border-radius: 50%; background: #e08a0033 }`;
const ARROW = `<svg width="22" height="30" viewBox="0 0 22 30"><path d="M1 1v23l6-5 4 9 4-2-4-8h8z" stroke="#fff" stroke-width="1.5"/></svg>`;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});
const page = await browser.newPage({
  bypassCSP: true,
  colorScheme: "light",
  viewport: { width: 800, height: 358 },
});
await page.goto(pathToFileURL(resolve(html)).href);
await page.addStyleTag({ content: STYLE });
await page.evaluate((arrow) => {
  document.body.insertAdjacentHTML(
    "afterbegin",
    `<p id="caption"></p><div id="pointer">${arrow}</div>`,
  );
  const pointer = document.getElementById("pointer");
  addEventListener("mousemove", ({ x, y }) =>
    Object.assign(pointer.style, { left: `${x}px`, top: `${y}px` }),
  );
  for (const type of ["mousedown", "mouseup"])
    addEventListener(type, () => pointer.classList.toggle("down", type === "mousedown"));
}, ARROW);

const motor = page.locator("#try .card").first();
const [cable, stop, words] = [
  motor.getByRole("checkbox"),
  page.locator("#stop"),
  page.locator("#stop-words.alarming"),
];
const says = (where, what) => where.filter({ hasText: what }).waitFor({ timeout: 5000 });
const caption = (text) =>
  page.locator("#caption").evaluate((p, text) => (p.textContent = text), text);
const press = async (control) => {
  const { x, y, width, height } = await control.boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  await wait(900);
  await page.mouse.down();
  await wait(300);
  await page.mouse.up();
};

async function story() {
  await wait(1500);
  await press(cable);
  await caption("2. Its cable is pulled");
  await says(motor, /Really1\.0.*DOES NOT ANSWER/);
  await wait(1800);
  await press(stop);
  await caption("3. STOP is pressed: it runs on, and the page says so");
  await says(words, "Motor 1 is NOT seen to stop");
  await wait(2500);
  await says(motor, /Really1\.0/);
  await press(cable);
  await caption("4. Plugged in again: stopped, and seen at standstill");
  await says(motor, /Really-?0\.0.*seen at standstill/);
  await says(
    page.locator("#stop-words:not(.alarming)"),
    "Motor 1, 2, 3, 4, 5, 6, 7, 8 (stop): stopped",
  );
  await wait(2500);
}

await caption("1. Motor 1 runs");
await says(motor, /Really1\.0/);
let isOver = false;
const told = story().finally(() => (isOver = true));
const [folder, frames] = [mkdtempSync(join(tmpdir(), "film-")), []];
while (!isOver) {
  const at = performance.now();
  frames.push({ at, png: await page.screenshot() });
  await wait(Math.max(0, at + FRAME_MS - performance.now()));
}
await told;
await browser.close();
const files = frames.flatMap(({ at, png }, n) => {
  writeFileSync(join(folder, `${n}.png`), png);
  const next = frames[n + 1]?.at ?? at + FRAME_MS;
  return ["-d", String(Math.round(next - at)), join(folder, `${n}.png`)];
});
execFileSync("img2webp", ["-loop", "0", "-lossless", "-m", "6", ...files, "-o", out]);
if (!process.env.KEEP) rmSync(folder, { recursive: true });
else console.log(folder, frames.length, ((frames.at(-1).at - frames[0].at) / 1000).toFixed(1));
