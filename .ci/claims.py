#!/usr/bin/env python3
"""Compares TESTING.md, and what other pages say of the episodes, with what was recorded.

    .ci/claims.py --check      every command exists, and every figure is that of its record
    .ci/claims.py --planted    plants wrong figures and commands, and checks that each is found

A row with a record has exactly the command that is named here. A row without one has no figure, but
those in SAID. `benches/noise.py` checks the figures of the noise.
"""

import functools
import os
import re
import subprocess
import sys
from pathlib import Path

import gate

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "tests"))
import mutants  # noqa: E402

STEPS = gate.steps()
# A row of the table of motors that stop.
MOTOR = re.compile(r"^\| (?:bus|rover)\b.*\| [\d.]+ \|$", re.MULTILINE)
FIGURE = re.compile(r"(?<![\w.,^/-])\d[\d,]*(?:\.\d+)?(?![\w^-])")

PROOFS, HOURS, COVERAGE = "tests/exhaustive.txt", "tests/soak.txt", "tests/coverage.txt"
NOISE = "`cargo run --release -p axle -- noise`"
# Of each row with a record: its commands, the record, what to look for in it, and the cell.
CELLS = [
    ("`bash tests/exhaustive.sh reads`", PROOFS, r"^(?!judge, .*none).*: (8) of 2\^32$", "the {0} legal READs, by each of {count} ways in"),
    ("`bash tests/exhaustive.sh errors`", PROOFS, r"^(\d+) damaged frames of 4 to 64 bytes, none accepted", "0 of {0} accepted"),
    ("`bash tests/exhaustive.sh lengths`", PROOFS,
     r"(?s)^READ to WRITE\D+(\d+) +(\d+) .*?^all +(\d+) +(\d+)",
     "UCP: {3} of {2} pass; READ and half a WRITE: {1} of {0}"),
    ("`bash tests/exhaustive.sh chance`", PROOFS, r"expected 4096 ± 64.0: [+-](\d\.\d+) sigma$",
     "2^-16, {count} kinds of frame, at most {most:.1f} sigma off"),
    ("`bash tests/exhaustive.sh checksum`", PROOFS, r"^(\d+) messages of 0 to 300 bytes", "{0} messages equal"),
    ("`cargo test --release --test campaign -- --ignored --nocapture`", "tests/campaign.txt", r"^([\d,]+) episodes", "{0}; no motor beyond its bound"),
    ("`tests/mends.py`", "tests/mends.txt", r"^(\w+) [0-9a-f]{8}: \w+: ", "{count} of {count} found by a test ([tests/mends.txt](tests/mends.txt))"),
    ("`fuzz/campaign all --minutes 4 --until 30`", "fuzz/campaign.txt", r"^# (CPU minutes)", "[fuzz/campaign.txt](fuzz/campaign.txt)"),
    ("`fuzz/campaign --coverage`", "fuzz/coverage.txt", r"^all +(\d+) +(\d+) ",
     "{1} of {0} ([fuzz/coverage.txt](fuzz/coverage.txt))"),
    ("`tests/mutants.py --woven`, `tests/mutants.py --table`", "tests/mutants.txt",
     r"^# (\d+) files: (\d+) caught of (\d+) that compile(; \d+ are not tried)?\.$",
     "{1} of {2} viable ones in {0} files caught, the others explained ([tests/mutants.txt](tests/mutants.txt)){3}{not_tried}"),
    ("`.ci/coverage`", COVERAGE, r"(?s)^axle, all +([\d.]+) +([\d.]+)$.*^library, all +([\d.]+) +([\d.]+)$",
     "library {2} % of lines, {3} % of branches; tool {0} and {1} ([tests/coverage.txt](tests/coverage.txt))"),
    ("`.ci/prove`", ".ci/prove.txt", r"^(\w+) [0-9a-f]{8} [0-9a-f]{8}: ", "all {count} seen to fail ([.ci/prove.txt](.ci/prove.txt))"),
    ("`cargo test --release --test soak -- --ignored --nocapture`", HOURS, r"In all ([\d,]+) READ and ([\d,]+) reports",
     "{0} READ, {1} reports; no invariant broken ([tests/soak.txt](tests/soak.txt))"),
    ("`AXLE_HOUR_MINUTES=60 cargo test --release -p axle --test hour -- --ignored --nocapture`", HOURS,
     r"500 kbit/s: ([\d,]+) answers", "{0} answers; no leak, the beat of 20 ms moved by less than 1 us"),
    ("`examples/firmware/soak.sh 12`", HOURS, r"^  ([\d,]+) exchanges in 12 minutes", "{0} exchanges, none lost"),
]
WITH_RECORD = [NOISE, *(commands for commands, *_ in CELLS)]
# What claims and evidence may say with figures, and rows without a record: sizes, no results.
SAID = [
    "all 2^32 strings of 4 bytes", "all 2^32 payloads", "every error of 1, 2 and 3 bits",
    "every burst up to 16 bits, 4 to 64 bytes", "AA to BB (2 bits)", "UCP's `len` (1 bit)", "to 300 bytes",
    "the pace of 500 kbit/s", "(MPL-2.0, on a PC only)",
]
# Rows and anchors of TESTING.md: change these only if you mean to take one out, or add one.
ROWS, ANCHORS = 37, 7
LINK = re.compile(r"\(TESTING\.md#([\w-]+)\)")
CAMPAIGN = ["tests/campaign.txt", "tests/campaign.rs", "tests/campaign/bus.rs", "tests/campaign/rover.rs"]
# Bytes of a READ, and of an answer and of a WRITE for one motor and for three.
READ_LEN, DATA_LENS = 4, (8, 16)
PAGES = ["TESTING.md", "src/safety.md", "README.md", "CONTRIBUTING.md"]
# The ignored tests of these programs are no part of what is claimed.
IGNORED_APART = {"models", "ports"}


