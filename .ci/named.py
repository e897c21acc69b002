#!/usr/bin/env python3
"""Checks that every test that safety.md and SECURITY.md name is run by the gate.

    .ci/named.py               asks the programs of `cargo test` and of the step `ports`
    .ci/named.py --planted     that a test which is switched off is found
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def named():
    """The tests that the pages name."""
    page = (ROOT / "src/safety.md").read_text()
    names = {name for line in page.splitlines() if line.startswith("| ") and len(line.split("|")) == 7
             for name in re.findall(r"`(\w+)`", line.split("|")[4])}
    security = re.findall(r"`(\w+)`", (ROOT / "SECURITY.md").read_text())
    return names | {name for name in security if name.count("_") >= 2}


def run():
    """The tests that the steps `test` and `ports` run."""
    def listed(programs, *words):
        command = ["cargo", "test", "--quiet", *programs, "--", "--list", "--format=terse", *words]
        out = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
        return set(re.findall(r"^(\S+): test$", out, re.MULTILINE))
    names = set()
    for programs in ["--lib", "--bins", "--tests"], ["-p", "axle", "--test", "ports", "--test", "memory"]:
        names |= listed(programs) - listed(programs, "--ignored")
    return {name.rsplit("::", 1)[-1] for name in names}


def faults(names, are_run):
    return [f"named, but not run: {name}" for name in sorted(names - are_run)] + ["hardly any test is named"] * (len(names) < 100)


def main(options):
    names, are_run = named(), run()
    found = faults(names, are_run)
    if options == ["--planted"]:
        # One test that is gone, and a page that names none.
        found += ["a test that is switched off is not found"] * (not faults(names, are_run - {min(names)}))
        found += ["a page without tests is not found"] * (not faults(set(), are_run))
    print(*found, f"{len(names)} tests are named, {len(found)} faults", sep="\n")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
