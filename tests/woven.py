"""All mutants in one build: `tests/mutants.py --woven` uses this.

Each change is written beside the code that it replaces, behind a question to a number that an
environment variable sets: `(if woven(17) { (a) - (b) } else { (a) + (b) })`. So the tree is built
once, and a mutant costs the run of a few tests instead of a build. Two more things make it quick: a
first run of each test notes which mutants it reaches, and a mutant gets those tests alone, the ones
that caught its neighbours first.

What cannot be woven stays for the plain way: changes that confuse the compiler's inference, and
what is only evaluated while compiling.
"""

import bisect
import collections
import concurrent.futures
import itertools
import json
import os
import pathlib
import subprocess
import sys
import threading
import time

import quick
import tree_sitter
import tree_sitter_rust

ASK = "crate::woven::on"
# Asked at run time alone: a constant keeps its value. 0 is no mutant.
MODULE = """
//! Which mutant is on.
extern crate std;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
const COUNT: usize = %d;
const RECORDING: u32 = u32::MAX - 1;
const UNKNOWN: u32 = u32::MAX;
static CHOSEN: AtomicU32 = AtomicU32::new(UNKNOWN);
static SEEN: [AtomicBool; COUNT + 1] = [const { AtomicBool::new(false) }; COUNT + 1];
pub(crate) const fn on(n: u32) -> bool {
    core::intrinsics::const_eval_select((n,), compiling, running)
}
const fn compiling(_: u32) -> bool { false }
#[inline(always)]
fn running(n: u32) -> bool {
    let chosen = CHOSEN.load(Relaxed);
    if chosen < RECORDING { chosen == n } else { ask(n) }
}
#[cold]
fn ask(n: u32) -> bool {
    if CHOSEN.load(Relaxed) == UNKNOWN {
        let chosen = std::env::var("WOVEN").ok().and_then(|it| it.parse().ok()).unwrap_or(0);
        let is_recording = std::env::var_os("WOVEN_REACHED").is_some();
        CHOSEN.store(if is_recording { RECORDING } else { chosen }, Relaxed);
        return running(n);
    }
    if !SEEN[n as usize].swap(true, Relaxed) {
        use std::io::Write;
        let file = std::env::var_os("WOVEN_REACHED").unwrap();
        let file = std::fs::OpenOptions::new().append(true).create(true).open(file);
        let _ = file.and_then(|mut file| file.write_all(&n.to_le_bytes()));
    }
    false
}
"""
# Crates, and where they find the module. Proofs and fuzz targets borrow files of the library.
ROOTS = {
    "src/lib.rs": ("axlewire", "mod woven;"),
    "tests/exhaustive.rs": ("axlewire", '#[path = "../src/woven.rs"] mod woven;'),
    "tests/fuzz_seeds.rs": ("axlewire", '#[path = "../src/woven.rs"] mod woven;'),
    "examples/axle/src/main.rs": ("axle", "mod woven;"),
}
ATTRIBUTES = "#![feature(core_intrinsics, const_eval_select)] #![allow(internal_features)] "

# A test that takes so much longer than without a change waits for something that it prevents.
PATIENCE, LEAST_PATIENCE_S = 8, 2
# Tests that took longer have to fail twice: they use the real clock.
REAL_TIME_S = 1.0
# So much of the tests that reach a mutant, the quickest ones, is tried at first; all of them with
# `--survivors`.
FIRST_S = 15


class Edit:
    """Text around or before a part of a file. `write` is given what is inside, already woven."""

    def __init__(self, start, end, order, write):
        self.start, self.end, self.order, self.write = start, end, order, write


