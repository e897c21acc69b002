#!/usr/bin/env python3
"""Runs every benchmark once: each checks its answers, and none may be missing.

    python3 benches/check.py            also the tests of what the benchmarks share
    python3 benches/check.py --record   writes benches/names.txt, the names of the benchmarks

Timing never fails it. With `-- --test` the contenders of `ratios` and `printing` pretend to take
known times, so that each figure is known; those printed must be the recorded ones, by name.
"""

import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NAMES = HERE / "names.txt"
RECORDS = [HERE / "ratios.txt", HERE / "printing.txt"]


def main(options):
    cargo = ["cargo", "bench", "--quiet", "-p", "axlewire-benches"]
    subprocess.run([*cargo[:1], "test", *cargo[2:], "--lib"], cwd=HERE, check=True)
    run = subprocess.run([*cargo, "--benches", "--", "--test"], cwd=HERE, stdout=subprocess.PIPE, text=True)
    if run.returncode != 0:
        print(run.stdout)
        return run.returncode
    measured = sorted(re.findall(r"^Testing (.+)\nSuccess$", run.stdout, re.MULTILINE))
    if options == ["--record"]:
        NAMES.write_text("\n".join(measured) + "\n")
    faults = compared(NAMES.read_text().splitlines(), measured)
    figures = re.findall(r"^([a-z0-9_-]+) \d+(?:\.\d+)? (-|\d+(?:\.\d+)?)$", run.stdout, re.MULTILINE)
    recorded = [tuple(line.split()[::2]) for path in RECORDS for line in path.read_text().splitlines()]
    faults += compared(sorted(recorded), sorted(figures))
    print(*faults, f"{len(measured)} benchmarks, {len(figures)} figures, {len(faults)} faults", sep="\n")
    return bool(faults) or not measured or not figures


def compared(recorded, found):
    """Names, or names with their goals."""
    return [f"recorded, but not run: {name}" for name in recorded if name not in found] + [
        f"run, but not recorded: {name}" for name in found if name not in recorded or found.count(name) > 1
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
