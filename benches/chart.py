#!/usr/bin/env python3
"""Draws benches/ratios.svg from benches/ratios.txt, the output of the bench `ratios`.

    chrt -f 10 cargo bench -q -p axlewire-benches --bench ratios > benches/ratios.txt
    python3 benches/chart.py

With `--check` it draws nothing, and fails if the picture is not the one that it would draw.

Left: throughput of each decoder over that of the C reference. Right: the intact frames that C
loses at each bit-error rate; axlewire loses none, or the bench would have failed.
"""

import sys
from pathlib import Path
from xml.sax.saxutils import escape

HERE = Path(__file__).parent
STREAMS = [
    ("ikeya8", "Ikeya, 8-byte responses"),
    ("ikeya_mixed", "Ikeya, both directions"),
    ("ucp44", "UCP, 44-byte reports"),
]
DECODERS = [
    ("each_simd", "each, SIMD", "#0d3b4c"),
    ("each", "Frames::each", "#155a73"),
    ("frames", "Frames", "#1f7f9f"),
    ("decoder4096", "Decoder by 4096", "#63a8bd"),
    ("decoder1", "Decoder by 1", "#b9d8e1"),
    ("c", "C reference", "#8a8a8a"),
]
RATES = ["1e-5", "1e-4", "1e-3"]
LINES = ["#c05a2b", "#d99a2b", "#7a4b9a"]
WIDTH, HEIGHT = 920, 420
TOP, BOTTOM = 70, 350


def main():
    values = {}
    for line in (HERE / "ratios.txt").read_text().splitlines():
        name, value, _goal = line.split()
        values[name] = float(value)
    body = throughput(values) + recovered(values)
    svg = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="sans-serif" font-size="12" fill="#222">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>',
        *body,
        "</svg>",
    ]
    picture, text = HERE / "ratios.svg", "\n".join(svg) + "\n"
    if sys.argv[1:] == ["--check"]:
        return None if picture.read_text() == text else f"{picture} is out of date"
    picture.write_text(text)


def throughput(values):
    """Grouped bars: one group for each stream, one bar for each decoder."""
    left, right = 60, 500
    ratios = {
        (stream, decoder): values[f"mb_per_s_{stream}_{decoder}"] / values[f"mb_per_s_{stream}_c"]
        for stream, _ in STREAMS
        for decoder, _, _ in DECODERS
    }
    limit = nice(max(ratios.values()))
    out = [text(left, 28, "Throughput, times the C reference (more is better)", weight="bold")]
    out += axis(left, right, [(i * limit / 4, f"{i * limit / 4:g}") for i in range(5)], limit)
    group = (right - left) / len(STREAMS)
    bar = group / (len(DECODERS) + 1)
    for i, (stream, title) in enumerate(STREAMS):
        start = left + i * group + bar / 2
        for j, (decoder, _, colour) in enumerate(DECODERS):
            ratio = ratios[stream, decoder]
            y = height_of(ratio, limit)
            x = start + j * bar
            out.append(
                f'<rect x="{x:.1f}" y="{y:.1f}" width="{bar - 4:.1f}" height="{BOTTOM - y:.1f}" fill="{colour}"/>'
            )
            out.append(text(x + bar / 2 - 2, y - 4, f"{ratio:.1f}" if ratio < 9.5 else f"{ratio:.0f}", "middle"))
        out.append(text(left + (i + 0.5) * group, BOTTOM + 18, title, "middle"))
    return out + legend(left, [(name, colour) for _, name, colour in DECODERS])


def recovered(values):
    """Lines: the share of intact frames that each receiver finds."""
    left, right = 600, 890
    shares = {
        (stream, rate, by): values[f"recovered_{stream}_{rate}_{by}_percent"]
        for stream, _ in STREAMS
        for rate in RATES
        for by in ("axlewire", "c")
    }
    lost = 100 - min(shares.values())
    span = nice(lost)
    out = [text(left - 40, 28, "Intact frames recovered, per bit-error rate", weight="bold")]
    ticks = [(i * span / 4, f"{100 - span + i * span / 4:.4g} %") for i in range(5)]
    out += axis(left, right, ticks, span)
    step = (right - left) / len(RATES)
    places = [left + (i + 0.5) * step for i in range(len(RATES))]
    for x, rate in zip(places, RATES):
        out.append(text(x, BOTTOM + 18, rate, "middle"))
    entries = [("axlewire, all three", DECODERS[0][2])]
    for (stream, title), colour in zip(STREAMS, LINES):
        out += line(places, [shares[stream, rate, "c"] - 100 + span for rate in RATES], span, colour)
        entries.append((f"C: {stream}", colour))
    for stream, _ in STREAMS:
        found = [shares[stream, rate, "axlewire"] - 100 + span for rate in RATES]
        out += line(places, found, span, DECODERS[0][2])
    return out + legend(left - 40, entries, per_row=2)


def nice(limit):
    """The next round number that leaves headroom."""
    step = 10.0
    while step > limit:
        step /= 10
    return next(m * step for m in (1, 1.2, 1.6, 2, 4, 5, 8, 10, 12, 16, 20, 40) if m * step >= limit * 1.02)


def height_of(value, limit):
    return BOTTOM - (BOTTOM - TOP) * value / limit


def axis(left, right, ticks, limit):
    out = []
    for value, label in ticks:
        y = height_of(value, limit)
        out.append(f'<line x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}" stroke="#ddd"/>')
        out.append(text(left - 6, y + 4, label, "end"))
    return out


def line(places, values, limit, colour):
    points = [(x, height_of(value, limit)) for x, value in zip(places, values)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>' for x, y in points]
    return [f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>', *dots]


def legend(left, entries, per_row=3):
    out = []
    for i, (name, colour) in enumerate(entries):
        x, y = left + i % per_row * (145 if per_row == 3 else 165), BOTTOM + 38 + i // per_row * 18
        out.append(f'<rect x="{x}" y="{y - 10}" width="11" height="11" fill="{colour}"/>')
        out.append(text(x + 16, y, name))
    return out


def text(x, y, words, anchor="start", weight="normal"):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-weight="{weight}">{escape(words)}</text>'


if __name__ == "__main__":
    sys.exit(main())
