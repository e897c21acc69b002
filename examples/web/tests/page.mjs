// Drives the built page in headless Chromium, story by story.
//   node tests/page.mjs INDEX_HTML SCREENSHOTS [CAPTURE] [PKG]
// In the environment: CHROMIUM, STORY (a pattern for the stories to run), FIELD (a folder of more
// captures to open).
import assert from "node:assert/strict";
import { mkdirSync, readdirSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [html, shots, capture = "../captures/motors.pcapng", pkg = "pkg"] = process.argv.slice(2);
if (!html || !shots) throw new Error("which index.html, and where to put the screenshots?");
mkdirSync(shots, { recursive: true });
const address = pathToFileURL(resolve(html)).href;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const wasm = await import(pathToFileURL(resolve(pkg, "axlewire_web.js")).href);
wasm.initSync({ module: readFileSync(resolve(pkg, "axlewire_web_bg.wasm")) });

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});

/** A page, and all that went wrong in it. */
async function open(
  hash = "",
  { url = address, serial, scheme = "light", size = { width: 1280, height: 800 } } = {},
) {
  const context = await browser.newContext({
    colorScheme: scheme,
    viewport: size,
    acceptDownloads: true,
  });
  const page = await context.newPage();
  page.wrong = [];
  page.on(
    "console",
    (said) => ["error", "warning"].includes(said.type()) && page.wrong.push(said.text()),
  );
  page.on("pageerror", (error) => page.wrong.push(String(error)));
  page.on(
    "request",
    (request) =>
      /^(file|data|blob):/.test(request.url()) ||
      request.url() === url + hash ||
      request.url() === url ||
      page.wrong.push(`request: ${request.url()}`),
  );
  await context.addInitScript(() =>
    addEventListener("securitypolicyviolation", (event) =>
      console.error(`policy: ${event.violatedDirective} ${event.blockedURI}`),
    ),
  );
  if (serial) await fakeSerial(context, page, serial);
  await page.goto(url + hash);
  return page;
}

async function close(page) {
  assert.deepEqual(page.wrong, [], "nothing is said on the console, nothing is requested");
  await page.context().close();
}

/** A serial port of which the other end is the simulator here. `page.plug()` pulls it. */
async function fakeSerial(context, page, simulator) {
  await context.exposeFunction("simulatorRead", () => [...simulator.read(performance.now())]);
  await context.exposeFunction("simulatorWrite", (bytes) =>
    simulator.write(new Uint8Array(bytes), performance.now()),
  );
  await context.addInitScript(() => {
    class Port extends EventTarget {
      readable = null;
      writable = null;
      opened = [];
      getInfo = () => ({ usbVendorId: 0x0403, usbProductId: 0x6001 });
      async open(options) {
        if (this.readable) throw new DOMException("The port is already open.", "InvalidStateError");
        this.opened.push(options.baudRate);
        this.readable = new ReadableStream({
          start: (controller) => void (this.controller = controller),
          cancel: () => void (this.controller = null),
        });
        this.writable = new WritableStream({
          write: async (bytes) => {
            if (this.isGone) throw new DOMException("The device has been lost.", "NetworkError");
            void window.simulatorWrite([...bytes]);
          },
        });
        this.isOpen = true;
        void this.poll();
      }
      async poll() {
        while (this.isOpen) {
          const bytes = await window.simulatorRead();
          if (this.isOpen && bytes.length > 0 && this.controller && this.baudIsRight())
            this.controller.enqueue(new Uint8Array(bytes));
          await new Promise((done) => setTimeout(done, 2));
        }
      }
      baudIsRight = () => !window.simulatorBaud || this.opened.at(-1) === window.simulatorBaud;
      async close() {
        this.isOpen = false;
        this.readable = this.writable = null;
      }
      pull() {
        this.isGone = true;
        this.isOpen = false;
        this.controller?.error(new DOMException("The device has been lost.", "NetworkError"));
        this.readable = this.writable = null;
        this.dispatchEvent(new Event("disconnect", { bubbles: true }));
      }
    }
    let port = (window.fakePort = new Port());
    window.plugIn = () => (port = window.fakePort = new Port());
    const serial = Object.assign(new EventTarget(), {
      requestPort: async () => port,
      getPorts: async () => [port],
    });
    Object.defineProperty(navigator, "serial", { value: serial, configurable: true });
  });
  page.pull = () => page.evaluate(() => window.fakePort.pull());
}

const text = (page, selector) => page.locator(selector).innerText();
const shot = (page, name) => page.screenshot({ path: `${shots}/${name}.png` });
const card = (page, title) =>
  page.locator(".card:visible", { has: page.getByRole("heading", { name: title }) });
const says = (where, words, timeout = 5000) =>
  where.filter({ hasText: words }).first().waitFor({ timeout });
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const turns = (simulator) => JSON.parse(simulator.state()).nodes[0].rps;

async function until(holds, what, ms = 5000) {
  for (const end = Date.now() + ms; Date.now() < end; await wait(20)) if (await holds()) return;
  assert.fail(`not within ${ms} ms: ${what}`);
}