def main(options):
    if options not in (["--check"], ["--planted"]):
        print(__doc__)
        return 2
    pages = {name: (ROOT / name).read_text() for name in PAGES}
    count, faults = compare(pages)
    if options == ["--planted"]:
        faults += planted(pages)
    print(*faults, f"{count} figures and commands compared, {len(faults)} faults", sep="\n")
    return bool(faults) or count < 45


def compare(pages):
    """Number of comparisons, and what is wrong."""
    testing, safety = pages["TESTING.md"], pages["src/safety.md"]
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")]
            for line in testing.splitlines() if line.startswith("| ")]
    faults = [f"TESTING.md: {len(row)} cells: {row[0]}" for row in rows if len(row) != 4]
    rows = [row for row in rows[1:] if len(row) == 4]
    anchors = re.findall(r'<a id="([\w-]+)"></a>', testing)
    if (len(rows), len(set(anchors))) != (ROWS, ANCHORS):
        faults.append(f"TESTING.md: {len(rows)} rows, {len(set(anchors))} anchors, not {ROWS} and {ANCHORS}")
    faults += [f"no anchor in TESTING.md: {to}" for text in pages.values() for to in LINK.findall(text) if to not in anchors]
    count = 0
    for page, sentence in sentences():
        count += 1
        if sentence not in " ".join(pages[page].split()):
            faults.append(f"{page}: does not say {sentence!r}")
    for row in rows:
        if not re.fullmatch(r"`[^`]+`(, `[^`]+`)*", row[2]):
            faults.append(f"TESTING.md: no command, or more than commands: {row[2]}")
        for command in re.findall(r"`([^`]+)`", row[2]):
            count += 1
            faults += [f"TESTING.md: {command}: {fault}" for fault in faults_of(command)]
        # The anchor of a claim is no text.
        cells = [re.sub(r"<a id=.*?</a>", "", row[0]), row[1]]
        if row[2] not in WITH_RECORD:
            cells += row[2:]
        faults += [f"TESTING.md: a figure of no record: {cell}" for cell in cells if re.search(r"\d", without_said(cell))]
    if sum(row[2] == NOISE for row in rows) != 1:
        faults.append(f"TESTING.md: not one row: {NOISE}")
    for commands, record, pattern, cell in CELLS:
        count += 1
        shown = [row[3] for row in rows if row[2] == commands]
        if fault := fault_of(shown, record, pattern, cell):
            faults.append(f"TESTING.md: {commands}: {fault}")
    shown, measured = (set(MOTOR.findall(text)) for text in (safety, (ROOT / "tests/campaign.txt").read_text()))
    count += len(shown | measured)
    faults += [f"not in both, src/safety.md and tests/campaign.txt: {line}" for line in sorted(shown ^ measured)]
    return count, faults + faults_of_modes()


