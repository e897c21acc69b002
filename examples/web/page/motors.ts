/**
 * A bus of motors: what each of them reports, how far its stop has come, and the orders that it can
 * be given.
 */
import {
  type BusNode,
  type BusState,
  isPending,
  type Simulation,
  STOP_WORDS,
  type Truth,
} from "./contract.ts";
import { make, numberField, numberIn, say } from "./dom.ts";
import type { Session } from "./session.ts";
import { Disc } from "./disc.ts";
import type { Bus } from "./wasm.ts";

export type BusSession = Session<Bus, BusState>;

const HEALTH_WORDS: Record<BusNode["health"], string> = {
  online: "answers",
  suspect: "has missed an answer",
  abnormal: "DOES NOT ANSWER",
  unknown: "not heard yet",
};

/**
 * What a person can mean. The crate takes any number, and what a motor can do is not known here.
 */
const MOST = 50;

/** A motor that turns more slowly stands still (ruling I12). */
const STANDS_RPS = 0.05;

/** The cards of a bus, one for each node that was heard. */
export class Motors {
  private readonly cards = new Map<number, MotorCard>();

  constructor(
    private readonly place: HTMLElement,
    private readonly session: BusSession,
    private readonly isArmed: () => boolean,
    private readonly refused: (why: string) => void,
    private readonly simulation?: Simulation,
  ) {
    place.replaceChildren();
  }

  show(state: BusState): void {
    for (const node of state.nodes) {
      const isThere = node.mode !== null || isPending(node.stop);
      if (!isThere) continue;
      if (this.cards.get(node.id)?.node.mode !== node.mode) this.add(node);
      this.cards.get(node.id)?.show(node, this.simulation?.truth());
    }
  }

  private add(node: BusNode): void {
    this.cards.get(node.id)?.element.remove();
    const card = new MotorCard(node, this.session, this.isArmed, this.refused, this.simulation);
    this.cards.set(node.id, card);
    const next = [...this.cards.keys()].filter((id) => id > node.id).sort((a, b) => a - b)[0];
    this.place.insertBefore(
      card.element,
      (next !== undefined && this.cards.get(next)?.element) || null,
    );
  }
}

class MotorCard {
  readonly element: HTMLElement;
  private readonly disc: Disc | undefined;
  private readonly really = make("dd");
  private readonly reported = make("dd");
  private readonly health = make("dd");
  private readonly stop = make("dd");
  private readonly goal = numberField("");
  private readonly turn = make("button", { type: "submit" });

  constructor(
    readonly node: BusNode,
    private readonly session: BusSession,
    private readonly isArmed: () => boolean,
    private readonly refused: (why: string) => void,
    simulation: Simulation | undefined,
  ) {
    const name = `Motor ${node.id}`;
    const isSpeed = node.mode !== "position";
    this.goal.value = isSpeed ? "1" : "2";
    this.turn.append(isSpeed ? "Run" : "Go", make("span", { class: "spoken" }, ` (${name})`));
    const halt = make(
      "button",
      { type: "button" },
      "Stop",
      make("span", { class: "spoken" }, ` ${name}`),
    );
    halt.addEventListener("click", () => this.give((bus, now) => bus.stop(node.id, now)));
    const orders = make(
      "form",
      { class: "orders", novalidate: "" },
      make("label", {}, isSpeed ? "turns/s " : "to position ", this.goal),
      this.turn,
      halt,
    );
    orders.addEventListener("submit", (event) => {
      event.preventDefault();
      this.move();
    });
    const facts = make("dl", {});
    const fact = (term: string, value: HTMLElement) =>
      facts.append(make("div", {}, make("dt", {}, term), value));
    if (simulation) fact("Really", this.really);
    fact("Reported", this.reported);
    fact("Link", this.health);
    fact("Stop", this.stop);
    this.element = make(
      "li",
      { class: "card" },
      make("h3", {}, name, " ", make("small", {}, isSpeed ? "speed control" : "position control")),
    );
    if (simulation) {
      this.disc = new Disc();
      this.element.append(this.disc.element);
    }
    this.element.append(facts, orders);
    if (simulation)
      this.element.append(plug(name, (isUnplugged) => simulation.unplug(node.id, isUnplugged)));
  }