async function aMotorRunsWithinTwoSeconds() {
  const begun = performance.now();
  const page = await open();
  await says(page.locator("#try-hint"), "Motor 1 is running");
  const ms = performance.now() - begun;
  assert.ok(ms < 2000, `the motor runs after ${ms.toFixed(0)} ms`);
  const disc = card(page, "Motor 1").locator(".disc");
  const before = await disc.evaluate((disc) => disc.style.transform);
  await until(
    async () => (await disc.evaluate((disc) => disc.style.transform)) !== before,
    "the disc turns",
  );
  await says(card(page, "Motor 1"), /Really\s*0\.9|Really\s*1\.0/);
  const paint = await page.evaluate(
    () => performance.getEntriesByName("first-contentful-paint")[0]?.startTime,
  );
  assert.ok(paint < 1000, `first paint after ${paint} ms`);
  await until(
    async () => (await page.locator("#try .card").count()) === 8,
    "eight motors are shown",
  );
  await shot(page, "try");
  await close(page);
  return `${ms.toFixed(0)} ms, first paint ${paint.toFixed(0)} ms`;
}

async function stopIsSeenToStandStill() {
  const page = await open();
  await says(page.locator("#try-hint"), "Motor 1 is running");
  await page.locator("#stop").click();
  await says(card(page, "Motor 1"), "seen at standstill");
  await says(page.locator("#try-story"), /is seen at standstill/);
  await says(page.locator("#stop-words"), /Stop of motors 1, .*seen at standstill/);
  await shot(page, "try-stopped");
  await close(page);
}

async function spaceStopsAlsoOnAButton() {
  const page = await open();
  await says(page.locator("#try-hint"), "Motor 1 is running");
  await until(async () => (await page.locator("#try .card").count()) === 8, "eight motors");
  await card(page, "Motor 2").getByRole("button", { name: "Run" }).click();
  await says(card(page, "Motor 2"), /Really\s*(0\.9|1\.0)/);
  await card(page, "Motor 2").getByRole("button", { name: "Run" }).focus();
  await page.keyboard.press("Space");
  await says(card(page, "Motor 1"), "seen at standstill");
  await says(card(page, "Motor 2"), "seen at standstill");
  await close(page);
}

async function aPulledPlugAndNoise() {
  const page = await open();
  await says(page.locator("#try-hint"), "Motor 1 is running");
  await says(card(page, "Motor 1"), /Really\s*(0\.9|1\.0)/);
  await page.getByRole("checkbox", { name: "Unplug Motor 1" }).focus();
  await page.keyboard.press("Enter");
  await says(card(page, "Motor 1"), "DOES NOT ANSWER");
  await page.locator("#stop").click();
  await says(card(page, "Motor 1"), "no answer yet: may be moving");
  await wait(500);
  await says(card(page, "Motor 1"), /Really\s*(0\.9|1\.0)/);
  await shot(page, "try-unplugged");
  await page.locator("#try-noise").fill("4");
  await says(page.locator("#try-noise-words"), "1 wrong bit in 1,000");
  await page.getByRole("checkbox", { name: "Unplug Motor 1" }).uncheck();
  await says(card(page, "Motor 1"), "seen at standstill", 10_000);
  await says(card(page, "Motor 1"), /Really\s*-?0\.0/);
  await close(page);
}

async function refusedOrdersAreSaid() {
  const page = await open();
  await until(async () => (await page.locator("#try .card").count()) === 8, "eight motors");
  await card(page, "Motor 3").locator("input[inputmode=decimal]").fill("1e9");
  await card(page, "Motor 3").getByRole("button", { name: "Run" }).click();
  await page.locator("#try-refused").waitFor();
  for (const text of ["1e9", "1 5", "--5", "0x10", "51", "1,5,5", "NaN"]) {
    await card(page, "Motor 3").locator("input[inputmode=decimal]").fill(text);
    await card(page, "Motor 3").getByRole("button", { name: "Run" }).click();
    await says(page.locator("#try-refused"), "Nothing was sent");
  }
  await wait(300);
  await says(card(page, "Motor 3"), /Really\s*0\.00/);
  await card(page, "Motor 3").locator("input[inputmode=decimal]").fill("1,5");
  await card(page, "Motor 3").getByRole("button", { name: "Run" }).click();
  await says(card(page, "Motor 3"), /Really\s*1\.[45]/);
  await card(page, "Motor 3").getByRole("button", { name: "Stop" }).click();
  await says(card(page, "Motor 3"), "seen at standstill");
  await card(page, "Motor 3").locator("input[inputmode=decimal]").fill("");
  await card(page, "Motor 3").getByRole("button", { name: "Run" }).click();
  await page.locator("#try-refused").waitFor();
  await wait(300);
  await says(card(page, "Motor 3"), /Really\s*0\.00/);
  await close(page);
}

