/**
 * Plots of the numbers of a capture, by uPlot. What is zoomed into is asked for again, in full
 * detail.
 */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { remember, settings } from "./address.ts";
import type { CaptureFile, Contents } from "./capture_file.ts";
import type { Column, Table } from "./contract.ts";
import { button, make, select, the } from "./dom.ts";
import { clock, GAPS } from "./frames.ts";

const HEIGHT = 300;
/** Nodes on a bus: each has a curve of its own. */
const MOST_NODES = 8;
const NOT_PLOTTED = new Set(["t", "offset", "interface", "length"]);
/** The column that tells the motors of a bus apart. */
const NODE = "node";
const DASHES = [[], [8, 4], [2, 3], [12, 3, 2, 3]];

const place = the("plot", HTMLElement);
const choice = the("plot-columns", HTMLElement);
const tableChoice = select("plot-table");
const isDark = matchMedia("(prefers-color-scheme: dark)");

let capture: CaptureFile | undefined;
let contents: Contents | undefined;
let plot: uPlot | undefined;
/** What of the time is seen; NaN: all. */
let range: [number, number] = [NaN, NaN];
let drawn = 0;

const style = (name: string) =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const plottable = (table: Table): Column[] =>
  table.columns.filter(({ name, numeric }) => numeric && !NOT_PLOTTED.has(name));
const theTable = (): Table | undefined =>
  contents?.tables.find(({ table }) => table === tableChoice.value);
const unitOf = ({ unit }: Column): string => (unit === "none" ? "" : unit);
const number = (text: string | null): number => (text === null ? NaN : Number.parseFloat(text));

/**
 * How much somebody wants to see a table at first: what is measured before what is ordered, gaps
 * last.
 */
const tells = (table: Table): number =>
  /report|response/.test(table.table) ? 2 : table.table === GAPS ? 0 : 1;

export function open(opened: CaptureFile, what: Contents): void {
  [capture, contents] = [opened, what];
  const tables = what.tables.filter((table) => table.rows > 0 && plottable(table).length > 0);
  tableChoice.replaceChildren(...tables.map(({ table }) => make("option", {}, table)));
  const best = tables.toSorted((a, b) => tells(b) - tells(a) || b.rows - a.rows)[0]?.table ?? "";
  const wanted = settings().get("plot") ?? "";
  tableChoice.value = tables.some(({ table }) => table === wanted) ? wanted : best;
  const [from, to] = [number(settings().get("from")), number(settings().get("to"))];
  range = from < to ? [from, to] : [NaN, NaN];
  offerColumns(settings().get("columns")?.split(","));
}

function offerColumns(wanted?: string[]): void {
  const columns = theTable() ? plottable(theTable() as Table) : [];
  const known = columns.filter(({ name }) => wanted?.includes(name));
  const speeds = columns.filter(({ name }) => /^rp[sm]/.test(name));
  const first = speeds.length > 0 ? speeds : [...columns.filter(unitOf), ...columns].slice(0, 1);
  const chosen = known.length > 0 ? known : first;
  choice.replaceChildren(
    ...columns.map((column) => {
      const box = make("input", { type: "checkbox", value: column.name });
      box.checked = chosen.includes(column);
      return make(
        "label",
        { title: column.meaning },
        box,
        ` ${column.name}${unitOf(column) && ` (${unitOf(column)})`}`,
      );
    }),
  );
  void draw();
}

function chosenColumns(): Column[] {
  const names = [...choice.querySelectorAll("input")]
    .filter(({ checked }) => checked)
    .map(({ value }) => value);
  return theTable()?.columns.filter(({ name }) => names.includes(name)) ?? [];
}

function zoom(from: number, to: number): void {
  range = [from, to];
  void draw();
}

/** Zooms around the middle of what is seen. */
function zoomBy(factor: number): void {
  const [from, to] = [plot?.scales.x?.min, plot?.scales.x?.max];
  if (from === undefined || to === undefined) return;
  const [middle, half] = [(from + to) / 2, ((to - from) / 2) * factor];
  zoom(middle - half, middle + half);
}

