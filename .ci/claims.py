#!/usr/bin/env python3
"""Compares TESTING.md and the table of src/safety.md with what was recorded.

    .ci/claims.py --check      every command exists, and every figure is on record
    .ci/claims.py --planted    plants wrong figures and commands, and checks that each is found

Figures are numbers of three digits or more; `benches/noise.py` checks those of the noise.
"""

import re
import sys
from pathlib import Path

import gate

ROOT = Path(__file__).resolve().parent.parent
RECORDS = ["tests/exhaustive.txt", "tests/campaign.txt", "tests/soak.txt", "tests/coverage.txt",
           "tests/mutants.txt", "fuzz/campaign.txt", "fuzz/coverage.txt"]
STEPS = gate.steps()
# A row of the table of motors that stop.
MOTOR = re.compile(r"^\| (?:bus|rover)\b.*\| [\d.]+ \|$", re.MULTILINE)
FIGURE = re.compile(r"(?<![\w.,^/-])\d[\d,]*(?:\.\d+)?(?![\w^-])")


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
    known = set()
    for record in RECORDS:
        known |= {number.replace(",", "") for number in FIGURE.findall((ROOT / record).read_text())}
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")]
            for line in testing.splitlines() if line.startswith("| ")]
    faults = [f"TESTING.md: {len(row)} cells: {row[0]}" for row in rows if len(row) != 4]
    count = 0
    for row in rows[1:]:
        for command in re.findall(r"`([^`]+)`", row[2]) if len(row) == 4 else []:
            count += 1
            faults += [f"TESTING.md: {command}: {fault}" for fault in faults_of(command)]
    figures = [("TESTING.md", row[3]) for row in rows[1:] if len(row) == 4 and "axle -- noise" not in row[2]]
    shown, measured = (set(MOTOR.findall(text)) for text in (safety, (ROOT / "tests/campaign.txt").read_text()))
    count += len(shown | measured)
    faults += [f"not in both, src/safety.md and tests/campaign.txt: {line}" for line in sorted(shown ^ measured)]
    for document, text in figures:
        for figure in FIGURE.findall(re.sub(r"\]\([^)]*\)", "", text)):
            if len(re.sub(r"[,.]", "", figure)) >= 3:
                count += 1
                if figure.replace(",", "") not in known:
                    faults.append(f"{document}: not on record: {figure}")
    return count, faults


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
            if len(re.sub(r"[,.]", "", figure.group())) >= 3:
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
