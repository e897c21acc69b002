#!/usr/bin/env python3
"""Draws examples/architecture.svg from the table "The floors" of src/lib.rs.

With `--check` it draws nothing, and fails if the picture is not the one that it would draw. With
`--planted` it checks that a changed table is noticed.

The text beside a floor is that of the table, and so are its modules:
a box for each, in the colour of its protocol or in grey.
"""

import re
import sys
from pathlib import Path
from textwrap import wrap
from xml.sax.saxutils import escape

HERE = Path(__file__).resolve().parent
TABLE = HERE.parent / "src/lib.rs"
PICTURE = HERE / "architecture.svg"

WIDTH, TEXT_LEFT, BOX_LEFT, BOX_WIDTH = 920, 650, 130, 490
FLOOR_HEIGHT, FLOOR_GAP, TOP = 58, 12, 84
COLOURS = {"ikeya": "#c9e4ee", "ucp": "#f3dcc3"}
BOTH, OUTSIDE, INK, PALE = "#e3e8ea", "#ffffff", "#17313c", "#5b6f78"
ABOVE = ["your firmware", "your program on a PC", "axle, the host tool"]
LEAST_FLOORS = 5


def floors(text):
    """Name, purpose and modules of each floor, top first."""
    table = text.split("//! # The floors")[1].split("//! #")[0]
    rows = re.findall(r"^//! \| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", table, re.M)
    # The protocols first, so that they are above each other.
    in_order = lambda where: sorted(re.findall(r"`([^`]+)`", where), key=lambda it: it not in COLOURS)
    rows = [(name, what.replace("`", ""), in_order(where)) for name, what, where in rows]
    rows = [row for row in rows if row[2]]
    if len(rows) < LEAST_FLOORS:
        sys.exit(f"{TABLE}: only {len(rows)} floors found")
    return rows


def box(left, top, width, text, fill, dashed=False):
    """A box with a line of text in its middle."""
    dashes = ' stroke-dasharray="5 4"' if dashed else ""
    return [
        f'<rect x="{left}" y="{top}" width="{width:.1f}" height="{FLOOR_HEIGHT - 14}" rx="6" '
        f'fill="{fill}" stroke="{PALE}"{dashes}/>',
        f'<text x="{left + width / 2:g}" y="{top + 27}" text-anchor="middle">{escape(text)}</text>',
    ]


def row_of_boxes(top, texts, fills, dashed=False):
    """Boxes of one width, side by side."""
    gap = 10
    width = (BOX_WIDTH - gap * (len(texts) - 1)) / len(texts)
    return [
        line
        for at, (text, fill) in enumerate(zip(texts, fills))
        for line in box(round(BOX_LEFT + at * (width + gap), 1), top, width, text, fill, dashed)
    ]


def merged(rows):
    """The floors with their texts; `drive` and `io`, which do not know each other, share one."""
    out = []
    for name, what, modules in rows:
        if name == "io" and out and out[-1][0] == ["drive"]:
            out[-1] = (["drive", "io"], [*out[-1][1], what], [*out[-1][2], *modules])
        else:
            out.append(([name], [what], modules))
    return out


def draw(text):
    """The picture, from the text of lib.rs."""
    lines = [
        f'<text x="{BOX_LEFT}" y="28" font-size="15" font-weight="bold">axlewire: bytes go up, '
        "commands come down</text>",
        *row_of_boxes(42, ABOVE, [OUTSIDE] * 3, dashed=True),
    ]
    top = TOP + FLOOR_GAP + 6
    for names, whats, modules in merged(floors(text)):
        fills = [COLOURS.get(module, BOTH) for module in modules]
        lines += row_of_boxes(top, modules, fills)
        lines.append(
            f'<text x="{BOX_LEFT - 14}" y="{top + 27}" text-anchor="end" fill="{PALE}">'
            f'{escape(" and ".join(names))}</text>'
        )
        told = [part for what in whats for part in wrap(what, 42)]
        first = top + 27 - 7 * (len(told) - 1)
        lines += [
            f'<text x="{TEXT_LEFT}" y="{first + 14 * at}" font-size="11" fill="{PALE}">'
            f"{escape(part)}</text>"
            for at, part in enumerate(told)
        ]
        top += FLOOR_HEIGHT - 14 + FLOOR_GAP
    lines += row_of_boxes(top + 4, ["the bytes of a UART, a USB adapter, a capture, or sim"], [OUTSIDE], True)
    height = top + FLOOR_HEIGHT + 8
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'font-family="sans-serif" font-size="13" fill="{INK}">',
        f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>',
        *lines,
        "</svg>",
    ]) + "\n"


def main():
    text = TABLE.read_text()
    if sys.argv[1:] == ["--planted"]:
        for old, new in [("//! | checksum |", "//! | sum |"), ("frames in and out of", "frames from"),
                         ("| [`crc16`] |", "| [`crc`] |")]:
            if old not in text or draw(text.replace(old, new)) == PICTURE.read_text():
                return f"not noticed: {old} as {new}"
        print("3 of 3 changes noticed")
        return None
    picture = draw(text)
    if sys.argv[1:] == ["--check"]:
        return None if PICTURE.read_text() == picture else f"{PICTURE} is out of date"
    PICTURE.write_text(picture)
    return None


if __name__ == "__main__":
    sys.exit(main())
