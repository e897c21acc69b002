#!/usr/bin/env python3
"""Compares the sigrok decoders with `axle decode`, on captures that `make.py` renders.

Of the same bytes, every packet, value, byte and gap must be that of `axle decode`, in its place in
time. Response times and warnings must be those of story.py, which are written by hand. Exit code 1
if anything differs. AXLE is the program, by default that of target/debug. Needs sigrok-cli.
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
from story import FRAMING, STORIES

HERE = Path(__file__).resolve().parent
AXLE = os.environ.get("AXLE") or make.ROOT / "target/debug/axle"
BAUDS = {"ikeya": make.IKEYA_BAUD, "ikeya-3": make.IKEYA_BAUD, "ucp": make.UCP_BAUD}
# By their names: an annotation whose class is in no row is then missing.
ROW_NAMES = "bytes:packets:values:gaps:responses:warnings"
# Silence behind every capture: longer than the 20 ms after which a candidate is given up.
SILENCE_US = 25_000
# Fewer values mean that hardly anything was compared.
LEAST_VALUES = 50_000

AXES = ("x", "y", "z")
WHEELS = ("front left", "front right", "back left", "back right")
NAMES = {"battery_pct": "battery", "power_w": "power", "voltage_dv": "voltage",
         "current_ca": "current", ("report", "version"): "firmware"}
UNITS = {"battery_pct": "%", "power_w": "W", "rpm": "rpm", "mag": "counts", "mag_bias": "counts",
         "heading": "deg", "speed": "%", "angular": "%", "count": "counts", "rotation": "turns"}
SCALES = {"acc": ("%.4f g (%d)", 16384), "acc_bias": ("%.4f g (%d)", 16384),
          "gyro": ("%.2f deg/s (%d)", 16.4), "gyro_bias": ("%.2f deg/s (%d)", 16.4),
          "voltage_dv": ("%.1f V", 10), "current_ca": ("%.2f A", 100)}
WORDS = {"err": ("fine", "damaged"), ("ota_ack", "err"): ("accepted", "failed", "forbidden"),
         "type": ("?", "magnetometer", "IMU"),
         "state": ("unknown", "SIM absent", "disconnected", "connected", "firmware update")}
OF_FRAME = {"event", "offset", "length", "protocol", "message", "id", "bytes", "payload", "mode",
            "layout", "state_width", "text", "rps"}
CLASSES = {"read_request": "read", "write": "write", "velocity_response": "velocity",
           "position_response": "position", "unknown": "unknown"}
PACKETS = {*CLASSES.values(), "to-host", "to-robot"}
TO_HOST = ("pong calibration_start_ack calibration_end_ack report imu_bias mag_bias bias_request "
           "ota_ack").split()

Note = collections.namedtuple("Note", "kind ss es texts")


def sigrok(scratch, *arguments):
    """Runs sigrok-cli with these decoders, not with those that the user may have."""
    variables = {"SIGROKDECODE_DIR": str(scratch), "HOME": str(scratch), "LC_ALL": "C.UTF-8",
                 "PYTHONDONTWRITEBYTECODE": "1", "PATH": os.environ["PATH"]}
    ran = subprocess.run(["sigrok-cli", *arguments], env=variables, timeout=300,
                         capture_output=True, text=True)
    return ran.stdout, ran.stderr


def notes_of(path, protocol, wires, options=""):
    """What the decoder shows of a capture."""
    name = "axle_" + protocol.removesuffix("-3")
    options += ":boards=three" * (protocol == "ikeya-3")
    pins = ":".join(("rx=RX", "tx=TX")[:wires])
    out, err = sigrok(path.parent, "-l", "4", "-i", str(path), "--protocol-decoder-samplenum",
                      "-P", "uart:%s:baudrate=%d,%s%s" % (pins, BAUDS[protocol], name, options),
                      "-A", "%s=%s" % (name, ROW_NAMES))
    if re.search("^srd: .*(?:Error|[Ff]ail)", err, re.MULTILINE):
        sys.exit("%s: sigrok-cli: %s" % (path.stem, err))
    notes = []
    for line in out.splitlines():
        ss, es, kind, texts = re.match(r'(\d+)-(\d+) axle_\w+-1: ([\w-]+): "(.*)"$', line).groups()
        notes.append(Note(kind, int(ss), int(es), texts.split('" "')))
    return notes


def decoded(arguments, data=None):
    """The frames and gaps of `axle decode --json`, with their contents as text."""
    def run(*more):
        command = [AXLE, "decode", *arguments, *more]
        return subprocess.run(command, input=data, check=True, stdout=subprocess.PIPE).stdout

    rows = [json.loads(line) for line in run("--json").decode().splitlines()]
    rows = [row for row in rows if row["event"] in ("frame", "skipped")]
    for row, line in zip(rows, run("--time", "none").decode().splitlines()[1:]):
        row["text"] = line[49:]
    return rows


def head_of(row):
    """The text of a packet."""
    number = "node %d" % row["node"] if "node" in row else "index %d" % row["index"]
    return "%s, %s" % (row["message"], number) + (": " + row["text"]) * bool(row["text"])


def class_of(row):
    return CLASSES.get(row["message"], "to-host" if row["message"] in TO_HOST else "to-robot")


def text_of(message, key, number):
    """A value with its unit, or in words."""
    if key in SCALES:
        form, one = SCALES[key]
        return form % ((number / one, number) if "(" in form else number / one)
    words = WORDS.get((message, key)) or WORDS.get(key)
    if words:
        return "%s (%d)" % (words[number] if number < len(words) else "?", number)
    return ("%d %s" % (number, UNITS.get(key, ""))).strip()


def values_of(row):
    """Name and text of each value, or the bits of a speed, in the order of the names: that of some
    reports on the wire is not that of the lines."""
    if row["message"] == "write" and "mode" not in row:
        return sorted([("node", str(row["node"])), (row["text"], "rps or turns")])
    # The lines have what a write means in either mode.
    other = {"velocity": ("count", "rotation"), "position": ("rps",)}.get(row.get("mode"), ())
    values = []
    for key, value in row.items():
        name = NAMES.get((row["message"], key)) or NAMES.get(key, key.replace("_", " "))
        numbers = value if isinstance(value, list) else [value]
        if key == "body":
            values += [("body " + value, "body")] * bool(value)
        elif key == "rps" and key not in other:
            values += [("speed", f32(it)) for it in numbers]
        elif key not in (*OF_FRAME, *other):
            parts = [""] * len(numbers)
            if isinstance(value, list) and row["protocol"] == "ucp":
                parts = WHEELS if key == "rpm" else AXES
            values += [(("%s %s" % (name, part)).strip(), text_of(row["message"], key, number))
                       for part, number in zip(parts, numbers)]
    return sorted(values, key=lambda it: it[0])


def parts_of(row):
    """What each byte of a frame is."""
    body = row["length"] - (8 if row["protocol"] == "ucp" else 4)
    if row["protocol"] == "ucp":
        return ["sync"] * 2 + ["length"] * 2 + ["id", "index"] + ["body"] * body + ["crc"] * 2
    return ["header", "node"] + [class_of(row)] * body + ["crc"] * 2


def f32(number):
    """Its bits: JSON and text may end in different digits of the same number."""
    return struct.pack("<f", float(number))


def next_of(shown, begin, end):
    """Takes the notes that are within these bytes."""
    taken = []
    while shown and shown[0][0] is not None and begin <= shown[0][0] and shown[0][1] <= end:
        taken.append(shown.pop(0))
    return taken


class Check:
    """Counts what is compared, and keeps what differs."""

    def __init__(self, scratch):
        self.scratch = scratch
        self.values = self.packets = 0
        self.differences = []

    def expect(self, where, found, wanted):
        self.values += 1
        if found != wanted:
            self.differences.append("%s: %r, not %r" % (where, found, wanted))

    def render(self, name, lines):
        path = self.scratch / (name + ".sr")
        end = max(line.places[-1][1] for line in lines if line.places)
        make.write(path, ["RX", "TX"][:len(lines)], lines, int(end + make.micros(SILENCE_US)))
        return path

    def stream(self, name, protocol, parts, options=""):
        """Bytes on one wire against `axle decode`. Silence ends what is open behind each part."""
        line, dice, at, rows, sent = make.Line(BAUDS[protocol]), random.Random(name), 500.0, [], 0
        way = re.search("direction=([a-z-]+)", options)
        arguments = ["--protocol", protocol, *(["--direction", way.group(1)] if way else [])]
        for data in parts:
            rows += [row | {"offset": row["offset"] + sent} for row in decoded(arguments, data)]
            sent += len(data)
            for begin in range(0, len(data), 16):
                at = line.send(data[begin:begin + 16], at)
                at += make.micros(dice.choice((0, 0, 0.7, 33, 190)))
            # A spike shorter than half a bit is no byte.
            line.spans.append((int(at + 100), int(at + 103)))
            at += make.micros(20_500)
        notes = notes_of(self.render(name, [line]), protocol, 1, options)
        bytes_shown = sorted((it for it in notes if it.kind in ("byte", "skipped-byte")),
                             key=lambda it: it.ss)
        self.expect(name + ": bytes", len(bytes_shown), sent)
        for note, value, place in zip(bytes_shown, line.bytes, line.places):
            is_there = max(abs(note.ss - place[0]), abs(note.es - place[1])) <= line.bit
            self.expect(name + ": a byte", (is_there, note.texts[1]), (True, "%02X" % value))
        # Where other notes are, as the bytes from and until which.
        begins = {note.ss: number for number, note in enumerate(bytes_shown)}
        ends = {note.es: number + 1 for number, note in enumerate(bytes_shown)}
        shown = collections.defaultdict(list)
        for note in notes:
            kind = "packet" if note.kind in PACKETS else note.kind
            shown[kind].append((begins.get(note.ss), ends.get(note.es), note))
        for row in rows:
            begin, end = row["offset"], row["offset"] + row["length"]
            self.row("%s: byte %d" % (name, begin), row, bytes_shown[begin:end],
                     *(next_of(shown[kind], begin, end) for kind in ("packet", "gap", "value")))
        for kind in ("packet", "gap", "value"):
            self.expect("%s: more of kind %s" % (name, kind), shown[kind], [])

    def row(self, where, row, held, packets, gaps, values):
        """What is shown of a frame or gap, and of each of its bytes."""
        words = [note.texts[0][3:] for note in held]
        place = row["offset"], row["offset"] + row["length"]
        if row["event"] == "skipped":
            reasons = row.get("reasons", {row["reason"]: row["length"]})
            text = "%d byte%s skipped: %s" % (row["length"], "s" * (row["length"] != 1),
                                              row["text"].replace(": ", ", "))
            if "reasons" in row:
                text += " (%s)" % ", ".join("%s %d" % item for item in reasons.items())
            self.expect(where, [(*at, note.texts[0]) for *at, note in gaps], [(*place, text)])
            self.expect(where, collections.Counter(words), reasons)
            self.expect(where, (packets, values), ([], []))
            self.expect(where, {it.kind for it in held}, {"skipped-byte"})
            return
        self.packets += 1
        self.expect(where, [(*at, it.kind, it.texts[0]) for *at, it in packets],
                    [(*place, class_of(row), head_of(row))])
        self.expect(where, words, parts_of(row))
        self.expect(where, {it.kind for it in held}, {"byte"})
        self.expect(where, gaps, [])
        # Together the values are of all bytes from the node or index to the CRC, each of its own.
        begin = row["offset"] + (5 if row["protocol"] == "ucp" else 1)
        edges = [begin] + [end for _, end, _ in values]
        self.expect(where, [at for at, _, _ in values], edges[:-1])
        self.expect(where, edges[-1], place[1] - 2)
        found = []
        for at, end, note in values:
            text, last = note.texts[1], note.texts[-1]
            name = note.texts[0].removesuffix(" " + text)
            of_motor = name == "speed" and row["protocol"] != "ucp"
            found.append((name, f32(last) if of_motor else text))
            if re.fullmatch(r"-?\d+", last) and not of_motor:
                raw = bytes(int(it.texts[1], 16) for it in held[at - row["offset"]:][:end - at])
                number = int(last) % 256 ** len(raw)
                self.expect(where + ": " + name, int.from_bytes(raw, "little"), number)
        self.expect(where, sorted(found, key=lambda it: it[0]), values_of(row))

    def story(self, name, protocol, wires, options, steps):
        """Response times and warnings, to within a bit time."""
        lines, at, wanted = [make.Line(BAUDS[protocol]) for _ in range(wires)], 500.0, []
        for wire, pause, data, *texts in steps:
            line = lines[wire % wires]
            at = max(at, line.send(data, at + make.micros(pause)))
            if FRAMING in texts:
                # The stop bit has the wrong level.
                line.spans.append((round(at - line.bit), round(at)))
            wanted += texts
        notes = [note for note in notes_of(self.render(name, lines), protocol, wires, options)
                 if note.kind not in {*PACKETS, "byte", "skipped-byte", "value", "gap"}]
        found = [note.texts[0] for note in notes]
        bit = 1e6 / BAUDS[protocol]
        self.expect(name + ": how many", len(found), len(wanted))
        for note, text in zip(notes, wanted):
            shown, times = split(note.texts[0])
            words, told = split(text)
            self.expect(name, shown, words)
            for time, other in zip(times, told):
                span = (note.es - note.ss) * 1e6 / make.SAMPLE_RATE
                # Of a long time, hundredths of a millisecond are told.
                most = bit + 5 * (abs(time) >= 1e4)
                self.expect("%s: %s" % (name, text), (abs(time - other) <= most,
                                                      abs(span - abs(time)) <= most), (True, True))


def split(text):
    """A text without its time, and the time in µs."""
    times = re.findall(r"(-?\d+\.\d+) (µs|ms)", text)
    return (re.sub(r"-?\d+\.\d+ ([µm]s)", r"\1", text),
            [float(number) * (1000 if unit == "ms" else 1) for number, unit in times])


def streams():
    """Name, protocol, parts, and options of the decoder."""
    dice = random.Random(1)
    speeds = [dice.randbytes(4).hex() for _ in range(300)]
    # Zeros, powers of two, and positions whose last digit is a half, which rounds to even.
    speeds += [struct.pack("<I", exponent << 23).hex() for exponent in range(0, 511, 3)]
    speeds += ["00010000", "00030000", "00ff0000"]
    bodies = [make.ucp(number, dice.randbytes(length), number)
              for number in [*range(12), 0x20, 0xFF]
              for length in (0, 1, 2, 3, 4, 6, 12, 16, 18, 19, 20, 34, 36, 56)]
    yield "speeds", "ikeya", [b"".join(make.sealed(head + it) for it in speeds
                                       for head in ("5502", "bb02", "5603", "bb03", "bb04"))], ""
    yield "bodies", "ucp", [b"".join(bodies)], ""
    for protocol in BAUDS:
        frames = make.vectors(protocol)
        yield "vectors-" + protocol, protocol, [b"".join(frames)], ""
        yield "noise-" + protocol, protocol, [b"".join(make.noisy(frames, 1))], ""
    for protocol in ("ikeya", "ucp"):
        path = make.ROOT / "examples" / "captures" / (protocol + ".bin")
        yield "capture-" + protocol, protocol, [path.read_bytes()], ""
    yield "silence", "ucp", [b"".join(make.noisy(frames, seed, 20)) for seed in range(5)], ""
    for direction in ("to-slave", "to-master"):
        data = b"".join(make.noisy(make.vectors("ikeya"), 2))
        yield direction, "ikeya", [data], ":direction=" + direction


def recorded(check, name, protocol, begin, end):
    """A part of a recording, drawn by make.py, has the packets that axle finds in it."""
    source = make.ROOT / "examples" / "captures" / (name + ".pcapng")
    path = check.scratch / (name + ".sr")
    make.recording(source, path, begin, end)
    rows = decoded([source])
    wanted = [head_of(row) for row in rows
              if row["event"] == "frame" and begin <= row["t"] - rows[0]["t"] <= end]
    found = [note.texts[0] for note in notes_of(path, protocol, 2) if note.kind in PACKETS]
    check.expect(name, collections.Counter(found), collections.Counter(wanted))
    check.packets += len(found)


def main():
    with tempfile.TemporaryDirectory(prefix="axle-sigrok-") as scratch:
        check = Check(Path(scratch))
        shutil.copytree(HERE / "axle_ucp", check.scratch / "axle_ucp")
        _, err = sigrok(scratch, "-P", "axle_ucp", "--show")
        needs = "axle_ucp needs the folder axle_ikeya beside it"
        check.expect("axle_ucp alone", needs in err, True)
        shutil.copytree(HERE / "axle_ikeya", check.scratch / "axle_ikeya")
        for stream in streams():
            check.stream(*stream)
        recorded(check, "motors", "ikeya", 0.0, 1.0)
        recorded(check, "drive", "ucp", 0.0, 0.5)
        for story in STORIES:
            check.story(*story)
    print("%d values of %d packets: %d differences" %
          (check.values, check.packets, len(check.differences)))
    print(*check.differences[:20], sep="\n", end="\n" if check.differences else "")
    if check.values < LEAST_VALUES:
        sys.exit("fewer than %d values were compared" % LEAST_VALUES)
    return bool(check.differences)


if __name__ == "__main__":
    sys.exit(main())
