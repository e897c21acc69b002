#!/usr/bin/env python3
"""Compares what tshark shows through axle.lua with `axle decode --json`, field by field.

Compared are examples/captures, the frames of tests/vectors, noise, and what tshark captures of a
simulated rover: every field of every frame and gap, its time and direction, and that there is
nothing else. Texts, response times and warnings are compared with story.py. Exit code 1 if anything
differs. AXLE is the program, by default that of target/debug.

tshark runs as an ordinary user with a home of its own, into which install.sh installs; for root,
that is the user `nobody`, because tshark ignores folders of plugins that are root's choice.
"""
import json
import os
import pwd
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
from pathlib import Path

import containers
from story import IN, OUT, STORY, UNKNOWN, make

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
AXLE = Path(os.environ.get("AXLE") or ROOT / "target/debug/axle")
LINK_TYPES = {"ikeya": 147, "ikeya-3": 148, "ucp": 150}
WAYS = {"in": IN, "out": OUT, None: UNKNOWN}
# Fewer values mean that hardly anything was compared.
LEAST_VALUES = 100_000
LIVE_PACKETS = 100
# Random files.
CONTAINERS = 120
WARNINGS = {"bad_crc", "gap", "unanswered", "late", "foreign", "mode_changed", "not_a_number",
            "hazard", "battery"}
# Fields of exchanges, which no line of JSON has; and keys of JSON that Wireshark itself shows.
EXCHANGE = {"request_in", "answer_in", "response_time_us", "response_time_of"}
OF_WIRESHARK = {"event", "t", "interface", "direction", "reasons"}
XYZ = ("x", "y", "z")
WHEELS = ("front_left", "front_right", "back_left", "back_right")


def option(code, value):
    return struct.pack("<HH", code, len(value)) + containers.padded(value)


def block(kind, body):
    length = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + length + body + length


def pcapng(interfaces, packets, now=1_700_000_000_123_456):
    """A capture: protocol and port of each interface; of each packet its interface, direction, µs
    since the one before, and bytes."""
    file = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    for protocol, port in interfaces:
        file += block(1, struct.pack("<HHI", LINK_TYPES[protocol], 0, 0) + option(2, port.encode())
                      + option(9, b"\6") + bytes(4))
    for interface, way, step, data in packets:
        now += step
        head = struct.pack("<5I", interface, now >> 32, now & 0xFFFFFFFF, len(data), len(data))
        flags = option(2, struct.pack("<I", way)) + bytes(4) if way else b""
        file += block(6, head + containers.padded(data) + flags)
    return file


def captures():
    """Name and contents of each capture."""
    yield "story", pcapng(STORY, [(number, *packet[:3])
                                  for number, (_, packets) in enumerate(STORY.values())
                                  for packet in packets])
    for path in sorted((ROOT / "examples/captures").glob("*.pcapng")):
        yield path.stem, path.read_bytes()
    interfaces = [(protocol, "/dev/ttyS0") for protocol in LINK_TYPES]
    yield "vectors", pcapng(interfaces, [
        (number, way, 1000, frame) for number, protocol in enumerate(LINK_TYPES)
        for frame in make.vectors(protocol) for way in WAYS.values()])
    yield "bytes", pcapng(interfaces, [
        (number, IN, 10, bytes([byte])) for number, protocol in enumerate(LINK_TYPES)
        if protocol != "ikeya-3"
        for byte in (ROOT / f"examples/captures/{protocol}.bin").read_bytes()])
    # Streams of all interfaces and directions, in pieces of any size, through each other.
    dice = random.Random(1)
    streams = {(number, way): b"".join(make.noisy(make.vectors(protocol), 3 * number + way, 500))
               for number, protocol in enumerate(LINK_TYPES) for way in WAYS.values()}
    packets = []
    while streams:
        key, size = dice.choice(list(streams)), dice.randint(1, 40)
        packets.append((*key, dice.choice((40, 4000, 40_000)), streams[key][:size]))
        streams[key] = streams[key][size:]
        if not streams[key]:
            del streams[key]
    yield "noise", pcapng(interfaces, packets)


