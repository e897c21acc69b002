/**
 * The third view: a real line, by Web Serial. Listening never sends; moving needs the switch
 * "Armed".
 */
import type { Guess, Summary } from "./contract.ts";
import {
  button,
  count,
  counted,
  download,
  input,
  make,
  message,
  numberIn,
  say,
  select,
  show,
  the,
} from "./dom.ts";
import { cells } from "./frames.ts";
import { type Kind, MovingMachine } from "./machine.ts";
import { serial, type SerialPort, SerialTransport } from "./serial.ts";
import { guard, unguard } from "./stopping.ts";
import { Story } from "./story.ts";
import { type Bus, guess, Listener } from "./wasm.ts";

const BAUD = { ucp: 115_200, ikeya: 500_000 };
const LISTEN_MS = 1000;
const WATCH_MS = 100;
/** The second click of a double click comes sooner. */
const CLOSE_AGAIN_MS = 1000;
const LINES_SEEN = 100;
/**
 * Pieces of a recording are joined when they are so many, so that the browser may keep them on
 * disk.
 */
const PIECES = 256;

const places = { cards: the("line-cards", HTMLElement), refused: the("line-refused", HTMLElement) };
const words = the("line-words", HTMLElement);
const alarm = the("line-alarm", HTMLElement);
const owedAlarm = the("line-owed", HTMLElement);
const arm = button("line-arm");
const armWords = the("line-arm-words", HTMLElement);
const watched = the("watch-lines", HTMLElement);

interface Watch {
  listener: Listener;
  transport: SerialTransport;
  timer: ReturnType<typeof setInterval>;
}

let port: SerialPort | undefined;
let machine: MovingMachine | undefined;
let machineKind: Kind = "bus";
let watch: Watch | undefined;
/** What was watched, as pcapng; it is there until the port is used again. */
let recording: Blob[] = [];
let isBusy = false;
/** The port is closed as soon as everything is seen at standstill; it was asked for at this time. */
let closingSince: number | undefined;
/**
 * What may have been moving when a line was lost or closed, and was not seen at standstill since:
 * the next session begins with a stop. A rover has the id 0.
 */
const owed: Record<Kind, Set<number>> = { bus: new Set(), rover: new Set() };

const protocol = (): "ucp" | "ikeya" | "ikeya-3" =>
  select("line-protocol").value as "ucp" | "ikeya" | "ikeya-3";
const kind = (): Kind => (protocol() === "ucp" ? "rover" : "bus");

function baud(): number {
  const value = numberIn(input("line-baud"), 1200, 4_000_000, true);
  if (value === undefined) throw new Error("Baud: a whole number from 1200 to 4000000, please.");
  return value;
}

const pause = (ms: number) => new Promise((resolve) => setTimeout(resolve, ms));

function warn(text: string): void {
  say(alarm, text);
  show(alarm, text !== "");
}

/** What can be pressed now. */
function showControls(): void {
  const isOpen = machine !== undefined || watch !== undefined;
  button("line-choose").disabled = isOpen || isBusy;
  for (const name of ["line-listen", "line-watch", "line-connect"])
    button(name).disabled = !port || isOpen || isBusy;
  if (protocol() === "ikeya-3") button("line-connect").disabled = true;
  for (const field of [select("line-protocol"), input("line-baud"), select("line-dead-man")])
    field.disabled = isOpen || isBusy;
  say(
    button("line-connect"),
    kind() === "bus" ? "3. Scan the bus (moves nothing)" : "3. Connect to the rover",
  );
  button("line-close").disabled = !isOpen;
  show(
    the("line-moving", HTMLElement),
    machine !== undefined || places.cards.childElementCount > 0,
  );
  show(the("line-watching", HTMLElement), watch !== undefined || watched.childElementCount > 0);
  arm.disabled = machine === undefined;
  places.cards.inert = machine === undefined;
}

/** Does one thing with the port; what fails is said. */
async function busy(work: () => Promise<void>): Promise<void> {
  isBusy = true;
  warn("");
  showControls();
  try {
    await work();
  } catch (error) {
    warn(message(error));
  } finally {
    isBusy = false;
    showControls();
  }
}

async function choose(): Promise<void> {
  try {
    port = await serial?.requestPort();
  } catch {
    return; // The user has closed the chooser.
  }
  const { usbVendorId, usbProductId } = port?.getInfo() ?? {};
  const hex = (id: number) => id.toString(16).padStart(4, "0");
  const name =
    usbVendorId === undefined
      ? "a port"
      : `a USB adapter (${hex(usbVendorId)}:${hex(usbProductId ?? 0)})`;
  say(words, `Chosen: ${name}. Detect the protocol if you do not know what is on the line.`);
  showControls();
}

