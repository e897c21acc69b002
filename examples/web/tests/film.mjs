// Films the first view of the built page in headless Chromium, for the README: a motor whose cable
// is pulled runs on after STOP, the page says so, and it is stopped when the cable is back.
//   node film.mjs INDEX_HTML OUT.webp
// It needs img2webp (Debian package "webp") and Liberation Sans. In the environment: CHROMIUM.
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
  header, #try > :not(#try-cards), .card:nth-child(n + 3), .keys { display: none !important }
  body, #stop-bar { border: 1px solid #c9ced3; font-family: "Liberation Sans" }
  body { padding: 0 1rem; height: 100vh; overflow: hidden }
  #stop-bar { border-top: 2px solid var(--stop); height: 5rem }
  #caption { display: flex; align-items: baseline; margin: .7rem 0 .6rem; font-size: 1.3rem; font-weight: bold }
  #caption::after { content: "simulated; 2 of 8 motors shown"; margin-left: auto; font-size: .85rem; font-weight: normal }
  #pointer { position: fixed; z-index: 99; pointer-events: none; transition: .6s; left: 38%; top: 58% }
  #pointer svg { display: block; position: relative }
  #pointer.down::before { content: ""; position: absolute; inset: -24px auto auto -24px; padding: 20px;
    border: 4px solid #e08a00; border-radius: 50%; background: #e08a0033 }`;
const ARROW = `<svg width="22" height="30" viewBox="0 0 22 30"><path d="M1 1v23l6-5 4 9 4-2-4-8h8z" stroke="#fff" stroke-width="1.5"/></svg>`;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});
const page = await browser.newPage({
  bypassCSP: true,
  colorScheme: "light",
  viewport: { width: 800, height: 342 },
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
const [cable, stop] = [motor.getByRole("checkbox"), page.locator("#stop")];
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
  await says(motor, /Really1\.0.*DOES NOT ANSWER.*sent, no answer yet/);
  await caption("2. Its cable is pulled: a stop is sent, not answered");
  await wait(2000);
  await press(stop);
  await caption("3. STOP is pressed: it runs on, and the page says so");
  await says(page.locator("#stop-alarm"), "Motor 1 is NOT seen to stop");
  await says(page.locator("#stop-words"), /motors 2, .*8: stopped/);
  await wait(2500);
  await says(motor, /Really1\.0/);
  await press(cable);
  await caption("4. It is plugged in again");
  await says(motor, /Really-?0\.0.*stopped, seen at standstill/);
  await says(page.locator("#stop-words"), /motors 1, .*8: stopped, seen/);
  await caption("4. Plugged in again: stopped, and seen at standstill");
  await wait(2500);
}

await caption("1. Motor 1 runs");
await says(motor, /Really1\.0/);
let isOver = false;
const told = story().finally(() => (isOver = true));
const frames = [];
while (!isOver) {
  const at = performance.now();
  frames.push({ at, png: await page.screenshot() });
  await wait(Math.max(0, at + FRAME_MS - performance.now()));
}
await told;
await browser.close();

const folder = mkdtempSync(join(tmpdir(), "film-"));
const pictures = frames.flatMap(({ at, png }, n) => {
  const file = join(folder, `${n}.png`);
  writeFileSync(file, png);
  return ["-d", String(Math.round((frames[n + 1]?.at ?? at + FRAME_MS) - at)), file];
});
execFileSync("img2webp", ["-loop", "0", "-lossless", "-m", "6", ...pictures, "-o", out]);
rmSync(folder, { recursive: true });