async function theRoverDrivesAndStops() {
  const page = await open("#try?on=rover");
  const rover = card(page, "Rover");
  await says(page.locator("#try-hint"), "The rover is standing still");
  await rover.getByRole("button", { name: "Drive" }).click();
  await says(rover, /wheels (3\d|[4-9]\d)/);
  await shot(page, "try-rover");
  await page.keyboard.press("Space");
  await says(rover, "it stands still", 10_000);
  await page.locator("#try-kind").selectOption("bus");
  await says(page.locator("#try-hint"), "Motor 1 is running");
  assert.match(page.url(), /#try$/);
  await close(page);
}

async function drop(page, name, bytes) {
  const data = await page.evaluateHandle(
    ([name, base64]) => {
      const transfer = new DataTransfer();
      transfer.items.add(
        new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], name),
      );
      return transfer;
    },
    [name, bytes.toString("base64")],
  );
  await page.locator("#capture-drop").dispatchEvent("drop", { dataTransfer: data });
}

/** What the crate says about a capture, for comparison. */
function decoded(bytes) {
  let at = 0;
  return wasm.decode((most) => {
    const part = new Uint8Array(bytes.subarray(at, at + most));
    at += part.length;
    return part;
  }, undefined);
}

async function aCaptureIsListedFilteredPlottedSaved() {
  const bytes = readFileSync(capture);
  const truth = decoded(bytes);
  const tables = JSON.parse(truth.tables()).filter(({ rows }) => rows > 0);
  const page = await open("#capture");
  await drop(page, "a <b>bold</b> name.pcapng", bytes);
  await says(page.locator("#capture-words"), `${truth.rows().toLocaleString("en")} rows`);
  assert.match(await text(page, "#capture-words"), /^a <b>bold<\/b> name\.pcapng: /);
  await says(page.locator("#capture-shown"), `${truth.rows().toLocaleString("en")} rows of`);
  await page.locator("#plot canvas").waitFor();
  await shot(page, "capture");

  const gap = page.getByRole("checkbox", { name: /^skipped/ });
  await gap.check();
  const skipped = tables.find(({ table }) => table === "skipped").rows;
  await says(page.locator("#capture-shown"), new RegExp(`^${skipped} rows of`));
  await page.locator("#capture-rows [role=option]").first().click();
  await says(page.locator("#capture-detail"), "Skipped bytes");
  await says(page.locator("#capture-detail"), /no frame starts here|damaged, or not a frame/);
  assert.match(page.url(), /tables=skipped/);
  await gap.uncheck();

  await page.locator("#capture-text").pressSequentially("c d");
  assert.equal(await page.locator("#capture-text").inputValue(), "c d", "where nothing moves");
  await page.locator("#capture-text").fill("CRC");
  await until(
    async () => (await text(page, "#capture-shown")).startsWith(`${truth.filter([], "CRC")} rows`),
    "the search has ended",
  );
  await page.locator("#capture-text").fill("");
  await says(page.locator("#capture-shown"), `${truth.rows().toLocaleString("en")} rows of`);
  await page.locator("#capture-rows").focus();
  await page.keyboard.press("End");
  await page.locator(`#row-${truth.rows() - 1}[aria-selected=true]`).waitFor();
  truth.filter([], "");
  const hex = JSON.parse(truth.bytes(truth.rows() - 1)).hex;
  if (hex) await says(page.locator("#capture-detail .hex"), hex);

  const [csv] = await Promise.all([
    page.waitForEvent("download"),
    page.locator("#export-csv").click(),
  ]);
  const saved = readFileSync(await csv.path(), "utf8");
  assert.equal(saved, truth.csv(tables[0].table, 0, 1e6), "the CSV is that of the crate");
  const [lines] = await Promise.all([
    page.waitForEvent("download"),
    page.locator("#export-json").click(),
  ]);
  assert.equal(
    readFileSync(await lines.path(), "utf8").trim(),
    truth.lines(0, truth.rows()).trim(),
  );

  const plot = await page.locator("#plot .u-over").boundingBox();
  await page.locator("#plot").scrollIntoViewIfNeeded();
  const over = await page.locator("#plot .u-over").boundingBox();
  assert.ok(plot && over.width > 200);
  await page.mouse.move(over.x + over.width * 0.3, over.y + 50);
  await page.mouse.down();
  await page.mouse.move(over.x + over.width * 0.6, over.y + 60, { steps: 4 });
  await page.mouse.up();
  await until(() => /from=/.test(page.url()), "the zoom is in the address");
  await page.locator("#plot canvas").waitFor();
  await shot(page, "capture-plot");
  await page.locator("#plot .u-over").dblclick();
  await until(() => !/from=/.test(page.url()), "double click shows all");
  await close(page);
}