async function draw(): Promise<void> {
  const columns = chosenColumns();
  const [from, to] = range;
  const isAll = Number.isNaN(from);
  remember({
    plot: tableChoice.value,
    columns: columns.map(({ name }) => name).join(","),
    from: isAll ? "" : String(from),
    to: isAll ? "" : String(to),
  });
  const mine = ++drawn;
  const names = columns.map(({ name }) => name);
  const hasNodes = theTable()?.columns.some(({ name }) => name === NODE) && !names.includes(NODE);
  const points = (hasNodes ? MOST_NODES : 1) * 2 * Math.max(300, place.clientWidth);
  const asked = hasNodes ? [...names, NODE] : names;
  const data =
    columns.length > 0
      ? await capture
          ?.ask("series", { table: tableChoice.value, columns: asked, from, to, points })
          .catch(() => undefined)
      : undefined;
  if (mine !== drawn) return;
  plot?.destroy();
  plot = undefined;
  if (!data?.[0]) return;
  const curves = columns.flatMap((column, at) =>
    curvesOf(
      column,
      data[at + 1] ?? new Float64Array(),
      hasNodes ? data[names.length + 1] : undefined,
    ),
  );
  plot = new uPlot(
    options(curves),
    [data[0], ...curves.map(({ values }) => values)] as uPlot.AlignedData,
    place,
  );
}

interface Curve {
  label: string;
  unit: string;
  /** uPlot knows an absent value as null. */
  values: (number | null)[];
}

/** One curve, or one for each node of a bus. */
function curvesOf(column: Column, values: Float64Array, nodes: Float64Array | undefined): Curve[] {
  const unit = unitOf(column);
  const label = unit ? `${column.name} (${unit})` : column.name;
  const only = (node?: number) =>
    Array.from(values, (value, at) =>
      Number.isNaN(value) || (node !== undefined && nodes?.[at] !== node) ? null : value,
    );
  if (!nodes) return [{ label, unit, values: only() }];
  return [...new Set(nodes)]
    .sort()
    .map((node) => ({ label: `node ${node}: ${label}`, unit, values: only(node) }));
}

function options(curves: Curve[]): uPlot.Options {
  const units = [...new Set(curves.map(({ unit }) => unit))];
  const hasTimes = contents?.summary.has_times ?? false;
  const ink = {
    stroke: style("--ink"),
    grid: { stroke: style("--line"), width: 1 },
    ticks: { stroke: style("--line"), width: 1 },
    font: "12px system-ui",
  };
  const [from, to] = range;
  return {
    width: Math.max(200, place.clientWidth),
    height: HEIGHT,
    scales: {
      x: { time: hasTimes, ...(Number.isNaN(from) ? {} : { range: [from, to] }) },
      ...Object.fromEntries(units.map((unit) => [`in ${unit}`, {}])),
    },
    axes: [
      hasTimes ? { ...ink, space: 100, values: times } : ink,
      ...units.map(
        (unit, at) =>
          ({
            ...ink,
            scale: `in ${unit}`,
            label: unit || "number",
            side: at === 0 ? 3 : 1,
            size: 60,
            grid: { ...ink.grid, show: at === 0 },
          }) as uPlot.Axis,
      ),
    ],
    series: [
      hasTimes
        ? { label: "time (UTC)", value: (_plot, at) => (at === null ? "--" : clock(at, 6)) }
        : { label: "byte" },
      ...curves.map(
        ({ label, unit }, at) =>
          ({
            label,
            scale: `in ${unit}`,
            stroke: style(`--plot-${(at % 6) + 1}`),
            width: 1.5,
            dash: DASHES[Math.floor(at / 6) % DASHES.length],
            spanGaps: true,
          }) as uPlot.Series,
      ),
    ],
    cursor: {
      drag: { x: true, y: false, setScale: false },
      bind: { dblclick: () => () => (zoom(NaN, NaN), null) },
    },
    hooks: {
      setSelect: [
        (plot) => {
          const { left, width } = plot.select;
          if (width > 2) zoom(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
        },
      ],
    },
  };
}

/** Times at the axis, as exact as they are apart; days where they are days apart. */
function times(_plot: uPlot, at: number[], _axis: number, _space: number, apart: number): string[] {
  if (apart >= 86_400)
    return at.map((seconds) => new Date(seconds * 1000).toISOString().slice(0, 10));
  return at.map((seconds) => clock(seconds, apart >= 1 ? 0 : apart >= 0.001 ? 3 : 6));
}

export function start(): void {
  tableChoice.addEventListener("change", () => {
    range = [NaN, NaN];
    offerColumns();
  });
  choice.addEventListener("change", () => void draw());
  button("plot-in").addEventListener("click", () => zoomBy(0.5));
  button("plot-out").addEventListener("click", () => zoomBy(2));
  button("plot-all").addEventListener("click", () => zoom(NaN, NaN));
  isDark.addEventListener("change", () => plot && void draw());
  new ResizeObserver(() =>
    plot?.setSize({ width: Math.max(200, place.clientWidth), height: HEIGHT }),
  ).observe(place);
}