  show(node: BusNode, truth: Truth | undefined): void {
    const real = truth?.nodes?.find(({ id }) => id === node.id);
    if (real) {
      this.disc?.turnTo(real.turns);
      const isSpeed = node.mode !== "position";
      say(
        this.really,
        isSpeed ? `${real.rps.toFixed(2)} turns/s` : `${real.turns.toFixed(2)} turns`,
      );
    }
    say(this.reported, report(node));
    say(this.health, HEALTH_WORDS[node.health] ?? node.health);
    say(this.stop, STOP_WORDS[node.stop]);
    this.element.dataset.stop = node.stop;
    this.element.dataset.link = node.health;
    if (this.turn.disabled === this.isArmed()) this.turn.disabled = !this.isArmed();
  }

  private move(): void {
    if (!this.isArmed()) return this.refused("Not armed. Nothing was sent.");
    const goal = numberIn(this.goal, -MOST, MOST);
    if (goal === undefined)
      return this.refused(
        `Motor ${this.node.id}: a number from -${MOST} to ${MOST}, please. Nothing was sent.`,
      );
    const { id, mode } = this.node;
    this.give((bus, now) =>
      mode === "position" ? bus.set_position(id, goal, now) : bus.set_velocity(id, goal, now),
    );
  }

  private give(order: (bus: Bus, now: number) => void): void {
    this.refused(this.session.ask(order));
  }
}

function report(node: BusNode): string {
  const [value, unit] =
    node.mode === "position" ? [node.position, "turns"] : [node.velocity, "turns/s"];
  if (value === null) return "nothing yet";
  const age = node.age_ms ?? 0;
  return `${value.toFixed(2)} ${unit}${age < 300 ? "" : `, ${(age / 1000).toFixed(1)} s ago`}`;
}

/** A plug that can be pulled. */
export function plug(name: string, pull: (isUnplugged: boolean) => void): HTMLElement {
  const box = make("input", { type: "checkbox", "aria-label": `Unplug ${name}` });
  box.addEventListener("change", () => pull(box.checked));
  return make("label", { class: "plug" }, box, " unplug this motor");
}

/** Nodes whose stop was asked for and has not ended yet. */
export const pendingStops = (state: BusState): BusNode[] =>
  state.nodes.filter((node) => isPending(node.stop));

/** What a page that was lost, or somebody else, has set moving. */
const movingWithoutOrder = (state: BusState): number[] =>
  state.nodes
    .filter(({ velocity }) => Math.abs(velocity ?? 0) >= STANDS_RPS)
    .filter(
      ({ stop, target }) => stop === "standing_still" || (stop === "not_asked" && target === null),
    )
    .map(({ id }) => id);

const motors = (ids: number[]): string => `motor${ids.length > 1 ? "s" : ""} ${ids.join(", ")}`;
const capital = (text: string): string => text.slice(0, 1).toUpperCase() + text.slice(1);
const isLost = ({ stop, health }: BusNode) => isPending(stop) && health === "abnormal";

/** What moves, or may move, against an order or without one; nothing if that is not so. */
export function busAlarm(state: BusState): string {
  const ids = (those: (node: BusNode) => boolean) => state.nodes.filter(those).map(({ id }) => id);
  return [
    [movingWithoutOrder(state), "MOVING without an order from here: press STOP"] as const,
    [ids(({ stop }) => stop === "still_moving"), "STILL MOVING after a confirmed stop"] as const,
    [ids(isLost), "NOT seen to stop: no answer, may be moving"] as const,
  ]
    .filter(([ids]) => ids.length > 0)
    .map(([ids, what]) => `${capital(motors(ids))} ${ids.length > 1 ? "are" : "is"} ${what}.`)
    .join(" ");
}

/** How far the other stops of a bus have come. */
export function busStopWords(state: BusState): string {
  const parts = (["owed", "confirmed", "standing_still"] as const)
    .map((progress) => {
      const those = state.nodes.filter((node) => node.stop === progress && !isLost(node));
      return [those.map(({ id }) => id), STOP_WORDS[progress]] as const;
    })
    .filter(([ids]) => ids.length > 0)
    .map(([ids, what]) => `Stop of ${motors(ids)}: ${what}.`);
  return parts.length > 0 || busAlarm(state) !== "" ? parts.join(" ") : "No stop is in progress.";
}

/** What may be moving by an order from here: a motor that stands still behind a stop may not. */
export const mayMove = (state: BusState): number[] =>
  state.nodes
    .filter(({ stop, target }) => isPending(stop) || (stop === "not_asked" && target !== null))
    .map(({ id }) => id);