@functools.cache
def sentences():
    """Page, and a sentence of it whose figures are on record, or those of what is run."""
    record, common, bus, rover = ((ROOT / name).read_text() for name in CAMPAIGN)
    episodes = re.search(r"^([\d,]+) episodes", record, re.MULTILINE)[1]
    noise = re.search(r"noise\(part\(rng\) \* 1e-(\d)\)", common)[1]
    slowed = re.search(r"loses (\d+) %.*\n.*from_millis\((\d+)\)", bus)
    wheels = re.search(r"constants of (\d+) ms", rover)[1]
    loose = [re.search(r"out_at \+ millis\(&mut rng, 0, (\d+)\)", text)[1] for text in (bus, rover)]
    baud = re.search(r"BAUD: u32 = (\w+);", (ROOT / "src/ikeya/units.rs").read_text())[1]
    # Ten bits for a byte.
    one, three = (1e4 * (READ_LEN + 2 * len_) / int(baud) for len_ in DATA_LENS)
    chance = f"{1 << 16:,}"
    return [
        ("README.md", f"In {episodes} simulated episodes with every fault at once no motor ran beyond its bound"),
        ("README.md", f"makes a frame with a correct CRC: one chance in {chance}."),
        ("CONTRIBUTING.md", f"{episodes} episodes of a stop in the middle of every fault"),
        ("src/safety.md", f"runs {episodes} episodes, half of them for each protocol"),
        ("src/safety.md", f"up to one wrong bit in {10 ** int(noise)}, lost"),
        ("src/safety.md", f"falls out for up to {loose[0]} ms (rover: {loose[1]} ms) around the stop"),
        ("src/safety.md", f"take {slowed[2]} ms (wheels: {wheels} ms) to lose {slowed[1]} % of their speed"),
        ("src/safety.md", f"plus some {one:.1f} ms later ({three:.1f} ms with three motors)"),
        ("src/safety.md", f"the time from the measurement to the WRITE, some {one:.1f} ms on a line of {int(baud) // 1000} kbit/s"),
        ("src/safety.md", f"16 bits of CRC: one damaged frame in {chance}"),
    ]


def without_said(cell):
    for words in SAID:
        cell = cell.replace(words, "")
    return cell


def fault_of(shown, record, pattern, cell):
    """Why the cells that are shown are not the one that the record makes."""
    if not (ROOT / record).is_file():
        return f"there is no {record}"
    found = [match.groups("") for match in re.finditer(pattern, (ROOT / record).read_text(), re.MULTILINE)]
    if not found or len(shown) != 1:
        return f"{len(shown)} rows, {len(found)} places in {record}"
    grouped = [f"{int(number.replace(',', '')):,}" if number.replace(",", "").isdigit() else number
               for number in found[0]]
    most = max((float(number) for number, *_ in found if re.fullmatch(r"[\d.]+", number)), default=0)
    count = len(found)
    expected = cell.format(*grouped, count={8: "eight"}.get(count, count), most=most, not_tried=not_tried())
    return None if shown[0] == expected else f"{shown[0]!r}, but {record} says {expected!r}"


@functools.cache
def not_tried():
    """How many files the record of the mutants does not have, such as new ones."""
    files = len(mutants.Record().not_tried())
    return f"; files not tried: {files}" * bool(files)


