/** A serial port of this computer, by Web Serial, as a transport. */
import type { Transport } from "./session.ts";

export interface SerialPort extends EventTarget {
  readonly readable: ReadableStream<Uint8Array> | null;
  readonly writable: WritableStream<Uint8Array> | null;
  open(options: { baudRate: number; bufferSize?: number }): Promise<void>;
  close(): Promise<void>;
  getInfo(): { usbVendorId?: number; usbProductId?: number };
}

interface Serial extends EventTarget {
  requestPort(): Promise<SerialPort>;
}

export const serial: Serial | undefined = (navigator as { serial?: Serial }).serial;

/**
 * Twice this long: a page that was held up by a question of the browser hears of its port in
 * between.
 */
const WRITE_MS = 500;

export class SerialTransport implements Transport {
  onbytes: (bytes: Uint8Array) => void = () => {};
  onclosed: (reason: string) => void = () => {};

  private reader: ReadableStreamDefaultReader<Uint8Array> | undefined;
  private isClosing = false;
  private readonly reading: Promise<void>;
  private readonly writer: WritableStreamDefaultWriter<Uint8Array>;
  private readonly unplugged = () => this.lost("The adapter was unplugged.");

  static async open(port: SerialPort, baudRate: number): Promise<SerialTransport> {
    await port.open({ baudRate, bufferSize: 65536 });
    return new SerialTransport(port);
  }

  private constructor(private readonly port: SerialPort) {
    if (!port.writable) throw new Error("This port cannot be written.");
    this.writer = port.writable.getWriter();
    port.addEventListener("disconnect", this.unplugged);
    this.reading = this.read();
  }

  /**
   * A port that takes nothing for a second is given up: what it holds must not move a motor later.
   */
  async write(bytes: Uint8Array): Promise<void> {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const late = new Promise<never>((_, reject) => {
      timer = setTimeout(
        () => (timer = setTimeout(() => reject(new Error("the port takes no bytes")), WRITE_MS)),
        WRITE_MS,
      );
    });
    try {
      await Promise.race([this.writer.write(bytes), late]);
    } catch (error) {
      this.lost("The port no longer takes bytes.");
      throw error;
    } finally {
      clearTimeout(timer);
    }
  }

  async close(): Promise<void> {
    this.isClosing = true;
    this.port.removeEventListener("disconnect", this.unplugged);
    await this.reader?.cancel().catch(() => {});
    await this.reading;
    await this.writer.abort().catch(() => {});
    this.writer.releaseLock();
    await this.port.close().catch(() => {});
  }

  /**
   * A framing error or a full buffer ends a stream, and the port then has a new one; an unplugged
   * port has none.
   */
  private async read(): Promise<void> {
    while (this.port.readable && !this.isClosing) {
      this.reader = this.port.readable.getReader();
      try {
        for (;;) {
          const { value, done } = await this.reader.read();
          // A port that is there ends by an error, and one that is closed says so.
          if (done) return this.lost("The adapter has ended.");
          this.onbytes(value);
        }
      } catch {
        // The next round of the loop finds out whether the port is still there.
      } finally {
        this.reader.releaseLock();
      }
    }
    if (!this.isClosing) this.lost("The adapter can no longer be read: unplugged?");
  }

  private lost(reason: string): void {
    if (this.isClosing) return;
    this.isClosing = true;
    this.onclosed(reason);
    void this.close();
  }
}
