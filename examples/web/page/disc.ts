/**
 * A disc with a mark that turns as a motor does. It is a picture only: the words beside it say the
 * same.
 */
import { make } from "./dom.ts";

const CALM_MS = 500;
const calm = matchMedia("(prefers-reduced-motion: reduce)");

export class Disc {
  readonly element = make("div", { class: "disc", "aria-hidden": "true" });
  private turnedAt = 0;

  turnTo(turns: number): void {
    const now = performance.now();
    if (calm.matches && now - this.turnedAt < CALM_MS) return;
    this.turnedAt = now;
    this.element.style.transform = `rotate(${((turns % 1) * 360).toFixed(1)}deg)`;
  }
}
