/**
 * A simulated line, in a worker, as a transport. The worker also tells what the motors really do.
 */
import type { Truth } from "./contract.ts";
import type { Transport } from "./session.ts";
import SimulatorWorker from "./simulator_worker.ts?worker&inline";

export type ToSimulator =
  | { start: WebAssembly.Module; nodes: string | undefined }
  | { write: Uint8Array }
  | { noise: number }
  | { unplug: number; isUnplugged: boolean };
export type FromSimulator = { bytes: Uint8Array } | { truth: Truth } | { failed: string };

export class SimulatedTransport implements Transport {
  onbytes: (bytes: Uint8Array) => void = () => {};
  onclosed: (reason: string) => void = () => {};
  truth: Truth = {};

  private readonly worker: Worker = new SimulatorWorker();

  /** A bus of such nodes ("1:velocity 2:position"), or a rover if there are none. */
  constructor(module: WebAssembly.Module, nodes: string | undefined) {
    this.worker.onmessage = ({ data }: MessageEvent<FromSimulator>) => {
      if ("bytes" in data) this.onbytes(data.bytes);
      else if ("truth" in data) this.truth = data.truth;
      else this.onclosed(`The simulation has failed: ${data.failed}`);
    };
    this.worker.onerror = (event) => this.onclosed(`The simulation has failed: ${event.message}`);
    this.tell({ start: module, nodes });
  }

  async write(bytes: Uint8Array): Promise<void> {
    this.tell({ write: bytes });
  }

  noise(share: number): void {
    this.tell({ noise: share });
  }

  unplug(node: number, isUnplugged: boolean): void {
    this.tell({ unplug: node, isUnplugged });
  }

  async close(): Promise<void> {
    this.worker.terminate();
  }

  private tell(order: ToSimulator): void {
    this.worker.postMessage(order);
  }
}
