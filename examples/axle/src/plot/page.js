"use strict";
// Draws the values in #data. Wheel, buttons and keys zoom, dragging moves, a double click shows all,
// and the pointer shows the values beside it. The part that is shown is in the address, behind the #.
const data = JSON.parse(document.getElementById("data").textContent);
const tip = document.getElementById("tip");
const end = Math.max(data.end, 1e-6);
const view = { from: 0, to: end };
const hidden = new Set();
const HEIGHTS = { tall: 230, low: 130, half: 120 };
const ROW = 19, LEFT = 52, ROWS_LEFT = 104, RIGHT = 40, LABELS = 20, NEAR = 24;
const FONT = "11px Inter, system-ui, 'Helvetica Neue', Arial, sans-serif";
const left = { half: LEFT, full: LEFT };
const hasRows = data.panels.some(panel => panel.size === "rows");

const panels = data.panels.map(panel => {
  const section = document.createElement("section");
  section.className = panel.size;
  const head = document.createElement("div");
  const title = document.createElement("h2");
  title.textContent = panel.title;
  if (panel.unit) {
    const unit = document.createElement("span");
    unit.textContent = ", " + panel.unit;
    title.append(unit);
  }
  const hint = document.createElement("span");
  hint.className = "hint";
  hint.textContent = panel.hint;
  const legend = document.createElement("span");
  legend.className = "legend";
  head.append(title, hint, legend);
  const canvas = document.createElement("canvas");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", panel.title);
  section.append(head, canvas);
  document.getElementById("panels").append(section);
  const shown = { panel, canvas, legend, left: 0, right: 0, top: 6, bottom: 0, low: 0, high: 1 };
  for (const series of panel.series.filter(series => series.named)) {
    const button = document.createElement("button");
    button.textContent = series.name;
    button.style.setProperty("--of", colour(series));
    button.setAttribute("aria-pressed", "true");
    // A set-point goes with what is measured: it has the same colour.
    button.onclick = () => {
      const isShown = button.getAttribute("aria-pressed") === "false";
      button.setAttribute("aria-pressed", String(isShown));
      for (const other of panel.series) {
        if (other.colour === series.colour) {
          isShown ? hidden.delete(other) : hidden.add(other);
        }
      }
      draw();
    };
    legend.append(button);
  }
  follow(shown);
  return shown;
});

document.getElementById("axis").textContent = data.axis;
for (const note of data.notes) {
  const item = document.createElement("li");
  item.textContent = note;
  document.getElementById("notes").append(item);
}

function style(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// On a dark page, dark colours are mixed with white.
function colour(series) {
  const parts = data.palette[series.colour].match(/[0-9a-f]{2}/g).map(two => parseInt(two, 16));
  const isDark = style("--lighter") === "1";
  const light = (parts[0] * 2 + parts[1] * 5 + parts[2]) / 8;
  const by = isDark ? Math.min(.62, Math.max(0, (150 - light) / 150)) : 0;
  return `rgb(${parts.map(part => Math.round(part + (255 - part) * by)).join(" ")})`;
}

// The first place that is not below x.
function find(xs, x) {
  let low = 0, high = xs.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (xs[middle] < x) low = middle + 1; else high = middle;
  }
  return low;
}

const ticksOf = (low, high, count) => {
  const rough = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(times => times * power >= rough);
  const ticks = [];
  for (let tick = Math.ceil(low / step); tick * step <= high; tick++) ticks.push(tick * step);
  return { ticks, texts: textsOf(ticks, step) };
};

// The numbers of ticks with this step between them: each is right and unlike its neighbours. Below
// 0.001 and from a million on they have exponents, if this makes them shorter.
function textsOf(ticks, step) {
  const powerOf = number => Math.floor(Math.log10(number) + 1e-9);
  const least = powerOf(step);
  const all = write => ticks.map(tick => Math.abs(tick) < step / 2 ? "0" : write(tick).replace(/-/g, "−"));
  const plain = all(tick => tick.toFixed(Math.min(100, Math.max(0, -least))));
  const most = Math.max(...ticks.map(Math.abs));
  if (most >= 1e-3 && most < 1e6) return plain;
  const short = all(tick => {
    const decimals = Math.min(20, Math.max(0, powerOf(Math.abs(tick)) - least));
    return tick.toExponential(decimals).replace(/\.?0+e/, "e").replace("+", "");
  });
  const width = texts => Math.max(...texts.map(text => text.length));
  return width(plain) <= width(short) ? plain : short;
}