class User:
    """An ordinary user with a home, in which the dissector is installed."""

    def __init__(self, folder):
        os.chmod(folder, 0o755)
        self.home, self.options = Path(folder) / "home", {}
        self.home.mkdir()
        if os.geteuid() == 0:
            nobody = pwd.getpwnam("nobody")
            os.chown(self.home, nobody.pw_uid, nobody.pw_gid)
            self.options = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
        extcap = self.home / ".local/lib/wireshark/extcap"
        self.options |= {"cwd": self.home, "stdout": subprocess.PIPE, "env": {
            "HOME": str(self.home), "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8",
            "WIRESHARK_EXTCAP_DIR": str(extcap)}}
        # The user may not be allowed to read the folder that the tool is in.
        self.axle = shutil.copy(AXLE, self.home / "axle")
        subprocess.run(["bash", HERE / "install.sh", "--to", self.home, "--axle", self.axle],
                       check=True, stdout=subprocess.DEVNULL)

    def start(self, *command, **more):
        return subprocess.Popen(list(map(str, command)), **self.options, **more)

    def run(self, *command):
        process = self.start(*command, stderr=subprocess.PIPE)
        out, err = process.communicate(timeout=300)
        if process.returncode or b"Lua" in err:
            sys.exit(f"{' '.join(map(str, command))}: {err.decode(errors='replace')}")
        return out

    def tshark(self, path, *options, read_filter="frame"):
        return self.run("tshark", "-2", "-R", read_filter, "-r", path, *options)


class Shown:
    """A frame or a gap, or a part of one, in a packet."""

    def __init__(self, packet, element):
        frame = {field.get("name"): field.get("show") for field in packet[1].iter("field")}
        self.packet = int(frame["frame.number"])
        seconds, _, fraction = frame["frame.time_epoch"].partition(".")
        self.micros = 1_000_000 * int(seconds) + int(fraction[:6])
        flags = int(frame.get("frame.packet_flags_direction", "0"), 0)
        self.way = {IN: "in", OUT: "out"}.get(flags)
        self.interface, self.port = int(frame["frame.interface_id"]), frame["frame.interface_name"]
        self.protocol = element.get("name").removeprefix("axle_")
        self.fields, self.warnings = {}, set()
        for field in element:
            name = field.get("name").removeprefix(element.get("name") + ".")
            if name == "_ws.expert":
                self.warnings |= {it.get("name").rpartition(".")[2] for it in field} & WARNINGS
            else:
                self.fields.setdefault(name, []).append((field.get("show"), field.get("value", "")))
        self.is_whole = bool({"message", "skipped.length"} & self.fields.keys())

    def show(self, name):
        return self.fields.get(name, [(None, None)])[0][0]


def shown_by_tshark(user, path):
    root = xml.fromstring(user.tshark(path, "-T", "pdml"))
    for field in root.iter("field"):
        if field.get("name") == "_ws.lua.error":
            sys.exit(f"{path}: {field.get('showname')}")
    return [Shown(packet, proto) for packet in root for proto in packet
            if proto.get("name") not in ("geninfo", "frame", "fake-field-wrapper")]


def decoded(path, *options):
    out = subprocess.run([AXLE, "decode", "--json", *options, path], stdout=subprocess.PIPE,
                         check=True)
    rows = map(json.loads, out.stdout.splitlines())
    return [row for row in rows if row["event"] in ("frame", "skipped")]


