/**
 * The stop that is always at hand: the bar, the space bar, and what happens when the page is hidden
 * or closed.
 */
import { button, say, show, the } from "./dom.ts";

/** Something with motors in it. */
export interface Machine {
  stop(): void;
  /** Stops, and forbids further movement until a person allows it again. */
  disarm(why: string): void;
  stopWithoutWaiting(): void;
  keepAlive(): void;
  /** It may be moving, or is allowed to. */
  isAtRisk(): boolean;
  /** How far the stop has come, in a few words. */
  words(): string;
  /** What moves against an order, or without one, if anything does. */
  alarm(): string;
}

const machines = new Set<Machine>();
const bar = the("stop-bar", HTMLElement);
const words = the("stop-words", HTMLElement);
const alarm = the("stop-alarm", HTMLElement);

/** From now on the stop bar is there and stops this machine. */
export function guard(machine: Machine): void {
  machines.add(machine);
  show(bar, true);
}

export function unguard(machine: Machine): void {
  machines.delete(machine);
  show(bar, machines.size > 0);
}

/** Called with each picture that the page draws. */
export function showStop(): void {
  const all = [...machines];
  say(alarm, all.map((machine) => machine.alarm()).join(" "));
  say(words, all.map((machine) => machine.words()).join(" "));
}

function stopAll(): void {
  for (const machine of machines) machine.stop();
}

/**
 * The space bar stops, also where it would press a button, open a list or tick a box: for these
 * there is the enter key.
 */
function key(event: KeyboardEvent): void {
  if (machines.size === 0) return;
  // A key that is held down gives no second order: a stop may have come between.
  if (event.key === "Enter" && event.repeat) return event.preventDefault();
  const isDown = event.type === "keydown" && !event.repeat;
  const isBox = event.target instanceof HTMLInputElement && event.target.type === "checkbox";
  if (event.key !== " " && !(event.key === "Enter" && isBox)) return;
  event.preventDefault();
  event.stopPropagation();
  if (isDown && event.key === " ") stopAll();
  else if (isDown) (event.target as HTMLInputElement).click();
}

/** An open list takes the keys, also the space bar: while motors may move, none is opened. */
function keepListsClosed(event: Event): void {
  const isAtRisk = [...machines].some((machine) => machine.isAtRisk());
  const opens = !(event instanceof KeyboardEvent) || !["Tab", "Shift"].includes(event.key);
  if (event.target instanceof HTMLSelectElement && isAtRisk && opens) event.preventDefault();
}

function personIsThere(): void {
  for (const machine of machines) machine.keepAlive();
}

export function start(): void {
  for (const type of ["pointerdown", "click"]) button("stop").addEventListener(type, stopAll);
  for (const type of ["keydown", "keyup"] as const) addEventListener(type, key, { capture: true });
  for (const type of ["mousedown", "keydown"])
    addEventListener(type, keepListsClosed, { capture: true });
  for (const type of ["pointerdown", "pointermove", "keydown", "wheel", "touchmove"]) {
    addEventListener(type, personIsThere, { capture: true, passive: true });
  }
  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState !== "hidden") return;
    for (const machine of machines)
      machine.disarm("The page was hidden: all motors are told to stop.");
  });
  addEventListener("pagehide", () => {
    for (const machine of machines) if (machine.isAtRisk()) machine.stopWithoutWaiting();
  });
  addEventListener("beforeunload", (event) => {
    const atRisk = [...machines].filter((machine) => machine.isAtRisk());
    for (const machine of atRisk) machine.stopWithoutWaiting();
    if (atRisk.length > 0) event.preventDefault();
  });
}
