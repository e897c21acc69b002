/**
 * A session with motors, of a bus or of a rover: what the page needs to show it, to stop it and to
 * know when it is safe.
 * A simulated one cannot hurt anybody: it is always armed.
 */
import { busStopWords, type BusSession, Motors, pendingStops } from "./motors.ts";
import { Drive, isStopPending, type RoverSession, roverStopWords } from "./drive.ts";
import type { Simulation } from "./contract.ts";
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

export class MovingMachine implements Machine {
  isArmed: boolean;
  /** As of the last picture. */
  isStopPending = false;
  /** Somebody has pressed STOP. */
  wasStopped = false;
  private stopWords = "";

  private constructor(
    readonly session: BusSession | RoverSession,
    private readonly picture: (mayMove: boolean) => { words: string; isPending: boolean },
    readonly story: Story,
    private readonly isSimulated: boolean,
  ) {
    this.isArmed = isSimulated;
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
    const motors = new Motors(places.cards, session, (why) => refuse(places, why), simulation);
    const picture = (mayMove: boolean) => {
      const state = session.state();
      motors.show(state, mayMove);
      return { words: busStopWords(state), isPending: pendingStops(state).length > 0 };
    };
    return new MovingMachine(session, picture, story, simulation !== undefined);
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
    const drive = new Drive(places.cards, session, (why) => refuse(places, why), simulation);
    const picture = (mayMove: boolean) => {
      const state = session.state();
      drive.show(state, mayMove);
      return { words: roverStopWords(state), isPending: isStopPending(state) };
    };
    return new MovingMachine(session, picture, story, simulation !== undefined);
  }

  /** Draws what is so now. */
  show(): void {
    if (this.session.closedBecause !== undefined) return;
    const { words, isPending } = this.picture(this.isArmed);
    this.stopWords = words;
    this.isStopPending = isPending;
    const events = this.session.events();
    this.story.add(events);
    if (this.isArmed && !this.isSimulated && events.some(({ event }) => event === "dead_man"))
      this.disarm("Disarmed: nobody has touched anything.");
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
    return `${this.isSimulated ? "Simulation" : "The line"}: ${this.stopWords}`;
  }
}

function refuse(places: Places, why: string): void {
  say(places.refused, why);
  show(places.refused, why !== "");
}
