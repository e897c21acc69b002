#!/usr/bin/env python3
"""Runs what the guide shows: its Rust code as doc tests; its commands, and what they print.

    tests/guide.py             everything; exit code 1 if a fault is found
    tests/guide.py CHAPTER     the commands of these chapters only
    tests/guide.py --write     writes what the commands print into the chapters
    tests/guide.py --planted   plants faults in copies of the chapters, and counts those found

A chapter is a Markdown file in `src/guide`. Every block of it is run, or is listed below with the
reason why it is not:

* Rust blocks are doc tests. Each must have run and passed; `ignore` and `no_run` need a reason.
* `console` blocks are run by bash in an empty folder with a link to `examples`, one shell per
  command. A line `$ command`, which `> ` continues, is followed by exactly what it prints. One that
  ends in `&` goes on until the end of the chapter, and the next waits until its `--link` is there.
* `toml` blocks depend on this crate: with features that it has.
* `diff` blocks are patches that are applied by another test, word for word.

The chapters are those of `src/guide/mod.rs`, in its order, and each leads to its neighbours.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
GUIDE = ROOT / "src" / "guide"
SPIN = "examples/host/src/bin/spin.rs"
# The blocks that are not run: (chapter, first line) and the reason.
NOT_RUN = {
    ("start_on_a_pc", "cargo install --path examples/axle"): "installs for the user; it is built here",
    ("adding_a_message", "python3 tests/new_message.py"): "takes minutes; the step `message` of the gate is this command",
    ("recording", "cargo install --path examples/axle --features mcap,parquet,plot"): "heavy features; the tests of axle use them",
    ("recording", "axle plot examples/captures/motors.pcapng -o motors.svg"): "a heavy feature; the tests of axle use it",
    ("recording", "examples/wireshark/install.sh"): "needs tshark; examples/wireshark checks it",
    ("recording", "axle watch --port /dev/ttyUSB0 --protocol ucp --udp 127.0.0.1:9870"):
        "an adapter, and a program that listens; the tests of axle send to one",
    ("recording", "axle watch --port /dev/ttyUSB0 --protocol ikeya"): "a page on a terminal, on an adapter",
    ("start_on_a_pc", "cargo new turn && cd turn"): "makes a project; the gate builds the same program",
    ("start_on_a_pc", "use axlewire::drive::{Driver, SerialPort, StdClock};"):
        f"opens a port; it is the text of {SPIN}, which the next block runs",
}
# Programs that are shown: (chapter, first line) and the file with this code behind its docs.
PROGRAMS = {("start_on_a_pc", "use axlewire::drive::{Driver, SerialPort, StdClock};"): SPIN}
# Patches that are shown, and the files in which other tests have them.
PATCHES = {"adding_a_message": "tests/new_message/added.patch"}

FENCE = re.compile(r"^```(.*)$")
RUST = {"rust", "ignore", "no_run", "should_panic", "compile_fail"}
DOC_TEST = re.compile(r"^test src/guide/(\w+)\.md - guide::\w+ \(line (\d+)\)( - compile)? \.\.\. (\w+)$", re.MULTILINE)
# A busy machine can delay three answers of a simulated motor in a row: it is then abnormal.
ATTEMPTS = 8
PATIENCE_S = 60
LEAST = {"chapters": 11, "doc tests": 27, "commands": 20}


class Block:
    """A block of code: its chapter, the line of its fence, what it is and its lines."""

    def __init__(self, chapter, line, info, lines):
        self.chapter, self.line, self.lines = chapter, line, lines
        self.words = re.split(r"[ ,]+", info.strip()) if info.strip() else ["rust"]
        self.kind = "rust" if set(self.words) & RUST or self.words[0].startswith("ignore") else self.words[0]
        self.key = (chapter, lines[0] if lines else "")

    def at(self, fault):
        return f"{self.chapter}.md:{self.line}: {fault}"


def main(args):
    texts = {path.stem: path.read_text() for path in sorted(GUIDE.glob("*.md"))}
    index = (GUIDE / "mod.rs").read_text()
    if args == ["--planted"]:
        return planted(texts, index)
    is_written, wanted = args == ["--write"], [arg for arg in args if arg != "--write"]
    if unknown := [name for name in wanted if name not in texts]:
        sys.exit(f"no chapter: {' '.join(unknown)}")
    build()
    faults, commands = [], 0
    for chapter in wanted or texts:
        found, printed = run_commands(chapter, texts[chapter], is_written)
        faults += found
        commands += len(printed)
        if is_written and printed:
            (GUIDE / f"{chapter}.md").write_text(rewritten(texts[chapter], printed))
    tests = 0
    if not args:
        run = doc_tests()
        tests = len(DOC_TEST.findall(run))
        faults += faults_of_text(texts, index) + faults_of_tests(texts, run)
        counts = {"chapters": len(texts), "doc tests": tests, "commands": commands}
        faults += [f"only {counts[what]} {what}" for what, least in LEAST.items() if counts[what] < least]
    print(*faults, sep="\n", end="\n" if faults else "")
    print(f"{len(texts)} chapters, {tests} doc tests, {commands} commands, {len(faults)} faults")
    return bool(faults)


def build():
    for package, binary in [("axle", "axle"), ("host-examples", "spin")]:
        subprocess.run(["cargo", "build", "--quiet", "-p", package, "--bin", binary], cwd=ROOT, check=True)


def doc_tests():
    """What the doc tests of the guide print."""
    command = ["cargo", "test", "--doc", "-p", "axlewire", "--", "src/guide/"]
    run = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if run.returncode:
        print(run.stdout)
    return run.stdout


def blocks_of(chapter, text):
    """The blocks of a chapter; one that does not end has the kind `open`."""
    blocks, start = [], None
    for number, line in enumerate(text.splitlines(), 1):
        if not (fence := FENCE.match(line)):
            if start:
                start[2].append(line)
        elif start:
            blocks.append(Block(chapter, *start))
            start = None
        else:
            start = (number, fence[1], [])
    return blocks + ([Block(chapter, start[0], "open", start[2])] if start else [])


def faults_of_text(texts, index):
    """What can be seen without running anything."""
    order = re.findall(r"^    (\w+)$", index.partition("\nchapters! {\n")[2], re.MULTILINE)
    listed = re.findall(r"^//! (\d+)\. \[([^\]]+)\]\((\w+)\)", index, re.MULTILINE)
    faults = []
    if [name for _, _, name in listed] != order:
        faults.append("mod.rs: the list is not that of the modules")
    if [int(number) for number, _, _ in listed] != list(range(1, len(listed) + 1)):
        faults.append("mod.rs: the numbers of the list are wrong")
    if sorted(order) != sorted(texts):
        faults.append(f"mod.rs: not the chapters that there are: {sorted(set(order) ^ set(texts))}")
    titles = {name: title for _, title, name in listed}
    for place, name in enumerate(order):
        text = texts.get(name, "")
        if not text.startswith(titles.get(name, "?") + ":"):
            faults.append(f"{name}.md: does not begin with its title")
        if not text.endswith("\n\n" + neighbours(order, titles, place)):
            faults.append(f"{name}.md: does not end with links to its neighbours")
    features = tomllib.loads((ROOT / "Cargo.toml").read_text())["features"]
    blocks = [block for name, text in texts.items() for block in blocks_of(name, text)]
    for block in blocks:
        faults += faults_of_block(block, features)
    for name, text in texts.items():
        # rustdoc knows them, and would run or ignore what is in them.
        odd = [line for line in text.splitlines() if re.match(r" *(~~~|````)| +```", line)]
        faults += [f"{name}.md: a fence of another kind: {line}" for line in odd]
    keys = {block.key for block in blocks}
    return faults + [f"{name}.md: no such block: {line}" for name, line in NOT_RUN if (name, line) not in keys]


def neighbours(order, titles, place):
    """The last lines of a chapter."""
    link = lambda name: f"[{titles.get(name, name)}](crate::guide::{name})"
    before = [f"← {link(order[place - 1])}"] if place else []
    behind = [f"{link(order[place + 1])} →"] if place + 1 < len(order) else []
    return " ·\n".join([*before, "[Contents](crate::guide)", *behind]) + "\n"


def faults_of_block(block, features):
    if block.kind == "open":
        return [block.at("the block does not end")]
    is_run = block.kind == "rust" and not any(word.startswith("ignore") or word == "no_run" for word in block.words)
    if block.key in PROGRAMS:
        code = (ROOT / PROGRAMS[block.key]).read_text().partition("\n\n")[2]
        if code != "\n".join(block.lines) + "\n":
            return [block.at(f"not the code of {PROGRAMS[block.key]}")]
    if is_run or block.key in NOT_RUN:
        return []
    if block.kind == "console":
        return [] if block.key[1].startswith("$ ") else [block.at("does not begin with a command")]
    if block.kind == "toml":
        wanted = tomllib.loads("\n".join(block.lines)).get("dependencies", {}).get("axlewire", {}).get("features", [])
        return [block.at(f"no such feature: {name}") for name in wanted if name not in features]
    if block.kind == "diff" and block.chapter in PATCHES:
        patch = (ROOT / PATCHES[block.chapter]).read_text()
        is_same = "\n".join(block.lines) + "\n" in patch
        return [] if is_same else [block.at(f"not in {PATCHES[block.chapter]}")]
    return [block.at(f"a block of {' '.join(block.words)} that is not run, without a reason")]


def faults_of_tests(texts, run):
    """Doc tests that did not run or did not pass."""
    passed = {(name, int(line)) for name, line, _, result in DOC_TEST.findall(run) if result == "ok"}
    due = [block for name, text in texts.items() for block in blocks_of(name, text) if block.kind == "rust"]
    return [block.at("no doc test that has passed") for block in due if (block.chapter, block.line) not in passed]


def commands_of(text, chapter=""):
    """The commands of a chapter: (line, command, the lines below it)."""
    commands = []
    for block in blocks_of(chapter, text):
        for number, line in enumerate(block.lines, block.line + 1):
            if block.kind != "console":
                break
            if line.startswith("$ "):
                commands.append((number, line[2:], []))
            elif commands and line.startswith("> ") and not commands[-1][2]:
                commands[-1] = (commands[-1][0], f"{commands[-1][1]}\n{line[2:]}", [])
            elif commands:
                commands[-1][2].append(line)
    return commands


def run_commands(chapter, text, is_written=False):
    """The faults, and what each command has printed: by its line."""
    commands = commands_of(text, chapter)
    if not commands:
        return [], {}
    for attempt in range(1, ATTEMPTS + 1):
        with tempfile.TemporaryDirectory() as folder:
            printed, faults = session(chapter, commands, pathlib.Path(folder))
        is_live = any(command.endswith("&") for _, command, _ in commands)
        if not faults or is_written or not is_live:
            break
        print(f"attempt {attempt}: {faults[0].strip().splitlines()[0]}", file=sys.stderr)
        time.sleep(5)
    return ([] if is_written else faults), printed


def session(chapter, commands, folder):
    (folder / "examples").symlink_to(ROOT / "examples")
    env = {name: value for name, value in os.environ.items() if not name.startswith("CARGO")}
    env |= {"PATH": f"{ROOT / 'target' / 'debug'}:{env['PATH']}", "LC_ALL": "C.UTF-8", "TZ": "UTC", "NO_COLOR": "1"}
    # Where it is allowed, other processes do not delay the answers.
    soon = ["chrt", "-f", "10"] if subprocess.run(["chrt", "-f", "10", "true"], capture_output=True).returncode == 0 else []
    printed, faults, behind = {}, [], []
    try:
        for line, command, shown in commands:
            where = f"{chapter}.md:{line}"
            if command.endswith("&"):
                behind.append(subprocess.Popen([*soon, "bash", "-c", command[:-1]], cwd=folder, env=env, stdin=subprocess.DEVNULL,
                                               start_new_session=True))
                printed[line] = []
                faults += [f"{where}: no link" for link in re.findall(r"--link (\S+)", command) if not appears(folder / link)]
                continue
            try:
                run = subprocess.run([*soon, "bash", "-o", "pipefail", "-c", command], cwd=folder, env=env, text=True,
                                     stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                     timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                faults.append(f"{where}: not done after {PATIENCE_S} s")
                continue
            printed[line] = [text.rstrip() for text in run.stdout.splitlines()]
            # `head` closes what it has read enough of.
            if run.returncode not in (0, 141):
                faults.append(f"{where}: exit code {run.returncode}: {run.stdout}")
            if printed[line] != [text.rstrip() for text in shown]:
                faults.append(f"{where}: prints something else:\n" + "\n".join(printed[line]))
    finally:
        for process in behind:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
    return printed, faults


def appears(link):
    for _ in range(100):
        if link.is_symlink() or link.exists():
            return True
        time.sleep(0.1)
    return False


def rewritten(text, printed):
    """The chapter with what its commands have printed."""
    out, is_in, due, is_old = [], False, [], False
    for number, line in enumerate(text.splitlines(), 1):
        if FENCE.match(line) or is_in and line.startswith("$ "):
            out += due
            is_in, is_old, due = line == "```console" or line.startswith("$ "), False, printed.get(number, [])
        elif is_in and not line.startswith("> "):
            is_old = True
        if not is_old:
            out.append(line)
    return "\n".join(out) + "\n"


def planted(texts, index):
    """Plants faults, each of which must be found where the sound guide has none."""
    name = "ikeya"
    block = lambda info, line: f"\n```{info}\n{line}\n```\n"
    changed = lambda chapter, old, new: {**texts, chapter: texts[chapter].replace(old, new, 1)}
    footer = lambda chapter, added: changed(chapter, "\n# ", f"{added}\n# ")
    without = {chapter: text for chapter, text in texts.items() if chapter != name}
    due = [it for chapter, text in texts.items() for it in blocks_of(chapter, text) if it.kind == "rust"]
    passes = "".join(f"test src/guide/{it.chapter}.md - guide::x (line {it.line}) ... ok\n" for it in due)
    cases = {
        "an ignored block": faults_of_text(footer(name, block("ignore", "loop {}")), index),
        "a block ignored on some systems": faults_of_text(footer(name, block("ignore-windows", "loop {}")), index),
        "a block that is only compiled": faults_of_text(footer(name, block("no_run", "loop {}")), index),
        "a shell block without a reason": faults_of_text(footer(name, block("sh", "rm file")), index),
        "a console block without a command": faults_of_text(footer(name, block("console", "out")), index),
        "a feature that is not there": faults_of_text(changed("start_on_a_board", '"ikeya"]', '"planted"]'), index),
        "a block that does not end": faults_of_text(footer(name, "\n```console\n$ true\n"), index),
        "a program that is another": faults_of_text(changed("start_on_a_pc", "Rps::new(2.0)?, Dur", "Rps::new(3.0)?, Dur"), index),
        "a reason without its block": faults_of_text(changed("start_on_a_pc", "cargo new turn", "cargo init turn"), index),
        "a fence of another kind": faults_of_text(footer(name, "\n~~~ignore\nloop {}\n~~~\n"), index),
        "an indented fence": faults_of_text(footer(name, "\n  ```ignore\n  loop {}\n  ```\n"), index),
        "a missing chapter": faults_of_text(without, index),
        "a chapter that is not listed": faults_of_text(texts, re.sub(rf"//! \d+\. \[[^\]]*\]\({name}\).*\n", "", index)),
        "a chapter that is no module": faults_of_text(texts, index.replace(f"    {name}\n", "")),
        "two chapters swapped": faults_of_text(texts, index.replace("    timing\n    staying_safe\n", "    staying_safe\n    timing\n")),
        "a wrong link to the next": faults_of_text(changed(name, "(crate::guide::ucp) →", "(crate::guide::timing) →"), index),
        "no links at the end": faults_of_text({**texts, name: texts[name].rpartition("\n\n")[0] + "\n"}, index),
        "another title": faults_of_text(changed(name, "Ikeya in ten", "Ikeya in nine"), index),
        "a doc test that did not run": faults_of_tests(texts, passes.partition("\n")[2]),
        "a doc test that failed": faults_of_tests(texts, passes.replace("... ok", "... FAILED", 1)),
        "an output that is another": run_commands(name, block("console", "$ echo a\nb"))[0],
        "an output that goes on": run_commands(name, block("console", "$ echo a; echo b\na"))[0],
        "a command that fails": run_commands(name, block("console", "$ false"))[0],
        "a command that is not there": run_commands(name, block("console", "$ axle planted | head -0"))[0],
    }
    if PATCHES:
        chapter = next(iter(PATCHES))
        cases["another patch"] = faults_of_text(changed(chapter, "\n+", "\n+planted"), index)
    sound = faults_of_text(texts, index) + faults_of_tests(texts, passes)
    sound += run_commands(name, block("console", "$ echo a; echo b\na\nb\n$ seq 99999 | head -1\n1"))[0]
    missed = [what for what, faults in cases.items() if not faults]
    print(*[f"not found: {what}" for what in missed], *[f"found without a fault: {it}" for it in sound], sep="\n")
    print(f"{len(cases) - len(missed)} of {len(cases)} planted faults found")
    return bool(missed or sound)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
