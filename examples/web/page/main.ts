/** The page: three views, a picture per frame of the screen, and the stop. */
import "./style.css";
import { view, VIEWS } from "./address.ts";
import * as capture from "./capture.ts";
import { message, say, show, the } from "./dom.ts";
import * as line from "./line.ts";
import * as stopping from "./stopping.ts";
import * as trial from "./try.ts";
import { ready } from "./wasm.ts";

function showView(): void {
  for (const name of VIEWS) {
    show(the(name, HTMLElement), name === view());
    const link = the(`to-${name}`, HTMLElement);
    if (name === view()) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

function draw(): void {
  trial.draw();
  line.draw();
  stopping.showStop();
  requestAnimationFrame(draw);
}

showView();
stopping.start();
capture.start(ready);
ready.then(
  (module) => {
    trial.start(module);
    trial.enter(module);
    line.start();
    draw();
    addEventListener("hashchange", () => {
      showView();
      trial.enter(module);
    });
  },
  (error: unknown) =>
    say(the("try-hint", HTMLElement), `This browser cannot run the page: ${message(error)}`),
);
