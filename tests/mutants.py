#!/usr/bin/env python3
"""Changes one expression at a time, and shows that a test fails for each.

    tests/mutants.py                      goes on where the last run ended, until all are tried
    tests/mutants.py --minutes 60         for an hour; --workers 2 tries two at a time
    tests/mutants.py --file 'src/ucp/**'  only these files; --again tries what has been tried, too
    tests/mutants.py --shuffled           in another order each time: a sample, with --minutes
    tests/mutants.py --woven              all in one build, many times quicker; see tests/woven.py
    tests/mutants.py --survivors          tries again what survived without a reason
    tests/mutants.py --sample             a sample of the mutants of the last commit, for the gate
    tests/mutants.py --table              prints the score of each module
    tests/mutants.py --check              the record is whole, each survivor has a reason that fits;
                                          names the files that are not on record

`cargo mutants` lists the changes. Each is made in a copy of the tree; first the unit tests run,
then those that concern its file; at the end all tests of the package, for those that had passed.
`tests/mutants.txt` has the outcome of each file, and the reason of each survivor that has no
effect. A file whose entry was changed by hand, but for a reason, counts as not tried.

Exit status 1 if a change survives without a reason.
"""

import argparse
import collections
import concurrent.futures
import datetime
import fnmatch
import hashlib
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import time

import quick

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / ".ci"))
from ledger import short_sha  # noqa: E402

RECORD = ROOT / "tests" / "mutants.txt"
WORK = ROOT / "target" / "mutants"
# Tests that take so many times as long as without a change wait for something that it prevents.
PATIENCE = 4
LEAST_PATIENCE_S = 60
# The compiler has no reason to take longer.
BUILD_S = 1200
# A file of which no more are left is recorded with those; the rest of it need not be tried again.
MOST_LEFT, NOT_TRIED = 40, "(not tried)"
# Fewer words are no reason.
LEAST_WORDS = 3

# The features of the tool that bring libraries along.
FORMATS = "--features mcap,parquet,plot"
# Files, and the tests that concern them most; the first match counts.
CONCERNED = [
    ("src/crc16/*", "--lib --test crc16 --test vectors"),
    ("src/ikeya/master/*", "--lib --test ikeya_roles --test drivers --test motion"),
    ("src/ikeya/slave/*", "--lib --test ikeya_roles --test adverse"),
    ("src/ikeya/board.rs", "--lib --test ikeya_roles --test vectors"),
    ("src/ikeya/batch/*", "--test simd --test stream --test crowds"),
    ("src/ikeya/framing.rs", "--lib --test stream --test crowds"),
    ("src/ikeya/judge.rs", "--lib --test stream --test ikeya"),
    ("src/ikeya/*", "--lib --test ikeya --test layout --test vectors"),
    ("src/ucp/host/*", "--lib --test ucp_roles --test drivers --test motion"),
    ("src/ucp/robot/*", "--lib --test ucp_roles --test adverse"),
    ("src/ucp/batch.rs", "--test simd --test stream --test crowds"),
    ("src/ucp/framing.rs", "--lib --test stream --test crowds"),
    ("src/ucp/*", "--lib --test ucp --test layout --test vectors --test ucp_roles"),
    ("src/stream/*", "--lib --test stream --test captures --test simd --test io"),
    ("src/sim/*", "--lib --test sim --test roles"),
    ("src/drive/tokio.rs", "--features tokio --test ports"),
    ("src/drive/serial_port.rs", "--features tokio --test ports"),
    ("src/drive/tty.rs", "--features tokio --test ports"),
    ("src/drive/*", "--lib --test drivers --test ports"),
    ("src/io/*", "--test io"),
    ("src/text/*", "--lib --test printing"),
    ("src/*", "--lib --test drivers --test ikeya_roles --test ucp_roles --test printing"),
    # On simulated lines; the word is the name of a module of tests, and of the file's own tests.
    ("examples/axle/src/bus*", "--bins --test ports stop"),
    ("examples/axle/src/calibrate.rs", "--bins --test ports rover"),
    ("examples/axle/src/drive*", "--bins --test ports drive"),
    ("examples/axle/src/rover*", "--bins --test ports rover"),
    ("examples/axle/src/spin/*", "--bins --test ports spin"),
    ("examples/axle/src/stop*", "--bins --test ports stop"),
    ("examples/axle/src/decode/*", "--bins --test decode --test whole --test summed --test times"),
    ("examples/axle/src/input.rs", "--bins --test ports progress"),
    ("examples/axle/src/sim/*", "--bins --test ports rover"),
    ("examples/axle/src/play/*", "--bins --test ports replay"),
    ("examples/axle/src/watch/*", "--bins --test ports page"),
    ("examples/axle/src/export/*", f"{FORMATS} --bins --test export"),
    ("examples/axle/src/tables*", f"{FORMATS} --bins --test export"),
    ("examples/axle/src/beside.rs", f"{FORMATS} --bins --test export"),
    ("examples/axle/src/plot/*", f"{FORMATS} --bins --test plot"),
    ("examples/axle/src/extcap/*", "--bins --test ports extcap"),
    ("examples/axle/src/*", "--bins"),
    ("examples/firmware/src/*", "--test firmware"),
]
# Modules of the tool that are built for its tests alone, under a longer `cfg` than `cargo mutants`
# knows.
OF_TESTS = ("examples/axle/src/flaky.rs", "examples/axle/src/played.rs")
# The images for QEMU. What they run is tried; what `bench.sh` and `no_panic.sh` build is not.
FIRMWARE = "axlewire-firmware"
IMAGES = ("ikeya_slave", "ikeya_master", "ucp_robot", "uart_check")
IN_QEMU = re.compile("examples/firmware/src/(?!bin/(bench|size_|no_panic|planted_|soak_)|work)")
# Where its files are.
FOLDERS = ("src", "examples/axle/src", "examples/firmware/src")
# What runs at the end if those pass: everything of the package.
ALL = {
    "axlewire": "--lib --tests --features tokio",
    # Those that `--tests` leaves out, too.
    "axle": f"{FORMATS} --bins --test *",
    FIRMWARE: "--test firmware",
}
UNIT_TESTS = {"axlewire": ALL["axlewire"], "axle": f"{FORMATS} --tests"}


