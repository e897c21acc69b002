#!/usr/bin/env python3
"""Draws benches/noise.svg: the intact frames that get through on noisy lines.

    cargo run --release -q -p axle -- noise --json | python3 benches/noise.py

With `--check` it draws nothing, and fails if the picture is not the one that it would draw, or if
TESTING.md does not have its figures. Fails if a decoder of ours loses or invents a frame.
"""

import collections
import json
import sys
from pathlib import Path
from xml.sax.saxutils import escape

TESTING = Path(__file__).parent.parent / "TESTING.md"
PICTURE = Path(__file__).parent / "noise.svg"
NOISES = [
    ("clean", "no noise", ""),
    ("bits-1e-5", "bits", "10⁻⁵"),
    ("bits-1e-4", "bits", "10⁻⁴"),
    ("bits-1e-3", "bits", "10⁻³"),
    ("slips-1e-4", "lost bytes", "10⁻⁴"),
    ("slips-1e-3", "lost bytes", "10⁻³"),
    ("bursts", "bursts", "1 in 10"),
    ("bursts-all", "bursts", "always"),
    ("headers", "headers", "1 in 2"),
    ("cuts", "cut off", "1 in 20"),
]
TRAFFICS = [
    ("ucp", "UCP, both ways", "#c05a2b"),
    ("ucp-robot", "UCP, to the robot", "#d99a2b"),
    ("ikeya", "Ikeya, answers", "#7a4b9a"),
    ("ikeya-slave", "Ikeya, requests", "#b06fa8"),
    ("ikeya-3", "Ikeya, three motors", "#4f6fae"),
]
OURS = "#0d3b4c"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 920, 420, 66, 900, 64, 300


def main():
    shares, least, counts = {}, 100.0, collections.defaultdict(lambda: [0, 0])
    for record in map(json.loads, sys.stdin):
        traffic, noise = record["stream"].split("/")
        share = 100 * record["delivered"] / record["intact"]
        counts[record["decoder"]][0] += record["delivered"]
        counts[record["decoder"]][1] += record["intact"]
        if record["decoder"].startswith("plain"):
            shares[traffic, noise] = share
        else:
            least = min(least, share)
            invented = record["phantoms"] - record["unavoidable"]
            assert invented <= 0, f"{record['decoder']} invents {invented} frames of {record['stream']}"
    assert least == 100, f"a decoder of axlewire delivers {least} %: nothing to be proud of"
    wanted = {(traffic, noise) for traffic, *_ in TRAFFICS for noise, *_ in NOISES}
    assert shares.keys() == wanted, "the input is not the standard set of axle noise"
    picture = "\n".join(drawn(shares)) + "\n"
    if sys.argv[1:] == ["--check"]:
        delivered, intact = counts.pop("plain")
        claim = (
            f"100 % of {intact:,} intact frames in {len(counts)} ways to decode, no phantom; a plain receiver "
            f"{100 * delivered / intact:.1f} %, at its worst, among false headers, {min(shares.values()):.1f} %"
        )
        assert min(shares, key=shares.get)[1] == "headers", "the worst is another noise"
        assert f" | {claim} |\n" in TESTING.read_text(), f"TESTING.md does not say: {claim}"
        sys.exit(None if PICTURE.read_text() == picture else f"{PICTURE} is out of date")
    PICTURE.write_text(picture)


def drawn(shares):
    """A group of bars for each noise: what the plain receiver delivers, and a line at 100 %."""
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="sans-serif" font-size="12" fill="#222">'
    )
    yield f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>'
    yield text(LEFT, 26, "Intact frames delivered on a noisy line", weight="bold")

    def height_of(share):
        return BOTTOM - (BOTTOM - TOP) * share / 100

    for share in range(0, 101, 20):
        y = height_of(share)
        yield f'<line x1="{LEFT}" y1="{y:.1f}" x2="{RIGHT}" y2="{y:.1f}" stroke="#ddd"/>'
        yield text(LEFT - 8, y + 4, f"{share} %", "end")
    group = (RIGHT - LEFT) / len(NOISES)
    bar = group / (len(TRAFFICS) + 1)
    for i, (noise, title, rate) in enumerate(NOISES):
        start = LEFT + i * group + bar / 2
        for j, (traffic, _, colour) in enumerate(TRAFFICS):
            y = height_of(shares[traffic, noise])
            yield (
                f'<rect x="{start + j * bar:.1f}" y="{y:.1f}" width="{bar - 2:.1f}" '
                f'height="{BOTTOM - y:.1f}" fill="{colour}"/>'
            )
        lowest = min(shares[traffic, noise] for traffic, *_ in TRAFFICS)
        # Never rounded up to 100.
        lowest = "100" if lowest == 100 else f"{int(10 * lowest) / 10:.1f}"
        for row, words in enumerate([title, rate, f"{lowest} %"]):
            weight = "bold" if row == 2 else "normal"
            yield text(start + bar * len(TRAFFICS) / 2, BOTTOM + 18 + 16 * row, words, "middle", weight)
    # Last, so that it lies on the bars.
    yield f'<line x1="{LEFT}" y1="{TOP}" x2="{RIGHT}" y2="{TOP}" stroke="{OURS}" stroke-width="4"/>'
    yield text(RIGHT, TOP - 10, "axlewire, in all its ways to decode: 100 %", "end", "bold", OURS)
    y = BOTTOM + 78
    yield text(LEFT, y, "Bars: a plain receiver, which drops a bad frame whole. In bold: the lowest of the five.")
    for j, (_, title, colour) in enumerate(TRAFFICS):
        x = LEFT + j * 160
        yield f'<rect x="{x}" y="{y + 12}" width="11" height="11" fill="{colour}"/>'
        yield text(x + 17, y + 22, title)
    yield "</svg>"


def text(x, y, words, anchor="start", weight="normal", colour="#222"):
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-weight="{weight}" '
        f'fill="{colour}">{escape(words)}</text>'
    )


if __name__ == "__main__":
    main()
