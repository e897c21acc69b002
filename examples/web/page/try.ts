/**
 * The first view: a simulated line. Motor 1 is running when the page opens, so that there is
 * something to stop.
 */
import { remember, settings, view } from "./address.ts";
import type { BusState, RoverState } from "./contract.ts";
import { button, input, say, select, the } from "./dom.ts";
import { type Kind, MovingMachine } from "./machine.ts";
import { SimulatedTransport } from "./simulated.ts";
import { guard, unguard } from "./stopping.ts";
import { Story } from "./story.ts";
import type { Bus } from "./wasm.ts";

const NODES =
  "1:velocity 2:velocity 3:velocity 4:velocity 5:velocity 6:velocity 7:position 8:position";
const RUNAWAY = { node: 1, rps: 1 };
/** The simulation is left alone while somebody reads. */
const DEAD_MAN_MS = 600_000;
/** Wrong bits per bit, for each step of the slider. */
const NOISE = [0, 0.00001, 0.0001, 0.0003, 0.001, 0.003, 0.01];

const places = { cards: the("try-cards", HTMLElement), refused: the("try-refused", HTMLElement) };
const hint = the("try-hint", HTMLElement);

let simulation:
  | {
      machine: MovingMachine;
      transport: SimulatedTransport;
      kind: Kind;
      isRunaway: boolean;
      /** In the last picture. */
      wasStopPending: boolean;
    }
  | undefined;

const kind = (): Kind => (settings().get("on") === "rover" ? "rover" : "bus");

/** Starts or ends the simulation, as the address says. */
export function enter(module: WebAssembly.Module): void {
  const isWanted = view() === "try";
  if (isWanted && simulation?.kind === kind()) return;
  end();
  if (isWanted) begin(module, kind());
}

function begin(module: WebAssembly.Module, kind: Kind): void {
  select("try-kind").value = kind;
  const transport = new SimulatedTransport(module, kind === "bus" ? NODES : undefined);
  const picture = {
    truth: () => transport.truth,
    unplug: (node: number, isUnplugged: boolean) => transport.unplug(node, isUnplugged),
  };
  const story = new Story(the("try-story", HTMLElement));
  const machine =
    kind === "bus"
      ? MovingMachine.bus(transport, 500_000, DEAD_MAN_MS, places, story, picture)
      : MovingMachine.rover(transport, DEAD_MAN_MS, places, story, picture);
  machine.session.onclosed = (reason) => say(hint, reason);
  if (kind === "bus") machine.session.order((role, now) => (role as Bus).discover(now));
  simulation = { machine, transport, kind, isRunaway: false, wasStopPending: false };
  input("try-noise").value = "0";
  input("try-cable").checked = false;
  showNoise();
  say(hint, "The simulation is starting …");
  guard(machine);
}

function end(): void {
  if (!simulation) return;
  unguard(simulation.machine);
  void simulation.machine.session.close();
  simulation = undefined;
}

/** Called for each picture of the screen. */
export function draw(): void {
  if (!simulation) return;
  if (!simulation.isRunaway) runAway();
  const { machine } = simulation;
  machine.show();
  const [wasPending, { isPending }] = [simulation.wasStopPending, machine.picture];
  simulation.wasStopPending = isPending;
  if (
    machine.session.closedBecause !== undefined ||
    isPending === wasPending ||
    !simulation.isRunaway
  )
    return;
  say(
    hint,
    wasPending
      ? "Stopped, and seen at standstill. Try it again with noise, or with a motor unplugged."
      : "A stop is sent again and again until standstill is seen.",
  );
}

/** Sets the first motor, or the rover, going as soon as it was heard. */
function runAway(): void {
  if (!simulation) return;
  const { machine, kind } = simulation;
  const session = machine.session;
  if (session.closedBecause !== undefined) return;
  if (machine.wasStopped) {
    simulation.isRunaway = true;
    return;
  }
  try {
    if (kind === "bus") {
      if (
        !(session.state() as BusState).nodes.some(
          ({ id, mode }) => id === RUNAWAY.node && mode === "velocity",
        )
      )
        return;
      session.order((role, now) => (role as Bus).set_velocity(RUNAWAY.node, RUNAWAY.rps, now));
      say(hint, "Motor 1 is running. Press STOP (or the space bar), or unplug it and watch.");
    } else {
      if (machine.isStopPending || (session.state() as RoverState).link !== "up") return;
      say(
        hint,
        "The rover is standing still. Drive it, then press STOP (or the space bar), or unplug its cable while it drives.",
      );
    }
    simulation.isRunaway = true;
    simulation.wasStopPending = machine.isStopPending;
  } catch {
    // It is not ready yet: the next picture tries again.
  }
}

function showNoise(): void {
  const share = NOISE[input("try-noise").valueAsNumber] ?? 0;
  const text =
    share === 0 ? "no noise" : `1 wrong bit in ${Math.round(1 / share).toLocaleString("en")}`;
  say(the("try-noise-words", HTMLElement), text);
  input("try-noise").setAttribute("aria-valuetext", text);
  simulation?.transport.noise(share);
}

export function start(module: WebAssembly.Module): void {
  select("try-kind").addEventListener("change", () => {
    remember({ on: select("try-kind").value === "rover" ? "rover" : "" });
    enter(module);
  });
  input("try-noise").addEventListener("input", showNoise);
  input("try-cable").addEventListener("change", () =>
    simulation?.transport.unplug(0, input("try-cable").checked),
  );
  button("try-runaway").addEventListener("click", () => {
    end();
    begin(module, kind());
  });
}
