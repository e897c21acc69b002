#!/usr/bin/env python3
"""Compares the sigrok decoders with `axle decode`, on captures that `make.py` renders.

    examples/sigrok/check.py AXLE              AXLE is the program; prints what was compared
    examples/sigrok/check.py AXLE --planted    damages the decoders, too, and sees each damage found

Of the same bytes, every packet, value, byte and gap must be that of `axle decode`, in its place in
time. Response times must be those that were put there, to within a bit time. Each hazard must give
its warning, and nothing else one. Needs sigrok-cli.
"""

import collections
import json
import os
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True
import make
from make import micros, read, sealed, ucp

HERE = Path(__file__).resolve().parent
DECODERS = ("axle_ikeya", "axle_ucp")
# By their names: an annotation whose class is in no row is then missing.
ROW_NAMES = "bytes:packets:values:gaps:responses:warnings"

Note = collections.namedtuple("Note", "kind ss es texts")

# Silence behind every capture: longer than the 20 ms after which a candidate is given up.
TAIL_US = 25_000


class Wrong(Exception):
    """A difference."""


def main():
    if len(sys.argv) < 2 or sys.argv[2:] not in ([], ["--planted"]):
        sys.exit(__doc__.split("\n\n")[1])
    if not Path(sys.argv[1]).is_file():
        sys.exit("check.py: no such program: " + sys.argv[1])
    if not shutil.which("sigrok-cli"):
        print("sigrok-cli is missing: install the Debian packages sigrok-cli and libsigrokdecode4",
              file=sys.stderr)
        sys.exit(3)
    with tempfile.TemporaryDirectory(prefix="axle-sigrok-") as scratch:
        cases = Cases(Path(sys.argv[1]).resolve(), Path(scratch))
        decoders = copied(Path(scratch) / "decoders")
        counts = collections.Counter()
        try:
            for _, case in cases.all:
                case(decoders, counts)
        except Wrong as wrong:
            sys.exit("sigrok: %s" % wrong)
        print(", ".join("%d %s" % (count, name) for name, count in counts.items()))
        if counts["packets"] < 2000 or counts["gaps"] < 300:
            sys.exit("sigrok: too little was compared")
        if sys.argv[2:]:
            planted(cases, Path(scratch) / "planted")


