/**
 * A session with motors, of a bus or of a rover: what the page needs to show it, to stop it and to
 * know when it is safe.
 * A simulated one cannot hurt anybody: it is always armed.
 */
import {
  busStopWords,
  type BusSession,
  busAlarm,
  mayMove,
  Motors,
  pendingStops,
} from "./motors.ts";
import { Drive, roverAlarm, isStopPending, type RoverSession, roverStopWords } from "./drive.ts";
import { isPending, type Simulation } from "./contract.ts";
import { say, show } from "./dom.ts";
import { Session, type Transport } from "./session.ts";
import type { Machine } from "./stopping.ts";
import type { Story } from "./story.ts";
import { Bus, Rover } from "./wasm.ts";

export type Kind = "bus" | "rover";

export interface Places {
  cards: HTMLElement;
  /** Why an order was refused. */
  refused: HTMLElement;
}

/** What of it is to be seen at a glance. */
interface Picture {
  /** How far the stop has come. */
  words: string;
  isPending: boolean;
  alarm: string;
  /** Of motors, their ids; of a rover, 0: what may be moving, and what was stopped. */
  mayMove: number[];
  standsStill: number[];
}

const ROVER = 0;

export class MovingMachine implements Machine {
  isArmed: boolean;
  /** Somebody has pressed STOP. */
  wasStopped = false;
  /** As of the last look, such as that of `show`. */
  picture: Picture = {
    words: "",
    isPending: false,
    alarm: "",
    mayMove: [],
    standsStill: [],
  };

  private constructor(
    readonly session: BusSession | RoverSession,
    private readonly draw: () => Picture,
    private readonly stopOne: (id: number) => void,
    readonly story: Story,
    private readonly isSimulated: boolean,
  ) {
    this.isArmed = isSimulated;
  }

  /** As of now: a decision must not rest on an old picture, and a hidden page draws none. */
  get isStopPending(): boolean {
    return this.look().isPending;
  }

  static bus(
    transport: Transport,
    baud: number,
    deadMan: number,
    places: Places,
    story: Story,
    simulation?: Simulation,
  ): MovingMachine {
    const session: BusSession = new Session(
      new Bus(baud, deadMan, performance.now()),
      transport,
      (bus, now) => bus.stop_all(now),
      (bus, now) => bus.keep_alive(now),
    );
    const isArmed = () => machine.isArmed;
    const say = (why: string) => refuse(places, why);
    const motors = new Motors(places.cards, session, isArmed, say, simulation);
    const draw = () => {
      const state = session.state();
      motors.show(state);
      return {
        words: busStopWords(state),
        isPending: pendingStops(state).length > 0,
        alarm: busAlarm(state),
        mayMove: mayMove(state),
        standsStill: state.nodes
          .filter(({ stop }) => stop === "standing_still")
          .map(({ id }) => id),
      };
    };
    const stop = (id: number) => session.order((bus, now) => bus.stop(id, now));
    const machine = new MovingMachine(session, draw, stop, story, simulation !== undefined);
    return machine;
  }

  static rover(
    transport: Transport,
    deadMan: number,
    places: Places,
    story: Story,
    simulation?: Simulation,
  ): MovingMachine {
    const session: RoverSession = new Session(
      new Rover(deadMan, performance.now()),
      transport,
      (rover, now) => rover.stop(now),
      (rover, now) => rover.keep_alive(now),
    );
    const isArmed = () => machine.isArmed;
    const say = (why: string) => refuse(places, why);
    const drive = new Drive(places.cards, session, isArmed, say, simulation);
    const draw = () => {
      const state = session.state();
      drive.show(state);
      return {
        words: roverStopWords(state),
        isPending: isStopPending(state),
        alarm: roverAlarm(state),
        mayMove: isPending(state.stop) || state.stop === "not_asked" ? [ROVER] : [],
        standsStill: state.stop === "standing_still" && state.link === "up" ? [ROVER] : [],
      };
    };
    const stop = () => session.order((rover, now) => rover.stop(now));
    const machine = new MovingMachine(session, draw, stop, story, simulation !== undefined);
    return machine;
  }

  /** Draws what is so now. */
  show(): void {
    if (this.session.closedBecause !== undefined) return;
    this.look();
    const events = this.session.events();
    this.story.add(events);
    if (this.isArmed && !this.isSimulated && events.some(({ event }) => event === "dead_man"))
      this.disarm("Disarmed: nobody has touched anything.");
  }

  /** What may be moving now, also when the line is gone. */
  mayMove(): number[] {
    return this.look().mayMove;
  }

  /** Stops what an earlier session could not, whether or not it was heard yet, and nothing else. */
  stopWhatIsOwed(ids: Iterable<number>): void {
    this.story.tell("An earlier session has not seen it at standstill: stop.");
    for (const id of ids) this.stopOne(id);
  }

  private look(): Picture {
    try {
      this.picture = this.draw();
    } catch {
      // The page has failed, or the session is over: the last picture is what is known.
    }
    return this.picture;
  }

  stop(): void {
    this.wasStopped = true;
    this.session.stop();
  }

  disarm(why: string): void {
    this.isArmed = this.isSimulated;
    this.story.tell(why);
    this.session.stop();
  }

  stopWithoutWaiting(): void {
    this.session.stopWithoutWaiting();
  }

  keepAlive(): void {
    this.session.keepAlive();
  }

  isAtRisk(): boolean {
    return !this.isSimulated && (this.isArmed || this.isStopPending);
  }

  words(): string {
    return this.named(this.picture.words);
  }

  alarm(): string {
    return this.named(this.picture.alarm);
  }

  private named(text: string): string {
    return text && `${this.isSimulated ? "Simulation" : "The line"}: ${text}`;
  }
}

function refuse(places: Places, why: string): void {
  say(places.refused, why);
  show(places.refused, why !== "");
}
