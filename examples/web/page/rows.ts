/** A list of any length, of which only the rows that are seen exist. */
import { make } from "./dom.ts";

export const ROW_PX = 24;
/**
 * Browsers cap the height of an element, some at 17 million pixels: a longer list is scrolled by
 * shares.
 */
const MOST_PX = 15_000_000;

export class Rows {
  private total = 0;
  private first = 0;
  private selected = -1;
  private isAsking = false;
  private isStale = false;
  /** Where this file has put the scroll bar: the event that follows says nothing new. */
  private putAt = -1;
  private readonly space = make("div", { role: "presentation" });
  private readonly seen = make("div", { role: "presentation", class: "seen" });

  constructor(
    private readonly list: HTMLElement,
    private readonly fetch: (from: number, count: number) => Promise<string[]>,
    private readonly row: (line: string) => Node[],
    private readonly chosen: (row: number) => void,
  ) {
    this.space.append(this.seen);
    list.replaceChildren(this.space);
    list.addEventListener("scroll", () => this.scrolled());
    list.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    list.addEventListener("keydown", (event) => this.key(event));
    list.addEventListener("click", (event) => {
      const row = (event.target as Element).closest<HTMLElement>("[data-row]");
      if (row) this.choose(Number(row.dataset.row));
    });
    new ResizeObserver(() => void this.draw()).observe(list);
  }

  /** The list is another one now. */
  reset(total: number, selected = -1): void {
    this.total = total;
    this.selected = selected < total ? selected : -1;
    this.space.style.height = `${this.height()}px`;
    this.goTo(Math.max(0, this.selected - Math.floor(this.fits() / 2)));
  }

  private choose(row: number): void {
    this.selected = Math.max(0, Math.min(row, this.total - 1));
    if (this.total === 0) return;
    if (this.selected < this.first) this.goTo(this.selected);
    else if (this.selected >= this.first + this.fits()) this.goTo(this.selected - this.fits() + 1);
    else void this.draw();
    this.chosen(this.selected);
  }

  private readonly height = () => Math.min(this.total * ROW_PX, MOST_PX);
  private readonly fits = () => Math.max(1, Math.floor(this.list.clientHeight / ROW_PX));
  private readonly last = () => Math.max(0, this.total - this.fits());
  private readonly rowsPerPx = () =>
    this.last() / Math.max(1, this.height() - this.list.clientHeight);

  private goTo(row: number): void {
    this.first = Math.max(0, Math.min(Math.round(row), this.last()));
    this.list.scrollTop = this.rowsPerPx() > 0 ? this.first / this.rowsPerPx() : 0;
    this.putAt = this.list.scrollTop;
    void this.draw();
  }

  private scrolled(): void {
    if (Math.abs(this.list.scrollTop - this.putAt) < 1) return;
    this.putAt = -1;
    this.first = Math.min(Math.round(this.list.scrollTop * this.rowsPerPx()), this.last());
    void this.draw();
  }

  /** Where a pixel of the scroll bar is many rows, the wheel goes by rows. */
  private wheel(event: WheelEvent): void {
    if (this.total * ROW_PX <= MOST_PX || event.ctrlKey) return;
    event.preventDefault();
    this.goTo(this.first + event.deltaY / ROW_PX);
  }

  private key(event: KeyboardEvent): void {
    const at = Math.max(0, this.selected);
    const to: Record<string, number> = {
      ArrowDown: this.selected + 1,
      ArrowUp: at - 1,
      PageDown: at + this.fits(),
      PageUp: at - this.fits(),
      Home: 0,
      End: this.total - 1,
    };
    const row = to[event.key];
    if (row === undefined) return;
    event.preventDefault();
    this.choose(row);
  }

  /** Asks for the rows that are seen, one question at a time, and shows them. */
  private async draw(): Promise<void> {
    this.isStale = true;
    if (this.isAsking) return;
    this.isAsking = true;
    try {
      while (this.isStale) {
        this.isStale = false;
        const [from, count] = [this.first, Math.min(this.fits() + 1, this.total - this.first)];
        const lines = count > 0 ? await this.fetch(from, count) : [];
        if (!this.isStale) this.paint(from, lines);
      }
    } catch {
      this.seen.replaceChildren();
    } finally {
      this.isAsking = false;
    }
  }

  private paint(from: number, lines: string[]): void {
    this.seen.style.height = `${this.list.clientHeight}px`;
    const rows = lines.map((line, at) => {
      const row = from + at;
      const attributes = {
        role: "option",
        id: `row-${row}`,
        class: "row",
        "data-row": String(row),
        "aria-selected": String(row === this.selected),
        "aria-setsize": String(this.total),
        "aria-posinset": String(row + 1),
      };
      return make("div", attributes, ...this.row(line));
    });
    this.seen.replaceChildren(...rows);
    if (rows.some((row) => row.id === `row-${this.selected}`))
      this.list.setAttribute("aria-activedescendant", `row-${this.selected}`);
    else this.list.removeAttribute("aria-activedescendant");
  }
}