/** Opens the port at both baud rates, a second each, and only reads. */
async function listen(): Promise<void> {
  const heard: string[] = [];
  for (const baud of [BAUD.ucp, BAUD.ikeya]) {
    say(words, `Listening at ${count(baud)} baud …`);
    const bytes = await hear(baud);
    const [best] = JSON.parse(guess(bytes)) as Guess[];
    if (best && 2 * best.framed > bytes.length) {
      select("line-protocol").value = best.protocol;
      input("line-baud").value = String(baud);
      say(
        words,
        `${select("line-protocol").selectedOptions[0]?.text}, ${count(baud)} baud: ${count(best.framed)} of ${counted(bytes.length, "byte")} are in ${counted(best.frames, "frame")}.`,
      );
      return;
    }
    heard.push(
      `At ${count(baud)} baud: ${bytes.length > 0 ? `${counted(bytes.length, "byte")}, mostly no frames.` : "nothing."}`,
    );
  }
  say(
    words,
    `${heard.join(" ")} A motor bus is silent until somebody asks: if this is one, scan it.`,
  );
}

async function hear(baud: number): Promise<Uint8Array> {
  const transport = await SerialTransport.open(port as SerialPort, baud);
  const heard: Uint8Array[] = [];
  let lost = "";
  transport.onbytes = (bytes) => heard.push(bytes);
  transport.onclosed = (reason) => (lost = reason);
  await pause(LISTEN_MS);
  await transport.close();
  if (lost) throw new Error(lost);
  return new Uint8Array(await new Blob(heard as BlobPart[]).arrayBuffer());
}

async function beginWatch(): Promise<void> {
  const transport = await SerialTransport.open(port as SerialPort, baud());
  const listener = new Listener(protocol(), baud(), Date.now(), performance.now());
  clear();
  transport.onbytes = (bytes) => listener.receive(bytes, performance.now());
  transport.onclosed = (reason) => {
    void end();
    warn(`${reason} What was recorded can still be saved.`);
  };
  watch = { listener, transport, timer: setInterval(showWatch, WATCH_MS) };
  say(words, `Watching at ${count(baud())} baud. Nothing is sent.`);
}

function showWatch(): void {
  if (!watch) return;
  collect(watch);
  const lines = watch.listener
    .lines()
    .split("\n")
    .filter((line) => line !== "")
    .slice(-LINES_SEEN);
  watched.prepend(...lines.reverse().map((line) => make("li", { class: "row" }, ...cells(line))));
  while (watched.childElementCount > LINES_SEEN) watched.lastElementChild?.remove();
  const summary = JSON.parse(watch.listener.summary()) as Summary["summary"];
  say(
    the("watch-words", HTMLElement),
    `${counted(summary.received, "byte")}, ${counted(summary.frames, "frame")}, ${counted(summary.skipped, "byte")} skipped.`,
  );
}

function collect({ listener }: Watch): void {
  const piece = listener.recording();
  if (piece.length > 0) recording.push(new Blob([piece as BlobPart]));
  if (recording.length >= PIECES) recording = [new Blob(recording)];
}

function connect(): Promise<void> {
  return busy(async () => {
    const transport = await SerialTransport.open(port as SerialPort, baud());
    clear();
    closingSince = undefined;
    machineKind = kind();
    const story = new Story(the("line-story", HTMLElement));
    const deadMan = Number(select("line-dead-man").value) * 1000;
    machine =
      kind() === "bus"
        ? MovingMachine.bus(transport, baud(), deadMan, places, story)
        : MovingMachine.rover(transport, deadMan, places, story);
    machine.session.onclosed = lost;
    guard(machine);
    if (kind() === "bus") machine.session.order((role, now) => (role as Bus).discover(now));
    if (owed[machineKind].size > 0) machine.stopWhatIsOwed(owed[machineKind]);
    say(
      words,
      kind() === "bus"
        ? "The bus is asked who is there. No motor is told to move."
        : "The rover is told to stand, again and again, until you drive it.",
    );
  });
}

/** The line is gone while there may be motors that move. */
function lost(reason: string): void {
  const isAtRisk = machine?.isAtRisk() ?? false;
  if (machine) {
    unguard(machine);
    owe(machine);
    void machine.session.close();
  }
  machine = undefined;
  closingSince = undefined;
  warn(
    isAtRisk || isSomethingOwed()
      ? `${reason} The motors may still be moving: this page can no longer stop them. Cut their power if they move.`
      : `${reason} Nothing was moving by an order from here.`,
  );
  say(words, "The line is gone. Below is what was last seen.");
  showControls();
}

/** Remembers what may be moving, for the next session. */
function owe(machine: MovingMachine): void {
  for (const id of machine.mayMove()) owed[machineKind].add(id);
  keepOwed();
}

const isSomethingOwed = (): boolean => Object.values(owed).some((ids) => ids.size > 0);

