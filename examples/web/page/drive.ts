/** A rover: what it reports, how far its stop has come, and how it is driven. */
import { isPending, type RoverState, type Simulation } from "./contract.ts";
import { Disc } from "./disc.ts";
import { make, numberField, numberIn, say } from "./dom.ts";
import type { Session } from "./session.ts";
import type { Rover } from "./wasm.ts";

export type RoverSession = Session<Rover, RoverState>;

const LINK_WORDS: Record<RoverState["link"], string> = {
  waiting: "nothing heard yet",
  up: "the rover reports",
  down: "THE ROVER IS SILENT",
};

/**
 * Of a report, what tells how the rover is: in words, its field, the unit, and how much of the unit
 * the field counts.
 */
const REPORTED: [string, string, string, number][] = [
  ["Wheels say", "rpm", "1/min", 1],
  ["Battery", "battery_pct", "%", 1],
  ["Voltage", "voltage_dv", "V", 0.1],
  ["Current", "current_ca", "A", 0.01],
  ["Power", "power_w", "W", 1],
  ["Heading", "heading", "degrees", 1],
];

export class Drive {
  private readonly wheels = [new Disc(), new Disc(), new Disc(), new Disc()];
  private readonly turns = [0, 0, 0, 0];
  private isLit = false;
  private shownAt = performance.now();
  private readonly facts = new Map<string, HTMLElement>();
  private readonly list = make("dl");
  private readonly go = make("button", { type: "submit" }, "Drive");
  private readonly lamp = make("button", { type: "button", "aria-pressed": "false" }, "Lamp");
  private readonly card = make("li", { class: "card wide" }, make("h3", {}, "Rover"));

  constructor(
    place: HTMLElement,
    private readonly session: RoverSession,
    private readonly isArmed: () => boolean,
    private readonly refused: (why: string) => void,
    private readonly simulation?: Simulation,
  ) {
    const [speed, angular] = [numberField("30"), numberField("0")];
    const halt = make(
      "button",
      { type: "button" },
      "Stop",
      make("span", { class: "spoken" }, " the rover"),
    );
    halt.addEventListener("click", () => this.give((rover, now) => rover.stop(now)));
    this.lamp.addEventListener("click", () =>
      this.giveArmed((rover, now) => rover.lamp(!this.isLit, now)),
    );
    const orders = make(
      "form",
      { class: "orders", novalidate: "" },
      make("label", {}, "Speed ", speed, " %"),
      make("label", {}, "Steer ", angular, " %"),
      this.go,
      halt,
      this.lamp,
    );
    orders.addEventListener("submit", (event) => {
      event.preventDefault();
      const [ahead, turn] = [speed, angular].map((field) => numberIn(field, -100, 100, true));
      if (ahead === undefined || turn === undefined)
        return this.refused("Whole numbers from -100 to 100, please. Nothing was sent.");
      this.giveArmed((rover, now) => rover.drive(ahead, turn, now));
    });
    if (simulation)
      this.card.append(
        make("div", { class: "wheels" }, ...this.wheels.map((wheel) => wheel.element)),
      );
    this.card.append(orders, this.list);
    place.replaceChildren(this.card);
  }

  show(state: RoverState): void {
    for (const button of [this.go, this.lamp])
      if (button.disabled === this.isArmed()) button.disabled = !this.isArmed();
    this.card.dataset.stop = state.stop;
    this.isLit = state.command?.lamp ?? false;
    this.lamp.setAttribute("aria-pressed", String(this.isLit));
    const rpm = this.simulation?.truth().rover?.rpm;
    if (rpm) this.turnWheels(rpm);
    this.card.dataset.link = state.link;
    if (rpm) this.fact("Really", `wheels ${rpm.map((value) => value.toFixed(0)).join(", ")} 1/min`);
    this.fact(
      "Link",
      LINK_WORDS[state.link] +
        (state.age_ms !== null && state.age_ms > 300
          ? `, last ${(state.age_ms / 1000).toFixed(1)} s ago`
          : ""),
    );
    this.fact("Stop", state.stop_text);
    this.fact(
      "Told to",
      state.command
        ? `speed ${state.command.speed} %, steer ${state.command.angular} %`
        : "do nothing",
    );
    this.fact(
      "Ping answered in",
      state.round_trip_ms === null ? "not measured" : `${state.round_trip_ms.toFixed(1)} ms`,
    );
    this.fact("Reports lost", String(state.statistics.reports_lost ?? 0));
    for (const [term, field, unit, share] of REPORTED) {
      const value = this.fact(term, `${reported(state.report?.[field], share)} ${unit}`);
      value.classList.toggle("old", state.link === "down");
    }
  }

  private turnWheels(rpm: number[]): void {
    const now = performance.now();
    const minutes = (now - this.shownAt) / 60_000;
    this.shownAt = now;
    for (const [at, wheel] of this.wheels.entries()) {
      this.turns[at] = (this.turns[at] ?? 0) + (rpm[at] ?? 0) * minutes;
      wheel.turnTo(this.turns[at]);
    }
  }

  private fact(term: string, text: string): HTMLElement {
    let value = this.facts.get(term);
    if (!value) {
      value = make("dd");
      this.facts.set(term, value);
      this.list.append(make("div", {}, make("dt", {}, term), value));
    }
    say(value, text);
    return value;
  }

  private giveArmed(order: (rover: Rover, now: number) => void): void {
    if (!this.isArmed()) return this.refused("Not armed. Nothing was sent.");
    this.give(order);
  }

  private give(order: (rover: Rover, now: number) => void): void {
    this.refused(this.session.ask(order));
  }
}

function reported(value: unknown, share: number): string {
  if (Array.isArray(value)) return value.join(", ");
  return typeof value === "number" ? (value * share).toFixed(share === 1 ? 0 : 2) : "?";
}

export const roverAlarm = (state: RoverState): string =>
  isStopPending(state) && (state.link === "down" || state.stop === "still_moving")
    ? `The rover is NOT seen to stop: ${state.link === "down" ? "it is silent" : state.stop_text}.`
    : "";

export const roverStopWords = (state: RoverState): string =>
  roverAlarm(state) === "" ? `Rover: ${state.stop_text}.` : "";

export const isStopPending = (state: RoverState): boolean => isPending(state.stop);
