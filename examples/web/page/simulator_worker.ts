/** The crate's simulated line. */
import init, { Simulator } from "../pkg/axlewire_web.js";
import type { FromSimulator, ToSimulator } from "./simulated.ts";

const READ_MS = 4;
const TRUTH_MS = 16;

let simulator: Simulator | undefined;
let waiting: ToSimulator[] = [];
let toldAt = 0;
let soon: ReturnType<typeof setTimeout> | undefined;

const tell = (news: FromSimulator) => postMessage(news);

function read(): void {
  if (!simulator) return;
  const now = performance.now();
  const bytes = simulator.read(now);
  if (bytes.length > 0) tell({ bytes });
  if (now - toldAt >= TRUTH_MS) {
    toldAt = now;
    tell({ truth: JSON.parse(simulator.state()) });
  }
}

function readSoon(): void {
  soon ??= setTimeout(() => {
    soon = undefined;
    read();
  }, 0);
}

async function start(order: Extract<ToSimulator, { start: unknown }>): Promise<void> {
  await init({ module_or_path: order.start });
  const [seed, now] = [Math.floor(Math.random() * 0xffff_ffff), performance.now()];
  simulator =
    order.nodes === undefined ? Simulator.rover(seed, now) : Simulator.bus(order.nodes, seed, now);
  setInterval(read, READ_MS);
  for (const early of waiting.splice(0)) obey(early);
}

function obey(order: ToSimulator): void {
  if ("start" in order)
    void start(order).catch((error: unknown) => tell({ failed: String(error) }));
  else if (!simulator) waiting.push(order);
  else if ("write" in order) {
    simulator.write(order.write, performance.now());
    readSoon();
  } else if ("noise" in order) simulator.noise(order.noise);
  else simulator.unplug(order.unplug, order.isUnplugged);
}

onmessage = ({ data }: MessageEvent<ToSimulator>) => obey(data);
