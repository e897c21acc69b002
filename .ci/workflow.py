#!/usr/bin/env python3
"""Checks that the hosted workflow runs every step of the gate exactly once, and that neither it nor
a step ignores a check that fails.

    .ci/workflow.py --check
"""

import collections
import pathlib
import re
import sys

import gate

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORKFLOW = ROOT / ".github" / "workflows" / "gate.yml"

COMMAND = """
          read -ra steps <<<"$STEPS"
          bash .ci/run "${steps[@]}"

"""


def main():
    steps = gate.steps()
    matrix = re.search(r"^        steps:\n((?:          - .*\n)+)", WORKFLOW.read_text(), re.MULTILINE)
    run = collections.Counter(" ".join(re.findall(r"- (.*)", matrix[1])).split()) if matrix else {}
    faults = [f"{step}: run {run[step]} times" for step in steps if run[step] != 1]
    faults += [f"{step}: no step of the gate" for step in run if step not in steps]
    # Nothing may hide a step that fails.
    text = WORKFLOW.read_text()
    faults += ["the steps are not run as they should be"] * (COMMAND not in text)
    faults += [f"it hides failures: {word}" for word in ("|| true", "continue-on-error", "set +e") if word in text]
    # Of a check; what was started in the background may have ended.
    checks = re.findall(r"^ +(?:python3|bash|cargo|\.ci/).*$", (ROOT / ".ci" / "run").read_text(), re.MULTILINE)
    faults += [f".ci/run hides a failure: {line.strip()}" for line in checks if re.search(r"\|\| (true|:)", line)]
    faults += ["hardly any check is run"] * (len(checks) < 40)
    print(f"{len(steps)} steps, {len(faults)} faults", *faults, sep="\n")
    return bool(faults) or len(steps) < 20


if __name__ == "__main__":
    sys.exit(main())
