/**
 * One conversation on one line: a role of the crate (the master of a bus, the host of a rover) and
 * a transport.
 * The role decides what is sent and when; this file only carries bytes.
 */
import { Alarm } from "./alarm.ts";
import type { RoleEvent } from "./contract.ts";
import { message } from "./dom.ts";

export interface Transport {
  write(bytes: Uint8Array): Promise<void>;
  onbytes: (bytes: Uint8Array) => void;
  /** The line is gone, for this reason. */
  onclosed: (reason: string) => void;
  close(): Promise<void>;
}

/** What `Bus` and `Rover` have in common. */
export interface Role {
  receive(bytes: Uint8Array, now: number): void;
  transmit(now: number): Uint8Array | undefined;
  sent(ok: boolean, now: number): void;
  wait(now: number): number | undefined;
  state(now: number): string;
  events(): string;
  /** What is written last by a page that closes. */
  last_words?(now: number): Uint8Array;
  free(): void;
}

const KEEP_ALIVE_MS = 200;
/** A role must have its turn this often. */
const TURN_MS = 10;
/** Longer than a role waits for an answer. */
const LAST_MS = 150;

export class Session<R extends Role, State> {
  /** Why the line is gone, if it is. */
  closedBecause: string | undefined;
  onclosed: (reason: string) => void = () => {};

  private readonly alarm = new Alarm(() => void this.pump());
  private isPumping = false;
  private isWriting = false;
  private isFreed = false;
  /** The role was told already that the frame in hand was written. */
  private isTold = false;
  private keptAliveAt = 0;
  /** Bytes that came while a frame was being written: the role is told of the frame first. */
  private held: Uint8Array[] = [];

  constructor(
    readonly role: R,
    private readonly transport: Transport,
    private readonly stopAll: (role: R, now: number) => void,
    private readonly personIsThere: (role: R, now: number) => void,
  ) {
    transport.onbytes = (bytes) => this.received(bytes);
    transport.onclosed = (reason) => this.closed(reason);
    void this.pump();
  }

  /** Gives the role an order. Throws if it refuses, with a sentence that says why. */
  order(give: (role: R, now: number) => void): void {
    if (this.closedBecause !== undefined) throw new Error(this.closedBecause);
    give(this.role, performance.now());
    void this.pump();
  }

  /** The same for an order of the user: returns why it was refused, or nothing. */
  ask(give: (role: R, now: number) => void): string {
    try {
      this.order(give);
      return "";
    } catch (error) {
      return message(error);
    }
  }

  stop(): void {
    if (this.closedBecause === undefined) this.order(this.stopAll);
  }

  /**
   * The page is about to end, or to stand still for a question of the browser. The stops that are
   * due next are handed
   * to the port without waiting for it; what the line does meanwhile cannot be heard, so an answer
   * that is due is given up.
   */
  stopWithoutWaiting(): void {
    if (this.closedBecause !== undefined) return;
    if (this.isWriting) this.told(true);
    this.isTold = this.isWriting;
    this.stopAll(this.role, performance.now());
    let isHandedOver = false;
    for (const end = performance.now() + LAST_MS; performance.now() < end;) {
      const frame = this.role.transmit(performance.now());
      if (frame === undefined && isHandedOver) break;
      if (frame === undefined) continue;
      isHandedOver = true;
      this.transport.write(frame).catch(() => {});
      this.told(true);
    }
    const last = this.role.last_words?.(performance.now()) ?? new Uint8Array();
    if (last.length > 0) this.transport.write(last).catch(() => {});
  }

  private told(ok: boolean): void {
    this.role.sent(ok, performance.now());
  }

  /** A person is there. */
  keepAlive(): void {
    const now = performance.now();
    if (this.closedBecause !== undefined || now - this.keptAliveAt < KEEP_ALIVE_MS) return;
    this.keptAliveAt = now;
    this.personIsThere(this.role, now);
    void this.pump();
  }

  state(): State {
    return JSON.parse(this.role.state(performance.now())) as State;
  }

  events(): RoleEvent[] {
    return JSON.parse(this.role.events()) as RoleEvent[];
  }

  async close(): Promise<void> {
    this.transport.onclosed = this.onclosed = () => {};
    this.closed("The line was closed.");
    await this.transport.close();
    this.isFreed = true;
    if (!this.isPumping) this.role.free();
  }

  private received(bytes: Uint8Array): void {
    if (this.closedBecause !== undefined) return;
    this.held.push(bytes);
    void this.pump();
  }

  /** Sends what is due, one frame after the other, and sets the alarm for the next. */
  private async pump(): Promise<void> {
    if (this.isPumping) return;
    this.isPumping = true;
    try {
      while (this.closedBecause === undefined) {
        for (const bytes of this.held.splice(0)) this.role.receive(bytes, performance.now());
        const frame = this.role.transmit(performance.now());
        if (frame === undefined) break;
        const ok = await this.write(frame);
        if (!this.isTold) this.told(ok);
        this.isTold = false;
      }
      if (this.closedBecause === undefined)
        this.alarm.set(Math.min(TURN_MS, this.role.wait(performance.now()) ?? TURN_MS));
    } catch (error) {
      this.closed(`The page has failed: ${message(error)}`);
    } finally {
      this.isPumping = false;
      if (this.isFreed) this.role.free();
    }
  }

  private async write(frame: Uint8Array): Promise<boolean> {
    this.isWriting = true;
    try {
      await this.transport.write(frame);
      return true;
    } catch {
      return false;
    } finally {
      this.isWriting = false;
    }
  }

  private closed(reason: string): void {
    if (this.closedBecause !== undefined) return;
    this.closedBecause = reason;
    this.alarm.end();
    this.onclosed(reason);
  }
}