// The values of a series that are shown, and one beyond each end.
function range(series) {
  return [Math.max(0, find(series.x, view.from) - 1), Math.min(series.x.length, find(series.x, view.to) + 1)];
}

function scale(shown) {
  const { panel } = shown;
  if (panel.size === "rows") {
    [shown.low, shown.high] = [panel.series.length, 0];
    return;
  }
  let low = Infinity, high = -Infinity;
  for (const series of panel.series.filter(series => !hidden.has(series))) {
    const [first, last] = range(series);
    for (let at = first; at < last; at++) {
      const y = series.y[at];
      if (y !== null) { low = Math.min(low, y); high = Math.max(high, y); }
    }
  }
  const [least, most] = panel.least ?? [Infinity, -Infinity];
  [low, high] = [Math.min(low, least), Math.max(high, most)];
  if (low > high) [low, high] = [0, 1];
  // A smaller difference is none: a double has no numbers for ticks in between.
  const isFlat = high - low < 1e-12 * Math.max(1, Math.abs(low), Math.abs(high));
  const room = isFlat ? Math.max(Math.abs(high) * .1, 1) : (high - low) * .06;
  shown.low = panel.least && low === least && high > low ? low : low - room;
  shown.high = high + room;
}

// Where panels begin: behind their labels, and above each other at the same place.
function measure() {
  [left.half, left.full] = [LEFT, hasRows ? ROWS_LEFT : LEFT];
  for (const shown of panels.filter(shown => shown.panel.size !== "rows")) {
    scale(shown);
    const pen = shown.canvas.getContext("2d");
    pen.font = FONT;
    shown.up = ticksOf(shown.low, shown.high, (HEIGHTS[shown.panel.size] - shown.top) / 28);
    const width = Math.max(...shown.up.texts.map(text => pen.measureText(text).width)) + 10;
    const of = shown.panel.size === "half" ? "half" : "full";
    left[of] = Math.max(left[of], Math.ceil(width));
  }
}

function draw() {
  measure();
  for (const shown of panels) paint(shown);
  const root = document.documentElement;
  [root.dataset.from, root.dataset.to] = [view.from, view.to];
}

function paint(shown) {
  const { panel, canvas } = shown;
  const isRows = panel.size === "rows", isHalf = panel.size === "half";
  const width = canvas.clientWidth;
  const height = isRows ? panel.series.length * ROW + LABELS + 6 : HEIGHTS[panel.size] + LABELS;
  const dots = window.devicePixelRatio || 1;
  canvas.style.height = height + "px";
  [canvas.width, canvas.height] = [Math.round(width * dots), Math.round(height * dots)];
  const pen = canvas.getContext("2d");
  pen.scale(dots, dots);
  shown.left = isHalf ? left.half : left.full;
  shown.right = width - (isHalf ? 4 : RIGHT);
  shown.bottom = height - LABELS;
  if (isRows) scale(shown);
  const px = x => shown.left + (x - view.from) / (view.to - view.from) * (shown.right - shown.left);
  const py = y => shown.bottom - (y - shown.low) / (shown.high - shown.low) * (shown.bottom - shown.top);
  Object.assign(shown, { px, py });
  pen.font = FONT;
  pen.lineWidth = 1;
  const line = (x0, y0, x1, y1, ink) => {
    pen.strokeStyle = ink;
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x1, y1);
    pen.stroke();
  };
  const crisp = at => Math.round(at) + .5;
  const across = ticksOf(view.from, view.to, (shown.right - shown.left) / 95);
  pen.fillStyle = style("--soft");
  pen.textAlign = "center";
  across.ticks.forEach((tick, at) => {
    line(crisp(px(tick)), shown.top, crisp(px(tick)), shown.bottom + 4, style("--grid"));
    pen.fillText(across.texts[at], px(tick), height - 4);
  });
  if (!isRows) {
    pen.textAlign = "right";
    shown.up.ticks.forEach((tick, at) => {
      line(shown.left, crisp(py(tick)), shown.right, crisp(py(tick)), style("--grid"));
      pen.fillText(shown.up.texts[at], shown.left - 7, py(tick) + 4);
    });
  }
  line(shown.left + .5, shown.top, shown.left + .5, shown.bottom, style("--frame"));
  line(shown.left, shown.bottom + .5, shown.right, shown.bottom + .5, style("--frame"));
  panel.series.forEach((series, row) => {
    if (isRows) {
      pen.fillStyle = style("--soft");
      pen.textAlign = "right";
      pen.fillText(series.name, shown.left - 8, shown.top + ROW * row + 14);
      pen.textAlign = "left";
      pen.fillText(series.count + "×", shown.right + 7, shown.top + ROW * row + 14);
    }
  });
  pen.save();
  pen.beginPath();
  pen.rect(shown.left, shown.top - 2, shown.right - shown.left, shown.bottom - shown.top + 4);
  pen.clip();
  pen.lineJoin = "round";
  panel.series.forEach((series, row) => {
    if (!hidden.has(series)) curve(pen, series, row, px, py);
  });
  pen.restore();
}

