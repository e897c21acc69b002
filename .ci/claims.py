#!/usr/bin/env python3
"""Compares TESTING.md and the table of src/safety.md with what was recorded.

    .ci/claims.py --check      every command exists, and every figure is that of its record
    .ci/claims.py --planted    plants wrong figures and commands, and checks that each is found

`benches/noise.py` checks the figures of the noise.
"""

import re
import sys
from pathlib import Path

import gate

ROOT = Path(__file__).resolve().parent.parent
STEPS = gate.steps()
# A row of the table of motors that stop.
MOTOR = re.compile(r"^\| (?:bus|rover)\b.*\| [\d.]+ \|$", re.MULTILINE)
FIGURE = re.compile(r"(?<![\w.,^/-])\d[\d,]*(?:\.\d+)?(?![\w^-])")

PROOFS, HOURS, COVERAGE = "tests/exhaustive.txt", "tests/soak.txt", "tests/coverage.txt"
# Of each row with figures: a part of its command, the record, what to look for in it, and the cell.
CELLS = [
    ("exhaustive.sh reads", PROOFS, r"^(?!judge, .*none).*: (8) of 2\^32$", "the {0} legal READs, by each of {count} ways in"),
    ("exhaustive.sh errors", PROOFS, r"^(\d+) damaged frames of 4 to 64 bytes, none accepted", "0 of {0} accepted"),
    ("exhaustive.sh lengths", PROOFS, r"(?s)^READ to WRITE\D+(\d+) +(\d+) .*?^all +(\d+) +(\d+)",
     "UCP: {3} of {2} pass; READ and half a WRITE: {1} of {0}"),
    ("exhaustive.sh chance", PROOFS, r"expected 4096 ± 64.0: [+-](\d\.\d+) sigma$",
     "2^-16, {count} kinds of frame, at most {most:.1f} sigma off"),
    ("exhaustive.sh checksum", PROOFS, r"^(\d+) messages of 0 to 300 bytes", "{0} messages equal"),
    ("--test campaign", "tests/campaign.txt", r"^([\d,]+) episodes", "{0}; no motor beyond its bound"),
    ("tests/mends.py", "tests/mends.txt", r"^(\w+) [0-9a-f]{8}: \w+: ", "{count} of {count} found by a test ([tests/mends.txt](tests/mends.txt))"),
    ("fuzz/campaign --coverage", "fuzz/coverage.txt", r"^all +(\d+) +(\d+) ",
     "{1} of {0} ([fuzz/coverage.txt](fuzz/coverage.txt))"),
    ("tests/mutants.py", "tests/mutants.txt", r"^# (\d+) files: (\d+) caught of (\d+) that compile; (\d+) are not tried",
     "{1} of {2} viable ones in {0} files caught, the others explained ([tests/mutants.txt](tests/mutants.txt)); "
     "{3} are not tried, most of them constants{rest}"),
    ("`.ci/coverage`", COVERAGE, r"(?s)^axle, all +([\d.]+) +([\d.]+)$.*^library, all +([\d.]+) +([\d.]+)$",
     "library {2} % of lines, {3} % of branches; tool {0} and {1} ([tests/coverage.txt](tests/coverage.txt))"),
    ("`.ci/prove`", ".ci/prove.txt", r"^(\w+) [0-9a-f]{8}: ", "all {count} seen to fail ([.ci/prove.txt](.ci/prove.txt))"),
    ("--test soak", HOURS, r"In all ([\d,]+) READ and ([\d,]+) reports",
     "{0} READ, {1} reports; no invariant broken ([tests/soak.txt](tests/soak.txt))"),
    ("--test hour", HOURS, r"500 kbit/s: ([\d,]+) answers", "{0} answers; no leak, the beat of 20 ms moved by less than 1 us"),
    ("soak.sh", HOURS, r"^  ([\d,]+) exchanges in 12 minutes", "{0} exchanges, none lost"),
]


def main(options):
    if options not in (["--check"], ["--planted"]):
        print(__doc__)
        return 2
    testing, safety = ((ROOT / name).read_text() for name in ("TESTING.md", "src/safety.md"))
    count, faults = compare(testing, safety)
    if options == ["--planted"]:
        faults += planted(testing, safety)
    print(*faults, f"{count} figures and commands compared, {len(faults)} faults", sep="\n")
    return bool(faults) or count < 45