async function theAddressBringsTheViewBack() {
  const page = await open("#capture?text=crc");
  await drop(page, "again.pcapng", readFileSync(capture));
  const truth = decoded(readFileSync(capture));
  await until(
    async () =>
      (await text(page, "#capture-shown")).startsWith(`${truth.filter([], "crc")} rows of`),
    "it is filtered",
  );
  assert.equal(await page.locator("#capture-text").inputValue(), "crc");

  const shows = (found) => says(page.locator("#capture-shown"), `${found} row`);
  const edit = (hash) => page.evaluate((hash) => void (location.hash = hash), hash);
  await edit("#capture?text=idle&row=banana&from=2&to=1");
  await shows(truth.filter([], "idle"));
  assert.equal(await page.locator("#capture-text").inputValue(), "idle");
  await page.locator("#to-try").click();
  await page.locator("#try-hint").waitFor();
  await page.locator("#to-capture").click();
  assert.match(page.url(), /#capture\?.*text=idle/, "the link leads back to what was shown");
  await edit("#capture?protocol=evil");
  await shows(truth.rows().toLocaleString("en"));
  assert.equal(await page.locator("#capture-protocol").inputValue(), "auto");
  await edit("#capture?protocol=ucp");
  await says(page.locator("#capture-words"), "ucp");

  await edit("#capture?protocol=ikeya&text=crc");
  await shows(truth.filter([], "crc"));
  await drop(page, "next.bin", Buffer.from("aa01bed055010000000031de", "hex"));
  await says(page.locator("#capture-shown"), "2 rows of 2");
  assert.equal(await page.locator("#capture-text").inputValue(), "", "the search is forgotten");
  await close(page);
}

/** A gap of a file of raw bytes shows its reason and its bytes. */
async function aGapShowsItsBytes() {
  const page = await open("#capture?tables=skipped");
  await drop(page, "gap.bin", Buffer.from("aa01bed0c0ffee55010000000031de", "hex"));
  await page.locator("#capture-rows [role=option]").first().click();
  await says(page.locator("#capture-detail .hex"), "C0 FF EE");
  await says(page.locator("#capture-detail"), "header: no frame starts here");
  await close(page);
}

/** A capture of a million rows, and bytes that are no capture. */
async function aMillionRowsAndNonsense() {
  const page = await open("#capture");
  const frame = Buffer.from("aa01bed055010000000031de", "hex");
  const rows = 1_000_000;
  const big = Buffer.alloc((frame.length * rows) / 2);
  for (let at = 0; at < big.length; at += frame.length) frame.copy(big, at);
  const begun = performance.now();
  await drop(page, "big.bin", big);
  await says(page.locator("#capture-shown"), "1,000,000 rows of", 60_000);
  const ms = performance.now() - begun;
  await page.locator("#capture-rows").focus();
  await page.keyboard.press("End");
  await page.locator("#row-999999").waitFor();
  await page.locator("#capture-rows").evaluate((list) => list.scrollTo(0, list.scrollHeight / 2));
  await until(
    async () =>
      Math.abs(
        Number(
          (await page.locator("#capture-rows [role=option]").first().getAttribute("id"))?.slice(4),
        ) - 500_000,
      ) < 100,
    "the middle is shown",
  );
  await page.locator("#capture-text").fill("nothing has this");
  await says(page.locator("#capture-shown"), "Searching");
  assert.ok(await page.locator("#export-json").isDisabled(), "what is saved is what is shown");
  await page.locator("#capture-text").fill("");
  await says(page.locator("#capture-shown"), "1,000,000 rows of", 60_000);
  let saved = 0;
  page.on("download", () => (saved += 1));
  await page.locator("#export-json").click();
  await page.locator("#capture-cancel").click();
  await says(page.locator("#capture-words"), "is being decoded");
  await says(page.locator("#capture-shown"), "1,000,000 rows of", 60_000);
  await page.locator("#row-0, [role=option]").first().click();
  await says(page.locator("#capture-detail"), "AA 01");
  assert.equal(saved, 0, "a cancelled export saves nothing, and the list is there again");

  await page.mouse.move(200, 500);
  for (const nonsense of [
    Buffer.alloc(0),
    Buffer.from("telnet"),
    Buffer.alloc(5000, 0xfd),
    Buffer.from([0x1f, 0x8b, 8, 0, 1, 2, 3]),
    Buffer.from("0a0d0d0a00000000", "hex"),
  ]) {
    await drop(page, `<script>alert(${nonsense.length})</script>`, nonsense);
    await until(
      async () => /^<script>alert\(\d+\)<\/script>: /.test(await text(page, "#capture-words")),
      "it is said what is wrong",
    );
    await until(async () => page.locator("#capture-progress").isHidden(), "it has ended");
  }
  await close(page);
  return `a million rows after ${ms.toFixed(0)} ms`;
}

/** What the fuzzers of captures begin with, and every file of a folder (FIELD). */
async function hostileFilesAreNoTrouble() {
  const seeds = new URL("../../../fuzz/seeds/captures", import.meta.url).pathname;
  const files = [seeds, process.env.FIELD]
    .filter((folder) => folder !== undefined)
    .flatMap((folder) => readdirSync(folder, { recursive: true, withFileTypes: true }))
    .filter((file) => file.isFile());
  assert.ok(files.length > 10);
  const page = await open("#capture");
  for (const { name, parentPath } of files) {
    await drop(page, name, readFileSync(`${parentPath}/${name}`));
    await until(
      async () => (await text(page, "#capture-words")).startsWith(`${name}: `),
      `${name} is decoded, or it is said why not`,
      20_000,
    );
    await until(async () => page.locator("#capture-progress").isHidden(), `${name} has ended`);
    if (await page.locator("#capture-opened").isVisible())
      await until(
        async () => / shown$/.test(await text(page, "#capture-shown")),
        `${name} is listed`,
        20_000,
      );
  }
  await close(page);
  return `${files.length} files`;
}

async function decodingIsCancelled() {
  const page = await open("#capture");
  await page.evaluate(() => {
    const part = new Uint8Array(10_000_000).fill(0x55);
    const transfer = new DataTransfer();
    transfer.items.add(new File(Array(60).fill(part), "long.bin"));
    document
      .getElementById("capture-drop")
      .dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true }));
  });
  await page.locator("#capture-cancel").click({ timeout: 5000 });
  await says(page.locator("#capture-words"), "Cancelled");
  await close(page);
}

