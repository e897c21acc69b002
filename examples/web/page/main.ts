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

/** Whatever fails, the next picture is drawn: it says how far a stop has come. */
function draw(): void {
  requestAnimationFrame(draw);
  trial.draw();
  line.draw();
  stopping.showStop();
}

/** On a site with the docs beside it. */
const docs: unknown = import.meta.env.VITE_DOCS;
if (typeof docs === "string" && docs !== "") {
  the("to-docs", HTMLElement).setAttribute("href", docs);
  show(the("to-docs", HTMLElement), true);
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