def fields_of(row):
    """Field names with the values that they must have, without the protocol in front."""
    if row["event"] == "skipped":
        wanted = {"skipped." + key: row[key] for key in ("offset", "length", "reason")}
        reasons = row.get("reasons", {})
        return wanted | {"skipped.reasons." + name: count for name, count in reasons.items()}
    wanted = {}
    for key, value in row.items():
        if key in OF_WIRESHARK:
            continue
        is_of_frame = key in ("offset", "length", "protocol", "message", "id", "index", "bytes")
        name = f"{row['message']}.{key}" if row["protocol"] == "ucp" and not is_of_frame else key
        if not isinstance(value, list):
            wanted[name] = value
        elif row["protocol"] == "ucp":
            parts = WHEELS if key == "rpm" else XYZ
            wanted |= {f"{name}.{part}": it for part, it in zip(parts, value, strict=True)}
        else:
            wanted |= {f"motor{motor}.{key}": it for motor, it in enumerate(value, 1)}
    return wanted


def is_equal(wanted, shown, raw):
    """Whether a field shows this value; `raw` is the bytes behind it."""
    if isinstance(wanted, float) or wanted in ("nan", "inf", "-inf"):
        if len(raw) != 8:
            return False
        (found,) = struct.unpack("<f", bytes.fromhex(raw))
        if found != found:
            return wanted == "nan" and float(shown) != float(shown)
        near = float(shown) == found or abs(float(shown) - found) <= 1e-5 * abs(found)
        return near and struct.pack("<f", float(wanted)) == bytes.fromhex(raw)
    if isinstance(wanted, int):
        return re.fullmatch(r"-?\d+", shown) and int(shown) == wanted
    return shown.replace(":", "") == wanted