def copied(target):
    """The decoders alone in a folder, as a user installs them, and make.py beside it."""
    shutil.rmtree(target, ignore_errors=True)
    for name in DECODERS:
        shutil.copytree(HERE / name, target / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(HERE / "make.py", target.parent)
    return target


def run_sigrok(decoders, *arguments):
    """Only these decoders: those of the user, who may have installed others, are not read."""
    home = decoders.parent / "home"
    variables = {"SIGROKDECODE_DIR": str(decoders), "HOME": str(home), "LC_ALL": "C.UTF-8",
                 "PYTHONDONTWRITEBYTECODE": "1", "PATH": os.environ["PATH"]}
    try:
        ran = subprocess.run(["sigrok-cli", *arguments], env=variables, timeout=300,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    except subprocess.TimeoutExpired:
        raise Wrong("sigrok-cli does not end: %s" % " ".join(arguments)) from None
    return ran.returncode, ran.stdout.decode(errors="replace"), ran.stderr.decode(errors="replace")


class Capture:
    """A rendered capture, and what a decoder is told about it."""

    def __init__(self, path, protocol, lines, options=""):
        self.path, self.protocol, self.options = path, protocol, options
        self.wires = len(lines)
        self.baud = make.UCP_BAUD if protocol == "ucp" else make.IKEYA_BAUD
        ends = [line.places[-1][1] for line in lines if line.places]
        if lines:
            make.write(path, ["RX", "TX"][:len(lines)], lines, int(max(ends) + micros(TAIL_US)))

    @classmethod
    def drawn(cls, path, source, begin, end):
        """A part of a recording, as the user draws it."""
        command = [sys.executable, HERE / "make.py", source, path, str(begin), str(end)]
        subprocess.run(command, check=True)
        capture = cls(path, "ucp" if source.stem == "drive" else "ikeya", [])
        capture.wires = 2
        return capture

    def notes(self, decoders):
        """What the decoder shows."""
        name = "axle_ucp" if self.protocol == "ucp" else "axle_ikeya"
        wires = ":".join("%s=%s" % pair for pair in [("rx", "RX"), ("tx", "TX")][:self.wires])
        stack = "uart:%s:baudrate=%d,%s%s" % (wires, self.baud, name, self.options)
        status, out, err = run_sigrok(decoders, "-l", "4", "-i", str(self.path), "-P", stack,
                                      "-A", "%s=%s" % (name, ROW_NAMES),
                                      "--protocol-decoder-samplenum")
        said = re.search("^srd: .*(?:Error|[Ff]ail).*$", err, re.MULTILINE)
        if status or said:
            said = said.group() if said else "exit status %d" % status
            raise Wrong("%s: sigrok-cli: %s" % (self.path.stem, said))
        notes = []
        for line in out.splitlines():
            head = re.match(r'(\d+)-(\d+) axle_\w+-1: ([\w-]+): (".*")$', line)
            if not head:
                raise Wrong("%s: not a line of sigrok-cli: %s" % (self.path.stem, line))
            ss, es, kind, texts = head.groups()
            if int(es) <= int(ss):
                raise Wrong("%s: nothing of it can be seen: %s" % (self.path.stem, line))
            notes.append(Note(kind, int(ss), int(es), texts[1:-1].split('" "')))
        return notes


class Cases:
    """What is checked; the captures are rendered and decoded by axle once."""

    def __init__(self, axle, scratch):
        self.axle, self.scratch = axle, scratch
        # The short ones first: a planted damage is then found sooner.
        self.all = [("ikeya", case) for case in (
            self.hazards("ikeya"), self.texts("ikeya"), self.broken(), self.silence(), self.never(),
            *(self.times(count) for count in (1, 2)), *self.exchanges())]
        self.all += [("ucp", case) for case in (
            self.hazards("ucp"), self.texts("ucp"), self.wires(), self.rover_times())]
        self.all += [("both", self.shown), ("both", self.ends), ("both", self.alone),
                     ("both", self.loads), ("once", self.tools), ("make", self.recordings)]
        self.all += [("ikeya", self.recorded("motors", 0.0, 1.0)),
                     ("ucp", self.recorded("drive", 0.0, 0.5))]
        for name, protocol, data, options in streams():
            case = self.stream(name, protocol, data, options)
            self.all.append(("ucp" if protocol == "ucp" else "ikeya", case))

    def of(self, name):
        """The cases that a file matters to."""
        if name == MAKE:
            return [case for group, case in self.all if group == "make"]
        others = ("once", "make", {ROVER: "ikeya", NODE: "ucp"}.get(name))
        return [case for group, case in self.all if group not in others]

    def capture(self, name, protocol, lines, options=""):
        return Capture(self.scratch / (name + ".sr"), protocol, lines, options)

    def decoded(self, protocol, data, direction=None):
        """Each line of `axle decode --json`, with the contents as text."""
        way = ["--direction", direction] if direction else []
        command = [self.axle, "decode", "--protocol", protocol, *way]
        run = lambda *more: subprocess.run([*command, *more], input=data, check=True, timeout=60,
                                           stdout=subprocess.PIPE).stdout.decode()
        rows = [json.loads(line) for line in run("--json").splitlines()]
        rows = [row for row in rows if row["event"] != "summary"]
        lines = run().splitlines()[1:1 + len(rows)]
        for row, line in zip(rows, lines):
            row["text"] = line[49:]
            if row["offset"] != int(line[:10]):
                raise Wrong("the two listings of axle differ")
        return rows

    def recorded(self, name, begin, end):
        """A part of a recording, drawn by make.py, has the frames that axle finds in it."""
        path = make.ROOT / "examples" / "captures" / (name + ".pcapng")
        capture = Capture.drawn(self.scratch / (name + ".sr"), path, begin, end)
        run = lambda *more: subprocess.run([self.axle, "decode", *more, path], check=True,
                                           stdout=subprocess.PIPE).stdout.decode().splitlines()
        rows = [json.loads(line) for line in run("--json")]
        start, want = rows[0]["t"], collections.Counter()
        for row, line in zip(rows, run("--time", "none")[1:]):
            if row["event"] == "frame" and begin <= row["t"] - start <= end:
                number = "node %d" % row["node"] if "node" in row else "index %d" % row["index"]
                text = "%s, %s" % (row["message"], number)
                want[text + (": " + line[49:]) * bool(line[49:])] += 1

        def check(decoders, counts):
            notes = [note for note in capture.notes(decoders) if ROWS.get(note.kind) == "packets"]
            found = collections.Counter(note.texts[0] for note in notes)
            for text, count in (want - found).items() or (found - want).items():
                raise Wrong("%s: %d times %s too few or too many" % (name, count, text))
            counts["packets of recordings"] += len(notes)
        return check

    def loads(self, decoders, counts):
        """Both are listed, and nothing else is in the folder."""
        _, out, err = run_sigrok(decoders, "-L")
        for name in DECODERS:
            if not re.search(r"^\s*%s " % name, out, re.MULTILINE):
                raise Wrong("%s is not listed" % name)
        if "srd: " in err:
            raise Wrong(err.strip().splitlines()[0])

    def alone(self, decoders, counts):
        """Without the shared modules there is a clear line."""
        target = decoders.parent / "alone"
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(decoders / "axle_ucp", target / "axle_ucp")
        _, _, err = run_sigrok(target, "-P", "axle_ucp", "--show")
        if "axle_ucp needs the folder axle_ikeya beside it" not in err:
            raise Wrong("axle_ucp alone does not say what it needs: %s" % err)

    def shown(self, decoders, counts):
        """The options with their values and defaults, and the classes of each row."""
        for name, want in SHOWN.items():
            _, out, _ = run_sigrok(decoders, "-P", name, "--show")
            rows = out.partition("Annotation rows:")[2].partition("Binary")[0]
            options = out.partition("\nOptions:")[2].partition("Documentation:")[0]
            found = re.findall(r"^- (.*)$", rows, re.MULTILINE)
            found += [" ".join(pair) for pair in
                      re.findall(r"^- (\w+): .* (\([^()]*\))$", options, re.MULTILINE)]
            differs("what %s shows" % name, found, want.strip().splitlines())

    def tools(self, decoders, counts):
        """Without sigrok-cli the exit code is 3."""
        for command in ([sys.executable, HERE / "check.py", self.axle],
                        [shutil.which("bash"), HERE / "check.sh"]):
            tools = self.scratch / "tools"
            tools.mkdir(exist_ok=True)
            if not (tools / "dirname").exists():
                (tools / "dirname").symlink_to(shutil.which("dirname"))
            ran = subprocess.run(command, env={"PATH": str(tools)}, stderr=subprocess.PIPE)
            if ran.returncode != 3 or not ran.stderr.startswith(b"sigrok-cli is missing"):
                raise Wrong("%s: without sigrok-cli: %d, %r" %
                            (command[1].name, ran.returncode, ran.stderr))

    def recordings(self, decoders, counts):
        """What make.py draws of recordings that are not as usual, and what it says."""
        folder = self.scratch / "recordings"
        for name, data, said, want in RECORDINGS:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            source, out = folder / "in.pcapng", folder / "out.sr"
            source.write_bytes(data)
            # Files of the user.
            for other in ("out.sr.part", "out.part"):
                (folder / other).write_text("mine")
            if said.startswith("/"):
                out = Path(said.split(": ")[0])
            command = [sys.executable, decoders.parent / "make.py", source, out]
            # Enough for 20 s, and no more.
            ran = subprocess.run(["bash", "-c", 'ulimit -v 2000000; exec "$@"', "-", *command],
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60)
            line = "make.py: %s%s\n" % ("" if said.startswith("/") else "%s: " % source, said)
            differs("%s: make.py says" % name, ran.stderr.decode()[-200:], line if said else "")
            differs("%s: exit status" % name, ran.returncode, 0 if want else 1)
            files = sorted(path.name for path in folder.iterdir())
            differs("%s: files" % name, files, ["in.pcapng", "out.part"] +
                    ["out.pvs", "out.sr"] * bool(want) + ["out.sr.part"])
            if any((folder / other).read_text() != "mine" for other in ("out.sr.part", "out.part")):
                raise Wrong("%s: a file of the user is overwritten" % name)
            if want:
                capture = Capture(out, "ikeya", [])
                capture.wires = 2
                found = [note.texts[0] for note in capture.notes(decoders)
                         if ROWS.get(note.kind) in (None, "packets")]
                differs(name, found, want)

    def ends(self, decoders, counts):
        """Newer versions of libsigrokdecode tell the end of a capture."""
        for protocol, data in (("ikeya", b"\xaa" + read(1) + b"\x55"),
                               ("ucp", b"\xfd\xff\x20\x00" + ucp(1, b""))):
            ran = subprocess.run([sys.executable, "-c", AT_END, decoders, "axle_" + protocol,
                                  data.hex()], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            found = ran.stdout.decode().split()
            want = []
            for row in self.decoded(protocol, data):
                want.append("gap" if row["event"] == "skipped" else "frame")
            want += ["missing"]
            if found != want:
                raise Wrong("at the end of a capture: %s, not %s %s" %
                            (found, want, ran.stderr.decode()[-300:]))

    def stream(self, name, protocol, data, options):
        """Bytes on one wire against axle's rows."""
        line = make.Line(make.UCP_BAUD if protocol == "ucp" else make.IKEYA_BAUD)
        pauses, at = random.Random(name), 500.0
        for begin in range(0, len(data), 16):
            at = line.send(data[begin:begin + 16], at) + micros(pauses.choice((0, 0, 0.7, 33, 190)))
        direction = re.search("direction=([a-z-]+)", options)
        rows = self.decoded(protocol, data, direction and direction.group(1))
        capture = self.capture(name, protocol, [line], options)
        # The last bytes of the expected gap end with the data.
        return lambda decoders, counts: compare(capture, line, rows, decoders, counts)

    def times(self, count):
        """Response times of a motor bus, with two wires of one pair each or all on one wire."""
        story = Story(make.IKEYA_BAUD, count)
        for number, time in enumerate(TIMES):
            node = 1 + number % 8
            speed = struct.pack("<f", number / 4)
            if count == 2 or time >= 0:
                story.asks(read(node)).answers(sealed("55%02x" % node + speed.hex()), time)
                story.says(judged(node, time))
        # Until the next request, or until the master's timeout.
        story.asks(read(2)).lacks("node 2", 300).asks(read(3)).lacks("node 3", 500)
        # Nothing follows but silence.
        return story.case(self, "times-%d" % count, "ikeya")

    def exchanges(self):
        """What is taken for an answer, for a strike and for an echo."""
        story = Story(make.IKEYA_BAUD, 2)
        story.asks(read(1)).answers(answer(2, 1.0), 20)
        story.warns(8, "node 2 answers, node 1 was asked (I7)")
        # It is still open: 20, 160 of the other answer, 20.
        story.answers(answer(1, 1.0), 20).says(judged(1, 200))
        # The other wire has long been silent.
        story.pause(30_000).asks(read(1)).answers(answer(1, 1.0), 400).says(judged(1, 400))
        # In two sets of three, late answers; those after the timeout count as strikes.
        for time in (400, 600):
            for _ in range(3):
                story.asks(read(3)).answers(answer(3, 1.0), time).says(judged(3, time))
        story.warns(8, STRUCK % 3)
        # The next request begins before the last one has ended.
        story.asks(read(4)).lacks("node 4", 0).answers(read(5), -60).lacks("node 5", 500)
        yield story.case(self, "exchanges", "ikeya")

        story = Story(make.IKEYA_BAUD, 2)
        for number, time in enumerate((8, 11, 60, 99, 150, 299, 350, 700)):
            story.asks(read(1 + number)).answers(answer(1 + number, 1.0), time)
            story.says(judged(1 + number, time, 10, 100, 300))
        story.asks(read(1)).lacks("node 1", 300).pause(400)
        story.asks(read(2)).answers(answer(2, 1.0), 11).says(judged(2, 11, 10, 100, 300))
        limits = ":turnaround_us=10:budget_us=100:timeout_us=300"
        yield story.case(self, "limits", "ikeya", limits)

        # Three motors: a WRITE is answered (I10).
        story, speeds = Story(make.IKEYA_BAUD, 1), struct.pack("<3f", 1, 2, 3).hex()
        for node, header in ((1, "bb"), (2, "aa"), (1, "bb")):
            story.asks(sealed("%s%02x%s" % (header, node, speeds * (header == "bb"))))
            story.answers(sealed("55%02x%s" % (node, speeds)), 30).says(judged(node, 30))
        story.asks(sealed("bb03" + speeds)).lacks("node 3", 500)
        yield story.case(self, "three-exchanges", "ikeya", ":boards=three")

        # With one direction alone, no exchange is whole.
        for direction in ("to-slave", "to-master"):
            story = Story(make.IKEYA_BAUD, 1)
            for _ in range(4):
                story.asks(read(1)).answers(answer(1, 1.0), 30)
            story.answers(sealed("560100000000"), 300)
            if direction == "to-master":
                story.warns(8, "node 1 answers in position mode, before in velocity mode: in doubt"
                               " (I11)")
            yield story.case(self, "half-" + direction, "ikeya", ":direction=" + direction)
        yield self.echoes()

    def echoes(self):
        """A receiver that hears its own sender, on the wire or as a program has recorded it."""
        story = Story(make.IKEYA_BAUD, 2)
        write, wrong = sealed("bb010000803f"), sealed("bb010000c07f")
        for _ in range(4):
            story.asks(read(1)).answers(read(1), -80).answers(answer(1, 1.0), 30)
            story.says(judged(1, 30))
        story.asks(write).answers(write, -160)
        story.asks(wrong).warns(8, "node 1: NaN rps: a slave refuses it (I4)").answers(wrong, -160)
        # Both echoes come behind both packets, in one piece; then the echo comes first.
        story.asks(write).asks(read(1)).answers(write + read(1), 40).answers(answer(1, 1.0), 0)
        story.says(judged(1, 280))
        story.asks(read(2)).answers(read(2), -100).answers(answer(2, 1.0), 30)
        story.says(judged(2, 50))
        # The echo of the first is damaged.
        story.asks(read(3)).lacks("node 3", 300).asks(read(4)).answers(read(4), -80)
        story.answers(answer(4, 1.0), 30).says(judged(4, 30))
        # Three requests without an answer are three.
        for wait in (300, 300, 500):
            story.asks(read(5)).answers(read(5), -80).lacks("node 5", wait)
        story.warns((0, 500), STRUCK % 5).pause(600)
        # An answer has an echo, too, where a slave's own wires are.
        story.asks(read(6)).answers(answer(6, 1.0), 30).answers(answer(6, 1.0), -160, True)
        story.says(judged(6, 30))
        # Much later it is no echo.
        story.asks(read(7)).lacks("node 7", 500).pause(25_000)
        story.answers(read(7), 0).lacks("node 7", 500)
        return story.case(self, "echoes", "ikeya")

    def rover_times(self):
        story = Story(make.UCP_BAUD, 2)
        for name, ask, answer, from_host in EXCHANGES:
            for time in (0.0, 0.5, 41.3, 873.6, 5000.0, 15_000.25):
                story.asks(ask, from_host).answers(answer, time, not from_host)
                story.says(("answer", time, "%s answered after " % name))
        story.asks(ucp(1, b"")).lacks("ping", 200_300).pause(200_000).asks(ucp(1, b""))
        story.answers(ucp(1, b"\0"), 100.0).says(("answer", 100.0, "ping answered after "))
        # An answer that begins 13 ms before its request has ended, and pauses.
        begin, pong = story.at + micros(2000), ucp(1, b"\0")
        story.lines[0].send(pong[:3], begin)
        story.pause(2000 + 12_000).asks(ucp(1, b""))
        time = (begin - story.at) * 1e6 / make.SAMPLE_RATE
        story.answers(pong[3:], 100.0).says(("answer", time, "ping answered after "))
        return story.case(self, "rover-times", "ucp")

    def hazards(self, protocol):
        """Each frame has its warnings, in this order, and no other. Each is in its place."""
        line, want, places = make.Line(make.UCP_BAUD if protocol == "ucp" else make.IKEYA_BAUD), [], []
        end = 500
        for data, texts, *place in HAZARDS[protocol]:
            before, begin = end, len(line.places)
            end = line.send(data, end + micros(700))
            # A row of HAZARDS is a frame; of the motor bus, an answer may be its last eight bytes.
            first, last = 0 if protocol == "ucp" else max(0, len(data) - 8), len(data) - 1
            if place == ["first byte"]:
                last = 0
            place = ((before, before + micros(500)) if place == ["timeout before"] else
                     (line.places[begin + first][0], line.places[begin + last][1]))
            want += texts
            places += [place] * len(texts)
        capture = self.capture("hazards-" + protocol, protocol, [line])

        def check(decoders, counts):
            notes = [note for note in capture.notes(decoders) if note.kind == "warning"]
            differs("the warnings of " + protocol, [note.texts[0] for note in notes], want)
            for note, place in zip(notes, places):
                in_place(capture, note, *place)
            counts["warnings"] += len(want)
        return check

    def texts(self, protocol):
        """All texts of each class of annotations, from the longest to the shortest."""
        line, at = make.Line(make.UCP_BAUD if protocol == "ucp" else make.IKEYA_BAUD), 500
        data, want = TEXTS[protocol]
        for piece in data:
            at = line.send(piece, at + micros(30))
        capture = self.capture("texts-" + protocol, protocol, [line])

        def check(decoders, counts):
            found = [(note.kind, " | ".join(note.texts)) for note in capture.notes(decoders)
                     if ROWS.get(note.kind) != "bytes"]
            differs("the texts of " + protocol, found, want)
            counts["texts"] += len(want)
        return check

    def wires(self):
        """What only the host may not send is told by the wire."""
        lines = [make.Line(make.UCP_BAUD) for _ in range(2)]
        report, request = ucp(5, bytes(36)), ucp(8, b"")
        bad, inside = b"\xfd\xff\x50\x00", ucp(0x20, b"\xfd\xff")
        at = 500
        for line in lines:
            for data in (report, request, bad, ucp(5, b"\0"), ucp(2, b"\0"), inside):
                at = line.send(data, at) + micros(100)
        captures = [self.capture("wires-" + host, "ucp", lines, ":host=" + host)
                    for host in ("rx", "tx", "unknown")]
        both = ["id 5 from a host hangs shipped robots (U13)",
                "a body of 0 bytes, not 19: shipped robots read what lies behind (U13)"]
        short = "a body of 1 bytes, not 16: " + LIES
        either = [LENGTH, both[0], short, INSIDE]
        known = both + either
        wants = [known, known, 2 * [text + IF_HOST for text in either]]

        def check(decoders, counts):
            for capture, want in zip(captures, wants):
                notes = [note for note in capture.notes(decoders) if note.kind == "warning"]
                differs(capture.path.stem, [note.texts[0] for note in notes], want)
                half = lines[0].places[-1][1]
                if capture is captures[0] and any(note.ss > half for note in notes):
                    raise Wrong("a warning on the wrong wire")
                counts["warnings"] += len(want)
        return check

    def broken(self):
        """A byte with a bad stop bit counts, and is marked."""
        line = make.Line(make.IKEYA_BAUD)
        packet = read(1)
        at = line.send(packet[:3], 500)
        at = line.send(packet[3:], at, is_broken=True) + micros(40)
        # A spike shorter than half a bit is no byte.
        line.spans.append((int(at - micros(20)), int(at - micros(19.4))))
        line.send(read(2), at)
        capture = self.capture("broken", "ikeya", [line])

        def check(decoders, counts):
            notes = capture.notes(decoders)
            found = [note.texts[0] for note in notes if note.kind in ("read", "warning")]
            want = ["framing or parity error: is the bit rate right?", "read_request, node 1",
                    "read_request, node 2"]
            differs("a framing error", found, want)
            if any(note.kind == "skipped-byte" for note in notes):
                raise Wrong("a spike is taken for a byte")
        return check

    def silence(self):
        """Only a long silence ends a candidate: each part is then a capture of its own."""
        line = make.Line(make.IKEYA_BAUD)
        first, second = read(1)[:3], read(2) + b"\xbb\x01"
        at = line.send(read(3)[:2], 500) + micros(15_000)
        at = line.send(read(3)[2:] + first, at) + micros(20_500)
        line.send(second, at)
        rows = []
        for data, offset in ((read(3) + first, 0), (second, 7)):
            rows += [row | {"offset": row["offset"] + offset}
                     for row in self.decoded("ikeya", data)]
        capture = self.capture("silence", "ikeya", [line])
        return lambda decoders, counts: compare(capture, line, rows, decoders, counts)

    def never(self):
        """Without a limit of silence, a candidate waits for its bytes."""
        line = make.Line(make.IKEYA_BAUD)
        line.send(read(3)[2:], line.send(read(3)[:2], 500) + micros(40_000))
        rows = self.decoded("ikeya", read(3))
        capture = self.capture("never", "ikeya", [line], ":silence_ms=0")
        return lambda decoders, counts: compare(capture, line, rows, decoders, counts)


# Drives a decoder without sigrok: bytes, then the end.
AT_END = """
import sys, types
stub = types.ModuleType("sigrokdecode")
class Decoder:
    def register(self, kind): return kind
    def put(self, ss, es, out, data):
        name = self.annotations[data[0]][0]
        if name in ("gap", "missing"): print(name)
        if name in ("read", "to-robot"): print("frame")
stub.Decoder, stub.OUTPUT_ANN, stub.SRD_CONF_SAMPLERATE = Decoder, 0, 1
sys.modules["sigrokdecode"] = stub
sys.dont_write_bytecode = True
sys.path.insert(0, sys.argv[1])
decoder = __import__(sys.argv[2]).Decoder()
decoder.options = {option["id"]: option["default"] for option in decoder.options}
decoder.start()
decoder.metadata(1, 5_000_000)
for number, value in enumerate(bytes.fromhex(sys.argv[3])):
    ss = 1000 + 100 * number
    decoder.decode(ss, ss + 90, ["DATA", 0, (value, [])])
    decoder.decode(ss, ss + 100, ["FRAME", 0, (value, True)])
decoder.end()
"""


class Story:
    """Requests and answers with known times, on one wire or two."""

    def __init__(self, baud, count):
        self.lines = [make.Line(baud) for _ in range(count)]
        self.baud, self.at, self.want = baud, 500.0, []

    def line(self, is_request):
        return self.lines[-1 if is_request else 0]

    def asks(self, data, is_request=True):
        self.at = self.line(is_request).send(data, self.at + micros(300))
        return self

    def answers(self, data, time, is_request=False):
        begin = self.at + micros(time)
        self.at = max(self.at, self.line(is_request).send(data, begin))
        return self

    def pause(self, time):
        self.at += micros(time)
        return self

    def lacks(self, name, time):
        """What has just been sent is not answered: this is shown for so long."""
        return self.says(("missing", (self.at, self.at + micros(time)), name + ": no answer"))

    def warns(self, place, text):
        """A warning of as many bytes, which have just been sent, or from and until these times."""
        begin, end = place if isinstance(place, tuple) else (-place * make.BITS * 1e6 / self.baud, 0)
        return self.says(("warning", (self.at + micros(begin), self.at + micros(end)), text))

    def says(self, *expected):
        self.want += expected
        return self

    def case(self, cases, name, protocol, options=""):
        capture = cases.capture(name, protocol, self.lines, options)
        kinds = ("in-time", "too-fast", "late", "missing", "answer", "warning")

        def check(decoders, counts):
            notes = [note for note in capture.notes(decoders) if note.kind in kinds]
            differs(name + ": kinds of answers", [note.kind for note in notes],
                    [kind for kind, _, _ in self.want])
            for note, (_, time, text) in zip(notes, self.want):
                self.one(capture, note, time, text)
                counts["response times"] += 1
        return check

    def one(self, capture, note, time, text):
        """`time` is from request to answer, or the place of a note without time."""
        name = capture.path.stem
        found = re.match(r"(.*?)(-?[\d.]+) (µs|ms)(.*)$", note.texts[0])
        if isinstance(time, tuple):
            differs(name, note.texts[0], text)
            in_place(capture, note, *time)
            return
        if not found:
            raise Wrong("%s: no time in %s" % (name, note.texts[0]))
        head, number, unit, tail = found.groups()
        differs(name, (head + tail).strip(), text.strip())
        differs("%s: the unit of %s" % (name, note.texts[0]), unit, "µs" if abs(time) < 1e4 else "ms")
        bit = 1e6 / self.baud
        shown = float(number) * (1000 if unit == "ms" else 1)
        # Hundredths of a millisecond are the last digit of a long time.
        if abs(shown - time) > bit + (5 if unit == "ms" else 0):
            raise Wrong("%s: %s, not %s µs" % (name, note.texts[0], time))
        span = (note.es - note.ss) * 1e6 / make.SAMPLE_RATE
        if abs(span - abs(time)) > bit:
            raise Wrong("%s: %s spans %s µs" % (name, note.texts[0], span))


def in_place(capture, note, begin, end):
    """Whether a note is in its place, to within a bit."""
    bit = make.SAMPLE_RATE / capture.baud
    if abs(note.ss - begin) > bit or abs(note.es - end) > bit:
        raise Wrong("%s: %s is at %d to %d, not %d to %d" %
                    (capture.path.stem, note.texts[0], note.ss, note.es, begin, end))


# µs from request to answer, both sides of each limit: 2, 50 and 500. A sample, 0.2, is allowed.
TIMES = (10, 0, 1.2, 1.8, 2.6, 23.4, 49.4, 50, 50.2, 50.6, 71.8, 499.2, 500.2, 500.8, 812.5, 1500.4,
         12_345.6, -30.0, -2.0, 5)


def judged(node, time, fastest=2, budget=50, timeout=500):
    """Class and text of a response time."""
    too_fast = "too fast: less than %d µs to turn the line round" % fastest
    for limit, kind, text in ((fastest - 0.3, "too-fast", too_fast),
                              (budget + 0.3, "in-time", "in time: at most %d µs (I9)" % budget),
                              (timeout + 0.3, "late", "late: more than %d µs (I9)" % budget),
                              (1e9, "late", "after the master's timeout of %d µs (I7)" % timeout)):
        if time < limit:
            return kind, float(time), "node %d: , %s" % (node, text)


# Name of the request, request, answer, and whether the host asks.
EXCHANGES = (
    ("ping", ucp(1, b""), ucp(1, b"\0"), True),
    ("calibration_start", ucp(3, b"\1"), ucp(3, b"\1\0"), True),
    ("calibration_end", ucp(4, b"\1"), ucp(4, b"\1\0"), True),
    ("imu_bias", ucp(6, bytes(12)), ucp(6, b"\0"), False),
    ("mag_bias", ucp(7, bytes(6)), ucp(7, b"\0"), False),
    ("bias_request", ucp(8, b""), ucp(8, bytes(19)), False),
    ("ota_request", ucp(9, b"\x26\0"), ucp(9, b"\0"), True),
)


def motor(speed=0, angular=0, front=0, back=0, version=0, reserve1=0, reserve2=0):
    return ucp(2, struct.pack("<hhhhHHI", speed, angular, front, back, version, reserve1, reserve2))


def report(index, battery=50):
    return ucp(5, struct.pack("<H", battery) + bytes(34), index)


def answer(node, speed):
    return sealed("55%02x" % node + struct.pack("<f", speed).hex())


STARTS = "starts a firmware update (U7)"
LENGTH = "length below 4 or above 60: hangs or corrupts shipped robots (U2, U13)"
LIES = "shipped robots read what lies behind (U13)"
INSIDE = "another FD FF inside: robots may take it for a frame (U13)"
IF_HOST = ", if the host sent it"
UNASKED = "node %d answers without a request (I9)"
STRUCK = "node %d: 3 requests in a row without an answer in time: abnormal (I7)"
# Bytes, their warnings, and their place if that is not the frame.
HAZARDS = {
    "ucp": (
        (motor(100, -100, 100), []),
        (motor(60, -20), []),
        (motor(101), ["speed 101 % is out of range: -100 to 100 (U7)"]),
        (motor(0, -101), ["angular -101 % is out of range: -100 to 100 (U7)"]),
        (motor(version=38), ["version 38, not 0 (U7)"]),
        (motor(version=39), ["version 39 " + STARTS]),
        (motor(version=0x7FFF), ["version 32767 " + STARTS]),
        (motor(version=0x8000), ["version 32768, not 0 (U7)"]),
        (motor(back=1, reserve1=2, reserve2=3),
         ["back led 1, not 0 (U7)", "reserve1 2, not 0 (U7)", "reserve2 3, not 0 (U7)"]),
        (motor(front=1), ["front led 1, neither 0 nor 100 (U7)"]),
        (ucp(9, b"\x26\0"), []),
        (ucp(9, b"\x27\0"), ["version 39 " + STARTS]),
        (ucp(9, b"\xff\xff"), []),
        (ucp(9, b"\xd9\xff"), []),
        (ucp(9, b"\2"), ["the robot refuses the update"]),
        (report(7), []),
        (report(8, 100), []),
        (report(9, 101), ["battery 101: not 0 to 100 % (U5)"]),
        (report(11), ["report 11 after 9: reports are missing (U9)"]),
        (report(255), ["report 255 after 11: reports are missing (U9)"]),
        (report(0), []),
        (ucp(5, bytes(3)), ["id 5 from a host hangs shipped robots (U13)" + IF_HOST]),
        (ucp(2, bytes(15)), ["a body of 15 bytes, not 16: " + LIES + IF_HOST]),
        (ucp(2, bytes(17)), []),
        (ucp(8, bytes(18)), ["a body of 18 bytes, not 19: " + LIES + IF_HOST]),
        (ucp(10, bytes(1)), []),
        (ucp(10, bytes(0)), ["a body of 0 bytes, not 1: " + LIES + IF_HOST]),
        (ucp(10, bytes([9, 0, 0, 0])), ["state 9 is unknown (U8)"]),
        (ucp(10, b"\4"), []),
        (ucp(10, b"\5"), ["state 5 is unknown (U8)"]),
        (ucp(1, b"\1"), ["err 1: ping was damaged (U12)"]),
        (ucp(7, b"\1"), ["err 1: mag_bias was damaged (U12)"]),
        (ucp(8, b"\1" + bytes(18)), []),
        (ucp(0x20, b"\1\2"), []),
        (ucp(0x20, b"\1\xfd\xff\2"), [INSIDE + IF_HOST]),
        (b"\xfd\xff\x3d\0" + bytes(6), [LENGTH + IF_HOST], "first byte"),
        (b"\xfd\xff\0\0", [LENGTH + IF_HOST], "first byte"),
        (b"\xfd\xff\3\0" + bytes(6), [LENGTH + IF_HOST], "first byte"),
        (b"\xfd\xff\4\1", [LENGTH + IF_HOST], "first byte"),
        (b"\xfd\0", []),
    ),
    "ikeya": (
        (read(1) + answer(1, 1.0), []),
        (answer(1, 1.0), [UNASKED % 1]),
        (read(1) + answer(2, 1.0), ["node 2 answers, node 1 was asked (I7)"]),
        (sealed("aa09"), ["node 9 with a good CRC: not 1 to 8 (I1)"]),
        (sealed("bb000000803f"), ["node 0 with a good CRC: not 1 to 8 (I1)"]),
        (sealed("bb010000c07f"), ["node 1: NaN rps: a slave refuses it (I4)"]),
        (sealed("bb01000080ff"), ["node 1: -inf rps: a slave refuses it (I4)"]),
        # Its mode is not known: it may be a position.
        (sealed("bb040000c07f"), []),
        (read(3) + answer(3, float("inf")), ["node 3: inf rps: no speed (I4)"]),
        (read(1) + sealed("560100000000"),
         ["node 1 answers in position mode, before in velocity mode: in doubt (I11)"]),
        (sealed("bb010000c07f"), []),
        (read(1) + answer(1, 0.0),
         ["node 1 answers in velocity mode, before in position mode: in doubt (I11)"]),
        (read(5) + read(5), []),
        (read(5), []),
        (read(6), [STRUCK % 5], "timeout before"),
        (read(5) + answer(5, 0.0), []),
        (read(5) + read(5) + read(5) + answer(5, 0.0), []),
        (sealed("bb050000803f") + answer(5, 0.0), [UNASKED % 5]),
        (3 * read(7) + answer(7, 0.0), []),
        (2 * read(7) + answer(7, 0.0), []),
    ),
}

SHOWN = {
    "axle_ikeya": """
bytes (Bytes): byte, skipped-byte
packets (Packets): read, write, velocity, position
values (Values): value
gaps (Gaps): gap
responses (Response times): in-time, too-fast, late, missing
warnings (Warnings): warning
boards ('one', 'three', default 'one')
direction ('both', 'to-slave', 'to-master', default 'both')
turnaround_us (default 2)
budget_us (default 50)
timeout_us (default 500)
silence_ms (default 20)
""",
    "axle_ucp": """
bytes (Bytes): byte, skipped-byte
packets (Packets): to-robot, to-host, unknown
values (Values): value
gaps (Gaps): gap
responses (Response times): answer, missing
warnings (Warnings): warning
host ('unknown', 'rx', 'tx', default 'unknown')
silence_ms (default 20)
""",
}

# Pieces of bytes, 30 µs apart, and the notes in their order: class, texts.
TEXTS = {
    "ikeya": ((b"\x01", read(1), answer(1, 0.5), read(2), sealed("bb010000c07f"),
               sealed("5603f0ff0100"), sealed("5601f0ff0100"), sealed("aa09")), [
        ("gap", "1 byte skipped: header, no frame starts here | 1 byte skipped: header | 1 "
                "header | h"),
        ("value", "node 1 | 1"),
        ("read", "read_request, node 1 | read_request, node 1 | read 1 | R"),
        ("value", "node 1 | 1"),
        ("velocity", "velocity_response, node 1: 0.5 rps | velocity_response, node 1 | velocity "
                     "1 | V"),
        ("value", "speed 0.5 rps | 0.5 rps | 0.5"),
        ("in-time", "node 1: 30.0 µs, in time: at most 50 µs (I9) | node 1: 30.0 µs | 30.0 µs | "
                    "30"),
        ("value", "node 2 | 2"),
        ("read", "read_request, node 2 | read_request, node 2 | read 2 | R"),
        ("value", "node 1 | 1"),
        ("write", "write, node 1: NaN rps | write, node 1 | write 1 | W"),
        ("value", "speed NaN rps | NaN rps | NaN"),
        ("missing", "node 2: no answer | no answer | none | -"),
        ("warning", "node 1: NaN rps: a slave refuses it (I4) | not finite | !"),
        ("value", "node 3 | 3"),
        ("position", "position_response, node 3: 0.9980 turns (rotation 1, count -16) | "
                     "position_response, node 3 | position 3 | P"),
        ("value", "count -16 counts | -16 counts | -16"),
        ("value", "rotation 1 turns | 1 turns | 1"),
        ("warning", "node 3 answers without a request (I9) | unasked | ?"),
        ("value", "node 1 | 1"),
        ("position", "position_response, node 1: 0.9980 turns (rotation 1, count -16) | "
                     "position_response, node 1 | position 1 | P"),
        ("value", "count -16 counts | -16 counts | -16"),
        ("value", "rotation 1 turns | 1 turns | 1"),
        ("warning", "node 1 answers in position mode, before in velocity mode: in doubt (I11) | "
                    "mode | M"),
        ("warning", "node 1 answers without a request (I9) | unasked | ?"),
        ("warning", "node 9 with a good CRC: not 1 to 8 (I1) | node 9"),
        ("gap", "4 bytes skipped: id, invalid node id | 4 bytes skipped: id | 4 id | i"),
    ]),
    "ucp": ((b"\xfd\x01", ucp(1, b"", 7), ucp(1, b"", 8), ucp(1, b"\1", 9), ucp(0x20, b"\1\2"),
             ucp(9, b"\x27\0"), ucp(10, b"\5"), b"\xfd\xff\0\0"), [
        ("gap", "2 bytes skipped: header, no frame starts here | 2 bytes skipped: header | 2 "
                "header | h"),
        ("value", "index 7 | 7"),
        ("to-robot", "ping, index 7 | ping, index 7 | ping | 1"),
        ("value", "index 8 | 8"),
        ("to-robot", "ping, index 8 | ping, index 8 | ping | 1"),
        ("missing", "ping: no answer | no answer | -"),
        ("value", "index 9 | 9"),
        ("value", "err damaged (1) | damaged (1) | 1"),
        ("to-host", "pong, index 9: damaged | pong, index 9 | pong | 1"),
        ("warning", "err 1: ping was damaged (U12) | err"),
        ("answer", "ping answered after 30.0 µs | ping 30.0 µs | 30.0 µs"),
        ("value", "index 0 | 0"),
        ("unknown", "unknown, index 0: id 32, body 0102 | unknown, index 0 | id 32 | ?"),
        ("value", "body 0102 | body"),
        ("value", "index 0 | 0"),
        ("value", "version 39 | 39 | 39"),
        ("to-robot", "ota_request, index 0: version 39 | ota_request, index 0 | ota_request | 9"),
        ("warning", "version 39 starts a firmware update (U7) | hazard | !"),
        ("value", "index 0 | 0"),
        ("value", "state ? (5) | ? (5) | 5"),
        ("to-robot", "network_state, index 0: state 5, in 1 byte | network_state, index 0 | "
                     "network_state | 10"),
        ("warning", "state 5 is unknown (U8) | state"),
        ("warning", "length below 4 or above 60: hangs or corrupts shipped robots (U2, U13), if "
                    "the host sent it | length | !"),
        ("gap", "4 bytes skipped: length, invalid length (header 3, length 1) | 4 bytes "
                "skipped: length | 4 length | l"),
    ]),
}


def block(kind, body):
    """A block of a pcapng file."""
    body += bytes(-len(body) % 4)
    length = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + length + body + length


def pcapng(packets, name=b"ikeya", baud=make.IKEYA_BAUD):
    """A recording: the time of each packet in µs, its option of flags, and its bytes."""
    option = lambda code, value: struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)
    out = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    out += block(1, struct.pack("<HHI", 147, 0, 0) + option(3, name) +
                 option(8, struct.pack("<Q", baud)) + option(9, b"\6") + bytes(4))
    for time, flags, data in packets:
        time += 1_700_000_000_000_000
        head = struct.pack("<5I", 0, time >> 32, time & 0xFFFFFFFF, len(data), len(data))
        out += block(6, head + data + bytes(-len(data) % 4) + option(2, flags) + bytes(4))
    return out


SENT, GOT = b"\2\0\0\0", b"\1\0\0\0"
ASKED, GAVE = "read_request, node %d", "velocity_response, node %d: 1.0 rps"
PAIR = [(0, SENT, read(1)), (200, GOT, answer(1, 1.0))]
IN_TIME = [ASKED % 1, GAVE % 1, "node 1: 40.0 µs, in time: at most 50 µs (I9)"]
# Name, file, what make.py says of it, and the packets, times and warnings that are then seen.
RECORDINGS = (
    ("one pair", pcapng(PAIR), "", IN_TIME),
    ("slow bytes", pcapng([(0, SENT, bytes(60_000))], baud=300), make.TOO_LONG, []),
    ("many bytes at once", pcapng([(time, SENT, bytes(60_000)) for time in range(20)]),
     make.TOO_LONG, []),
    ("a long first chunk", pcapng([(0, SENT, 60 * read(0) + read(1)), PAIR[1]]), "",
     60 * ["node 0 with a good CRC: not 1 to 8 (I1)"] + IN_TIME),
    ("no flags", pcapng([(0, b"", read(1)), (100, b"\2", read(2))]), "",
     [ASKED % 1, ASKED % 2, "node 1: no answer", "node 2: no answer"]),
    ("a clock set back", pcapng([(1000, SENT, read(2)), (1200, GOT, answer(2, 1.0))] + PAIR), "",
     IN_TIME + [text.replace("node 1", "node 2") for text in IN_TIME]),
    ("two sections", pcapng(PAIR) + pcapng([(1000, SENT, ucp(1, b""))], b"ucp", make.UCP_BAUD),
     "only the first of its sections is drawn", IN_TIME),
    ("no folder", pcapng(PAIR), "/no such folder/out.sr: No such file or directory", []),
)


def streams():
    """Bytes to compare: name, protocol, bytes, options of the decoder."""
    for protocol, values in (("ikeya", values_of_ikeya()), ("ucp", values_of_ucp())):
        capture = (make.ROOT / "examples" / "captures" / (protocol + ".bin")).read_bytes()
        yield "capture-" + protocol, protocol, capture, ""
        yield "values-" + protocol, protocol, values, ""
    three = three_motors()
    yield "three", "ikeya-3", b"".join(three), ":boards=three"
    yield "three-noise", "ikeya-3", noisy(three, 7), ":boards=three"
    for direction in ("to-slave", "to-master"):
        data = noisy(make.vectors("ikeya"), 8)
        yield direction, "ikeya", data, ":direction=" + direction
    for protocol in ("ikeya", "ucp"):
        frames = make.vectors(protocol)
        yield "vectors-" + protocol, protocol, b"".join(frames), ""
        for seed in range(3):
            yield "noise-%s-%d" % (protocol, seed), protocol, noisy(frames, seed), ""


def noisy(frames, seed):
    """Frames with bit errors, insertions, deletions, bursts and cut frames in between."""
    chance = random.Random(seed)
    out = bytearray()
    starts = (0xAA, 0xBB, 0x55, 0x56, 0xFD, 0xFF)
    for _ in range(160):
        frame = bytearray(chance.choice(frames))
        kind = chance.randrange(10)
        if kind == 0:
            frame[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
        elif kind == 1:
            frame.insert(chance.randrange(len(frame)), chance.choice(starts))
        elif kind == 2:
            del frame[chance.randrange(len(frame))]
        elif kind == 3:
            frame = bytearray(chance.randrange(256) for _ in range(chance.randrange(3, 40)))
        elif kind == 4:
            frame = frame[:chance.randrange(1, len(frame))]
        elif kind == 5:
            frame[:0] = bytes(chance.choice(starts) for _ in range(chance.randrange(1, 6)))
        out += frame
    return bytes(out)


def values_of_ikeya():
    """Speeds of all sizes, and positions: an answer tells the mode of its node."""
    chance = random.Random(1)
    speeds = [0, 1, 0x80000000, 0x7F7FFFFF, 0x00800000, 0x007FFFFF, 0x7F800000, 0xFF800000,
              0x7FC00000, 0x3DCCCCCD, 0x5A0E1BCA, 0x4B800000, 0x38D1B717, 0x38D1B716, 0x4D000000]
    speeds += [(exponent << 23) for exponent in range(1, 255, 3)]
    speeds += [chance.getrandbits(32) for _ in range(250)]
    out = []
    for bits in speeds:
        out += [sealed("5502" + bits.to_bytes(4, "little").hex()),
                sealed("bb02" + bits.to_bytes(4, "little").hex()),
                sealed("bb04" + bits.to_bytes(4, "little").hex())]
    for _ in range(100):
        position = chance.getrandbits(32).to_bytes(4, "little").hex()
        out += [sealed("5603" + position), sealed("bb03" + position)]
    # 256 and 768 counts are halves of a ten-thousandth of a turn, which round to even.
    edges = [(256, 0), (768, 0), (-256, 0), (0, 0), (-1, 0), (4096, 0), (-8192, 1), (32767, 32767), (-32768, -32768), (1, -1)]
    out += [sealed("5603" + struct.pack("<hh", *edge).hex()) for edge in edges]
    return b"".join(out)


def values_of_ucp():
    """Every id with bodies of every length up to the cap, of zeros and of random bytes."""
    chance = random.Random(2)
    out = []
    for number in [*range(0, 12), 0x20, 0xFD, 0xFF]:
        for length in (0, 1, 2, 3, 4, 6, 12, 16, 18, 19, 20, 34, 35, 36, 37, 56):
            out.append(ucp(number, bytes(length), chance.randrange(256)))
            out.append(ucp(number, chance.randbytes(length), chance.randrange(256)))
    for number, length in ((1, 1), (3, 1), (3, 2), (4, 2), (6, 1), (7, 1), (9, 1), (10, 1)):
        for value in range(6):
            out.append(ucp(number, bytes([value] * length)))
    for front in (0, 100, 99, -1):
        out.append(motor(60, -20, front))
    # Halves, which round to even.
    for raw in (2048, 6144, -2048, 82, 246, 1638, -82, -41, 8192, 41, 409, 573, -16384, 1, -1, 0):
        out.append(ucp(5, struct.pack("<H4h3h", 100, 1, -1, 9999, 0, raw, -raw, raw) + bytes(20)))
        out.append(ucp(5, struct.pack("<H4h3h3h", 100, 1, -1, 9999, 0, 0, 0, 0, raw, -raw, raw)
                       + bytes(14)))
    out.append(b"\xfd\xff\x3d\0" + bytes(59))
    return b"".join(out)


def three_motors():
    chance = random.Random(3)
    frames = [read(1), read(8)]
    for node in range(1, 9):
        speeds = struct.pack("<3f", *(chance.uniform(-9, 9) for _ in range(3)))
        positions = struct.pack("<6h", *(chance.randrange(-32768, 32768) for _ in range(6)))
        # Written before the mode is known, and after.
        frames += [sealed("bb%02x" % node + speeds.hex())]
        frames += [sealed("55%02x" % node + speeds.hex())] * (node % 2)
        frames += [sealed("56%02x" % node + positions.hex())] * (1 - node % 2)
        frames += [sealed("bb%02x" % node + positions.hex())]
    return frames


def differs(what, found, want):
    """Raises with the first difference."""
    if found == want:
        return
    if isinstance(found, list):
        for number, (one, other) in enumerate(zip(found, want)):
            if one != other:
                raise Wrong("%s: number %d is %r, not %r" % (what, number, one, other))
        raise Wrong("%s: %d, not %d: %r" % (what, len(found), len(want), (found + want)[-1:]))
    raise Wrong("%s: %r, not %r" % (what, found, want))


def compare(capture, line, rows, decoders, counts):
    """Bytes, packets, values and gaps against the rows of axle, each in its place."""
    what, bit = capture.path.stem, line.bit
    by_kind = collections.defaultdict(list)
    for note in capture.notes(decoders):
        by_kind[ROWS.get(note.kind, note.kind)].append(note)
    want = collections.defaultdict(list)
    for row in rows:
        first, length = row["offset"], row["length"]
        if row["event"] == "skipped":
            want["gaps"].append((first, length, "gap", gap_text(row, length)))
            continue
        number = "node %d" % row["node"] if "node" in row else "index %d" % row["index"]
        text = "%s, %s" % (row["message"], number)
        kind = CLASSES[row["message"]]
        want["packets"].append((first, length, kind, text + (": " + row["text"]) * bool(row["text"])))
        want["values"] += [(first + at, size, "value", text) for at, size, text in values_of(row)]
    for name in ("gaps", "packets", "values"):
        found = [(note.kind, note.texts[0]) for note in by_kind[name]]
        differs("%s: %s" % (what, name), found, [(kind, text) for _, _, kind, text in want[name]])
        for note, (first, length, _, text) in zip(by_kind[name], want[name]):
            begin, end = line.places[first][0], line.places[first + length - 1][1]
            if abs(note.ss - begin) > bit or abs(note.es - end) > bit:
                raise Wrong("%s: %s is at %d to %d, not %d to %d" %
                            (what, text, note.ss, note.es, begin, end))
            shorter = [len(text) for text in note.texts]
            if shorter != sorted(shorter, reverse=True):
                raise Wrong("%s: texts that do not get shorter: %s" % (what, note.texts))
        counts[name] += len(want[name])
    compare_bytes(what, line, rows, by_kind["bytes"], counts)


def compare_bytes(what, line, rows, notes, counts):
    """Each byte is shown once, as part of what axle says."""
    if len(notes) != len(line.bytes):
        raise Wrong("%s: %d bytes, not %d" % (what, len(notes), len(line.bytes)))
    notes = sorted(notes, key=lambda note: note.ss)
    for note, value, (begin, end) in zip(notes, line.bytes, line.places):
        if note.texts[1] != "%02X" % value or not note.texts[0].startswith("%02X " % value):
            raise Wrong("%s: byte %02x is shown as %s" % (what, value, note.texts))
        if abs(note.ss - begin) > line.bit or abs(note.es - end) > line.bit:
            raise Wrong("%s: a byte at %d, not %d" % (what, note.ss, begin))
    for row in rows:
        held = notes[row["offset"]:row["offset"] + row["length"]]
        names = [note.texts[0][3:] for note in held]
        if row["event"] == "skipped":
            account = row.get("reasons") or {row["reason"]: row["length"]}
            differs(what + ": reasons of bytes", dict(collections.Counter(names)), account)
            differs(what + ": first reason", names[0], row["reason"])
            kind = "skipped-byte"
        else:
            differs(what + ": parts", names, parts_of(row))
            kind = "byte"
        if any(note.kind != kind for note in held):
            raise Wrong("%s: a byte of %s is not a %s" % (what, row, kind))
    counts["bytes"] += len(notes)


ROWS = {"byte": "bytes", "skipped-byte": "bytes", "value": "values", "gap": "gaps",
        "read": "packets", "write": "packets", "velocity": "packets", "position": "packets",
        "to-robot": "packets", "to-host": "packets", "unknown": "packets"}

TO_ROBOT = ("ping motor_control calibration_start calibration_end imu_bias_ack mag_bias_ack biases "
            "ota_request network_state").split()
TO_HOST = ("pong calibration_start_ack calibration_end_ack report imu_bias mag_bias bias_request "
           "ota_ack").split()
CLASSES = {"read_request": "read", "write": "write", "velocity_response": "velocity",
           "position_response": "position", "unknown": "unknown"}
CLASSES |= {name: "to-robot" for name in TO_ROBOT} | {name: "to-host" for name in TO_HOST}


def gap_text(row, length):
    text = "%d byte%s skipped: %s" % (length, "s" * (length != 1), row["text"].replace(": ", ", "))
    if "reasons" in row:
        text += " (%s)" % ", ".join("%s %d" % item for item in row["reasons"].items())
    return text


def parts_of(row):
    length = row["length"]
    if row["protocol"] == "ucp":
        return ["sync"] * 2 + ["length"] * 2 + ["id", "index"] + ["body"] * (length - 8) + ["crc"] * 2
    return ["header", "node"] + [CLASSES[row["message"]]] * (length - 4) + ["crc"] * 2


AXES = ("x", "y", "z")
WHEELS = ("front left", "front right", "back left", "back right")
ERR = {0: "fine", 1: "damaged"}
UPDATE = {0: "accepted", 1: "failed", 2: "forbidden"}
KIND = {1: "magnetometer", 2: "IMU"}
STATE = {0: "unknown", 1: "SIM absent", 2: "disconnected", 3: "connected", 4: "firmware update"}


def acc(raw):
    return "%.4f g (%d)" % (raw / 16384, raw)


def gyro(raw):
    return "%.2f deg/s (%d)" % (raw / 16.4, raw)


def plain(unit):
    return lambda raw: ("%d %s" % (raw, unit)).strip()


def code(words):
    return lambda raw: "%s (%d)" % (words.get(raw, "?"), raw)


# Field of the JSON: its name here, bytes of a number, text, names of its parts.
FIELDS = {
    "speed": ("speed", 2, plain("%"), None),
    "angular": ("angular", 2, plain("%"), None),
    "front_led": ("front led", 2, plain(""), None),
    "back_led": ("back led", 2, plain(""), None),
    "version": ("version", 2, plain(""), None),
    "reserve1": ("reserve1", 2, plain(""), None),
    "reserve2": ("reserve2", 4, plain(""), None),
    "battery_pct": ("battery", 2, plain("%"), None),
    "rpm": ("rpm", 2, plain("rpm"), WHEELS),
    "acc": ("acc", 2, acc, AXES),
    "gyro": ("gyro", 2, gyro, AXES),
    "mag": ("mag", 2, plain("counts"), AXES),
    "heading": ("heading", 2, plain("deg"), None),
    "power_w": ("power", 1, plain("W"), None),
    "voltage_dv": ("voltage", 1, lambda raw: "%.1f V" % (raw / 10), None),
    "current_ca": ("current", 2, lambda raw: "%.2f A" % (raw / 100), None),
    "acc_bias": ("acc bias", 2, acc, AXES),
    "gyro_bias": ("gyro bias", 2, gyro, AXES),
    "mag_bias": ("mag bias", 2, plain("counts"), AXES),
    "err": ("err", 1, code(ERR), None),
    "type": ("type", 1, code(KIND), None),
}
# The order of the document's report on the wire (ruling U5).
DOCUMENT = ("battery_pct", "rpm", "power_w", "voltage_dv", "current_ca", "acc", "gyro", "mag",
            "heading")


def values_of(row):
    """Each value of a row: its place in the frame, its bytes, and its text."""
    return values_of_rover(row) if row["protocol"] == "ucp" else values_of_node(row)


def values_of_rover(row):
    yield 5, 1, "index %d" % row["index"]
    if row.get("body"):
        yield 6, len(row["body"]) // 2, "body " + row["body"]
    names = DOCUMENT if row.get("layout") == "document" else row
    at = 6
    for name in names:
        if name == "state":
            size, text = row["state_width"], code(STATE)
            yield at, size, "state " + text(row[name])
        if name not in FIELDS or (name == "acc" and row["message"] == "ping"):
            continue
        label, size, text, parts = FIELDS[name]
        if name == "version" and row["message"] == "report":
            label = "firmware"
        if name == "err" and row["message"] == "ota_ack":
            text = code(UPDATE)
        numbers = row[name] if isinstance(row[name], list) else [row[name]]
        for number, part in zip(numbers, parts or ("",)):
            yield at, size, ("%s %s" % (label, part)).strip() + " " + text(number)
            at += size


def values_of_node(row):
    yield 1, 1, "node %d" % row["node"]
    message, mode = row["message"], row.get("mode")
    if message == "read_request":
        return
    if message == "write" and mode is None:
        yield 2, row["length"] - 4, row["text"]
        return
    if message == "velocity_response" or mode == "velocity":
        # The text is that of axle, a number for each motor.
        for number, text in enumerate(row["text"].removesuffix(" rps").split()):
            speed = row["rps"] if isinstance(row["rps"], float | int | str) else row["rps"][number]
            if f32(text) != f32(speed):
                raise Wrong("axle says %s and %s" % (text, speed))
            yield 2 + 4 * number, 4, "speed %s rps" % text
        return
    at = 2
    for name, unit in (("count", "counts"), ("rotation", "turns")):
        for number in row[name] if isinstance(row[name], list) else [row[name]]:
            yield at, 2, "%s %d %s" % (name, number, unit)
            at += 2


def f32(number):
    """Its bytes: JSON and text may end in different digits of the same number."""
    return struct.pack("<f", float(number))


def planted(cases, target):
    """Each damage of the decoders must be found."""
    missed = []
    for name, text, replacement in DAMAGES:
        decoders = copied(target)
        path = decoders / name
        before = path.read_text()
        if before.count(text) < 1:
            sys.exit("planted: %s does not contain: %s" % (name, text))
        path.write_text(before.replace(text, replacement, 1))
        try:
            for case in cases.of(name):
                case(decoders, collections.Counter())
        except Wrong as wrong:
            print("found: %s: %s: %s" % (name, text.strip()[:50], str(wrong)[:100]))
            continue
        missed.append("%s: %s" % (name, text))
    if missed:
        sys.exit("planted, and not found: " + "; ".join(missed))
    print("%d damages to the decoders and make.py, each found" % len(DAMAGES))


WIRE, TEXT, NODE, ROVER, MAKE = ("axle_ikeya/axle_wire.py", "axle_ikeya/axle_text.py",
                                 "axle_ikeya/pd.py", "axle_ucp/pd.py", "../make.py")
DAMAGES = (
    # The search for frames.
    (WIRE, "0xA001", "0x8005"),
    (WIRE, "values[-2] | values[-1] << 8", "values[-1] | values[-2] << 8"),
    (WIRE, "if len(self.held) >= self.need:", "if len(self.held) > self.need:"),
    (WIRE, "yield self.skip(verdict[1], verdict[2])", "yield self.skip(verdict[1], len(self.held))"),
    (WIRE, "                yield from self.end_gap()\n                frame,", "                frame,"),
    (WIRE, "            self.gap = Gap()\n", ""),
    (WIRE, "        self.es = skipped[-1].es\n", "        self.es = self.es or skipped[-1].es\n"),
    (WIRE, "if self.reason is None:", "if True:"),
    (WIRE, "+ len(skipped)", "+ 1"),
    (WIRE, 'yield self.skip("idle", 1)', 'yield self.skip("idle", len(self.held))'),
    (WIRE, "            yield from self.look()\n        yield", "        yield"),
    (WIRE, '"truncated at the end"', '"cut off"'),
    (WIRE, 'if length == 1 else "bytes"', 'if length == 2 else "bytes"'),
    (WIRE, '"little", signed=True', '"big", signed=True'),
    (WIRE, '"little", signed=True', '"little"'),
    # Times and silence.
    (NODE, "            self.give_up(None)\n", "            pass\n"),
    (NODE, "and self.open.es <= since", "and self.open.es < 0"),
    (WIRE, "samples * 1e6", "samples * 1e5"),
    (WIRE, "micros / 1e3", "micros / 1e2"),
    (WIRE, "            self.quiet(wire, es)\n", "            pass\n"),
    (WIRE, "limit * 1e3", "limit * 500"),
    (WIRE, " or limit <= 0", ""),
    (WIRE, "            self.show(wire, search.idle())\n        self.give_up(None)", "            pass"),
    (WIRE, "            if not value[1]:", "            if False:"),
    (WIRE, "            self.data[wire] = None\n", "            self.data[wire] = self.data[wire]\n"),
    (WIRE, '["%s %s" % (text, reason), text]', '["%s" % text, text]'),
    (WIRE, 'self.note("value", held[0].ss, held[-1].es', 'self.note("value", held[0].ss, held[0].es'),
    (WIRE, "            at += count\n", ""),
    # Numbers.
    (TEXT, "floor % 2 == 1", "floor % 2 == 0"),
    (TEXT, '"-" * is_negative', '""'),
    (TEXT, "COUNTS_PER_TURN = 8192", "COUNTS_PER_TURN = 2048"),
    (TEXT, "low <= number * unit <= high if is_even else", "low < number * unit < high if is_even else"),
    (TEXT, "low < number * unit < high)", "low <= number * unit <= high)"),
    (TEXT, "fraction == 0 and exponent > 1", "False"),
    (TEXT, "-number", "number"),
    (TEXT, "-3 <= point", "-2 <= point"),
    (TEXT, "1 <= point <= 16", "1 <= point <= 15"),
    # The motor bus.
    (NODE, '"id", length)', '"id", 1)'),
    (NODE, "1 <= values[1] <= 8", "1 <= values[1] <= 9"),
    (NODE, '"three": 16', '"three": 8'),
    (NODE, '"to-slave": TO_SLAVE', '"to-slave": TO_MASTER'),
    (NODE, "mode if header == WRITE else header\n        if reading == VELOCITY", "header\n        if reading == VELOCITY"),
    (NODE, "reading = mode if header == WRITE else header\n        if header == READ", "reading = mode or header\n        if header == READ"),
    (NODE, "numbers[:len(numbers) // 2], numbers[len(numbers) // 2:]", "numbers[::2], numbers[1::2]"),
    (NODE, "2 + 4 * number, 4", "2, 4"),
    (NODE, "        self.modes[node] = header\n", ""),
    (NODE, "if before not in (None, header):", "if before is not None:"),
    (NODE, "not abs(speed) < float", "abs(speed) == float"),
    (NODE, "(header == WRITE and mode == VELOCITY)", "header == WRITE"),
    (NODE, "elif request.key != node:", "elif False:"),
    (NODE, "            self.open = None\n            self.measure", "            self.measure"),
    (NODE, "        self.give_up(frame.ss)\n", ""),
    (NODE, "self.strikes[node] == STRIKES", "self.strikes[node] > STRIKES"),
    (NODE, "self.strikes[node] = 0", "pass"),
    (NODE, '"desc": "An answer in less is too fast, µs", "default": 2', '"desc": "x", "default": 1'),
    (NODE, '"default": 50}', '"default": 51}'),
    (NODE, '"default": 500}', '"default": 499}'),
    (NODE, "frame.ss - request.es\n", "frame.es - request.es\n"),
    (NODE, "min(request.es, frame.ss), max", "request.es, max"),
    (NODE, "if is_answered:", "if True:"),
    # The rover's link.
    (ROVER, "SHORTEST, LONGEST = 4, 60", "SHORTEST, LONGEST = 4, 61"),
    (ROVER, "SHORTEST, LONGEST = 4, 60", "SHORTEST, LONGEST = 3, 60"),
    (ROVER, "values[3] << 8", "values[3] << 4"),
    (ROVER, "if len(values) > 3 else 0", "if len(values) > 4 else 0"),
    (ROVER, "return \"partial\", len(values) + 1", "return \"partial\", 9"),
    (ROVER, 'Field("heading", "i16", unit("deg"))', 'Field("heading", "u16", unit("deg"))'),
    (ROVER, "raw, 2) +", "raw, 1) +"),
    (ROVER, "raw / 16384", "raw / 8192"),
    (ROVER, 'WHEELS = ("front left", "front right"', 'WHEELS = ("front right", "front left"'),
    (ROVER, "(BATTERY, RPM) + POWER + SENSORS", "(BATTERY, RPM) + SENSORS + POWER"),
    (ROVER, 'Message("mag_bias_ack", True', 'Message("mag_bias_ack", False'),
    (ROVER, '{0: "off", 100: "on"}', '{0: "off", 1: "on"}'),
    (ROVER, "< version < 0x8000", "< version"),
    (ROVER, "if battery <= 100", "if battery < 100"),
    (ROVER, "abs(raw) * 100, 16384), 2", "abs(raw) * 10, 16384), 1"),
    (ROVER, "abs(of[name][0]) > 100", "of[name][0] > 100"),
    (ROVER, 'for name in ("back led", "reserve1", "reserve2"):\n            if', 'for name in ("reserve1", "reserve2"):\n            if'),
    (ROVER, "not in (0, 100)", "not in (0, 1, 100)"),
    (ROVER, 'of["battery"][0] > 100:', 'of["battery"][0] > 101:'),
    (ROVER, "(last + 1) % 256", "last + 1"),
    (ROVER, "        self.last_index[wire] = index\n", "        self.last_index.setdefault(wire, index)\n"),
    (ROVER, "if len(body) < min(lengths):", "if len(body) != min(lengths):"),
    (ROVER, '("unknown", WIRES[wire])', '("unknown", "rx")'),
    (ROVER, 'reason == "length" and', "False and"),
    (ROVER, '"ota_request": "ota_ack",', ""),
    (ROVER, "            self.close(message.name, frame.ss)\n", ""),
    (ROVER, "frame.ss - request.es\n", "frame.es - request.es\n"),
    (ROVER, "if number == REPORT and", "if False and"),
    (ROVER, "bytes(SYNC) in bytes(body)", "False"),
    # Found by an attack on this check: texts, rows, options, places, strikes.
    (WIRE, 'return [text, head, "%d %s" % (length, self.reason), self.reason[0]]', 'return [text, head, "%d" % length, ""]'),
    (WIRE, "if abs(micros) < 1e4:", "if abs(micros) < 1e3:"),
    (WIRE, "if abs(micros) < 1e4:", "if micros < 1e4:"),
    (WIRE, "self.silent(search.end)", "self.silent(until)"),
    (WIRE, '"default": 20,', '"default": 16,'),
    (NODE, "self.open.es <= since", "self.open.es <= since + 1000000"),
    (NODE, "slack = self.micros(1)", "slack = 0"),
    (NODE, "micros < fastest - slack", "micros < fastest"),
    (NODE, "micros <= timeout + slack", "micros <= timeout"),
    (NODE, 'time, "%d" % round(micros)]', 'time, "%d" % round(samples)]'),
    (NODE, "            in_time = False\n", "            pass\n"),
    (NODE, "            self.strike(node, frame.ss, frame.es)\n", "            pass\n"),
    (NODE, "in_time = True", "in_time = micros <= budget + slack"),
    (NODE, "self.note(kind, ss, max(es, ss + 1),", "self.note(kind, ss, es,"),
    (NODE, "max(request.es + 1, min(until, limit))", "min(until, limit)"),
    (NODE, "max(request.es + 1, min(until, limit))", "max(request.es + 1, until)"),
    (NODE, "self.samplerate // 1_000_000)", "self.samplerate // 2_000_000)"),
    (NODE, 'header == READ or self.options["boards"] == "three"', "header == READ"),
    (NODE, '            self.warn(frame.ss, frame.es, text, "foreign"', '            self.open = None\n            self.warn(frame.ss, frame.es, text, "foreign"'),
    (NODE, 'self.options["budget_us"], self.options["timeout_us"]', 'self.options["budget_us"], 500'),
    (NODE, 'self.options["budget_us"], self.options["timeout_us"]', '50, self.options["timeout_us"]'),
    (NODE, 'fastest = self.options["turnaround_us"]', "fastest = 2"),
    (NODE, '"Packets", (2, 3, 4, 5)', '"Packets", (2, 3, 4)'),
    (NODE, '"Gaps", (7,)', '"Gaps", ()'),
    (NODE, '"Response times", (8, 9, 10, 11)', '"Response times", (8, 9, 10)'),
    (NODE, '"Warnings", (12,)', '"Warnings", ()'),
    (NODE, 'self.warn(frame.ss, frame.es, text, "not finite"', 'self.warn(frame.ss, frame.ss + 1, text, "not finite"'),
    (NODE, "self.warn(skipped[0].ss, skipped[-1].es, text", "self.warn(skipped[0].ss, skipped[0].es, text"),
    (NODE, 'self.note("missing", request.es, until,', 'self.note("missing", 0, until,'),
    (NODE, '"three")},', '"two")},'),
    (ROVER, 'self.warn(skipped[0].ss, skipped[0].es, text, "length"', 'self.warn(0, skipped[0].es, text, "length"'),
    (ROVER, 'self.warn(frame.ss, frame.es, text, "hazard"', 'self.warn(0, frame.es, text, "hazard"'),
    (ROVER, '("unknown",) + WIRES', '("unknown", "rx")'),
    (ROVER, '"Packets", (2, 3, 4)', '"Packets", (2, 3)'),
    (ROVER, '"Response times", (7, 8)', '"Response times", (7,)'),
    (ROVER, '"Warnings", (9,)', '"Warnings", ()'),
    (ROVER, "max(es, ss + 1), [text,", "es, [text,"),
    (ROVER, "ss, es = min(request.es, frame.ss), max(request.es, frame.ss)", "ss, es = request.es, frame.ss"),
    (ROVER, "request.es, max(until, request.es + 1),", "request.es, request.es + 1,"),
    (ROVER, 'of["version"][0] > LAST', 'abs(of["version"][0]) > LAST'),
    (ROVER, 'of["state"][0] not in STATES', 'of["state"][0] > 5'),
    (ROVER, 'message.name, "%d" % number]', 'message.name, "%d" % index]'),
    (ROVER, '== "unknown" else ""', '== "both" else ""'),
    (ROVER, "in bytes(body) and self.may_be_host(wire):", "in bytes(body):"),
    # One direction, and echoes.
    (NODE, 'if self.options["direction"] == "both":', "if True:"),
    (NODE, "if self.is_echo(wire, frame):", "if False:"),
    (NODE, "frame.ss - carried[0].es > limit", "False"),
    (NODE, "if sent.values == frame.values:", "if place == 0 and sent.values == frame.values:"),
    (NODE, "self.carried[1 - wire]", "self.carried[wire]"),
    (NODE, "ECHO_MS = 20", "ECHO_MS = 26"),
    (NODE, "if header in TO_MASTER:", "if False:"),
    # Recordings that are drawn.
    (MAKE, "    packets.sort(key=lambda packet: packet[0])\n", ""),
    (MAKE, "if max(free.values()) > MOST_SECONDS + 1:", "if False:"),
    (MAKE, 'int.from_bytes(flags, "little")', "flags[0]"),
    (MAKE, '"%s.%d.part" % (path, os.getpid())', '"%s.part" % path'),
    (MAKE, "if kind == 0x0A0D0D0A and at > 0:", "if False:"),
    (MAKE, "    if not is_all:\n", "    if False:\n"),
    (MAKE, "duration - seconds + 2 * BITS / baud", "0"),
    (MAKE, "        raise Unwritable(", "        raise ValueError("),
    # The folders.
    ("axle_ucp/__init__.py", '"axle_ucp needs', '"x needs'),
    ("axle_ikeya/__init__.py", "from .pd import Decoder", ""),
)


if __name__ == "__main__":
    main()
