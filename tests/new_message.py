#!/usr/bin/env python3
"""Adds a message of its own to a copy of the tree, and shows that one file is all it takes.

    tests/new_message.py              apply the patch, build library and tool, and prove the message
    tests/new_message.py --planted    spoil the patch in several ways, and see each found

`tests/new_message/added.patch` adds the message, a lamp with an invented id, as a program that
speaks a UCP of its own would. It may change one file of what is published: this counts. The guide
shows the same patch. Then `tests/new_message/proof.rs` runs in the copy: bytes, decoding, text,
data, roles. The tool of the copy decodes the message by name. Three tests in `tests/ucp` that have
ruling U4 once more fail in the copy: an id that the ruling does not have is noticed.

Exit status 1 if something is not as said here.
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT / "tests" / "new_message"
COPY = ROOT / "target" / "new_message" / "tree"
BUILD = ROOT / "target" / "new_message" / "build"
TABLE = "src/ucp/catalogue.rs"
# Tests of the ruling, which an added message fails.
NOTICING = ["frames::a_raw_frame_with_a_known_id_is_refused_and_any_other_is_sent",
            "messages::every_id_and_body_length_is_its_message_or_unknown_and_never_misread",
            "messages::only_the_ids_of_ruling_u4_are_known"]
# Fewer tests mean that the proof was not run.
LEAST_TESTS = 7
# A message of each direction, without its CRC, and what the tool says of it.
FRAMES = ["fdff08004207" "5001dc05", "fdff09004202" "1900fdff00"]
DATA = [
    {"event": "frame", "offset": 0, "length": 12, "protocol": "ucp", "message": "set_lamp", "id": 66,
     "index": 7, "brightness_pct": 80, "colour": 1, "time_ms": 1500},
    {"event": "frame", "offset": 12, "length": 13, "protocol": "ucp", "message": "lamp_state", "id": 66,
     "index": 2, "temperature_c": [25, -3], "err": 0},
]
# Its tables, with the columns of the first line and those that all messages have.
TABLES = {"ucp.set_lamp.csv": ["offset,length,id,index,brightness_pct,colour,time_ms,bytes", "0,12,66,7,80,1,1500,"],
          "ucp.lamp_state.csv": ["offset,length,id,index,temperature_c_0,temperature_c_1,err,bytes", "12,13,66,2,25,-3,0,"]}
COLUMNS = ["ucp.set_lamp,length,byte,u8", "ucp.set_lamp,time_ms,unknown,i64", "ucp.lamp_state,temperature_c_1,unknown,i64"]
TEXT = ["12 set_lamp 7 brightness 80 %, red, time 1500 ms", "13 lamp_state 2 temperature 25 -3 C, fine"]

# What is spoilt, the text in the patch, its replacement, and what is then said.
CHECK, TEST, COUNT = "check", "test", "count"
SPOILT = [
    (CHECK, "two bodies of one length", "[[u8; 2]; 2] as [i16; 2]", "[u8; 3] as [u8; 3]", "Lamp: two bodies have one length"),
    (CHECK, "a body of 57 bytes", "[[u8; 2]; 2] as [i16; 2]", "[[u8; 2]; 28] as [i16; 28]", "or one is too long"),
    (CHECK, "an id that is taken", "Lamp = 0x42", "Lamp = 0x0A", "`10` assigned more than once"),
    (CHECK, "a key that every frame has", '= "colour"', '= "index"', "cannot be used: index"),
    (CHECK, "a unit that is not ASCII", 'in "C"', 'in "\u00b0C"', "unit or key of LampState"),
    (CHECK, "a direction that does not exist", 'to_robot "set_lamp"', 'to_rover "set_lamp"', "no rules expected"),
    (CHECK, "a value without a description", "+                    /// For how long, milliseconds.\n", "", "missing documentation"),
    (CHECK, "a value wider than its bytes", "[u8; 2] as u16", "[u8; 2] as u32", "mismatched types"),
    (TEST, "another unit", 'in "%"', 'in "percent"', "it_prints_its_values_with_their_units"),
    (TEST, "another key", '"time_ms"', '"time"', "it_is_data_with_the_keys_of_its_fields"),
    (TEST, "the other direction", 'to_host "lamp_state"', 'to_robot "lamp_state"', "it_has_its_id_its_name_and_its_direction"),
    (COUNT, "a second file", "", "--- a/src/stats.rs\n+++ b/src/stats.rs\n@@ -1,1 +1,2 @@\n+// Planted.\n {first}\n", "changed 2 files"),
]


class Wrong(Exception):
    """What is not as it should be, for people."""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--planted", action="store_true")
    args = parser.parse_args()
    began = time.monotonic()
    try:
        said = planted() if args.planted else proven()
    except Wrong as wrong:
        print(wrong, file=sys.stderr)
        return 1
    print(f"{said}, {time.monotonic() - began:.0f} s")
    return 0


def proven():
    """Builds and runs all of it: what it found."""
    changed, added = applied((FOLDER / "added.patch").read_text())
    of_docs = pages()
    tests = tests_pass()
    rulings_notice()
    tool_tells()
    return (f"a message of its own: {changed} file, {added} lines added, none changed; {tests} tests, "
            f"{len(DATA)} lines of JSON; {of_docs} pages show it")


def planted():
    """Spoils the patch and sees that each is found."""
    patch, spared = (FOLDER / "added.patch").read_text(), []
    first = (ROOT / "src/stats.rs").read_text().split("\n")[0]
    for kind, what, old, new, expected in SPOILT:
        if old and patch.count(old) != 1:
            raise Wrong(f"{what}: {old!r} is {patch.count(old)} times in the patch")
        spoilt = recounted(patch.replace(old, new)) if old else patch + new.format(first=first)
        try:
            applied(spoilt)
            {CHECK: library_compiles, TEST: tests_pass, COUNT: lambda: None}[kind]()
            spared.append(what)
        except Wrong as wrong:
            print(f"{what}: {'found' if expected in str(wrong) else 'NOT THIS: ' + str(wrong)}")
            if expected not in str(wrong):
                spared.append(what)
    if spared:
        raise Wrong(f"not found: {', '.join(spared)}")
    return f"{len(SPOILT)} of {len(SPOILT)} found"


def applied(patch):
    """Makes the copy anew with this patch: how many files it changed, how many lines it added."""
    names = git("ls-files", "-z", "-co", "--exclude-standard", cwd=ROOT).split("\0")
    known = {name for name in names if name and (ROOT / name).is_file()}
    for old in [path for path in COPY.rglob("*") if path.is_file()]:
        if str(old.relative_to(COPY)) not in known:
            old.unlink()
    for name in known:
        # What is the same stays, and is not built again.
        if not same(name):
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, COPY / name)
    git("apply", "-", cwd=COPY, text=patch)
    changed = sorted(name for name in known if not same(name))
    if changed != [TABLE]:
        raise Wrong(f"the patch changed {len(changed)} files, not {TABLE} alone: {', '.join(changed)}")
    if removed := [line for line in patch.split("\n") if line.startswith("-") and not line.startswith("---")]:
        raise Wrong(f"the patch does not only add lines: {removed[0]}")
    shutil.copyfile(FOLDER / "proof.rs", COPY / "tests" / "new_message.rs")
    return len(changed), len(additions(patch))


def same(name):
    return (COPY / name).is_file() and (COPY / name).read_bytes() == (ROOT / name).read_bytes()


def additions(patch):
    return [line[1:] for line in patch.split("\n") if line.startswith("+") and not line.startswith("+++")]


def recounted(patch):
    """With the numbers of lines that its parts have after a change."""
    parts = re.split(r"(?m)^(@@ .*)$\n", patch)
    for at in range(1, len(parts), 2):
        lines = parts[at + 1].rstrip("\n").split("\n")
        old, new = (sum(line[:1] in (" ", sign) for line in lines) for sign in "-+")
        parts[at] = re.sub(r"-(\d+),\d+ \+(\d+),\d+", rf"-\1,{old} +\2,{new}", parts[at]) + "\n"
    return "".join(parts)


def pages():
    """How many pages of the guide show the patch; one that shows another is wrong."""
    texts = {page: page.read_text() for page in sorted((ROOT / "src" / "guide").glob("*.md"))}
    shown = {page: re.findall(r"(?ms)^```diff\n(.*?)^```$", text) for page, text in texts.items()}
    of_table = {page: diffs for page, diffs in shown.items() if any(TABLE in diff for diff in diffs)}
    added = additions((FOLDER / "added.patch").read_text())
    for page, diffs in of_table.items():
        if all(additions(diff) != added for diff in diffs):
            raise Wrong(f"{page.relative_to(ROOT)} shows another patch than tests/new_message/added.patch")
    return len(of_table)


def library_compiles():
    cargo("check", "-p", "axlewire", "--lib")


def tests_pass():
    """Runs the proof: the number of its tests."""
    out = cargo("test", "-p", "axlewire", "--test", "new_message")
    passed = re.search(r"test result: ok\. (\d+) passed", out)
    if not passed or int(passed[1]) < LEAST_TESTS:
        raise Wrong(f"the proof was not run:\n{out}")
    return int(passed[1])


def rulings_notice():
    """The tests that repeat ruling U4 fail, and no other of theirs."""
    try:
        cargo("test", "-p", "axlewire", "--test", "ucp")
        failed = []
    except Wrong as wrong:
        failed = sorted(re.findall(r"(?m)^---- (\S+) stdout ----$", str(wrong)))
    if failed != NOTICING:
        raise Wrong(f"of tests/ucp fail {failed}, expected {NOTICING}")


def tool_tells():
    """The tool decodes the message by its name, as data and as text, and exports it."""
    cargo("build", "-p", "axle", "--no-default-features", "--bin", "axle")
    frames = [bytes.fromhex(frame) for frame in FRAMES]
    frames = [frame + crc(frame).to_bytes(2, "little") for frame in frames]
    capture = COPY.parent / "lamp.bin"
    capture.write_bytes(b"".join(frames))
    axle = [str(BUILD / "debug" / "axle"), "decode", "--protocol", "ucp"]
    lines = [json.loads(line) for line in ran([*axle, "--json", str(capture)]).splitlines()]
    expected = [data | {"bytes": frame.hex()} for data, frame in zip(DATA, frames)]
    if lines[:-1] != expected or lines[-1]["frames"] != len(frames) or lines[-1]["skipped"]:
        raise Wrong(f"axle decode --json says {lines}, expected {expected} and a summary")
    text = " ".join(ran([*axle, str(capture)]).split())
    if missing := [words for words in TEXT if words not in text]:
        raise Wrong(f"axle decode does not say {missing[0]!r}:\n{text}")
    tool_exports(axle[0], capture, frames)


def tool_exports(axle, capture, frames):
    """The tool exports the message, although its schema does not have it."""
    table, lines = COPY.parent / "lamp.csv", COPY.parent / "lamp.jsonl"
    shutil.rmtree(table, ignore_errors=True)
    lines.unlink(missing_ok=True)
    for output in (table, lines):
        ran([axle, "export", "--protocol", "ucp", str(capture), "-o", str(output)])
    if lines.read_text() != ran([axle, "decode", "--protocol", "ucp", "--json", str(capture)]):
        raise Wrong(f"axle export to JSON lines says {lines.read_text()}")
    for (name, (titles, row)), frame in zip(TABLES.items(), frames):
        if (told := (table / name).read_text()) != (expected := f"{titles}\n{row}{frame.hex()}\n"):
            raise Wrong(f"axle export to {name} says {told}, expected {expected}")
    told = (table / "columns.csv").read_text()
    if missing := [column for column in COLUMNS if column not in told.splitlines()]:
        raise Wrong(f"axle export does not list {missing[0]}:\n{told}")


def crc(frame):
    """CRC-16/MODBUS."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


def cargo(command, *options):
    """Its output. A warning of the library is an error, as in the gate."""
    environment = os.environ | {
        "CARGO_TARGET_DIR": str(BUILD), "CARGO_TERM_COLOR": "never", "CARGO_PROFILE_DEV_DEBUG": "none",
        "CARGO_INCREMENTAL": "1"}
    out = ran(["cargo", command, "--locked", "--quiet", *options], cwd=COPY, env=environment)
    if "axlewire" in options and "warning: " in out:
        raise Wrong(f"cargo {command} warns:\n{out}")
    return out


def git(*words, cwd, text=None):
    # The copy is no repository, although it is in one.
    environment = os.environ | {"GIT_CEILING_DIRECTORIES": str(COPY.parent)}
    return ran(["git", *words], cwd=cwd, env=environment, input=text)


def ran(command, **options):
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    if run.returncode:
        raise Wrong(f"{' '.join(map(str, command))} failed:\n{run.stdout}")
    return run.stdout


if __name__ == "__main__":
    sys.exit(main())