def compare(testing, safety):
    """Number of comparisons, and what is wrong."""
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")]
            for line in testing.splitlines() if line.startswith("| ")]
    faults = [f"TESTING.md: {len(row)} cells: {row[0]}" for row in rows if len(row) != 4]
    rows = [row for row in rows[1:] if len(row) == 4]
    count = 0
    for row in rows:
        for command in re.findall(r"`([^`]+)`", row[2]):
            count += 1
            faults += [f"TESTING.md: {command}: {fault}" for fault in faults_of(command)]
        has_cell = any(part in row[2] for part, *_ in CELLS) or "axle -- noise" in row[2]
        if not has_cell and re.search(r"\d{3}", row[3]):
            faults.append(f"TESTING.md: a figure of no record: {row[3]}")
    for part, record, pattern, cell in CELLS:
        count += 1
        shown = [row[3] for row in rows if part in row[2]]
        if fault := fault_of(shown, record, pattern, cell):
            faults.append(f"TESTING.md: {part}: {fault}")
    shown, measured = (set(MOTOR.findall(text)) for text in (safety, (ROOT / "tests/campaign.txt").read_text()))
    count += len(shown | measured)
    faults += [f"not in both, src/safety.md and tests/campaign.txt: {line}" for line in sorted(shown ^ measured)]
    return count, faults


def fault_of(shown, record, pattern, cell):
    """Why the cells that are shown are not the one that the record makes."""
    found = [match.groups() for match in re.finditer(pattern, (ROOT / record).read_text(), re.MULTILINE)]
    if not found or len(shown) != 1:
        return f"{len(shown)} rows, {len(found)} places in {record}"
    grouped = [f"{int(number.replace(',', '')):,}" if number.replace(",", "").isdigit() else number
               for number in found[0]]
    most = max((float(number) for number, *_ in found if re.fullmatch(r"[\d.]+", number)), default=0)
    count = len(found)
    # Without a figure, what is left to do may be told in words.
    rest = shown[0].partition("constants")[2] if "{rest}" in cell else ""
    if re.search(r"\d", rest):
        return f"a figure of no record: {rest}"
    expected = cell.format(*grouped, count={8: "eight"}.get(count, count), most=most, rest=rest)
    return None if shown[0] == expected else f"{shown[0]!r}, but {record} says {expected!r}"


def faults_of(command):
    """What of a command does not exist."""
    words = [word for word in command.split() if "=" not in word]
    if words[:2] == ["bash", ".ci/run"]:
        return [f"no step {step}" for step in words[2:] if step not in STEPS]
    if words[0] != "cargo":
        script = words[words[0] == "bash"]
        options = [f"{script} has no {word}" for word in words[1:]
                   if word.startswith("--") and (ROOT / script).is_file() and word not in (ROOT / script).read_text()]
        return options if (ROOT / script).is_file() else [f"no file {script}"]
    places = [ROOT / "tests", ROOT / "examples" / "axle" / "tests"]
    tests = [words[at + 1] for at, word in enumerate(words) if word == "--test"]
    return [f"no test {test}" for test in tests
            if not any((place / f"{test}.rs").exists() or (place / test / "main.rs").exists() for place in places)]


def planted(testing, safety):
    """Changes every figure and command, one at a time; the plants that are not found."""
    missed, plants = [], 0

    def plant(testing, safety, what):
        nonlocal plants
        plants += 1
        if not compare(testing, safety)[1]:
            missed.append(f"not found: {what}")

    def wrong(figure):
        return figure.group()[:-1] + str((int(figure.group()[-1]) + 1) % 10)

    lines = testing.splitlines()
    for at, line in enumerate(lines):
        cells = line.split("|")
        if not line.startswith("| ") or len(cells) != 6 or "axle -- noise" in line or "claim" in cells[1]:
            continue
        for figure in FIGURE.finditer(re.sub(r"\]\([^)]*\)", lambda link: "." * len(link.group()), cells[4])):
            cell = cells[4][: figure.start()] + wrong(figure) + cells[4][figure.end() :]
            plant("\n".join([*lines[:at], "|".join([*cells[:4], cell, ""]), *lines[at + 1 :]]), safety, cell)
        for name in re.findall(r"--test \w+|(?:bash |`)[\w./]+/[\w.]+", cells[3]):
            cell = cells[3].replace(name, name + "_x")
            plant("\n".join([*lines[:at], "|".join([*cells[:3], cell, *cells[4:]]), *lines[at + 1 :]]), safety, name)
    for line in MOTOR.findall(safety):
        for figure in FIGURE.finditer(line):
            plant(testing, safety.replace(line, line[: figure.start()] + wrong(figure) + line[figure.end() :]), line)
    print(f"{plants} planted, {len(missed)} missed")
    return missed + ["too few plants"] * (plants < 60)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