/** For this tab, in case that it is loaded again. */
function keepOwed(): void {
  sessionStorage.setItem("owed", JSON.stringify({ bus: [...owed.bus], rover: [...owed.rover] }));
}

function takeUpOwed(): void {
  const kept = JSON.parse(sessionStorage.getItem("owed") ?? "{}") as Partial<
    Record<Kind, number[]>
  >;
  for (const kind of ["bus", "rover"] as const)
    for (const id of kept[kind] ?? []) owed[kind].add(id);
}

/** What no session that is open now can stop. */
function owedWords(): string {
  const isServed = (kind: Kind) => machine !== undefined && machineKind === kind;
  const motors = isServed("bus") ? [] : [...owed.bus].sort((a, b) => a - b);
  const names = motors.length > 0 ? [`Motor ${motors.join(", ")}`] : [];
  if (!isServed("rover") && owed.rover.size > 0) names.push("The rover");
  return names.length > 0
    ? `${names.join(" and ")} may still be moving: an earlier session has not seen standstill. Connect again, or cut the power.`
    : "";
}

/** Removes what an earlier line has left on the screen. */
function clear(): void {
  places.cards.replaceChildren();
  watched.replaceChildren();
  the("line-story", HTMLElement).replaceChildren();
  recording = [];
}

/** Stops first; asked for again, not by a double click, it closes whatever still moves. */
async function close(): Promise<void> {
  const now = performance.now();
  if (closingSince !== undefined && now < closingSince + CLOSE_AGAIN_MS) return;
  if (closingSince === undefined && machine && (machine.isArmed || machine.isStopPending)) {
    closingSince = now;
    if (machine.isArmed) machine.disarm("Closing: all motors are told to stop.");
    say(words, "The port is closed as soon as everything is seen at standstill.");
    return;
  }
  const isPending = machine?.isStopPending ?? false;
  await end();
  if (isPending)
    warn("The port was closed before everything was seen at standstill: a motor may be moving.");
}

async function end(): Promise<void> {
  closingSince = undefined;
  if (machine) {
    unguard(machine);
    owe(machine);
    const { session } = machine;
    machine = undefined;
    await session.close();
  }
  if (watch) {
    const { timer, transport, listener } = watch;
    clearInterval(timer);
    showWatch();
    watch = undefined;
    await transport.close();
    listener.free();
  }
  say(words, "The port is closed.");
  showControls();
}

function setArmed(isArmed: boolean): void {
  if (!machine) return;
  if (isArmed) {
    closingSince = undefined;
    machine.isArmed = true;
    machine.story.tell("Armed by hand.");
  } else {
    machine.disarm("Disarmed by hand: all motors are told to stop.");
  }
}

/** Called for each picture of the screen. */
export function draw(): void {
  const isArmed = machine?.isArmed ?? false;
  if (machine) machine.show();
  for (const id of machine?.picture.standsStill ?? []) if (owed[machineKind].delete(id)) keepOwed();
  say(owedAlarm, owedWords());
  show(owedAlarm, owedAlarm.textContent !== "");
  const isPending = machine?.picture.isPending ?? false;
  if (closingSince !== undefined && machine && !isPending) void end();
  arm.setAttribute("aria-checked", String(isArmed));
  say(
    armWords,
    !machine
      ? "No line is open."
      : isArmed
        ? "Armed: orders move motors."
        : isPending
          ? "Disarmed, and waiting until the motors are seen at standstill."
          : "Disarmed: nothing can be set moving from here.",
  );
  say(
    button("line-close"),
    isPending && closingSince !== undefined
      ? "Close although a stop is pending"
      : isPending || isArmed
        ? "Stop, and close the port"
        : "Close the port",
  );
}

export function start(): void {
  takeUpOwed();
  addEventListener("pagehide", () => machine && owe(machine));
  show(the("line-none", HTMLElement), serial === undefined);
  show(the("line-port", HTMLElement), serial !== undefined);
  button("line-choose").addEventListener("click", () => void choose());
  button("line-listen").addEventListener("click", () => void busy(listen));
  button("line-watch").addEventListener("click", () => void busy(beginWatch));
  button("line-connect").addEventListener("click", () => void connect());
  button("line-close").addEventListener("click", () => void close());
  button("watch-save").addEventListener("click", () => {
    if (watch) collect(watch);
    download(
      `axlewire-${new Date().toISOString().slice(0, 19).replaceAll(":", "")}.pcapng`,
      recording,
      "application/octet-stream",
    );
  });
  arm.addEventListener("click", () => setArmed(!machine?.isArmed));
  select("line-protocol").addEventListener("change", () => {
    input("line-baud").value = String(protocol() === "ucp" ? BAUD.ucp : BAUD.ikeya);
    showControls();
  });
  showControls();
}
