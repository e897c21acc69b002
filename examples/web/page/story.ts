/**
 * The list of what happened on a line, newest first, and the same for a screen reader, but not more
 * often than it can speak.
 */
import type { RoleEvent } from "./contract.ts";
import { make, say } from "./dom.ts";

const KEPT = 200;
const SPOKEN_EVERY_MS = 2000;

export class Story {
  readonly list = make("ol", {
    class: "story",
    tabindex: "0",
    "aria-label": "What happened, newest first",
  });
  private readonly spoken = make("p", { class: "spoken", role: "status" });
  private spokenAt = -Infinity;
  private next = "";
  private last = "";
  private times = 0;
  private readonly since = performance.now();

  constructor(place: HTMLElement) {
    place.replaceChildren(this.list, this.spoken);
  }

  add(events: RoleEvent[]): void {
    for (const event of events) this.tell(event.text, event.t);
    this.speak();
  }

  tell(text: string, at = performance.now()): void {
    const seconds = Math.max(0, (at - this.since) / 1000).toFixed(1);
    this.times = text === this.last ? this.times + 1 : 1;
    if (this.times > 1) this.list.firstElementChild?.remove();
    else this.next = text;
    this.last = text;
    this.list.prepend(
      make(
        "li",
        {},
        make("time", {}, `${seconds} s`),
        ` ${text}${this.times > 1 ? ` (${this.times} times)` : ""}`,
      ),
    );
    while (this.list.childElementCount > KEPT) this.list.lastElementChild?.remove();
  }

  private speak(): void {
    const now = performance.now();
    if (this.next === "" || now - this.spokenAt < SPOKEN_EVERY_MS) return;
    this.spokenAt = now;
    say(this.spoken, this.next);
    this.next = "";
  }
}
