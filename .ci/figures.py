#!/usr/bin/env python3
"""Compares the figures in the documents with the recorded ones, and those with their goals.

    .ci/figures.py --check      exit status 1 if one differs; measures nothing
    .ci/figures.py --planted    plants wrong figures in copies, and checks that each is found

The records are written by the commands that measure: `benches/ratios.txt`, `printing.txt`,
`tool.txt` and `instructions.txt`; `examples/firmware/figures.txt` and `costs.txt`. Each table below
gives the cells that a row of a document must have; `None` is a cell of prose.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NAMES = {
    "ratios": "benches/ratios.txt", "printing": "benches/printing.txt", "tool": "benches/tool.txt",
    "export": "benches/export.txt",
    "counts": "benches/instructions.txt", "m4": "examples/firmware/figures.txt",
    "costs": "examples/firmware/costs.txt",
}
DOCUMENTS = ["README.md", "BENCHMARKS.md", "examples/firmware/README.md", "src/porting.md"]
STREAMS = ["ikeya8", "ikeya_mixed", "ucp44"]
# Fewer comparisons mean that the script did not read what it should.
LEAST = 150


class Record(dict):
    """Values by name, and `goals`. A figure that is missing is a fault of its own."""

    def __init__(self, text):
        super().__init__()
        self.goals, self.faults = {}, []
        self.compiler = (re.match(r"# rustc (\d+\.\d+)", text) or [None, "unknown"])[1]
        for line in text.splitlines():
            if line.startswith("#"):
                continue
            name, value, goal = [*line.split(), "-"][:3]
            if name in self or not re.fullmatch(r"\d+(\.\d+)?", value):
                self.faults.append(f"no figure, or twice: {line}")
                continue
            self[name], self.goals[name] = value, goal

    def number(self, name):
        return float(self[name])


def main(options):
    if options not in (["--check"], ["--planted"]):
        print(__doc__)
        return 2
    files = {name: (ROOT / name).read_text() for name in [*NAMES.values(), *DOCUMENTS]}
    if options == ["--planted"]:
        return planted(files)
    count, faults = compare(files)
    print(*faults, f"{count} figures compared, {len(faults)} faults", sep="\n")
    return bool(faults) or count < LEAST


def compare(files):
    """Number of comparisons, and what is wrong."""
    records = {name: Record(files[path]) for name, path in NAMES.items()}
    faults = [f"{NAMES[name]}: {fault}" for name, record in records.items() for fault in record.faults]
    faults += [f"{NAMES[name]}: empty" for name, record in records.items() if not record]
    count = 0
    try:
        for check in (goals, consistency):
            for is_right, what in check(records):
                count += 1
                faults += [] if is_right else [what]
        for document, head, rows in tables(records):
            found = rows_below(files[document], head)
            if len(found) != len(rows):
                faults.append(f"{document}: {head}: {len(found)} rows, not {len(rows)}")
            for wanted, cells in zip(rows, found):
                count += sum(cell is not None for cell in wanted)
                if len(wanted) != len(cells) or any(w not in (None, c) for w, c in zip(wanted, cells)):
                    faults.append(f"{document}: {' | '.join(cells)}: recorded are {wanted}")
        for document, sentence in sentences(records):
            count += 1
            if sentence not in " ".join(files[document].split()):
                faults.append(f"{document}: does not say {sentence!r}")
    except KeyError as missing:
        faults.append(f"not recorded: {missing}")
    except ZeroDivisionError:
        faults.append("a part of a ratio is 0")
    except ValueError as error:
        faults.append(f"not a whole number: {error}")
    return count, faults


def goals(records):
    """Recorded figures keep their goals; more is better on a host, less on the board."""
    for name, record in records.items():
        for figure, goal in record.goals.items():
            if goal != "-":
                at_most = name in ("m4", "costs") or goal.startswith("<=")
                limit, value = float(goal.removeprefix("<=")), record.number(figure)
                kept = value <= limit if at_most else value >= limit
                yield kept, f"{NAMES[name]}: {figure} is {value:g}, and its goal {goal}"
            zero = name == "m4" and figure.startswith("constants_")
            yield zero or record.number(figure) > 0, f"{NAMES[name]}: {figure} measures nothing"


def consistency(records):
    """A ratio is that of its parts, where these are recorded: none is upside down."""
    ratios, printing = records["ratios"], records["printing"]

    def near(name, value, record=ratios, slack=0.01):
        return abs(record.number(name) / value - 1) < slack, f"{name} is {record[name]}, its parts give {value:.3f}"

    def mb(stream, decoder):
        return ratios.number(f"mb_per_s_{stream}_{decoder}")

    for stream in STREAMS:
        over = "_frames_over_c" if stream != "ikeya_mixed" else "_over_c"
        yield near(stream + over, mb(stream, "frames") / mb(stream, "c"))
        yield near(stream + over + "_simd", mb(stream, "each_simd") / mb(stream, "c"))
        yield near(stream + "_each_over_c", mb(stream, "each") / mb(stream, "c"))
    for stream in ("ikeya8", "ucp44"):
        yield near(f"{stream}_decoder4096_over_frames", mb(stream, "decoder4096") / mb(stream, "frames"))
        yield near(f"{stream}_decoder1_over_c", mb(stream, "decoder1") / mb(stream, "c"))
    for length in ("6", "42"):
        crates = [f"crc{length}_over_{name}" for name in CRATES.values() if not name.startswith("c_")]
        yield near(f"crc{length}_over_best_crate", min(map(ratios.number, crates)))
    yield near("crc42_over_c_table", ratios.number("crc42_over_c_two_tables"))
    for end in ("", "_simd"):
        for protocol in ("ikeya", "ucp"):
            yield near(f"noise_{protocol}_over_c{end}", ratios.number(f"hostile_{protocol}_noise_over_c{end}"))
        worst = [name for name in ratios if re.fullmatch(rf"hostile_(ikeya|ucp)_.*_over_c{end}", name)]
        worst = [name for name in worst if "noise" not in name and "3c_00" not in name]
        yield near(f"hostile_worst_over_c{end}", min(map(ratios.number, worst)))
    for stream in PRINTED:
        parts = printing.number(f"mb_per_s_text_{stream}") / printing.number(f"mb_per_s_json_{stream}")
        yield near(f"text_over_json_{stream}", parts, printing, 0.03)
        parts = printing.number(f"ns_per_frame_json_{stream}") / printing.number(f"ns_per_frame_text_{stream}")
        yield near(f"text_over_json_{stream}", parts, printing, 0.03)


PRINTED = ["ikeya8", "ikeya_mixed", "ikeya_mixed_1e-3", "ucp44", "ucp44_1e-3"]
CRATES = {
    "C, two tables": "c_two_tables", "`crc` 3, `Table<1>`": "crc_table1", "`crc` 3, `Table<16>`": "crc_table16",
    "`crc16` 0.4": "crc16", "`crcxx` 0.3, 8 tables": "crcxx_lut256x8", "`rscrypto` 0.9, SIMD": "rscrypto",
}
TITLES = ["Ikeya responses", "Ikeya, both directions", "UCP reports"]


def fixed(value, digits=2):
    return f"{float(value):.{digits}f}"


def tables(records):
    """Document, first line of a table, and the cells of its rows."""
    ratios, counts, m4, costs = (records[name] for name in ("ratios", "counts", "m4", "costs"))
    printing, tool = records["printing"], records["tool"]
    doc = "BENCHMARKS.md"
    # Those with goals, up to the first that is a component.
    names = list(ratios)[: list(ratios).index("ikeya8_each_over_c")]
    yield doc, "| figure | measured |", [[f"`{n}`", None, ratios[n], ratios.goals[n]] for n in names]
    decoders = ["c", "frames", "each", "each_simd", "decoder4096", "decoder1"]
    yield doc, "| stream, MB/s |", [
        [title, *(ratios[f"mb_per_s_{stream}_{by}"] for by in decoders)] for title, stream in zip(TITLES, STREAMS)]
    yield doc, "| figure | stream |", [
        [f"`text_over_json_{n}`", None, fixed(printing[f"text_over_json_{n}"]), "1"] for n in PRINTED]
    shown = ["tool_text_over_json", *(f"tool_jobs2_over_jobs1_{s}" for s in ("text", "json", "summary")),
             "tool_two_processes_over_one_json", "tool_summary_gb_per_s", "tool_peak_memory_mb"]
    yield doc, "| figure | UCP |", [
        [f"`{n}`", *(fixed(tool[f"{n}_{p}"], 1 if "memory" in n else 2) for p in ("ucp", "ikeya")), None] for n in shown]
    export = records["export"]
    yield doc, "| export | UCP |", [
        [f"`{n}`", *(export[f"{n}_{p}"] for p in ("ucp", "ikeya")), goals]
        for n, goals in [("export_parquet_mb_per_s", "150 and 60"), ("export_parquet_peak_memory_mb", "")]]
    yield doc, "| | 6 bytes |", [
        [title, *(fixed(ratios[f"crc{n}_over_{name}"]) for n in (6, 42))] for title, name in CRATES.items()]
    hostile = [n for n in ratios if n.startswith("hostile_") and n.endswith("_over_c") and "worst" not in n]
    yield doc, "| stream | `Frames` over C |", [[title_of(n), fixed(ratios[n]), fixed(ratios[n + "_simd"])] for n in hostile]
    caps = [28, 44, 64, 128, 256]
    mb = [ratios[f"mb_per_s_candidates_of_{cap}"] for cap in caps]
    # 500 kbit/s are 0.05 MB/s.
    yield doc, "| longest frame, bytes |", [
        [f"{cap}{', the default' * (cap == 64)}", speed, f"{int(speed) * 20}"] for cap, speed in zip(caps, mb)]
    yield doc, "| stream | bit-error rate |", [
        [title, rate, *(f"{ratios[f'recovered_{stream}_{rate}_{by}_percent']} %" for by in ("axlewire", "c")),
         *(fixed(ratios[f"speed_{stream}_{rate}_over_clean{end}"]) for end in ("", "_simd"))]
        for title, stream in zip(TITLES, STREAMS) for rate in ("1e-5", "1e-4", "1e-3")]
    kinds = ["ikeya8_frames", "ikeya8_each", "ikeya_mixed_frames", "ikeya_mixed_each_simd", "ucp44_frames",
             "ikeya8_decoder4096", "ucp44_decoder4096", "ikeya8_decoder1", "ucp44_decoder1", "crc6", "crc42"]
    of_c = [re.sub(r"_(frames|each|each_simd|decoder\d+)$", "", kind) for kind in kinds]
    yield doc, "| | axlewire | C, two tables |", [
        [None, counts[kind], counts[f"c_{c}"]] for kind, c in zip(kinds, of_c)]
    cells = ["ikeya8_slice", "ucp44_slice", "ikeya8_bytes", "ucp44_bytes", "crc_42"]
    yield doc, "| | instructions | goal |", [
        *([None, m4[n], m4.goals[n]] for n in cells), [None, m4["read_to_answer"], None]]
    goal = lambda n: m4.goals[n].replace("-", "")
    slices = ["flash_crc", "flash_ikeya8_slice", "flash_ucp44_slice", "flash_both_slices"]
    roles = ["master", "slave", "host", "robot"]
    yield doc, "| | flash, bytes |", [
        *([None, m4[n], goal(n), ""] for n in slices),
        *([None, m4[f"flash_{r}"], goal(f"flash_{r}"), m4[f"ram_{r}"]] for r in roles)]
    programs = ["ikeya_slave", "ikeya_master", "ucp_robot", "bench"]
    yield "examples/firmware/README.md", "| program | flash |", [
        [f"`{p}`", *(costs[f"{what}_{p}"] for what in ("flash", "ram", "stack")), response(costs, p)] for p in programs]
    kb = lambda n: f"{m4.number(n) / 1000:.1f} KB" if m4.number(n) > 900 else f"{m4[n]} bytes"
    yield "src/porting.md", "| decoders | `Slave` |", [
        [f"{m4['ram_ikeya_decoder']} and {m4['ram_ucp_decoder']} bytes",
         *(kb(f"ram_{r}") for r in ("slave", "robot", "master", "host"))]]


def title_of(hostile):
    """The stream of a figure: its protocol, words, and bytes in capitals."""
    protocol, *words = hostile.removeprefix("hostile_").removesuffix("_over_c").split("_")
    words = [word.upper() if re.fullmatch("[0-9a-f]{2}", word) else word for word in words]
    return " ".join([{"ikeya": "Ikeya", "ucp": "UCP"}[protocol], *words])


def response(costs, program):
    """With the microseconds at 168 MHz and 1.5 cycles per instruction."""
    count = costs.get(f"response_{program}")
    return f"{count} instructions, {int(count) * 1.5 / 168:.1f} µs" if count else "-"


def sentences(records):
    """Document, and a sentence of it with its figures."""
    ratios, m4, printing, tool = (records[name] for name in ("ratios", "m4", "printing", "tool"))
    doc = "BENCHMARKS.md"
    good = [f"{s}{'_frames' * (s != 'ikeya_mixed')}_over_c{end}" for s in STREAMS for end in ("", "_simd")]
    good = sorted(map(ratios.number, good))
    yield "README.md", f"{good[0]:.0f} to {good[-1]:.0f} times as fast as the usual C receiver on good frames"
    yield "README.md", f"a slave needs {m4['read_to_answer']} instructions from the last byte of a READ to its answer"
    yield doc, f"axlewire takes {ratios['ns_crc6']} ns for 6 bytes and {ratios['ns_crc42']} ns for 42"
    # The share of its goal that each figure has to spare.
    spare = sorted((ratios.number(n) / float(g), n) for n, g in ratios.goals.items() if g != "-" and "recovered" not in n)
    first, second = [name for _, name in spare[:2]]
    yield doc, (f"Closest to their goals are `{first}`, {fixed(ratios[first])} for "
                f"{ratios.goals[first]}, and `{second}`, {fixed(ratios[second])} for {ratios.goals[second]}")
    us = lambda n: f"{printing.number(n) / 1000:.2f} µs"
    yield doc, (f"A frame of the bus takes about {us('ns_per_frame_text_ikeya_mixed')} as text and "
                f"{us('ns_per_frame_json_ikeya_mixed')} as JSON, a report {us('ns_per_frame_text_ucp44')} and "
                f"{us('ns_per_frame_json_ucp44')}")
    mb = lambda style, protocol: f"{tool.number(f'tool_{style}_mb_per_s_{protocol}'):.0f}"
    yield doc, (f"text has {mb('text', 'ucp')} and {mb('text', 'ikeya')} MB/s of capture, "
                f"JSON {mb('json', 'ucp')} and {mb('json', 'ikeya')} MB/s")
    yield doc, (f"a call with a slice of one frame costs {m4['ikeya8_slice_alone']} and "
                f"{m4['ucp44_slice_alone']} instructions")
    pushes = int(m4["push"]) * 44
    yield doc, f"Of the {m4['ucp44_bytes']} instructions for a report, the 44 pushes take {pushes}"
    yield doc, f"A byte that completes nothing costs {m4['push']} more"
    yield doc, f"A CRC check of 44 bytes alone costs {m4['check_44']}"
    none = [m4[f"constants_{n}_opt3"] for n in ("crc", "both", "slave", "robot")]
    have = "no constants in flash" if none == ["0"] * 4 else f"constants of {none}"
    yield doc, f"the CRC, the slice decoders, the slave and the robot have {have}"
    yield doc, f"the master has {m4['constants_master_opt3']} bytes, the host {m4['constants_host_opt3']}"
    yield doc, f"fat LTO, rustc {m4.compiler}"
    answer = m4.number("read_to_answer") * 1.5
    yield "src/porting.md", f"The crate needs {m4['read_to_answer']} instructions on a Cortex-M4"
    yield "src/porting.md", f"that is {answer / 168:.0f} µs at 168 MHz. At 16 MHz it is {answer / 16:.0f} µs"
    sizes = sorted(m4.number(f"flash_{role}") / 1000 for role in ("master", "slave", "host", "robot"))
    yield "src/porting.md", f"Each role takes {sizes[0]:.1f} to {sizes[-1]:.1f} KB of flash"


def rows_below(text, head):
    """Cells of the rows of the table whose first line begins so."""
    lines = text.splitlines()
    starts = [at for at, line in enumerate(lines) if line.startswith(head)]
    rows = []
    for line in lines[starts[0] + 2 :] if len(starts) == 1 else []:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip().strip("|").split("|")])
    return rows


def planted(files):
    """Changes every figure of a compared place, and every goal, one at a time."""
    faults = compare(files)[1]
    missed = ["a fault without a plant: " + fault for fault in faults]
    plants = 0

    def plant(name, text, what):
        nonlocal plants
        plants += 1
        if not compare({**files, name: text})[1]:
            missed.append(f"{name}: {what}")

    records = {name: Record(files[path]) for name, path in NAMES.items()}
    for document, head, rows in tables(records):
        for row, wanted in zip(rows_below(files[document], head), rows):
            for at, cell in enumerate(wanted):
                if cell is None or not any(map(str.isdigit, cell)):
                    continue
                line = next(l for l in files[document].splitlines()
                            if [c.strip() for c in l.strip().strip("|").split("|")] == row)
                cells = line.split("|")
                digit = re.search(r"\d", cells[at + 1])
                cells[at + 1] = cells[at + 1][: digit.start()] + str((int(digit[0]) + 1) % 10) + cells[at + 1][digit.end() :]
                plant(document, files[document].replace(line, "|".join(cells)), "|".join(cells))
    for name, path in NAMES.items():
        for figure, goal in records[name].goals.items():
            line = re.search(rf"^{re.escape(figure)} .*$", files[path], re.MULTILINE)[0]
            if goal != "-":
                at_most = name in ("m4", "costs") or goal.startswith("<=")
                value = float(goal.removeprefix("<=")) * (1.1 if at_most else 0.9)
                plant(path, files[path].replace(line, f"{figure} {value:g} {goal}"), f"{figure} beyond its goal")
            if not (name == "m4" and figure.startswith("constants_")):
                plant(path, files[path].replace(line, f"{figure} 0 {goal}"), f"{figure} is 0")
        plant(path, "", "empty")
    for upside_down in ["ikeya_mixed_over_c", "ucp44_decoder1_over_c", "noise_ucp_over_c", "crc42_over_rscrypto"]:
        line = re.search(rf"^{upside_down} (\S+)", files[NAMES["ratios"]], re.MULTILINE)
        turned = f"{upside_down} {1 / float(line[1]):.3f}"
        plant(NAMES["ratios"], files[NAMES["ratios"]].replace(line[0], turned), turned)
    for document, sentence in sentences(records):
        digits = [*re.finditer(r"\d+", sentence)]
        last = digits[-1] if digits else re.search("no ", sentence)
        other = str(int(last[0]) + 1) if digits else "two "
        wrong = sentence[: last.start()] + other + sentence[last.end() :]
        # As it is broken into lines.
        there = re.compile(r"\s+".join(map(re.escape, sentence.split())))
        plant(document, there.sub(lambda _: wrong, files[document]), wrong)
    print(*missed, f"{plants} planted, {len(missed)} missed", sep="\n")
    return bool(missed) or plants < LEAST


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
