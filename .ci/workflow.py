#!/usr/bin/env python3
"""Checks that the hosted workflow runs every step of the gate exactly once, and that neither it nor
a step ignores a check that fails.

    .ci/workflow.py --check

Each line of the workflow must be one of those that are named here. A line of `.ci/run` must be a
plain command, after whose failure bash ends the step. Any other line must have one of the forms of
HARMLESS, or be listed in SEEN, because somebody has seen that it hides nothing. What `.ci/prove`
plants shows what is found; its record is void once a step has changed.
"""

import collections
import pathlib
import re
import sys

import gate

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORKFLOW = ROOT / ".github" / "workflows" / "gate.yml"

# When and with what it runs: all above the jobs.
BEGIN = """
name: gate

on:
  push:
    branches: [main]
  pull_request:
  schedule:
    - cron: "17 3 * * 1"

permissions: {}

concurrency:
  group: gate-${{ github.ref }}
  cancel-in-progress: true

env:
  CARGO_TERM_COLOR: never

jobs:
"""
# Of each job: the lines that it must have, in this order. `STEPS` stands for lists of steps.
STEPS = "- STEPS"
JOBS = {
    "steps": [
        STEPS,
        "STEPS: ${{ matrix.steps }}",
        "run: |",
        'read -ra steps <<<"$STEPS"',
        'bash .ci/run "${steps[@]}"',
    ],
    "complete": ["- run: python3 .ci/workflow.py --check"],
    "msrv": [
        "run: |",
        r"""msrv=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)""",
        'rustup toolchain install "$msrv" --profile minimal',
        'cargo "+$msrv" check -p axlewire --lib --all-features',
    ],
    "other-systems": ["os: [macos-14, windows-2022]", "runs-on: ${{ matrix.os }}", "- run: cargo test"],
    # Only what takes too long for every change has a condition.
    "evidence": [
        "if: github.event_name == 'schedule'",
        "- bash tests/exhaustive.sh",
        "- bash .ci/reproduce",
        "- .ci/sbom",
        "- .ci/coverage",
        "- .ci/prove",
        "- fuzz/campaign all --minutes 15",
        "- tests/mutants.py --minutes 300 --workers 4",
        "- cargo test --release --test soak -- --ignored --nocapture",
        "- cargo test --release --test campaign -- --ignored --nocapture",
        "COMMAND: ${{ matrix.command }}",
        "run: |",
        'read -ra command <<<"$COMMAND"',
        '"${command[@]}"',
    ],
    "advisories": [
        "- run: cargo deny --workspace --config deny.toml check advisories",
        "run: |",
        "read -r _ commit <.ci/api-released",
        'cargo semver-checks -p axlewire --all-features --baseline-rev "$commit"',
    ],
}
# What any job may say besides; nothing of it decides whether or what a job checks.
BESIDES = re.compile(
    r"runs-on: ubuntu-24\.04|timeout-minutes: \d+|permissions:|contents: read|strategy:|fail-fast: false|matrix:"
    r"|(- )?name: [\w ${}.]+|(steps|command|with|env):|fetch-depth: 0|persist-credentials: false"
    r"|- uses: actions/checkout@[0-9a-f]{40} # v[\d.]+|(- )?run: rustup toolchain install [\w ,&-]+"
    r"|- run: cargo install --locked( cargo-[\w-]+)+")

# How it begins.
HEAD = ["set -euo pipefail", 'cd "$(dirname "$0")/.."', "export CARGO_TERM_COLOR=never CARGO_INCREMENTAL=0"]
# How .ci/run ends: it runs the steps, and fails if one does.
END = """
names() { sed -n 's/^#: \\([a-z]*\\): .*/\\1/p' "$0"; }

if [ "${1:-}" = --list ]; then
    sed -n 's/^#: //p' "$0"
    exit
fi
for name in ${*:-$(names)}; do
    echo "== $(sed -n "s/^#: \\($name: .*\\)/\\1/p" "$0")"
    SECONDS=0
    # Not in a condition, where -e would not count.
    set +e
    (set -e; "step_$name")
    status=$?
    set -e
    case $status in
    0) echo "== $name passed in ${SECONDS} s" ;;
    # It says why. A hosted run has all that it needs.
    77) echo "== $name SKIPPED"; [ -z "${GITHUB_ACTIONS:-}" ] || exit 77 ;;
    *) exit "$status" ;;
    esac
done
"""