class File:
    """A source file with all its mutants that can be woven; `apart` has the others."""

    parser = tree_sitter.Parser(tree_sitter.Language(tree_sitter_rust.language()))

    def __init__(self, text, mutants):
        self.source = text.encode()
        self.tree = self.parser.parse(self.source)
        self.starts = [0]
        for line in text.split("\n"):
            self.starts.append(self.starts[-1] + len(line.encode()) + 1)
        self.lines = text.split("\n")
        self.mutants, self.apart = mutants, set()
        self.constant = {number for number, mutant in mutants if self.is_constant(mutant)}

    def is_constant(self, mutant):
        """Whether it may be evaluated while compiling."""
        place = self.at(mutant.span["start"])
        node = self.tree.root_node.descendant_for_byte_range(place, place)
        while node is not None:
            modifiers = [child for child in node.children if child.type == "function_modifiers"]
            if node.type in ("const_item", "static_item", "const_block") or any(b"const" in self.part(it) for it in modifiers):
                return True
            # The lengths in `[b' '; 2 * LEN]` and `first_chunk::<{ 2 * LEN }>()`.
            length = node.child_by_field_name("length")
            if node.type == "type_arguments" or length is not None and length.start_byte <= place < length.end_byte:
                return True
            node = node.parent
        return False

    def at(self, place):
        line = self.lines[place["line"] - 1]
        return self.starts[place["line"] - 1] + len(line[: place["column"] - 1].encode())

    def woven(self, without):
        """The text, and where in it which mutant's own code is: `(start, end, number)`."""
        wraps = collections.defaultdict(list)  # (start, end): [(number, its text)]
        guards = collections.defaultdict(list)  # (start, end): [(number, kind)]
        inserts = collections.defaultdict(list)  # place: [(before, number, its text, after)]
        for number, mutant in self.mutants:
            if number in without or number in self.apart:
                continue
            start, end = self.at(mutant.span["start"]), self.at(mutant.span["end"])
            if not self.weave(number, mutant, start, end, wraps, guards, inserts):
                self.apart.add(number)
        edits = []
        for (start, end), options in wraps.items():
            edits.append(Edit(start, end, 1, lambda inner, options=options: wrapped(inner, options)))
        for (start, end), options in guards.items():
            edits.append(Edit(start, end, 2, lambda inner, options=options: guarded(inner, options)))
        for place, pieces in inserts.items():
            text = [it for piece in pieces for it in piece]
            edits.append(Edit(place, place, 0, lambda inner, text=text: inner + text))
        edits.sort(key=lambda edit: (edit.start, edit.end > edit.start, -edit.end, -edit.order))
        pieces, rest = self.rendered(0, len(self.source), edits)
        assert not rest, f"{len(rest)} edits cross another"
        text, regions = bytearray(), []
        for piece in pieces:
            if isinstance(piece, tuple):
                number, own = piece
                regions.append((len(text), len(text) + len(own), number))
                text += own
            else:
                text += piece
        return bytes(text), regions

    def weave(self, number, mutant, start, end, wraps, guards, inserts):
        genre, replacement = mutant.genre, mutant.replacement.encode()
        ask = f"{ASK}({number})".encode()
        node = self.tree.root_node.descendant_for_byte_range(start, max(start, end - 1))
        if genre == "FnValue" and replacement == b"::std::iter::empty()":
            # The type of `impl Iterator` is that of the body: the same one without its items.
            inserts[start].append((b"core::iter::Iterator::filter({ ", (number, b""), b""))
            inserts[end].append((b" }, |_| !" + ask, (number, b""), b")"))
        elif genre == "FnValue" and replacement.startswith(b"::std::iter::"):
            return False
        elif genre == "FnValue":
            inserts[start].append((b"if " + ask + b" { ", (number, b"return " + replacement), b"; } "))
        elif genre == "BinaryOperator":
            while node.type not in ("binary_expression", "compound_assignment_expr"):
                node = node.parent
                if node is None:
                    return False
            left, right = node.child_by_field_name("left"), node.child_by_field_name("right")
            if not left.end_byte <= start < right.start_byte:
                return False
            own = b"(" + self.part(left) + b") " + replacement + b" (" + self.part(right) + b")"
            if node.type != "binary_expression":
                own = self.part(left) + b" " + replacement + b" " + self.part(right)
            wraps[node.start_byte, node.end_byte].append((number, own))
        elif genre == "UnaryOperator":
            while node.type not in ("unary_expression", "negative_literal"):
                node = node.parent
                if node is None:
                    return False
            if node.start_byte != start:
                return False
            wraps[node.start_byte, node.end_byte].append((number, self.source[end : node.end_byte]))
        elif genre == "StructField":
            # The value of the struct that the others come from.
            field = self.tree.root_node.descendant_for_byte_range(start, start)
            while field is not None and field.type not in ("field_initializer", "shorthand_field_initializer"):
                field = field.parent
            base = field and next((it for it in field.parent.children if it.type == "base_field_initializer"), None)
            if not base:
                return False
            own = b"(" + self.part(base)[2:].strip() + b")." + self.part(field).split(b":")[0].strip()
            value = field.child_by_field_name("value")
            if value is None:
                inserts[field.end_byte].append((b": if " + ask + b" { ", (number, own), b" } else { " + self.part(field) + b" }"))
            else:
                wraps[value.start_byte, value.end_byte].append((number, own))
        elif genre in ("MatchArm", "MatchArmGuard"):
            while node.type != "match_arm":
                node = node.parent
                if node is None:
                    return False
            pattern = node.child_by_field_name("pattern")
            guard = pattern.child_by_field_name("condition")
            if guard is not None:
                if guard.type in ("let_condition", "let_chain"):
                    return False
                kind = "never" if genre == "MatchArm" else replacement.decode()
                guards[guard.start_byte, guard.end_byte].append((number, kind))
            elif genre == "MatchArm":
                inserts[pattern.end_byte].append((b" if !" + ask, (number, b""), b" "))
            else:
                return False
        else:
            return False
        return True

    def part(self, node):
        return self.source[node.start_byte : node.end_byte]

    def rendered(self, start, end, edits):
        """Pieces of `start..end`: bytes, and `(number, bytes)` for a mutant's own code."""
        pieces, place = [], start
        while edits and edits[0].start < end and edits[0].end <= end:
            edit = edits[0]
            pieces.append(self.source[place : edit.start])
            inner, edits = self.rendered(edit.start, edit.end, edits[1:]) if edit.end > edit.start else ([], edits[1:])
            pieces += edit.write(inner)
            place = edit.end
        pieces.append(self.source[place:end])
        return pieces, edits