class Comparison:
    """Counts what is compared, and keeps what differs."""

    def __init__(self):
        self.values = self.rows = 0
        self.differences = []

    def expect(self, where, found, wanted):
        self.values += 1
        if found != wanted:
            self.differences.append(f"{where}: {found!r}, not {wanted!r}")

    def compare(self, name, rows, shown):
        """Every row is shown once, with its fields, and nothing else is."""
        found = {(it.interface, it.way, int(it.show("offset") or it.show("skipped.offset"))): it
                 for it in shown if it.is_whole}
        self.expect(f"{name}: frames and gaps", sum(it.is_whole for it in shown), len(rows))
        for number, row in enumerate(rows, 1):
            where = f"{name}: line {number}"
            item = found.pop((row["interface"], row.get("direction"), row["offset"]), None)
            if item is None:
                self.expect(where, None, row)
                continue
            self.rows += 1
            wanted = fields_of(row)
            for field, value in wanted.items():
                shows = item.fields.get(field, [])
                right = len(shows) == 1 and is_equal(value, *shows[0])
                self.expect(f"{where}: {field}", value if right else shows, value)
            self.expect(f"{where}: fields", item.fields.keys() - EXCHANGE, wanted.keys())
            self.expect(f"{where}: time", item.micros, round(row["t"] * 1e6))
            if row["event"] == "frame":
                protocol = row["protocol"].removesuffix("-3")
                self.expect(f"{where}: protocol", item.protocol, protocol)
        self.expect(f"{name}: more", list(found), [])
        self.exchanges(name, shown)

    def exchanges(self, name, shown):
        """A request and its answer point at each other, and the response time is between them."""
        pairs = {(it.packet, int(it.show("answer_in"))): it for it in shown if it.show("answer_in")}
        answers = [it for it in shown if it.show("request_in")]
        self.expect(f"{name}: answers", len(answers), len(pairs))
        for answer in answers:
            request = pairs.get((int(answer.show("request_in")), answer.packet))
            took = answer.micros - request.micros if request else None
            shows = answer.show("response_time_us")
            self.expect(f"{name}: packet {answer.packet}: took", shows and int(shows),
                        took if took is None or took >= 0 else None)

    def story(self, user, path, shown):
        """The texts, response times and warnings that are written by hand."""
        lines = user.tshark(path, "-T", "fields", "-e", "_ws.col.Info", "-e", "_ws.col.Protocol")
        lines = lines.decode().splitlines()
        told = [(*packet[:3], f"{packet[3]}\t{'UCP' if protocol == 'ucp' else 'Ikeya MD'}",
                 *packet[4:]) for (protocol, _), (_, packets) in STORY.items()
                for packet in packets]
        for number, (packet, line) in enumerate(zip(told, lines, strict=True), 1):
            _, _, _, text, *warnings = packet
            found = set().union(*(it.warnings for it in shown if it.packet == number))
            self.expect(f"story: packet {number}", (line, found), (text, set(warnings)))
        whose = {port: words for (_, port), (words, _) in STORY.items()}
        for item in shown:
            if item.show("response_time_us"):
                told = whose[item.port] in item.show("response_time_of")
                self.expect(f"story: packet {item.packet}: whose time", told, True)

    def settings(self, user, story, vectors):
        """A reply window of 500 µs, and a first pass, which knows no interfaces yet."""
        answers = ("-Y", "axle_ikeya.response_time_us > 1000 and not axle_ikeya.late")
        window = ("-o", "axle_ikeya.reply_window_us:500")
        for options, is_there in (((), True), (window, False)):
            found = bool(user.tshark(story, *answers, *options))
            self.expect(f"slow answers in time with {options}", found, is_there)
        frames = ("-Y", "axle_ucp.message or axle_ikeya.message")
        once = user.run("tshark", "-r", vectors, *frames).count(b"\n")
        self.expect("frames in one pass", once, user.tshark(vectors, *frames).count(b"\n"))
        told = user.run("tshark", "-2", "-r", vectors, "-T", "fields", "-e", "_ws.col.Info")
        hint = b"as if there were one interface only"
        self.expect("without -R frame, it is told", hint in told, True)

    def read_filters(self, user, path):
        """Packets show the same with a read filter, which gives their numbers to others."""
        names = [f"axle_{of}.{name}" for of in ("ikeya", "ucp")
                 for name in ("request_in", "answer_in", "ends_in")]
        options = [it for name in ("frame.number", "frame.time_epoch", "_ws.col.Info", *names)
                   for it in ("-e", name)]

        def rows(read_filter):
            out = user.tshark(path, "-T", "fields", *options, read_filter=read_filter).decode()
            packets = [line.split("\t") for line in out.splitlines()]
            times = {number: time for number, time, *_ in packets}
            return {time: (info, [[times.get(it, it) for it in field.split(",") if it]
                                  for field in numbers])
                    for _, time, info, *numbers in packets}

        everything = rows("frame")
        for wanted in ("frame.len == 8", "frame.packet_flags_direction == 1",
                       "axle_ikeya.node == 2 or axle_ucp.message == report"):
            found = rows(wanted)
            self.expect(f"{path.stem}: found by -R {wanted}",
                        0 < len(found) < len(everything), True)
            # What is not in the list is not referred to; of the last packet it is not known.
            last = next(reversed(found), None)
            listed = found.keys() - {last}
            for time, (info, fields) in found.items():
                text, numbers = everything[time]
                fields = [[it for it in field if it != last] for field in fields]
                numbers = [[it for it in field if it in listed] for field in numbers]
                self.expect(f"{path.stem}: -R {wanted}: {time}", (info, fields), (text, numbers))

    def containers(self, user, folder):
        """Random files have the packets, times, interfaces and directions that tshark finds."""
        for seed in range(CONTAINERS):
            contents, count, before = containers.capture(random.Random(seed))
            path = folder / "random.pcapng"
            path.write_bytes(contents)
            found = [(row.get("t") and round(row["t"] * 1e6), row["interface"],
                      row.get("direction"), row.get("bytes"))
                     for row in decoded(path, "--protocol", "ucp")]
            wanted = []
            for packet in json.loads(user.run("tshark", "-r", path, "-T", "json", "-x")):
                frame = packet["_source"]["layers"]["frame"]
                if "frame.interface_id" not in frame:
                    # A custom block, which tshark lists too.
                    continue
                seconds, _, fraction = frame.get("frame.time_epoch", "").partition(".")
                flags = frame.get("frame.packet_flags_tree", {}).get("frame.packet_flags_direction")
                wanted.append((int(seconds + fraction[:6]) if seconds else None,
                               before[int(frame["frame.section_number"]) - 1]
                               + int(frame["frame.interface_id"]),
                               {IN: "in", OUT: "out"}.get(int(flags or "0", 0)),
                               packet["_source"]["layers"]["frame_raw"][0]))
            self.expect(f"random file {seed}: packets", len(wanted), count)
            for number, (one, other) in enumerate(zip(found, wanted), 1):
                self.expect(f"random file {seed}: packet {number}", one, other)
            self.expect(f"random file {seed}: frames", len(found), count)

    def hanging(self, user):
        """Captures that cannot begin end by themselves."""
        for port, protocol, *more in (("/dev/no-such-port", "ucp"), ("/dev/null", "modbus"),
                                      ("/dev/null", "ucp", "-f", "tcp")):
            tshark = user.start("tshark", "-q", "-i", "axle", "-o", f"extcap.axle.port:{port}",
                                "-o", f"extcap.axle.protocol:{protocol}", *more,
                                stderr=subprocess.DEVNULL, start_new_session=True)
            try:
                tshark.communicate(timeout=20)
            except subprocess.TimeoutExpired:
                os.killpg(tshark.pid, signal.SIGKILL)
                self.expect(f"a capture of {port} as {protocol}", "does not end", "ends")

    def filters(self, user, paths):
        """Each filter of README.md and of the colours finds something in one of the captures."""
        filters = re.findall(r"^\| `(.*?)` \|", (HERE / "README.md").read_text(), re.MULTILINE)
        filters += re.findall(r"^@.*?@(.*?)@", (HERE / "colours").read_text(), re.MULTILINE)
        for wanted in filters:
            is_found = any(user.tshark(path, "-Y", wanted) for path in paths)
            self.expect(f"what is found by {wanted}", is_found, True)