# What can hide that a command fails: operators and substitutions anywhere, these words in front.
HIDING = re.compile(
    r"[;&`!]|\|\||[$<>]\("
    r"|^(if|then|elif|else|fi|while|until|for|case|select|function|set|shopt|trap|return|exit|break|continue)\b"
    r"|^(eval|exec|source|builtin|command|coproc|alias|unalias|unset|true|false|enable|declare)\b|^[:.{]( |$)"
    r"|\| *(if|while|until|for|case|true|:)( |$)|\w\(\)")
# A check that is only listed, built or said; a here-document.
IDLE = re.compile(r"(?<!<)<<(?!<)|(^|\s)--?(no-run|list|skip|help|version|dry-run|[hV])\b")
# How a line may begin: with what runs a check, or with what prepares or compares something.
PLAIN = re.compile(
    r"cargo (fmt|clippy|test|build|run|doc|check|hack) ?|cargo \"\+\$msrv\" check |python3 (\.ci|tests|benches|examples/axle/tests)/\w"
    r"|bash (\.ci|examples/\w+|benches)/\w|\.ci/\w|\$venv/bin/(pip|zizmor|check-jsonschema) |\$command --quiet <"
    r"|RUSTDOCFLAGS=\"-D warnings\" cargo doc |AXLE_HOUR_MINUTES=0\.33 cargo test |local -x RUSTFLAGS=\"-D warnings\"$"
    r"|AXLE=target/debug/axle PYTHON=[\w/]+ bash examples/\w|examples/architecture\.py --"
    r"|local [a-z]|grep -|sed -?[\w ]*['\"]|\[ \S+ -\w+ \d+ \]$|echo (\"[^\"]*\"|'[^']*')$"
    r"|no_std_features=|sleep [\d.]+$|kill \$sim$|rm \"\$told\"$|(done|\)|\})$")
# Forms that hide nothing; the strings in quotes are left out.
HARMLESS = [
    re.compile(form) for form in (
        r"for \w+ in [^$;&|`]+; do", "return 1",
        # The value of a variable: a failure is that of the line.
        r"\w+=\$\([^;&`|()]+(\|[^;&`|()]+)*\)", r"\w+=\$\(\([^;&`|()]+\)\)",
        # What fails is told, and is a failure of the function.
        r"grep [^;&`|$]+ \|\| \{ echo ''; return 1; \}",
        # A tool is installed if it is not there.
        r"command -v [\w-]+ >/dev/null \|\| [^;&`|]+",
    )
]
SEEN = {
    # The failure is kept in a variable, or returned.
    "{ $soon ${turn/PATH/$path} | grep -Fx 'found: [(N1, Velocity)]'; } || status=1",
    "grep 'node 1: turning at 2.00 rps' \"$told\" || status=1",
    "grep 'node 1: command 0.00 rps' \"$told\" || status=1",
    "return $status",
    "out=$(examples/firmware/run.sh ikeya_slave -- cargo run -q -p axle -- spin --port PORT --node 1 --rps 2 --for 1) || return",
    "$(command_of_readme 'axle -- decode') | grep -x '       328 in 15 frames' || {",
    # Another attempt; after the last one the step fails.
    "turn_of_readme && break",
    "motor_in_qemu && break",
    # A simulator in the background, which is ended. It must have printed what is expected.
    "timeout 60 $soon $(command_of_readme 'axle -- sim ikeya') >\"$told\" &",
    "sim=$!",
    "for _ in $(seq 100); do",
    "grep -q '^pty: ' \"$told\" && break",
    "wait $sim || true",
    # Whether there is something.
    "if chrt -f 10 true 2>/dev/null; then soon='chrt -f 10'; fi",
    "[ -x $venv/bin/zizmor ] || python3 -m venv $venv",
    "if command -v rustup >/dev/null && rustup toolchain list | grep -q \"^$msrv\"; then",
    "else",
    "fi",
    "[ -z \"$newer\" ] || { echo \"$newer\"; return 1; }",
    # Goes on for some lines, up to the closing bracket.
    "newer=$(cargo metadata --format-version 1 --all-features --filter-platform x86_64-unknown-linux-gnu |",
    # The sets of features, which are counted.
    "while read -r command; do",
    "done < <(",
    "for feature in $(features_of_library); do",
    "echo \"$((count + 7)) sets of features\"",
    # A function for others.
    "command_of_readme() { grep -m1 -F \"$1\" README.md | sed 's/ *#.*//'; }",
    # Python.
    "python3 -c '",
    "import json, sys",
    "meta = json.load(sys.stdin)",
    'packages = {p["id"]: p for p in meta["packages"]}',
    'nodes = {n["id"]: n for n in meta["resolve"]["nodes"]}',
    'limit = tuple(map(int, sys.argv[1].split(".")))',
    'todo = [p["id"] for p in meta["packages"] if p["name"] == "axlewire"]',
    "seen = set(todo)",
    "while todo:",
    "for dep in nodes[todo.pop()][\"deps\"]:",
    "if normal and dep[\"pkg\"] not in seen:",
    "normal = any(kind[\"kind\"] in (None, \"build\") for kind in dep[\"dep_kinds\"])",
    'seen.add(dep["pkg"])',
    'todo.append(dep["pkg"])',
    "for package in (packages[s] for s in seen):",
    'needs = package["rust_version"] or "1.0"',
    "if tuple(map(int, needs.split(\".\")[:2])) > limit:",
    'print(package["name"], package["version"], "needs", needs)',
    'assert len(seen) > 5, "the dependency graph was not read"',
    "' \"$msrv\")",
}
HELPERS = ["turn_of_readme", "features_of_library", "motor_in_qemu"]


