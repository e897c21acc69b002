#!/usr/bin/env python3
"""Writes the recorded figures into the tables of the documents: benches/tables.py

A table is between `<!-- figures:NAME -->` and `<!-- end -->`. Its rows keep their order and their
words; cells that are `None` here are left as they are. Fails if a table had other figures, or if a
recorded figure is beyond its goal.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = ["BENCHMARKS.md", "examples/firmware/README.md", "src/guide/start_on_a_board.md"]
STREAMS = ["ikeya8", "ikeya_mixed", "ucp44"]


def record(path):
    """Value and goal of each figure; no goal is an empty string."""
    rows = [line.split() for line in (ROOT / path).read_text().splitlines() if not line.startswith("#")]
    values = {name: value for name, value, *_ in rows}
    goals = {row[0]: row[2].replace("-", "").replace("<=", "at most ") if len(row) > 2 else "" for row in rows}
    assert len(values) == len(rows), f"{path}: a name twice"
    return values, goals


def rounded(value, digits=2):
    return f"{float(value):.{digits}f}"


def tables():
    """The cells of each table, by its name."""
    ratios, goals = record("benches/ratios.txt")
    printing, printing_goals = record("benches/printing.txt")
    tool, tool_goals = record("benches/tool.txt")
    counts, _ = record("benches/instructions.txt")
    m4, m4_goals = record("examples/firmware/figures.txt")
    costs, _ = record("examples/firmware/costs.txt")

    # Those with goals, up to the first that is a component.
    names = list(ratios)[: list(ratios).index("mb_per_s_ikeya8_c")]
    yield "ratios", [[f"`{n}`", None, ratios[n], goals[n]] for n in names]
    decoders = ["c", "frames", "each", "decoder4096", "decoder1"]
    yield "throughput", [[None, *(ratios[f"mb_per_s_{s}_{by}"] for by in decoders)] for s in STREAMS]
    crates = ["c_two_tables", "crc_table1", "crc_table16", "crc16", "crcxx_lut256x8", "rscrypto"]
    yield "crc", [[None, *(rounded(ratios[f"crc{n}_over_{name}"]) for n in (6, 42))] for name in crates] + [
        [None, ratios["ns_crc6"], ratios["ns_crc42"]]]
    hostile = [n for n in ratios if re.fullmatch("hostile_(ikeya|ucp)_.*_over_c", n)]
    yield "hostile", [[None, rounded(ratios[n])] for n in hostile]
    # 500 kbit/s are 0.05 MB/s.
    caps = [ratios[f"mb_per_s_candidates_of_{cap}"] for cap in (28, 44, 64, 128, 256)]
    yield "caps", [[None, mb, str(int(mb) * 20)] for mb in caps]
    damaged = [f"{s}_{rate}" for s in STREAMS for rate in ("1e-5", "1e-4", "1e-3")]
    yield "errors", [
        [None, None, *(f"{ratios[f'recovered_{d}_{by}_percent']} %" for by in ("axlewire", "c")),
         rounded(ratios[f"speed_{d}_over_clean"])] for d in damaged]

    printed = [name.removeprefix("text_over_json_") for name in printing if name.startswith("text_over")]
    us = lambda name: rounded(float(printing[name]) / 1000)
    yield "printing", [
        [f"`text_over_json_{s}`", None, rounded(printing[f"text_over_json_{s}"]), us(f"ns_per_frame_text_{s}"),
         us(f"ns_per_frame_json_{s}"), printing_goals[f"text_over_json_{s}"]] for s in printed]
    of_ucp = [name.removesuffix("_ucp") for name in tool if name.endswith("_ucp")]
    yield "tool", [
        [f"`{n}`", *(value for p in ("ucp", "ikeya") for value in [tool[f"{n}_{p}"]]),
         " and ".join(dict.fromkeys(tool_goals[f"{n}_{p}"] for p in ("ucp", "ikeya")))] for n in of_ucp]

    kinds = [name for name in counts if not name.startswith("c_")]
    of_c = [re.sub(r"_(frames|each|decoder\d+)$", "", kind) for kind in kinds]
    yield "instructions", [[None, counts[kind], counts[f"c_{c}"]] for kind, c in zip(kinds, of_c)]
    cells = ["ikeya8_slice", "ikeya8_slice_alone", "ucp44_slice", "ucp44_slice_alone", "ikeya8_bytes",
             "ucp44_bytes", "push", "crc_42", "check_44", "read_to_answer"]
    yield "m4", [[None, m4[n], m4_goals[n]] for n in cells]
    parts = ["crc", "ikeya8_slice", "ucp44_slice", "both_slices", "master", "slave", "host", "robot"]
    yield "m4-memory", [
        [None, m4[f"flash_{p}"], m4_goals[f"flash_{p}"], m4.get(f"constants_{p.removesuffix('_slices')}_opt3", ""),
         m4.get(f"ram_{p}", "")] for p in parts]
    yield "roles", [
        [None, m4.get(f"ram_{p}", m4.get(f"ram_{p}_decoder")), m4.get(f"flash_{p}", "")]
        for p in ("ikeya", "ucp", "slave", "robot", "master", "host")]
    yield "programs", [
        [f"`{p}`", *(costs[f"{what}_{p}"] for what in ("flash", "ram", "stack")), response(costs, p)]
        for p in ("ikeya_slave", "ikeya_master", "ucp_robot", "bench")]


def response(costs, program):
    """With the microseconds at 168 MHz and 1.5 cycles per instruction."""
    count = costs.get(f"response_{program}")
    return f"{count} instructions, {int(count) * 1.5 / 168:.1f} µs" if count else "-"


def filled(table, rows):
    """The lines of a table with these cells."""
    head, rule, *old = table.strip().splitlines()
    assert len(old) == len(rows), f"{len(old)} rows, not {len(rows)}: {head}"
    lines = [head, rule]
    for line, row in zip(old, rows):
        cells = [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
        assert len(cells) == len(row), f"{len(cells)} cells, not {len(row)}: {line}"
        lines.append("".join(f"| {old if new is None else new} " for old, new in zip(cells, row)) + "|")
    return "\n".join(lines).replace("|  |", "| |").replace("|  |", "| |")


def beyond_their_goals():
    """Ratios are at least their goal, unless it begins with `<=`; costs on a Cortex-M4 are at most."""
    found = []
    for path in ("benches/ratios.txt", "benches/printing.txt", "benches/tool.txt", "examples/firmware/figures.txt"):
        values, goals = record(path)
        for name, goal in goals.items():
            value, limit = float(values[name]), float(goal.split()[-1]) if goal else None
            is_cost = "at most" in goal or "firmware" in path
            if goal and (value > limit if is_cost else value < limit):
                found.append(f"{path}: {name} is {value}, its goal {goal}")
    print(*found, sep="\n", end="\n" * bool(found))
    return found


def main():
    figures, used, faults = dict(tables()), [], beyond_their_goals()
    for name in DOCUMENTS:
        text = (ROOT / name).read_text()

        def replaced(found):
            used.append(found[1])
            return f"<!-- figures:{found[1]} -->\n{filled(found[2], figures[found[1]])}\n<!-- end -->"

        new = re.sub(r"<!-- figures:([\w-]+) -->\n(.*?)<!-- end -->", replaced, text, flags=re.DOTALL)
        if new != text:
            (ROOT / name).write_text(new)
            print(f"{name} had other figures than the records, and has them now")
            faults.append(name)
    assert sorted(used) == sorted(figures), f"not one table each: {set(used) ^ set(figures)}"
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