class Mutant:
    """A change of one expression, as `cargo mutants` lists it."""

    def __init__(self, listed, source):
        self.file, self.package = listed["file"], listed["package"]
        self.span, self.replacement, self.genre = listed["span"], listed["replacement"], listed["genre"]
        change = listed["name"].split(": ", 1)[1]
        self.line = self.span["start"]["line"]
        # Without its place, so that it is the same after lines were added above.
        self.key = f"{change} | {source.split(chr(10))[self.line - 1].strip()}"
        self.name = f"{self.file}:{self.line}: {self.key}"

    def applied(self, source):
        lines = source.split("\n")
        start, end = self.span["start"], self.span["end"]
        head = lines[: start["line"] - 1] + [lines[start["line"] - 1][: start["column"] - 1]]
        tail = [lines[end["line"] - 1][end["column"] - 1 :]] + lines[end["line"] :]
        return "\n".join(head) + self.replacement + "\n".join(tail)


def is_changed(file):
    """Whether it changes this file, by its name: what is tested, not what tests."""
    is_firmware = file.startswith("examples/firmware/")
    # The tool borrows modules of the tests, and has some of its own.
    is_of_tests = re.search(r"(^|/)tests(/|\.rs$)", file) or file in OF_TESTS
    return file.endswith(".rs") and not is_of_tests and (not is_firmware or bool(IN_QEMU.match(file)))


def sources():
    """All files that it changes, and those in which there is nothing to change."""
    files = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", *FOLDERS], cwd=ROOT, check=True,
                           stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return [file for file in sorted(set(files)) if is_changed(file) and (ROOT / file).is_file()]