def wrapped(inner, options):
    pieces = [b"("]
    for number, own in options:
        pieces += [f"if {ASK}({number}) {{ ".encode(), (number, own), b" } else "]
    return pieces + [b"{ ", *inner, b" })"]


def guarded(inner, options):
    pieces = [b"("]
    for number, kind in options:
        pieces += [f"{ASK}({number}) || ".encode() if kind == "true" else f"!{ASK}({number}) && (".encode(), (number, b"")]
        if kind == "true":
            pieces.append(b"(")
    return pieces + [b"(", *inner, b")"] + [b")"] * len(options) + [b")"]


class Build:
    """The woven tree, built; says which mutants are unviable and which have to be tried apart."""

    def __init__(self, tree, target, mutants, packages):
        self.tree, self.target, self.mutants, self.packages = tree, target, mutants, packages
        self.unviable, self.apart = set(), set()
        self.roots = {root: (tree / root).read_text() for root in ROOTS}
        self.files = {}
        of_file = collections.defaultdict(list)
        for number, mutant in enumerate(mutants, 1):
            of_file[mutant.file].append((number, mutant))
        for file, its in of_file.items():
            self.files[file] = File((tree / file).read_text(), its)

    def environment(self):
        crates = "axlewire,axle,exhaustive,fuzz_seeds"
        return quick.build_environment(self.target) | {"RUSTC_BOOTSTRAP": crates}

    def write(self):
        """Writes all files; returns their regions."""
        regions = {}
        for name, file in self.files.items():
            text, regions[name] = file.woven(self.unviable | self.apart)
            (self.tree / name).write_bytes(text)
            self.apart |= file.apart
        for root, (package, module) in ROOTS.items():
            if package not in self.packages:
                continue
            path = self.tree / root
            text = path.read_text() if root in self.files else self.roots[root]
            path.write_text(ATTRIBUTES + text + f"\n{module}\n")
            if module == "mod woven;":
                (path.parent / "woven.rs").write_text(MODULE % len(self.mutants))
        return regions

    def cargo(self, *words):
        run = subprocess.run(["cargo", *words, "--keep-going", "--message-format=json"], cwd=self.tree, env=self.environment(),
                             stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        return run.returncode, [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]

    def settle(self, commands):
        """Builds until no mutant stops the compiler; returns the test programs of all packages."""
        programs = {}
        for words in commands:
            while True:
                regions = self.write()
                code, messages = self.cargo(*words)
                if code == 0:
                    break
                self.drop(regions, messages)
            programs |= {m["executable"]: (m["package_id"], m["target"]["name"], m["executable"]) for m in messages
                         if m["reason"] == "compiler-artifact" and m["profile"]["test"] and m["executable"]}
        return list(programs.values())

    def drop(self, regions, messages):
        """Takes out what the compiler complains about."""
        before = len(self.unviable) + len(self.apart)
        unexplained = []
        for message in messages:
            if message["reason"] != "compiler-message" or message["message"]["level"] != "error":
                continue
            spans = [span | {"file_name": os.path.normpath(span["file_name"])} for span in message["message"]["spans"]]
            spans = [span for span in spans if span["file_name"] in regions]
            blamed = {number for span in spans for start, end, number in regions[span["file_name"]]
                      if start <= span["byte_start"] and span["byte_end"] <= end + 1}
            self.unviable |= blamed
            if not blamed:
                unexplained += [(span, message["message"]["rendered"]) for span in spans]
        if len(self.unviable) + len(self.apart) > before:
            print(f"{len(self.unviable)} do not compile, {len(self.apart)} apart", flush=True)
            return
        # The weaving itself is the fault: what is on these lines is tried the plain way.
        for span, rendered in unexplained:
            print(rendered, flush=True)
            file = self.files[span["file_name"]]
            self.apart |= {number for number, mutant in file.mutants if number not in self.unviable
                           and mutant.span["start"]["line"] <= span["line_end"]
                           and mutant.span["end"]["line"] >= span["line_start"]}
        if len(self.unviable) + len(self.apart) == before:
            for _, rendered in unexplained[:3]:
                print(rendered)
            sys.exit("the woven tree does not compile")
        print(f"{len(self.unviable)} do not compile, {len(self.apart)} apart", flush=True)


class Test:
    """One test of a test program."""

    def __init__(self, package_path, program, name):
        self.at, self.program, self.name = package_path, program, name
        self.took_s, self.reaches, self.passes = 0.0, set(), False

    def run(self, extra, patience_s):
        """`passed`, `failed` or `late`."""
        # A test that a mutant fails is not to be run eight times because the machine is busy.
        environment = os.environ | {"CARGO_MANIFEST_DIR": str(self.at), "AXLEWIRE_ATTEMPTS": "2",
                                    "PROPTEST_DISABLE_FAILURE_PERSISTENCE": "1"} | extra
        code, _ = quick.finish([self.program, "--exact", self.name, "--test-threads=1"], patience_s,
                               cwd=self.at, env=environment, preexec_fn=quick.limit_memory)
        return "late" if code is None else "passed" if code == 0 else "failed"

    def learn(self, directory, number):
        """What it reaches, how long it takes, and whether it passes in the woven tree."""
        file, known = directory / f"{number}.reached", directory / f"{number}.json"
        key = [self.program, os.stat(self.program).st_mtime_ns, self.name]
        if known.exists() and (entry := json.loads(known.read_text()))["key"] == key:
            self.took_s, self.passes = entry["took_s"], entry["passes"]
        else:
            file.unlink(missing_ok=True)
            begin = time.monotonic()
            self.passes = self.run({"WOVEN_REACHED": str(file)}, 600) == "passed"
            self.took_s = time.monotonic() - begin
            # The record itself takes memory, which a few tests count.
            self.passes = self.passes or self.run({"WOVEN": "0"}, 600) == "passed"
            known.write_text(json.dumps({"key": key, "took_s": self.took_s, "passes": self.passes}))
        data = file.read_bytes() if file.exists() else b""
        self.reaches = {int.from_bytes(data[i : i + 4], "little") for i in range(0, len(data), 4)}


def tests_of(programs, tree):
    """All tests that are not ignored."""
    paths = {"axlewire": tree, "axle": tree / "examples" / "axle"}
    tests = []
    for package, _, program in programs:
        path = next(path for name, path in reversed(paths.items()) if f"/{name}#" in package or f"#{name}@" in package)
        listed = subprocess.run([program, "--list", "--format=terse"], cwd=path, check=True, stdout=subprocess.PIPE, text=True).stdout
        ignored = subprocess.run([program, "--list", "--format=terse", "--ignored"], cwd=path, check=True,
                                 stdout=subprocess.PIPE, text=True).stdout.splitlines()
        for line in listed.splitlines():
            if line.endswith(": test") and line not in ignored:
                tests.append(Test(path, program, line.removesuffix(": test")))
    return tests


def run(build, tests, numbers, until, workers, keep, is_patient):
    """Tries these mutants; `keep(number, outcome, why)` hears of each."""
    reaching = collections.defaultdict(list)
    for test in sorted(tests, key=lambda test: test.took_s):
        for number in test.reaches if test.passes else ():
            reaching[number].append(test)
    for number, own in reaching.items():
        # At least the quickest one of those that reach it.
        spent_s = list(itertools.accumulate(test.took_s for test in own))
        if not is_patient:
            reaching[number] = own[: max(1, bisect.bisect(spent_s, FIRST_S))]
    killers = collections.defaultdict(collections.deque)  # file: tests that caught the latest ones
    queue, lock = collections.deque(numbers), threading.Lock()

    constant = {number for file in build.files.values() for number in file.constant}

    def outcome(number):
        mutant = build.mutants[number - 1]
        own = reaching[number]
        if not own and number in constant:
            return "apart", "only evaluated while compiling"
        first = [test for test in list(killers[mutant.file]) if number in test.reaches][:6]
        for test in first + [test for test in own if test not in first]:
            patience_s = LEAST_PATIENCE_S + PATIENCE * test.took_s
            result = test.run({"WOVEN": str(number)}, patience_s)
            if result == "failed" and test.took_s > REAL_TIME_S:
                result = test.run({"WOVEN": str(number)}, patience_s)
            if result != "passed":
                with lock:
                    recent = killers[mutant.file]
                    if test in recent:
                        recent.remove(test)
                    recent.appendleft(test)
                    while len(recent) > 12:
                        recent.pop()
                return "caught", test.name
        return "survived", f"{len(own)} tests reach it"

    def work():
        while time.monotonic() < until:
            try:
                number = queue.popleft()
            except IndexError:
                return
            result, why = outcome(number)
            with lock:
                keep(number, result, why)

    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(work) for _ in range(workers)]:
            done.result()