function curve(pen, series, row, px, py) {
  const [first, last] = range(series);
  pen.strokeStyle = pen.fillStyle = colour(series);
  pen.globalAlpha = 1;
  pen.lineWidth = 1.5;
  if (series.look === "ticks") {
    pen.beginPath();
    for (let at = first; at < last; at++) {
      pen.moveTo(px(series.x[at]), py(row + .18));
      pen.lineTo(px(series.x[at]), py(row + .82));
    }
    pen.stroke();
    return;
  }
  if (series.look === "dots") {
    pen.globalAlpha = .75;
    for (let at = first; at < last; at++) {
      if (series.y[at] === null) continue;
      pen.beginPath();
      pen.arc(px(series.x[at]), py(series.y[at]), 1.5, 0, 7);
      pen.fill();
    }
    pen.globalAlpha = 1;
    return;
  }
  if (series.look === "held" || series.look === "wide") {
    pen.globalAlpha = .32;
    pen.lineWidth = 5;
  }
  pen.beginPath();
  let before = null;
  for (let at = first; at < last; at++) {
    const y = series.y[at];
    if (y === null) {
      // A held value holds until here.
      if (before !== null && isHeld(series)) pen.lineTo(px(series.x[at]), py(before));
      before = null;
      continue;
    }
    if (before === null) pen.moveTo(px(series.x[at]), py(y));
    else {
      if (isHeld(series)) pen.lineTo(px(series.x[at]), py(before));
      pen.lineTo(px(series.x[at]), py(y));
    }
    // A value between two interruptions is seen all the same.
    if (before === null && (at + 1 >= last || series.y[at + 1] === null)) pen.lineTo(px(series.x[at]) + 1.5, py(y));
    before = y;
  }
  if (series.look === "held" && series.open && before !== null && last === series.x.length) {
    pen.lineTo(px(end), py(before));
  }
  pen.stroke();
  pen.globalAlpha = 1;
}

const isHeld = series => series.look === "held" || series.look === "step";

// The value of a series that is nearest to x, if it is near enough.
function nearestAt(series, x, near) {
  const at = find(series.x, x);
  let best = null;
  for (let other = Math.max(0, at - 2); other < Math.min(series.x.length, at + 3); other++) {
    if (series.y[other] === null) continue;
    const distance = Math.abs(series.x[other] - x);
    if (distance <= near && (best === null || distance < Math.abs(series.x[best] - x))) best = other;
  }
  return best;
}

// The value that is held at x.
function heldAt(series, x) {
  let at = find(series.x, x);
  if (series.x[at] !== x) at--;
  while (at + 1 < series.x.length && series.x[at + 1] === x) at++;
  const isOver = at === series.x.length - 1 && x > series.x[at] && !(series.look === "held" && series.open);
  return at < 0 || isOver || series.y[at] === null ? null : at;
}