def listed(*options):
    """All mutants of library, tool and firmware by file; one key is listed once."""
    def items(*words):
        out = subprocess.run(["cargo", "mutants", "--list", "--json", *words, *options],
                             cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
        return json.loads(out or "[]")
    # A sample of a change has no time for QEMU.
    firmware = [] if options else items("--manifest-path", "examples/firmware/Cargo.toml")
    for item in firmware:
        item["file"] = "examples/firmware/" + item["file"]
    sources = {}
    mutants, seen = [], collections.Counter()
    for item in items("-p", "axlewire", "-p", "axle") + firmware:
        file = item["file"]
        if not is_changed(file):
            continue
        if file not in sources:
            sources[file] = (ROOT / file).read_text()
        mutant = Mutant(item, sources[file])
        # A module of tests under a longer `cfg` than `cargo mutants` knows.
        if (tests := re.search(r"^(pub\(crate\) )?mod tests \{", sources[file], re.M)):
            if mutant.line > sources[file].count("\n", 0, tests.start()):
                continue
        seen[file, mutant.key] += 1
        if (count := seen[file, mutant.key]) > 1:
            mutant.key += f" ({count})"
        mutants.append(mutant)
    return mutants


class Tree:
    """A copy of the files known to git, with a build directory of its own."""

    def __init__(self, number, until):
        self.path, self.target, self.until = WORK / f"tree{number}", WORK / f"target{number}", until
        self.path.mkdir(parents=True, exist_ok=True)
        self.took_s = {}  # tests: how long they run without a change
        self.latest_s = 0.0
        files = subprocess.run(["git", "ls-files", "-z", "-co", "--exclude-standard"], cwd=ROOT,
                               check=True, stdout=subprocess.PIPE, text=True).stdout
        known = {file for file in files.split("\0") if file and (ROOT / file).is_file()}
        for old in [path for path in self.path.rglob("*") if path.is_file()]:
            if str(old.relative_to(self.path)) not in known:
                old.unlink()
        for file in known:
            copy = self.path / file
            if not copy.is_file() or copy.read_bytes() != (ROOT / file).read_bytes():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / file, copy)

    def outcome(self, mutant, tests):
        """`caught`, `unviable`, `survived`, or `undecided` if the time is up."""
        file = self.path / mutant.file
        source = file.read_text()
        file.write_text(mutant.applied(source))
        try:
            return self.test(mutant.package, tests)
        finally:
            file.write_text(source)

    def test(self, package, tests):
        """Whether a test fails, or never ends; `unviable` if the tree does not compile."""
        command = ["cargo", "test", "--quiet", "-p", package, *tests.split()]
        options = {"cwd": self.path, "env": quick.build_environment(self.target)}
        builds = [[*command, "--no-run"]]
        if package == FIRMWARE:
            # The tests of the library build and run the images.
            command[4] = "axlewire"
            options["env"] |= {"AXLEWIRE_FIRMWARE": "required"}
            builds = [["bash", "examples/firmware/run.sh", "--build", *IMAGES], [*command, "--no-run"]]
        for build in builds:
            status, errors = quick.finish(build, min(BUILD_S, self.left_s()), **options)
            if status is None and self.left_s() == 0:
                return "undecided"
            if status != 0:
                if "could not compile" not in errors:
                    sys.exit(f"`{' '.join(build)}` fails in {self.path}: {errors}")
                return "unviable"
        patience_s = max(LEAST_PATIENCE_S, PATIENCE * self.took_s.get(tests, 1000))
        begin = time.monotonic()
        status, _ = quick.finish(command, min(patience_s, self.left_s()), preexec_fn=quick.limit_memory, **options)
        self.latest_s = time.monotonic() - begin
        if status is None and self.left_s() == 0:
            return "undecided"
        return "survived" if status == 0 else "caught"

    def left_s(self):
        return max(0, self.until - time.monotonic())

    def check_unchanged(self, package, tests):
        """Without a change these tests pass. Notes how long they run."""
        if tests in self.took_s:
            return
        outcome = self.test(package, tests)
        if outcome in ("caught", "unviable"):
            sys.exit(f"without a change, `cargo test -p {package} {tests}` fails in {self.path}")
        self.took_s[tests] = self.latest_s


def concerned(file):
    return next(tests for pattern, tests in CONCERNED if fnmatch.fnmatch(file, pattern))


def stages(mutant, is_sample):
    """The tests to run one after the other until one fails: those that are built quickest first."""
    tests = concerned(mutant.file)
    # In a sample there are too few mutants for what it takes to build each stage once.
    units = [kind for kind in ("--lib", "--bins") if tests.startswith(f"{kind} ") and not is_sample]
    return dict.fromkeys([*units, tests, ALL[mutant.package]])