async function scanned(simulator) {
  const page = await open("#line", { serial: simulator });
  await page.locator("#line-choose").click();
  await says(page.locator("#line-words"), "0403:6001");
  await page.locator("#line-baud").fill("-5");
  await page.locator("#line-connect").click();
  await says(page.locator("#line-alarm"), "a whole number from 1200");
  await page.locator("#line-baud").fill("500000");
  await page.locator("#line-connect").click();
  await says(page.locator("#line-cards"), "Motor 1", 10_000);
  return page;
}

async function aRealLineScanArmSpinStopUnplug() {
  const simulator = wasm.Simulator.bus("1:velocity 2:position", 1, performance.now());
  const page = await scanned(simulator);
  const motor = card(page, "Motor 1");
  assert.ok(
    await motor.getByRole("button", { name: "Run" }).isDisabled(),
    "nothing moves before it is armed",
  );
  assert.ok(await page.locator("#stop").isVisible());
  await page.locator("#line-arm").click();
  await motor.getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs");
  await says(motor, /Reported\s*(0\.9|1\.0)/);
  await shot(page, "line");
  await page.locator("#to-capture").click();
  await page.keyboard.press("Space");
  await until(
    () => Math.abs(turns(simulator)) < 0.05,
    "the motor stands, stopped from another view",
  );
  await page.locator("#to-line").click();
  await says(motor, "seen at standstill");
  await motor.getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs again");
  await page.locator("#line-arm").click();
  await until(() => Math.abs(turns(simulator)) < 0.05, "disarming stops");
  await says(page.locator("#line-arm-words"), "Disarmed: nothing");
  await page.locator("#line-arm").click();
  await motor.getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs once more");
  await page.pull();
  await says(page.locator("#line-alarm"), "may still be moving");
  await shot(page, "line-unplugged");
  assert.ok(await page.locator("#stop").isHidden());
  await close(page);
}

/** What runs when the line is lost is stopped first thing when it is there again. */
async function aLostMotorIsStoppedWhenTheLineIsBack() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await scanned(simulator);
  await page.locator("#line-arm").click();
  await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs");
  await page.pull();
  await says(page.locator("#line-alarm"), "may still be moving");
  assert.ok(turns(simulator) > 0.9, "nobody can reach it");
  await page.evaluate(() => void window.plugIn());
  await page.locator("#line-choose").click();
  await page.locator("#line-connect").click();
  await until(() => Math.abs(turns(simulator)) < 0.05, "it is stopped");
  await says(card(page, "Motor 1"), "seen at standstill");
  await page.locator("#line-close").click();
  await says(page.locator("#line-words"), "The port is closed");
  assert.equal(await text(page, "#line-alarm"), "", "an ordinary end is no alarm");
  await close(page);
}

/** Also if another session comes between that only watches, or is lost while it closes. */
async function aStopStaysOwedUntilStandstillIsSeen() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await scanned(simulator);
  const time = setInterval(() => simulator.read(performance.now()), 50);
  const plugIn = async () => {
    await page.evaluate(() => void window.plugIn());
    await page.locator("#line-choose").click();
  };
  const run = async () => {
    await page.locator("#line-arm").click();
    await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
    await until(() => turns(simulator) > 0.9, "the motor runs");
  };
  await run();
  await page.pull();
  await says(page.locator("#line-alarm"), "may still be moving");
  await plugIn();
  await page.locator("#line-watch").click();
  await says(page.locator("#line-words"), "Watching");
  await page.locator("#line-close").click();
  await says(page.locator("#line-words"), "The port is closed");
  simulator.unplug(1, true);
  await page.locator("#line-connect").click();
  await says(page.locator("#stop-words"), "Stop of motor 1: sent, no answer yet");
  await page.locator("#line-close").click();
  await wait(1000);
  await page.locator("#line-close").click();
  await says(page.locator("#line-alarm"), "a motor may be moving");
  simulator.unplug(1, false);
  await page.locator("#line-connect").click();
  await says(card(page, "Motor 1"), "seen at standstill");
  assert.ok(Math.abs(turns(simulator)) < 0.1, "it is stopped");

  await run();
  simulator.unplug(1, true);
  await page.locator("#line-close").click();
  await says(page.locator("#line-close"), "Close although a stop is pending");
  await page.pull();
  await says(page.locator("#line-alarm"), "may still be moving");
  simulator.unplug(1, false);
  await plugIn();
  await page.locator("#line-connect").click();
  await says(card(page, "Motor 1"), "seen at standstill");
  assert.ok(Math.abs(turns(simulator)) < 0.1, "it is stopped");
  assert.ok(await page.locator("#stop").isVisible(), "and the session goes on");
  clearInterval(time);
  await close(page);
}