def live(user):
    """A capture that tshark makes of a simulated rover, through `axle extcap`."""
    path = user.home / "live.pcapng"
    sim = user.start(user.axle, "sim", "ucp", "--for", 60)
    try:
        port = sim.stdout.readline().decode().strip().removeprefix("pty: ")
        user.run("tshark", "-q", "-i", "axle", "-o", f"extcap.axle.port:{port}",
                 "-o", "extcap.axle.protocol:ucp", "-c", LIVE_PACKETS, "-a", "duration:30",
                 "-w", path)
    finally:
        sim.terminate()
        sim.communicate()
    return path


def main():
    with tempfile.TemporaryDirectory() as folder:
        user, found, paths = User(folder), Comparison(), []
        for name, contents in captures():
            paths.append(Path(folder) / f"{name}.pcapng")
            paths[-1].write_bytes(contents)
        paths.append(live(user))
        for path in paths:
            rows, shown = decoded(path), shown_by_tshark(user, path)
            found.compare(path.stem, rows, shown)
            if path.stem == "story":
                found.story(user, path, shown)
        frames = sum(row["event"] == "frame" for row in rows)
        found.expect("live: enough frames", frames > LIVE_PACKETS * 2 // 3, True)
        for path in paths:
            if path.stem in ("motors", "drive", "noise"):
                found.read_filters(user, path)
        found.filters(user, paths)
        found.settings(user, paths[0], Path(folder) / "vectors.pcapng")
        found.hanging(user)
        found.containers(user, Path(folder))
    print(f"{found.values} values of {found.rows} frames and gaps in {len(paths)} captures: "
          f"{len(found.differences)} differences")
    print(*found.differences[:20], sep="\n", end="\n" if found.differences else "")
    if found.values < LEAST_VALUES:
        sys.exit(f"fewer than {LEAST_VALUES} values were compared")
    return bool(found.differences)


if __name__ == "__main__":
    sys.exit(main())