def digest(file):
    """Of what can be mutated: not of a module of tests at the end."""
    code = re.split(r"^#\[cfg\((?:all\()?test\b.*\n(?:pub\(crate\) )?mod tests \{", (ROOT / file).read_text(), maxsplit=1, flags=re.M)[0]
    return hashlib.sha256(code.encode()).hexdigest()[:12]


class Record:
    """The outcome of each file: in full in the build directory, for readers in `mutants.txt`."""

    def __init__(self):
        self.reasons = {}  # (file, key): why the change has no effect
        self.lines = {}  # file: (digest, counts, date)
        self.left = collections.defaultdict(set)  # file: keys that are not in its counts
        self.empty = set()  # files in which there is nothing to change
        seals = {}
        self.state_file = WORK / "outcomes.json"
        self.state = json.loads(self.state_file.read_text()) if self.state_file.exists() else {}
        file = key = None
        for line in RECORD.read_text().splitlines() if RECORD.exists() else []:
            if match := re.fullmatch(r"(\S+\.rs) (\w+): (\d+) caught, (\d+) unviable, (\d+) survived, ([\d-]+)(?:, (\w+))?", line):
                file = match[1]
                seals[file] = match[7]
                self.lines[file] = (match[2], [int(match[i]) for i in (3, 4, 5)], match[6])
            elif match := re.fullmatch(r"(\S+\.rs): not done", line):
                file = match[1]
            elif match := re.fullmatch(r"(\S+\.rs): nothing to change", line):
                self.empty.add(match[1])
            elif line == f"        {NOT_TRIED}":
                # A reason for it may be known.
                if not self.reasons[file, key]:
                    del self.reasons[file, key]
                self.left[file].add(key)
            elif line.startswith("        "):
                self.reasons[file, key] = line.strip()
            elif line.startswith("    "):
                key = line.strip()
                self.reasons.setdefault((file, key), "")
        # Their counts are worth nothing.
        self.broken = [file for file in self.lines if seals[file] != self.seal(file)]
        for file in self.broken:
            del self.lines[file]

    def seal(self, file):
        """The SHA-256 of all that its entry says, but for the reasons."""
        survived = sorted(key for (of, key), why in self.reasons.items() if of == file and why and key not in self.left[file])
        return short_sha([file, *self.lines[file], survived, sorted(self.left[file])])

    def not_tried(self):
        """The files of which it says nothing, such as new ones."""
        return [file for file in sources() if file not in self.lines and file not in self.empty]

    def outcomes(self, file):
        """By key; empty if the file has changed since."""
        entry = self.state.get(file, {})
        return entry.get("outcomes", {}) if entry.get("digest") == digest(file) else {}

    def has_line(self, file):
        """Whether the file has a line, of this or another machine, and has not changed since."""
        return file in self.lines and (ROOT / file).exists() and self.lines[file][0] == digest(file)

    def is_done(self, file):
        return self.has_line(file) and not self.left[file]

    def is_tried(self, mutant):
        """Whether it is in the counts of its file."""
        return self.has_line(mutant.file) and mutant.key not in self.left[mutant.file]

    def keep(self, mutant, outcome, save=True):
        known = self.outcomes(mutant.file) | {mutant.key: outcome}
        self.state[mutant.file] = {"digest": digest(mutant.file), "outcomes": known}
        if save:
            self.save()

    def forget(self, mutant):
        self.state.get(mutant.file, {}).get("outcomes", {}).pop(mutant.key, None)

    def save(self):
        self.state_file.parent.mkdir(parents=True, exist_ok=True)
        part = self.state_file.with_suffix(".part")
        part.write_text(json.dumps(self.state, indent=0))
        part.rename(self.state_file)

    def write(self, mutants):
        """Files of which few mutants are left to try, and all survivors explained, get a line."""
        of_file = collections.defaultdict(list)
        for mutant in mutants:
            of_file[mutant.file].append(mutant.key)
        today = datetime.date.today().isoformat()
        for file, keys in of_file.items():
            outcomes = self.outcomes(file)
            # What an earlier run has counted stays.
            is_rest = self.has_line(file) and self.left[file] and not set(keys) - self.left[file] <= set(outcomes)
            new = [key for key in (self.left[file] if is_rest else keys) if key in outcomes]
            left = {key for key in (self.left[file] if is_rest else keys) if key not in outcomes}
            if not new or len(left) > MOST_LEFT:
                continue
            counts = [sum(outcomes[key] == kind for key in new) for kind in ("caught", "unviable", "survived")]
            survived = {key for key in new if outcomes[key] == "survived"}
            if is_rest:
                counts = [a + b for a, b in zip(counts, self.lines[file][1])]
            else:
                self.reasons = {at: why for at, why in self.reasons.items() if at[0] != file or at[1] in survived | left}
            if self.lines.get(file, ())[:2] != (digest(file), counts):
                self.lines[file] = (digest(file), counts, today)
            self.left[file] = left
            # A file is done when each survivor has a reason.
            if missing := [key for key in survived if not self.reasons.get((file, key))]:
                self.lines.pop(file, None)
                print(f"{file}: {len(missing)} survivors without a reason")
        self.lines = {file: line for file, line in self.lines.items() if (ROOT / file).exists()}
        text = ["# Written by tests/mutants.py: of each file the SHA-256 of its code, what became of its changes, and the date.",
                "# Below it each change that survived, and why it has no effect.", self.sum(), ""]
        heads = {file: f"{file}: nothing to change" for file in sources() if file not in of_file}
        heads |= {file: f"{file}: not done" for (file, _), why in self.reasons.items() if why}
        for file, (sha, counts, date) in self.lines.items():
            heads[file] = f"{file} {sha}: {counts[0]} caught, {counts[1]} unviable, {counts[2]} survived, {date}, {self.seal(file)}"
        for file, head in sorted(heads.items()):
            text.append(head)
            left = self.left[file] if file in self.lines else ()
            for (of, key), why in sorted([*self.reasons.items(), *(((file, key), NOT_TRIED) for key in left)]):
                if of == file and why:
                    text += [f"    {key}", f"        {why}"]
        RECORD.write_text("\n".join(text) + "\n")

    def sum(self):
        caught, _, survived = (sum(counts[i] for _, counts, _ in self.lines.values()) for i in range(3))
        left = sum(len(self.left[file]) for file in self.lines)
        return (f"# {len(self.lines)} files: {caught} caught of {caught + survived} that compile"
                + f"; {left} are not tried." * bool(left) + "." * (not left))

    def has_reason(self, mutant):
        return bool(self.reasons.get((mutant.file, mutant.key)))