/** Not even if the switch and the order come before the next picture. */
async function aDisarmedRoverTakesNoOrder() {
  const simulator = wasm.Simulator.rover(1, performance.now());
  const page = await open("#line", { serial: simulator });
  await page.locator("#line-choose").click();
  await page.locator("#line-protocol").selectOption("ucp");
  await page.locator("#line-connect").click();
  const rover = card(page, "Rover");
  await says(rover, "it stands still", 10_000);
  await page.locator("#line-arm").click();
  await rover.getByRole("button", { name: "Drive" }).evaluate((drive) => {
    document.getElementById("line-arm").click();
    drive.click();
  });
  await says(page.locator("#line-refused"), "Not armed");
  await wait(500);
  assert.ok(JSON.parse(simulator.state()).rover.rpm.every((rpm) => Math.abs(rpm) < 1));
  await close(page);
}

function otherMasterTurns(simulator, node) {
  const other = new wasm.Bus(500_000, 60_000, performance.now());
  other.discover(performance.now());
  for (let isAsked = false; JSON.parse(simulator.state()).nodes[node - 1].rps < 0.9;) {
    const now = performance.now();
    for (let frame; (frame = other.transmit(now));) simulator.write(frame, now);
    other.receive(simulator.read(now), now);
    if (isAsked || JSON.parse(other.state(now)).nodes[node - 1].mode === null) continue;
    other.set_velocity(node, 1, now);
    isAsked = true;
  }
}

/** A motor that somebody else has set moving is said to move; one that comes later is stopped. */
async function aMotorThatNobodyHereHasMoved() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  otherMasterTurns(simulator, 1);
  const page = await scanned(simulator);
  await says(page.locator("#stop-alarm"), "Motor 1 is MOVING without an order from here");
  await page.keyboard.press("Space");
  await says(card(page, "Motor 1"), "seen at standstill");
  await close(page);
}

async function closingStopsFirst() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await scanned(simulator);
  const closing = page.locator("#line-close");
  const run = async () => {
    await page.locator("#line-arm").click();
    await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
    await until(() => turns(simulator) > 0.9, "the motor runs");
  };
  await run();
  await says(closing, "Stop, and close the port");
  await closing.click();
  await says(page.locator("#line-words"), "The port is closed.");
  assert.ok(Math.abs(turns(simulator)) < 0.1, "it was stopped before");
  await page.locator("#line-connect").click();
  await says(page.locator("#line-cards"), "Motor 1", 10_000);
  await run();
  await closing.dblclick();
  await says(page.locator("#line-words"), "The port is closed.");
  assert.ok(Math.abs(turns(simulator)) < 0.1, "a double click waits, too");
  await page.locator("#line-connect").click();
  await says(page.locator("#line-cards"), "Motor 1", 10_000);
  await run();
  simulator.unplug(1, true);
  await closing.click();
  await says(closing, "Close although a stop is pending");
  await wait(1000);
  await closing.click();
  await says(page.locator("#line-alarm"), "a motor may be moving");
  await says(page.locator("#line-owed"), "Motor 1 may still be moving");
  await page.reload();
  await says(page.locator("#line-owed"), "Motor 1 may still be moving");
  simulator.unplug(1, false);
  await page.locator("#line-choose").click();
  await page.locator("#line-connect").click();
  await says(card(page, "Motor 1"), "seen at standstill");
  await page.locator("#line-owed").waitFor({ state: "hidden" });
  await close(page);
}

/** Neither on connecting again nor by a stop that another motor is owed. */
async function whatOthersMoveIsLeftAlone() {
  const simulator = wasm.Simulator.bus("1:velocity 2:velocity", 1, performance.now());
  otherMasterTurns(simulator, 2);
  const page = await scanned(simulator);
  const reconnect = async () => {
    await page.locator("#line-close").click();
    await wait(1000);
    if ((await text(page, "#line-close")) === "Close although a stop is pending")
      await page.locator("#line-close").click();
    await says(page.locator("#line-words"), "The port is closed");
    await page.locator("#line-connect").click();
  };
  await says(page.locator("#stop-alarm"), "Motor 2 is MOVING without an order from here");
  await reconnect();
  await says(page.locator("#stop-alarm"), "Motor 2 is MOVING without an order from here");
  await page.locator("#line-arm").click();
  await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "motor 1 runs");
  await page.pull();
  await says(page.locator("#line-alarm"), "may still be moving");
  await page.evaluate(() => void window.plugIn());
  await page.locator("#line-choose").click();
  await page.locator("#line-connect").click();
  await says(card(page, "Motor 1"), "seen at standstill");
  assert.ok(JSON.parse(simulator.state()).nodes[1].rps > 0.9, "motor 2 runs on");
  await close(page);
}

/** While motors may move, no list opens, which would take the space bar. */
async function keysThatMustNotBeTaken() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await scanned(simulator);
  await page.locator("#line-arm").click();
  await page.locator("#to-capture").click();
  await page.locator("#capture-protocol").focus();
  await page.keyboard.press("ArrowDown");
  assert.equal(await page.locator("#capture-protocol").inputValue(), "auto");
  await page.locator("#to-line").click();
  const run = card(page, "Motor 1").getByRole("button", { name: "Run" });
  await run.focus();
  await page.keyboard.down("Enter");
  await until(() => turns(simulator) > 0.9, "the motor runs");
  await page.keyboard.press("Space");
  for (let repeated = 0; repeated < 10; repeated += 1) await page.keyboard.down("Enter");
  await says(card(page, "Motor 1"), "seen at standstill");
  await close(page);
}

