#!/usr/bin/env python3
"""Compares figures that were just measured with the recorded ones, or records them.

    bench | .ci/judge.py RECORD            a fault for each figure that is not what it should be
    bench | .ci/judge.py RECORD --record   writes them to RECORD, unless there is a fault
    .ci/judge.py --planted                 planted faults are found

A figure is a line `name value` or `name value goal`; less is better, and a goal of `-` is none.
Lines that begin with `#` say how the figures were measured. Options:

    --zero PREFIX     figures whose names begin so may be 0
    --other PREFIX    figures whose names begin so depend on more: they may be half as large again,
                      or two thirds
    --without SUFFIX  figures whose names end so cannot be measured on this machine

A figure may be 3 % above its record and 10 % below. Below that it is a gain that the documents do
not tell yet, or a measurement of nothing.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HIGHEST, LOWEST = 1.03, 0.90
# Of the figures that depend on more, such as the compiler of C.
OTHERS = 1.5
LINE = re.compile(r"([a-z0-9_]+) (\d+(?:\.\d+)?)(?: (\d+|-))?")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("path", nargs="?", type=Path)
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--zero", default="\n")
    parser.add_argument("--other", default="\n")
    parser.add_argument("--without", default="\n")
    parser.add_argument("--planted", action="store_true")
    options = parser.parse_args()
    if options.planted:
        return planted(options)
    lines = sys.stdin.read().splitlines()
    faults = judge(options, lines)
    if options.record and not faults:
        options.path.write_text("\n".join(lines) + "\n")
    print(*faults, f"{options.path}: {len(lines)} lines, {len(faults)} faults", sep="\n")
    return bool(faults)


def judge(options, lines):
    """What is wrong with these figures."""
    # The first record of all has nothing to be compared with.
    is_first = options.record and not options.path.exists()
    recorded, faults = ({}, []) if is_first else parsed(options.path.read_text().splitlines())
    faults = [f"recorded: {fault}" for fault in faults]
    if not recorded and not is_first:
        faults.append("nothing is recorded")
    found, wrong = parsed(lines)
    faults += wrong
    for name in recorded.keys() - found.keys():
        if not name.endswith(options.without):
            faults.append(f"{name}: not measured")
    for name, (value, goal) in found.items():
        if value == 0 and not name.startswith(options.zero):
            faults.append(f"{name}: nothing was measured")
        if goal is not None and value > goal:
            faults.append(f"{name}: {value:g}, but its goal is {goal:g}")
        if options.record:
            continue
        if name not in recorded:
            faults.append(f"{name}: not recorded")
            continue
        before, old_goal = recorded[name]
        if goal != old_goal:
            faults.append(f"{name}: its goal was {old_goal} and is {goal}")
        is_other = name.startswith(options.other)
        if value > before * (OTHERS if is_other else HIGHEST):
            faults.append(f"{name}: grew from {before:g} to {value:g}")
        if value < before * (1 / OTHERS if is_other else LOWEST):
            faults.append(f"{name}: fell from {before:g} to {value:g}: record a gain")
    return sorted(faults)


def parsed(lines):
    """Value and goal of each name, and what is no figure."""
    figures, faults = {}, []
    for line in lines:
        if line.startswith("#"):
            continue
        fields = LINE.fullmatch(line)
        if not fields or fields[1] in figures:
            faults.append(f"{'no figure' if not fields else 'twice'}: {line!r}")
            continue
        goal = float(fields[3]) if fields[3] and fields[3] != "-" else None
        figures[fields[1]] = (float(fields[2]), goal)
    if not figures:
        faults.append("no figures at all")
    return figures, faults


def planted(options):
    """Each of these must give exactly one fault, with these words."""
    record = ["# rustc", "size 100 120", "constants 0 64", "constants_all 20 64", "c_size 300 -",
              "run_simd 50.5 -"]
    good = record[1:]

    def with_line(old, *new):
        assert old in good
        return [line for each in good for line in (new if each == old else [each])]

    checks = [
        (good, None),
        (with_line("size 100 120", "size 103 120"), None),
        (with_line("size 100 120", "size 90 120"), None),
        (with_line("run_simd 50.5 -"), None),
        (with_line("c_size 300 -", "c_size 449 -"), None),
        (with_line("c_size 300 -", "c_size 201 -"), None),
        (with_line("c_size 300 -", "c_size 451 -"), "grew from 300 to 451"),
        (with_line("c_size 300 -", "c_size 199 -"), "fell from 300 to 199"),
        (with_line("size 100 120", "size 104 120"), "grew from 100 to 104"),
        (with_line("size 100 120", "size 89 120"), "fell from 100 to 89"),
        (with_line("size 100 120", "size 0 120"), "nothing was measured"),
        (with_line("size 100 120", "size -5 120"), "no figure"),
        (with_line("size 100 120", "failed: a sum"), "no figure"),
        (with_line("size 100 120", "size  120"), "no figure"),
        (with_line("size 100 120"), "size: not measured"),
        (with_line("size 100 120", "size 100 1200"), "its goal was"),
        (with_line("size 100 120", "size 100 -"), "its goal was"),
        (with_line("size 100 120", "size 100"), "its goal was"),
        (with_line("constants_all 20 64", "constants_all 0 64"), "fell from 20 to 0"),
        (with_line("constants 0 64", "constants 65 64"), "but its goal is 64"),
        (with_line("c_size 300 -", "c_size 0 -"), "nothing was measured"),
        (with_line("c_size 300 -"), "c_size: not measured"),
        (good + ["size 100 120"], "twice"),
        (good + ["depth 100 120"], "depth: not recorded"),
        ([], "no figures at all"),
    ]
    # Recording looks at the figures themselves, and lets none of the record vanish.
    refused = [
        (with_line("size 100 120", "size 0 120"), "nothing was measured"),
        (with_line("size 100 120", "size 121 120"), "but its goal is 120"),
        (with_line("size 100 120", "failed: a sum"), "no figure"),
        (with_line("size 100 120", "size -5 120"), "no figure"),
        (with_line("size 100 120"), "size: not measured"),
        ([], "no figures at all"),
    ]
    options.zero, options.other, options.without = "constants", "c_", "_simd"
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        options.path = Path(folder, "record")
        options.path.write_text("\n".join(record) + "\n")
        for options.record, cases in [(False, checks), (True, refused)]:
            for lines, words in cases:
                faults = judge(options, lines)
                if any(words in fault for fault in faults) if words else not faults:
                    continue
                missed += 1
                print(f"{lines} with{'' if words else 'out'} a fault gives {faults}")
        options.record = False
        # The same by the command itself: a fault is its exit status, and is not recorded.
        before = options.path.read_text()
        for words in [], ["--record"]:
            run = subprocess.run([sys.executable, __file__, options.path, *words], input="size 0 120\n",
                                 stdout=subprocess.DEVNULL, text=True)
            if run.returncode != 1 or options.path.read_text() != before:
                missed += 1
                print(f"figures with a fault were written, or are no failure: {words}")
        for empty in ["", "# rustc\n"]:
            options.path.write_text(empty)
            if "nothing is recorded" not in judge(options, good):
                missed += 1
                print(f"a record of {empty!r} is believed")
    print(f"{len(checks) + len(refused) + 2} planted, {missed} missed")
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())