function showTip(shown, clientX, clientY) {
  const box = shown.canvas.getBoundingClientRect();
  const perPixel = (view.to - view.from) / (shown.right - shown.left);
  const x = view.from + (clientX - box.left - shown.left) * perPixel;
  const rows = [];
  let place = x;
  const series = shown.panel.series.filter(series => !hidden.has(series));
  // All values are those of the place that is nearest.
  let nearest = Infinity;
  for (const one of series) {
    const at = nearestAt(one, x, perPixel * NEAR);
    if (at !== null && Math.abs(one.x[at] - x) < nearest) {
      nearest = Math.abs(one.x[at] - x);
      place = one.x[at];
    }
  }
  for (const one of series) {
    const at = isHeld(one) ? heldAt(one, place) : nearestAt(one, place, perPixel * NEAR / 2);
    if (at === null) continue;
    const unit = one.look === "ticks" ? "×" : " " + shown.panel.unit;
    rows.push({ one, at, text: String(one.y[at]).replace("-", "−") + unit });
  }
  tip.replaceChildren();
  const head = document.createElement("b");
  head.textContent = data.unit === "s" ? place.toFixed(6) + " s" : "byte " + Math.round(place);
  const table = document.createElement("table");
  for (const row of rows) {
    const line = table.insertRow();
    line.style.setProperty("--of", colour(row.one));
    line.insertCell().textContent = row.one.name;
    line.insertCell().textContent = row.text;
    Object.assign(line.dataset, { x: row.one.x[row.at], y: row.one.y[row.at] });
  }
  tip.append(head, table);
  tip.dataset.x = place;
  tip.hidden = false;
  const { offsetWidth: width, offsetHeight: height } = tip;
  tip.style.left = (clientX + 16 + width > innerWidth ? clientX - 16 - width : clientX + 16) + "px";
  tip.style.top = Math.max(4, Math.min(innerHeight - height - 4, clientY - height / 2)) + "px";
  for (const other of panels) {
    paint(other);
    const pen = other.canvas.getContext("2d");
    const at = other.px(place);
    if (at < other.left || at > other.right) continue;
    pen.strokeStyle = style("--soft");
    pen.lineWidth = 1;
    pen.setLineDash([3, 3]);
    pen.beginPath();
    pen.moveTo(at, other.top);
    pen.lineTo(at, other.bottom);
    pen.stroke();
    pen.setLineDash([]);
    if (other !== shown || other.panel.size === "rows") continue;
    for (const row of rows) {
      pen.fillStyle = colour(row.one);
      pen.beginPath();
      pen.arc(other.px(isHeld(row.one) ? place : row.one.x[row.at]), other.py(row.one.y[row.at]), 3.5, 0, 7);
      pen.fill();
    }
  }
}

function show(from, to) {
  const span = Math.min(end, Math.max(to - from, end * 1e-7));
  view.from = Math.min(Math.max(0, from), end - span);
  view.to = view.from + span;
  tip.hidden = true;
  const isAll = view.from === 0 && view.to === end;
  const address = isAll ? location.pathname : `#${+view.from.toFixed(6)},${+view.to.toFixed(6)}`;
  try { history.replaceState(null, "", address); } catch { /* Not where a page has no address. */ }
  draw();
}

function zoom(by, about = (view.from + view.to) / 2) {
  show(about - (about - view.from) * by, about + (view.to - about) * by);
}

function follow(shown) {
  const { canvas } = shown;
  let dragged = null;
  const at = event => {
    const x = event.clientX - canvas.getBoundingClientRect().left;
    return view.from + (x - shown.left) / (shown.right - shown.left) * (view.to - view.from);
  };
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    zoom(1.0015 ** event.deltaY, at(event));
  }, { passive: false });
  canvas.addEventListener("pointerdown", event => {
    dragged = { x: event.clientX, from: view.from, to: view.to };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointerup", () => { dragged = null; });
  canvas.addEventListener("pointercancel", () => { dragged = null; });
  canvas.addEventListener("pointermove", event => {
    if (dragged === null || Math.abs(event.clientX - dragged.x) < 3) {
      return showTip(shown, event.clientX, event.clientY);
    }
    const by = (event.clientX - dragged.x) / (shown.right - shown.left) * (dragged.to - dragged.from);
    show(dragged.from - by, dragged.to - by);
  });
  canvas.addEventListener("pointerleave", () => { tip.hidden = true; draw(); });
  canvas.addEventListener("dblclick", () => show(0, end));
}

document.getElementById("in").onclick = () => zoom(.5);
document.getElementById("out").onclick = () => zoom(2);
document.getElementById("all").onclick = () => show(0, end);
addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const span = view.to - view.from;
  const keys = {
    "+": () => zoom(.5), "=": () => zoom(.5), "-": () => zoom(2), "0": () => show(0, end),
    ArrowLeft: () => show(view.from - span / 5, view.to - span / 5),
    ArrowRight: () => show(view.from + span / 5, view.to + span / 5),
  };
  keys[event.key]?.();
});
addEventListener("resize", draw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const { panel, legend } of panels) {
    panel.series.filter(series => series.named).forEach((series, at) => {
      legend.children[at].style.setProperty("--of", colour(series));
    });
  }
  draw();
});

function fromAddress() {
  const [from, to] = location.hash.slice(1).split(",").map(Number);
  if (to > from && from >= 0) show(from, to); else draw();
}
addEventListener("hashchange", fromAddress);
fromAddress();