async function theDeadManDisarms() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await open("#line", { serial: simulator });
  await page.locator("#line-choose").click();
  await page.locator("#line-dead-man").selectOption("2");
  await page.locator("#line-connect").click();
  await says(page.locator("#line-cards"), "Motor 1", 10_000);
  await page.locator("#line-arm").click();
  await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs");
  await says(page.locator("#line-story"), "nobody has touched anything", 5000);
  await says(page.locator("#line-arm-words"), "Disarmed");
  await until(() => Math.abs(turns(simulator)) < 0.05, "the motor stands");
  await close(page);
}

async function aHiddenPageStops() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await scanned(simulator);
  await page.locator("#line-arm").click();
  await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs");
  await page.evaluate(() => {
    Object.defineProperty(document, "visibilityState", { value: "hidden", configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
  });
  await until(() => Math.abs(turns(simulator)) < 0.05, "the motor stands");
  await says(page.locator("#line-story"), "The page was hidden");
  await says(page.locator("#line-arm-words"), "Disarmed: nothing");
  await close(page);
}

async function aClosedPageStopsAndWarns() {
  const simulator = wasm.Simulator.bus("1:velocity", 1, performance.now());
  const page = await scanned(simulator);
  await page.locator("#line-arm").click();
  await card(page, "Motor 1").getByRole("button", { name: "Run" }).click();
  await until(() => turns(simulator) > 0.9, "the motor runs");
  const [dialog] = await Promise.all([
    page.waitForEvent("dialog"),
    page.close({ runBeforeUnload: true }),
  ]);
  assert.equal(dialog.type(), "beforeunload");
  await until(
    () => simulator.read(performance.now()) && Math.abs(turns(simulator)) < 0.05,
    "the motor was stopped before the question",
  );
  await dialog.dismiss();
  await close(page);
}

/** The plug is pulled in each state of the line. */
async function theFakePlugIsPulledInEachState() {
  const steps = {
    listening: async (page) => page.locator("#line-listen").click(),
    watching: async (page) => page.locator("#line-watch").click(),
    scanning: async (page) => page.locator("#line-connect").click(),
    armed: async (page) => {
      await page.locator("#line-connect").click();
      await page.locator("#line-arm").click();
    },
    stopping: async (page) => {
      await page.locator("#line-connect").click();
      await says(page.locator("#line-cards"), "Motor 1");
      await page.locator("#stop").click();
    },
  };
  for (const [name, step] of Object.entries(steps)) {
    const page = await open("#line", {
      serial: wasm.Simulator.bus("1:velocity", 1, performance.now()),
    });
    await page.locator("#line-choose").click();
    await step(page);
    await wait(50);
    await page.pull();
    await says(page.locator("#line-alarm"), /unplugged/i);
    if (name === "armed") await says(page.locator("#line-alarm"), "may still be moving");
    if (name === "scanning") await says(page.locator("#line-alarm"), "by an order from here");
    await until(
      () => page.locator("#line-choose").isEnabled(),
      `another port can be chosen after ${name}`,
    );
    await close(page);
  }
}

async function listenFirstThenWatchAndRecord() {
  const simulator = wasm.Simulator.rover(1, performance.now());
  const page = await open("#line", { serial: simulator });
  await page.evaluate(() => (window.simulatorBaud = 115200));
  await page.locator("#line-choose").click();
  await page.locator("#line-listen").click();
  await says(page.locator("#line-words"), "115,200 baud", 5000);
  await until(() => page.locator("#line-watch").isEnabled(), "the port is free again");
  assert.equal(await page.locator("#line-protocol").inputValue(), "ucp");
  await page.locator("#line-watch").click();
  await says(page.locator("#watch-lines"), "report");
  await wait(1000);
  await shot(page, "line-watch");
  await page.locator("#line-close").click();
  await says(page.locator("#line-words"), "closed");
  const [file] = await Promise.all([
    page.waitForEvent("download"),
    page.locator("#watch-save").click(),
  ]);
  const recording = decoded(readFileSync(await file.path()));
  assert.ok(recording.rows() > 20, `the recording has ${recording.rows()} rows`);
  await page.locator("#line-connect").click();
  const rover = card(page, "Rover");
  await says(rover, "the rover reports");
  await page.locator("#line-arm").click();
  await rover.getByRole("button", { name: "Drive" }).click();
  await until(() => JSON.parse(simulator.state()).rover.rpm[0] > 20, "the rover drives");
  await page.locator("#stop").click();
  await says(rover, "it stands still", 10_000);
  await page.locator("#line-arm").click();
  await page.locator("#line-close").click();
  await close(page);
}

async function aSilentBusIsSaid() {
  const page = await open("#line", {
    serial: wasm.Simulator.bus("1:velocity", 1, performance.now()),
  });
  await page.locator("#line-choose").click();
  await page.locator("#line-listen").click();
  await says(page.locator("#line-words"), "A motor bus is silent until somebody asks", 8000);
  await close(page);
}

async function withoutWebSerialItIsSaid() {
  const page = await open("#line");
  const has = await page.evaluate(() => "serial" in navigator);
  assert.equal(await page.locator("#line-none").isVisible(), !has);
  await close(page);
}

async function axeFindsNothing() {
  for (const scheme of ["light", "dark"]) {
    const simulator = wasm.Simulator.bus("1:velocity 2:position", 1, performance.now());
    const page = await open("#try", { scheme, serial: simulator });
    await says(page.locator("#try-hint"), "Motor 1 is running");
    await page.locator("#stop").click();
    await says(card(page, "Motor 1"), "seen at standstill");
    await check(page, `try ${scheme}`);
    await page.locator("#try-kind").selectOption("rover");
    await says(card(page, "Rover"), "the rover reports");
    await check(page, `rover ${scheme}`);
    await page.locator("#to-capture").click();
    await check(page, `capture empty ${scheme}`);
    await drop(page, "some.pcapng", readFileSync(capture));
    await page.locator("#plot canvas").waitFor();
    await page.locator("#capture-rows [role=option]").first().click();
    await page.locator("#capture-detail table").waitFor();
    await check(page, `capture ${scheme}`);
    await page.locator("#to-line").click();
    await check(page, `line closed ${scheme}`);
    await page.locator("#line-choose").click();
    await page.locator("#line-connect").click();
    await says(page.locator("#line-cards"), "Motor 2", 10_000);
    await page.locator("#line-arm").click();
    await check(page, `line armed ${scheme}`);
    await page.pull();
    await page.locator("#line-alarm").waitFor();
    await check(page, `line lost ${scheme}`);
    await close(page);
  }
}

async function check(page, name) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => window.axe.run());
  const found = violations.map(
    ({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`,
  );
  await shot(page, `axe ${name}`.replaceAll(" ", "-"));
  assert.deepEqual(found, [], `axe: ${name}`);
}

async function aPhoneShowsACapture() {
  const page = await open("#capture", { size: { width: 375, height: 720 } });
  await drop(page, "some.pcapng", readFileSync(capture));
  await page.locator("#plot canvas").waitFor();
  for (const view of ["capture", "try", "line"]) {
    await page.locator(`#to-${view}`).click();
    await wait(300);
    const [wide, width] = await page.evaluate(() => [
      document.documentElement.scrollWidth,
      innerWidth,
    ]);
    assert.ok(wide <= width, `${view} is ${wide} px wide on a phone`);
    await shot(page, `phone-${view}`);
  }
  await close(page);
}

async function servedItIsTheSame() {
  const server = createServer((_, reply) =>
    reply.setHeader("content-type", "text/html").end(readFileSync(html)),
  );
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  const page = await open("", { url: `http://127.0.0.1:${server.address().port}/` });
  await says(page.locator("#try-hint"), "Motor 1 is running");
  await close(page);
  server.close();
}

const stories = [
  aMotorRunsWithinTwoSeconds,
  stopIsSeenToStandStill,
  spaceStopsAlsoOnAButton,
  aPulledPlugAndNoise,
  refusedOrdersAreSaid,
  theRoverDrivesAndStops,
  aCaptureIsListedFilteredPlottedSaved,
  theAddressBringsTheViewBack,
  aGapShowsItsBytes,
  aMillionRowsAndNonsense,
  hostileFilesAreNoTrouble,
  decodingIsCancelled,
  aRealLineScanArmSpinStopUnplug,
  aLostMotorIsStoppedWhenTheLineIsBack,
  aStopStaysOwedUntilStandstillIsSeen,
  aDisarmedRoverTakesNoOrder,
  aMotorThatNobodyHereHasMoved,
  closingStopsFirst,
  whatOthersMoveIsLeftAlone,
  keysThatMustNotBeTaken,
  theDeadManDisarms,
  aHiddenPageStops,
  aClosedPageStopsAndWarns,
  theFakePlugIsPulledInEachState,
  listenFirstThenWatchAndRecord,
  aSilentBusIsSaid,
  withoutWebSerialItIsSaid,
  axeFindsNothing,
  aPhoneShowsACapture,
  servedItIsTheSame,
];
const only = new RegExp(process.env.STORY ?? "");
let [failed, ran] = [0, 0];
for (const story of stories) {
  if (!only.test(story.name)) continue;
  ran += 1;
  const begun = performance.now();
  try {
    const result = await story();
    console.log(
      `ok      ${story.name} (${((performance.now() - begun) / 1000).toFixed(1)} s)${result ? `: ${result}` : ""}`,
    );
  } catch (error) {
    failed += 1;
    console.log(`FAILED  ${story.name}: ${error.message}`);
    for (const context of browser.contexts()) {
      for (const page of context.pages()) {
        if (page.wrong?.length) console.log("        console:", page.wrong.slice(0, 5));
        await page.screenshot({ path: `${shots}/failed-${story.name}.png` }).catch(() => {});
      }
      await context.close().catch(() => {});
    }
  }
}
await browser.close();
process.exit(failed > 0 || ran === 0 ? 1 : 0);