def run(mutants, workers, until, record, is_sample=False):
    """Tries these until the time is up; returns the survivors without a reason, and the counts."""
    counts, survivors = collections.Counter(), []
    queue = collections.deque((mutant, *stages(mutant, is_sample)) for mutant in mutants)

    def work(number):
        tree = Tree(number, until)
        while queue:
            try:
                mutant, tests, *later = queue.popleft()
            except IndexError:
                return
            outcome = "undecided"
            if tree.left_s():
                tree.check_unchanged(mutant.package, tests)
                outcome = tree.outcome(mutant, tests)
            if outcome == "undecided":
                if not later:
                    print(f"not all tests were tried: {mutant.name}", flush=True)
                continue
            # A reason says more than all tests of the package could.
            if outcome == "survived" and len(later) > record.has_reason(mutant):
                # A sample decides as many as there is time for, those of the change first.
                (queue.appendleft if is_sample else queue.append)((mutant, *later))
                continue
            counts[outcome] += 1
            record.keep(mutant, outcome)
            if outcome == "survived" and not record.has_reason(mutant):
                survivors.append(mutant)
                print(f"survived: {mutant.name}", flush=True)

    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(work, number) for number in range(workers)]:
            done.result()
    return survivors, counts


def run_woven(mutants, wanted, workers, until, record, is_patient):
    """As `run`, with all mutants in one build. Some are left to it: these have no outcome."""
    try:
        import woven
    except ImportError:
        sys.exit("--woven needs: pip install tree-sitter tree-sitter-rust")
    packages = {mutant.package for mutant in wanted}
    mutants = [mutant for mutant in mutants if mutant.package in packages]
    tree = Tree("woven", until)
    build = woven.Build(tree.path, tree.target, mutants, packages)
    # `--bins` builds no unit tests, and `--tests` leaves out what is no test by default.
    commands = [[word, "-p", package, *targets.split()]
                for word, of in (("check", ALL), ("build", ALL), ("build", UNIT_TESTS))
                for package in sorted(packages, reverse=True) for targets in [of[package]]]
    tests = woven.tests_of(build.settle(commands), tree.path)
    print(f"{len(build.unviable)} do not compile, {len(build.apart)} apart; {len(tests)} tests", flush=True)
    reached = WORK / "reached"
    reached.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(test.learn, reached, number) for number, test in enumerate(tests)]:
            done.result()
    for test in tests:
        if not test.passes:
            print(f"left out, since it does not pass in the woven tree: {test.name}")
    print(f"they take {sum(test.took_s for test in tests):.0f} s one after the other", flush=True)
    for took_s, name in sorted(((test.took_s, test.name) for test in tests), reverse=True)[:10]:
        print(f"    {took_s:5.1f} s  {name}")
    numbers = {id(mutant): number for number, mutant in enumerate(mutants, 1)}
    chosen = [numbers[id(mutant)] for mutant in wanted]
    for number in chosen:
        if number in build.unviable:
            record.keep(mutants[number - 1], "unviable", save=False)
    counts, survivors = collections.Counter(unviable=len(build.unviable & set(chosen))), []

    def keep(number, outcome, why):
        mutant = mutants[number - 1]
        counts[outcome] += 1
        if outcome == "apart":
            record.forget(mutant)
            return
        record.keep(mutant, outcome, save=sum(counts.values()) % 20 == 0)
        if outcome == "survived" and not record.has_reason(mutant):
            survivors.append(mutant)
            print(f"survived ({why}): {mutant.name}", flush=True)
    woven.run(build, tests, [n for n in chosen if n not in build.unviable | build.apart], until, workers, keep,
              is_patient)
    record.save()
    return survivors, counts