def faults_of(command):
    """What of a command does not exist."""
    words = command.split()
    # A variable is named in what the command runs.
    variables = [word for word in words if "=" in word]
    words = [word for word in words if "=" not in word]
    if words[:2] == ["bash", ".ci/run"]:
        return [f"no step {step}" for step in words[2:] if step not in STEPS]
    if words[0] == "cargo":
        return faults_of_cargo(words[1:], variables)
    script = words.pop(0)
    is_direct = script != "bash"
    if not is_direct:
        script = words.pop(0)
    if variables or not (ROOT / script).is_file():
        return [f"no file {script}, or a variable"]
    if is_direct and not os.access(ROOT / script, os.X_OK):
        return ["not executable"]
    if script == "tests/exhaustive.sh":
        return [f"no proof {word}" for word in words if word not in proofs()]
    text = (ROOT / script).read_text()
    # A number is one of a row with a record.
    return [f"{script} has no {word}" for word in words
            if not word.isdigit() and not re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", text)]


@functools.cache
def faults_of_modes():
    """The scripts that say how they are run directly, and cannot be."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
    scripts = [name for name in listed if (ROOT / name).is_file() and (ROOT / name).read_bytes()[:3] == b"#!/"]
    return [f"{name}: not executable, although it says how to run it" for name in scripts
            if not os.access(ROOT / name, os.X_OK)
            and re.search(rf"^#? +{re.escape(name)}( |$)", (ROOT / name).read_text(errors="replace"), re.MULTILINE)]


def proofs():
    """The words that name a proof: its modules."""
    return [path.stem for path in (ROOT / "tests/exhaustive").glob("*.rs") if "#[ignore" in path.read_text()]


def faults_of_cargo(words, variables):
    """What of a command of cargo does not exist."""
    at = words.index("--") if "--" in words else len(words)
    words, behind = words[:at], words[at + 1 :]
    if words[0] == "run":
        return [] if [*words[1:], *variables] == ["--release", "-p", "axle"] and behind == ["noise"] else ["no such run"]
    faults = [f"no cargo {words[0]}"] * (words[0] != "test")
    tests, package, rest = [], ROOT, iter(words[1:])
    for word in rest:
        if word == "--test":
            tests.append(next(rest, ""))
        elif word == "-p":
            name = next(rest, "")
            package = ROOT / "examples" / name
            if not (package / "Cargo.toml").is_file():
                faults.append(f"no package {name}")
        elif word != "--release":
            faults.append(f"no option {word}")
    text = ""
    for test in tests:
        sources = sources_of(package / "tests", test)
        if not sources:
            faults.append(f"no test {test}")
        text += sources
        if "#[ignore" in sources and test not in IGNORED_APART and "--ignored" not in behind:
            faults.append(f"{test} has tests that only --ignored runs")
    for word in behind:
        is_option = word in ("--ignored", "--nocapture")
        if not is_option and not re.search(rf"^ *(mod|fn) {re.escape(word)}\b", text, re.MULTILINE):
            faults.append(f"no test is called {word}")
    return faults + [f"no variable {word}" for word in variables if f'"{word.partition("=")[0]}"' not in text]


def sources_of(folder, test):
    """All sources of a program of tests."""
    files = [folder / f"{test}.rs", *sorted((folder / test).glob("*.rs"))]
    return "".join(path.read_text() for path in files if path.is_file()) if test else ""


def planted(pages):
    """Changes every figure and command, one at a time; the plants that are not found."""
    missed, plants = [], 0
    known = set(compare(pages)[1])
    testing, safety = pages["TESTING.md"], pages["src/safety.md"]

    def plant(page, text, what):
        nonlocal plants
        plants += 1
        if set(compare(pages | {page: text})[1]) <= known:
            missed.append(f"not found: {what}")

    def wrong(figure):
        return re.sub(r"\d(?=\D*$)", lambda last: str((int(last[0]) + 1) % 10), figure.group())

    lines = testing.splitlines()

    def plant_cell(at, number, cell):
        cells = lines[at].split("|")
        row = "|".join([*cells[:number], cell, *cells[number + 1 :]])
        plant("TESTING.md", "\n".join([*lines[:at], row, *lines[at + 1 :]]), f"{cell} for {cells[number]}")

    for at, line in enumerate(lines):
        cells = line.split("|")
        if not line.startswith("| ") or len(cells) != 6 or "claim" in cells[1]:
            continue
        has_record = cells[3].strip() in WITH_RECORD
        plant("TESTING.md", "\n".join([*lines[:at], *lines[at + 1 :]]), f"without {line}")
        for anchor in re.findall(r"<a id=.*?</a>", line):
            plant("TESTING.md", testing.replace(anchor, ""), f"without {anchor}")
        # The figures of the noise are compared by another script.
        if NOISE not in cells[3]:
            for figure in FIGURE.finditer(re.sub(r"\]\([^)]*\)", lambda link: "." * len(link.group()), cells[4])):
                plant_cell(at, 4, cells[4][: figure.start()] + wrong(figure) + cells[4][figure.end() :])
        # A figure where there is none.
        plant_cell(at, 2, f" 9 of{cells[2]}")
        if not has_record:
            plant_cell(at, 4, f" 0 to 9{cells[4]}")
        # Each word of each command: another one in its place; if there is a record, also none.
        for word in re.finditer(r"[^\s`,]+", cells[3]):
            before, after = cells[3][: word.start()], cells[3][word.end() :]
            if word.group() != "--":
                plant_cell(at, 3, f"{before}{word.group()}_x{after}")
            if has_record:
                plant_cell(at, 3, before + after)
        for figure in re.finditer(r"\d+", cells[3]):
            plant_cell(at, 3, f"{cells[3][: figure.start()]}1{cells[3][figure.end() :]}")
        if "exhaustive.sh" in cells[3]:
            plant_cell(at, 3, cells[3].rstrip("` ") + "_of_nothing` ")
    for line in MOTOR.findall(safety):
        for figure in FIGURE.finditer(line):
            wrong_line = line[: figure.start()] + wrong(figure) + line[figure.end() :]
            plant("src/safety.md", safety.replace(line, wrong_line), line)
    for page, sentence in sentences():
        # As it is broken into lines.
        there = re.search(r"\s+".join(map(re.escape, sentence.split())), pages[page])
        for figure in FIGURE.finditer(there[0] if there else ""):
            wrong_text = there[0][: figure.start()] + wrong(figure) + there[0][figure.end() :]
            plant(page, pages[page].replace(there[0], wrong_text), wrong_text)
    print(f"{plants} planted, {len(missed)} missed")
    return missed + ["too few plants"] * (plants < 200)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
