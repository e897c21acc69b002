/** A capture that is decoded in a worker: what the page can ask about it. */
import CaptureWorker from "./capture_worker.ts?worker&inline";
import type { Summary, Table } from "./contract.ts";

export interface Questions {
  filter: { question: { tables: string[]; text: string }; answer: number };
  lines: { question: { from: number; count: number }; answer: string[] };
  bytes: { question: number; answer: { offset: number; hex: string } };
  series: {
    question: { table: string; columns: string[]; from: number; to: number; points: number };
    answer: Float64Array[];
  };
  csv: { question: { table: string; rows: number }; answer: Blob };
  jsonLines: { question: { rows: number }; answer: Blob };
}

export interface Contents {
  summary: Summary;
  tables: Table[];
  rows: number;
}

export type ToCapture =
  | { open: File; module: WebAssembly.Module; protocol: string | undefined }
  | { id: number; name: keyof Questions; question: unknown };
export type FromCapture =
  | { progress: number }
  | { opened: Contents }
  | { failed: string }
  | { id: number; answer: unknown }
  | { id: number; refused: string };

interface Waiting {
  resolve: (answer: never) => void;
  reject: (error: Error) => void;
}

export class CaptureFile {
  /** Resolves when all of it was decoded. */
  readonly contents: Promise<Contents>;

  private readonly worker: Worker = new CaptureWorker();
  private readonly waiting = new Map<number, Waiting>();
  private asked = 0;
  private giveUp: (error: Error) => void = () => {};

  constructor(
    readonly file: File,
    module: WebAssembly.Module,
    protocol: string | undefined,
    progress: (share: number) => void,
  ) {
    this.contents = new Promise((resolve, reject) => {
      this.giveUp = reject;
      this.worker.onerror = (event) => this.fail(event.message);
      this.worker.onmessage = ({ data }: MessageEvent<FromCapture>) => {
        if ("progress" in data) progress(data.progress);
        else if ("opened" in data) resolve(data.opened);
        else if ("failed" in data) this.fail(data.failed);
        else this.answered(data);
      };
    });
    this.worker.postMessage({ open: file, module, protocol } satisfies ToCapture);
  }

  ask<Q extends keyof Questions>(
    name: Q,
    question: Questions[Q]["question"],
  ): Promise<Questions[Q]["answer"]> {
    const id = ++this.asked;
    this.worker.postMessage({ id, name, question } satisfies ToCapture);
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  /** Ends the worker, whatever it does. */
  end(): void {
    this.fail("Cancelled.");
  }

  private answered(data: { id: number; answer: unknown } | { id: number; refused: string }): void {
    const waiting = this.waiting.get(data.id);
    this.waiting.delete(data.id);
    if ("refused" in data) waiting?.reject(new Error(data.refused));
    else waiting?.resolve(data.answer as never);
  }

  private fail(why: string): void {
    this.worker.terminate();
    const error = new Error(why);
    this.giveUp(error);
    for (const { reject } of this.waiting.values()) reject(error);
    this.waiting.clear();
  }
}
