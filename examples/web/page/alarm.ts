/**
 * A timer that keeps time in a hidden page too: there, the page's own timers run once per second or
 * minute, a worker's do not.
 */
import AlarmWorker from "./alarm_worker.ts?worker&inline";

export class Alarm {
  private readonly worker: Worker = new AlarmWorker();

  constructor(rings: () => void) {
    this.worker.onmessage = rings;
  }

  /** Rings once, after so many milliseconds; an alarm that was set before is forgotten. */
  set(ms: number): void {
    this.worker.postMessage(ms);
  }

  end(): void {
    this.worker.terminate();
  }
}