def main():
    steps = gate.steps()
    faults = faults_of_workflow(WORKFLOW.read_text(), steps)
    gate_text = (ROOT / ".ci" / "run").read_text()
    faults += faults_of_gate(gate_text, steps) + faults_of_tests(gate_text, (ROOT / "README.md").read_text())
    print(f"{len(steps)} steps, {len(faults)} faults", *faults, sep="\n")
    return bool(faults) or len(steps) < 20


def faults_of_workflow(text, steps):
    """What it does not run, or may not run, or what may hide that it fails."""
    # The first line says what it is for.
    begin, _, jobs = text.partition("\njobs:\n")
    faults = ["gate.yml does not begin as it should"] * ("\n" + begin.partition("\n")[2] + "\njobs:\n" != BEGIN)
    names = re.findall(r"^  (\S+):$", jobs, re.MULTILINE)
    if sorted(names) != sorted(JOBS):
        return [*faults, f"gate.yml does not have each job exactly once: {' '.join(names)}"]
    run = collections.Counter()
    for name, body in zip(names, re.split(r"^  \S+:$", jobs, flags=re.MULTILINE)[1:]):
        due = list(JOBS[name])
        for line in map(str.strip, body.splitlines()):
            words = line.removeprefix("- ").split()
            if line.startswith("- ") and name == "steps" and set(words) <= set(steps):
                run.update(words)
                line = STEPS
            if due and line == due[0]:
                due.pop(0)
            elif line and not line.startswith("#") and not BESIDES.fullmatch(line) and line != STEPS:
                faults.append(f"gate.yml: {name}: not a line that it may have: {line}")
        faults += [f"gate.yml: {name}: missing: {line}" for line in due]
    return faults + [f"{step}: run {run[step]} times" for step in steps if run[step] != 1]


def faults_of_gate(text, steps):
    """Where `.ci/run` could go on although a check has failed."""
    faults = []
    if not text.endswith(END):
        faults.append(".ci/run does not end as it should")
    # What is continued on the next line is one line.
    lines = [line.strip() for line in text.removesuffix(END).replace("\\\n", "").splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    if lines[: len(HEAD)] != HEAD:
        faults.append(f".ci/run does not begin as it should: {lines[0]}")
    functions = re.findall(r"^(\w+)\(\) \{$", "\n".join(lines), re.MULTILINE)
    if sorted(functions) != sorted([f"step_{step}" for step in steps] + HELPERS):
        faults.append(".ci/run does not have each step, and its other functions, exactly once")
    for line in lines[len(HEAD) :]:
        code = re.sub(r"'[^']*'|\"(?:(?!\$\()[^\"`])*\"", "''", line)
        is_harmless = any(form.fullmatch(code) for form in HARMLESS) or line in SEEN
        is_function = line.removesuffix("() {") in functions
        if is_harmless or is_function:
            continue
        if HIDING.search(code):
            faults.append(f".ci/run may hide a failure: {line}")
        elif IDLE.search(code) or not PLAIN.match(line):
            faults.append(f".ci/run may check nothing: {line}")
    checks = [line for line in lines if re.match(r"(python3|bash|cargo|\.ci/)", line)]
    return faults + ["hardly any check is run"] * (len(checks) < 40)


def faults_of_tests(text, readme):
    """The step `test` is what the README tells everybody to run, and nothing else."""
    command = re.search(r"^(cargo test\b.*?) +# the crate and the host tool", readme, re.MULTILINE)
    if not command:
        return ["README.md does not name the command for the tests"]
    expected = f"\nstep_test() {{\n    {command[1]}\n}}\n"
    return [f"the step test is not: {command[1]}"] * (expected not in text)


if __name__ == "__main__":
    sys.exit(main())