def of_change():
    """The mutants of the change that is under way, else of the last commit."""
    def git(*words):
        return subprocess.run(["git", *words], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    base = os.environ.get("MUTANTS_BASE") or ("HEAD" if git("status", "--porcelain", "-uno") else "HEAD~1")
    WORK.mkdir(parents=True, exist_ok=True)
    diff = WORK / "change.diff"
    diff.write_text(git("diff", base, "--", "src", "examples/axle/src"))
    return listed("--in-diff", str(diff)) if diff.read_text() else [], git("rev-parse", "HEAD").strip()


def sample(record, minutes):
    """A seeded sample of a change; from files on record, if the change has few mutants."""
    until = time.monotonic() + 60 * minutes
    mutants, seed = of_change()
    dice = random.Random(seed)
    dice.shuffle(mutants)
    of_others = [m for m in listed() if record.is_done(m.file) and m.package == "axlewire" and not record.has_reason(m)]
    others = dice.sample(of_others, min(len(of_others), 12)) if len(mutants) < 12 else []
    print(f"seed {seed[:12]}: {len(mutants)} mutants of the change, {len(others)} of other files")
    # Of one kind together: each has to be built once.
    chosen = sorted(mutants[:60], key=lambda m: concerned(m.file)) + sorted(others, key=lambda m: concerned(m.file))
    survivors, counts = run(chosen, 1, until, record, is_sample=True)
    tried = sum(counts.values())
    print(f"tried {tried} of {len(mutants) + len(others)}: "
          + ", ".join(f"{counts[kind]} {kind}" for kind in ("caught", "unviable", "survived")))
    return bool(survivors) or (tried == 0 and bool(mutants or others))


def table(record):
    rows = collections.defaultdict(lambda: [0, 0, 0, 0])
    for file, (_, counts, _) in record.lines.items():
        parts = file.split("/")
        row = rows[parts[1] if len(parts) > 2 else "others"]
        for i in range(3):
            row[i] += counts[i]
        row[3] += 1
    rows = dict(sorted(rows.items()))
    rows["all"] = [sum(row[i] for row in rows.values()) for i in range(4)]
    print("module     files  caught  unviable  survived  caught of viable")
    for name, (caught, unviable, survived, files) in rows.items():
        viable = caught + survived
        share = f"{100 * caught / viable:.1f} %" if viable else "-"
        print(f"{name:9} {files:6} {caught:7} {unviable:9} {survived:9} {share:>17}")


def check(record):
    """Every survivor on record has a reason in words, and its line is still in its file."""
    faults = []
    for (file, key), why in record.reasons.items():
        # Behind the first bar, or behind the second if the change itself is one of `|`.
        parts = re.sub(r" \(\d+\)$", "", key).split(" | ")
        lines = [" | ".join(parts[at:]).removeprefix("| ") for at in range(1, len(parts))]
        if len(re.findall(r"[^\W\d_]{2,}", why)) < LEAST_WORDS:
            faults.append(f"{file}: no reason: {key}: {why}")
        elif (ROOT / file).exists() and not any(line in (ROOT / file).read_text() for line in lines):
            faults.append(f"{file}: the line is gone: {key}")
    faults += [f"{file}: the entry was changed by hand" for file in record.broken]
    known = sources()
    faults += [f"{file}: there is no such file to change" for file in [*record.lines, *record.empty] if file not in known]
    for file, (_, (_, _, survived), _) in record.lines.items():
        # A reason may wait for a mutant that has not been tried.
        listed_ = sum(of == file and key not in record.left[file] for of, key in record.reasons)
        if survived != listed_:
            faults.append(f"{file}: {survived} survived, {listed_} of them are listed")
    if record.sum() not in RECORD.read_text().splitlines():
        faults.append(f"the sum is not: {record.sum()}")
    made = collections.Counter(mutant.file for mutant in listed())
    for file, (_, counts, _) in record.lines.items():
        listed_ = sum(counts) + len(record.left[file])
        if record.has_line(file) and listed_ != made[file]:
            faults.append(f"{file}: {listed_} mutants on record, but it has {made[file]}")
    faults += [f"{file}: nothing to change on record, but it has {made[file]} mutants"
               for file in record.empty if made[file]]
    stale = [file for file in record.lines if not record.has_line(file)]
    print(f"{len(record.lines)} files on record, {len(stale)} of them changed since; "
          f"{len(record.reasons)} survivors with a reason")
    not_tried = record.not_tried()
    print(f"{len(not_tried)} files are not tried: {' '.join(not_tried)}")
    for fault in faults:
        print(fault)
    return bool(faults) or not record.lines


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=float, default=10_000)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--file", action="append", default=[])
    parser.add_argument("--woven", action="store_true")
    for flag in ("again", "shuffled", "survivors", "sample", "table", "check"):
        parser.add_argument(f"--{flag}", action="store_true")
    args = parser.parse_args()
    record = Record()
    if args.table:
        return table(record)
    if args.check:
        return check(record)
    if args.sample:
        return sample(record, min(args.minutes, 4))
    mutants = listed()
    for pattern in args.file:
        if not fnmatch.filter((m.file for m in mutants), pattern):
            sys.exit(f"no mutant is in {pattern}")
    wanted = [m for m in mutants if any(fnmatch.fnmatch(m.file, f) for f in args.file or ["*"])]
    known = {m.name: record.outcomes(m.file).get(m.key) for m in wanted}
    if args.survivors:
        wanted = [m for m in wanted if known[m.name] == "survived" and not record.has_reason(m)]
    elif not args.again:
        wanted = [m for m in wanted if known[m.name] is None and not record.is_tried(m)]
    if args.shuffled:
        random.shuffle(wanted)
    print(f"{len(wanted)} of {len(mutants)} mutants to try", flush=True)
    until = time.monotonic() + 60 * args.minutes
    if args.woven:
        survivors, counts = run_woven(mutants, wanted, args.workers, until, record, args.survivors)
    else:
        survivors, counts = run(wanted, args.workers, until, record)
    record.write(mutants)
    print(", ".join(f"{count} {kind}" for kind, count in counts.items()) or "none was tried")
    return bool(survivors) or bool(wanted and not counts)


if __name__ == "__main__":
    sys.exit(main())
