"""Captures for check.py: written here, block by block, without the tool's own writer."""
import json
import random
import struct
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
LINK_TYPES = {"ikeya": 147, "ikeya-3": 148, "ucp": 150}
IN, OUT, UNKNOWN = 1, 2, 0
START_US = 1_700_000_000_123_456


class PcapNg:
    """A capture. Times go on by `step_us` with each packet unless they are given."""

    def __init__(self):
        self.bytes = bytearray()
        self.now_us = START_US
        self.section()

    def section(self):
        self.interfaces = 0
        self.block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))

    def interface(self, protocol, port="/dev/ttyUSB0"):
        body = struct.pack("<HHI", LINK_TYPES[protocol], 0, 0)
        body += option(2, port.encode()) + option(9, b"\6") + option(0, b"")
        self.block(1, body)
        self.interfaces += 1
        return self.interfaces - 1

    def packet(self, interface, bytes, direction=UNKNOWN, step_us=137):
        self.now_us += step_us
        head = (interface, self.now_us >> 32, self.now_us & 0xFFFFFFFF, len(bytes), len(bytes))
        body = struct.pack("<5I", *head) + padded(bytes)
        if direction:
            body += option(2, struct.pack("<I", direction)) + option(0, b"")
        self.block(6, body)

    def simple_packet(self, bytes):
        """A packet of the first interface, without a time and a direction."""
        self.block(3, struct.pack("<I", len(bytes)) + padded(bytes))

    def block(self, kind, body):
        length = len(body) + 12
        self.bytes += struct.pack("<II", kind, length) + body + struct.pack("<I", length)


class Read:
    """A capture, as far as it is needed. Little-endian files only, as the tool writes them.

    first: the number of the first interface of each section; ports: the name of each interface;
    last: its last time; ends: of each interface in each direction, end and number of each packet;
    protocols: of each packet."""

    def __init__(self, file):
        at, self.first, self.ports, self.last, self.ends = 0, {}, [], [], {}
        self.protocols, links = [], []
        names = {number: name for name, number in LINK_TYPES.items()}
        while at < len(file):
            kind, length = struct.unpack_from("<II", file, at)
            body = file[at + 8:at + length - 4]
            if kind == 0x0A0D0D0A:
                self.first[len(self.first) + 1] = len(self.ports)
            elif kind == 1:
                self.ports.append(value_of(body[8:], 2).decode())
                self.last.append(0)
                links.append(names[struct.unpack_from("<H", body)[0]])
            elif kind == 3:
                (held,) = struct.unpack_from("<I", body)
                self.packet(0, 0, held, UNKNOWN, links)
            elif kind == 6:
                interface, high, low, held, _ = struct.unpack_from("<5I", body)
                flags = value_of(body[20 + len(padded(bytes(held))):], 2)
                way = struct.unpack("<I", flags)[0] if flags else UNKNOWN
                self.packet(interface, high << 32 | low, held, way & 3, links)
            at += length

    def packet(self, interface, micros, held, way, links):
        interface += self.first[len(self.first)]
        self.protocols.append(links[interface])
        if held:
            self.last[interface] = max(self.last[interface], micros)
        ends = self.ends.setdefault((interface, {IN: "in", OUT: "out"}.get(way)), [])
        ends.append(((ends[-1][0] if ends else 0) + held, len(self.protocols)))


def value_of(options, code):
    """The value of an option; nothing if it is not there."""
    while len(options) >= 4:
        found, length = struct.unpack_from("<HH", options)
        if found == code:
            return options[4:4 + length]
        options = options[4 + len(padded(bytes(length))):]
    return b""


def padded(bytes):
    return bytes + b"\0" * (-len(bytes) % 4)


def option(code, value):
    return struct.pack("<HH", code, len(value)) + padded(value)


def crc(bytes):
    value = 0xFFFF
    for byte in bytes:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


def ucp(id, body=b"", index=0):
    frame = b"\xFD\xFF" + struct.pack("<HBB", len(body) + 4, id, index) + body
    return frame + crc(frame)


def bus(header, node, payload=b""):
    packet = bytes([header, node]) + payload
    return packet + crc(packet)


def rps(header, node, *values):
    return bus(header, node, struct.pack(f"<{len(values)}f", *values))


def vectors():
    """The recorded frames: (protocol, direction, bytes)."""
    found = []
    for name in ("ikeya", "ucp"):
        for line in (ROOT / "tests/vectors" / f"{name}.jsonl").read_text().splitlines():
            row = json.loads(line)
            frame = bytes.fromhex(row["hex"])
            protocol = {"ikeya-md": "ikeya", "ikeya-md-3motor": "ikeya-3", "ucp": "ucp"}
            # The tool runs at the host or master: what these send goes out.
            way = OUT if row["dir"].split("-")[0] in ("host", "master") else IN
            found.append((protocol[row["protocol"]], way, frame))
    return found


def of_vectors():
    """Each recorded frame as a packet, one interface per protocol."""
    file = PcapNg()
    interfaces = {protocol: file.interface(protocol) for protocol in LINK_TYPES}
    for protocol, way, frame in vectors():
        file.packet(interfaces[protocol], frame, way)
    return file


def of_captures(seed):
    """The raw captures of the repository: whole, byte by byte, and in pieces of random sizes."""
    dice, file = random.Random(seed), PcapNg()
    for name in ("ikeya", "ucp"):
        raw = (ROOT / "examples/captures" / f"{name}.bin").read_bytes()
        for most in (len(raw), 1, 3, 11, 40):
            line = file.interface(name, "/dev/ttyS0")
            at = 0
            while at < len(raw):
                size = most if most in (1, len(raw)) else dice.randint(1, most)
                file.packet(line, raw[at:at + size], IN)
                at += size
        file.section()
    return file


def of_noise(seed, packets=900):
    """Frames, damaged ones, parts and noise of all protocols, in both directions and pieces of any
    size, over several sections and interfaces."""
    dice, file, frames = random.Random(seed), PcapNg(), {}
    for protocol, _, frame in vectors():
        frames.setdefault(protocol, []).append(frame)
    headers = [b"\xFD\xFF", b"\xFD\xFF\x3C\x00", b"\xBB", b"\xAA\x01", b"\x55\x56", b"\xFD"]
    for _ in range(3):
        lines = [(file.interface(protocol), protocol, {}) for protocol in [*LINK_TYPES, "ikeya"]]
        for _ in range(packets // 3):
            number, protocol, held = dice.choice(lines)
            way = dice.choice((IN, IN, OUT, OUT, UNKNOWN))
            bytes = held.get(way, b"")
            for _ in range(dice.randint(1, 3)):
                bytes += piece(dice, frames[protocol], headers)
            size = dice.randint(1, len(bytes)) if dice.random() < 0.4 else len(bytes)
            held[way] = bytes[size:]
            file.packet(number, bytes[:size], way, dice.choice((40, 400, 4_000, 40_000)))
        file.section()
    return file


def piece(dice, frames, headers):
    frame = dice.choice(frames)
    kind = dice.random()
    if kind < 0.7:
        return frame
    if kind < 0.8:
        bit = dice.randrange(8 * len(frame))
        return frame[:bit // 8] + bytes([frame[bit // 8] ^ 1 << bit % 8]) + frame[bit // 8 + 1:]
    if kind < 0.88:
        return frame[:dice.randrange(len(frame))] or b"\0"
    if kind < 0.94:
        return dice.choice(headers)
    return dice.randbytes(dice.randint(1, 12))


def of_story():
    """Exchanges, hazards and oddities, one after the other."""
    file = PcapNg()
    line = file.interface("ikeya")
    read, write, speed, position = 0xAA, 0xBB, 0x55, 0x56
    for way, packet, step in [
        (OUT, bus(read, 1), 1000), (IN, rps(speed, 1, 1.5), 900),          # in time
        (OUT, bus(read, 2), 1000), (IN, rps(speed, 2, 0.0), 20_240),       # just in time
        (OUT, bus(read, 2), 1000), (IN, rps(speed, 2, 0.0), 20_241),       # late
        (OUT, bus(read, 3), 1000), (IN, rps(speed, 1, 1.5), 500),          # another node
        (IN, bus(position, 3, struct.pack("<hh", 5, -2)), 100),  # and the one that was asked
        (IN, bus(position, 3, struct.pack("<hh", 5, -2)), 100),  # once more
        (OUT, bus(read, 4), 1000), (OUT, bus(read, 4), 30_000),            # not answered, repeated
        (IN, bus(read, 4), 50), (IN, rps(speed, 4, -0.25), 300),           # an echo
        (OUT, rps(write, 1, 2.0), 100), (OUT, rps(write, 3, 2.0), 100),
        (OUT, rps(write, 7, 2.0), 100),
        (OUT, bus(read, 1), 100), (IN, bus(position, 1, b"\1\0\2\0"), 300),  # the mode has changed
        (OUT, rps(write, 4, float("nan")), 100), (IN, rps(speed, 5, float("inf")), 100),
        (IN, bus(speed, 9, bytes(4)), 100), (IN, rps(speed, 6, float("-inf"))[:-1], 100),
        (OUT, bus(read, 8), 100),
    ]:
        file.packet(line, packet, way, step)
    three = file.interface("ikeya-3", "/dev/pts/3")
    for way, packet, step in [
        (OUT, rps(write, 1, 1.0, 2.0, -3.5), 100), (IN, rps(speed, 1, 1.0, 2.0, -3.5), 700),
        (OUT, rps(write, 1, 0.5, 2.0, -3.5), 100), (OUT, bus(read, 2), 700),
        (IN, bus(position, 2, struct.pack("<6h", 1, 2, 3, -4, -5, -6)), 400),
    ]:
        file.packet(three, packet, way, step)
    rover = file.interface("ucp", "/dev/ttyACM0")
    report = struct.pack("<H13hBBHH", 200, *range(-6, 7), 12, 119, 204, 38)
    def motor(speed, angular, version=0):
        return struct.pack("<4hHHI", speed, angular, 100, 0, version, 0, 0)
    for way, frame, step in [
        (IN, ucp(8), 100), (OUT, ucp(8, bytes(range(19))), 2_000),
        (OUT, ucp(1, index=1), 100), (OUT, ucp(1, index=2), 900_000), (IN, ucp(1, b"\0"), 1_500),
        (OUT, ucp(3, b"\1"), 10), (IN, ucp(3, b"\1\0"), 800), (OUT, ucp(4, b"\2"), 10),
        (IN, ucp(4, b"\2\1"), 800), (IN, ucp(6, bytes(12)), 10), (OUT, ucp(6, b"\0"), 20),
        (IN, ucp(7, bytes(6)), 10), (OUT, ucp(7, b"\0"), 20), (OUT, ucp(9, b"\x27\0"), 10),
        (IN, ucp(9, b"\2"), 400_000), (IN, ucp(1, b"\1"), 10),
        (IN, ucp(5, report, 9), 100), (OUT, ucp(5, report, 9), 100), (IN, ucp(5, report[2:]), 100),
        (IN, ucp(5, b"\x0C\0" + report[2:]), 100),
        (OUT, ucp(2, motor(100, -100)), 10), (OUT, ucp(2, motor(101, 0)), 10),
        (OUT, ucp(2, motor(0, -101)), 10), (OUT, ucp(2, motor(0, 0, 38)), 10),
        (OUT, ucp(2, motor(0, 0, 39)), 10), (OUT, ucp(2, motor(0, 0, 32768)), 10),
        (OUT, ucp(2, bytes(15)), 10), (OUT, ucp(0x0A, b"\3"), 10),
        (OUT, ucp(0x0A, b"\4\0\0\1"), 10),
        (OUT, ucp(0x42, b"hello"), 10), (OUT, ucp(0x42), 10), (OUT, ucp(0x42, bytes(56)), 10),
        (OUT, ucp(0x42, bytes(57)), 10), (OUT, ucp(1, index=255), 10),
        (OUT, b"\xFD\xFF\3\0", 10), (IN, b"\xFD", 10), (IN, ucp(1, b"\0")[:-1], 10),
    ]:
        file.packet(rover, frame, way, step)
    # An answer behind a false header, found at the end only.
    last = file.interface("ucp", "COM3")
    file.packet(last, ucp(1, index=3), OUT)
    file.packet(last, b"\xFD\xFF\x3C\0" + ucp(1, b"\0", 4), IN)
    return file


def of_echo():
    """A bus whose adapter hears what it sends, several frames at a time. What must be shown of
    each frame and gap is written here by hand: it is not left to a rule."""
    file, told, steps = PcapNg(), [], []
    line, echo = file.interface("ikeya"), {("echo", True)}
    read, write, speed = 0xAA, 0xBB, 0x55
    def ask(node):
        return bus(read, node)
    def drive(node, value=2.0):
        return rps(write, node, value)
    def tell(node):
        return rps(speed, node, 1.5)
    def answers(request, took):
        return {("request", request), ("took", took)}
    damaged = drive(1)[:-1] + b"\0"
    steps += [
        (OUT, 1000, [(drive(1), set())]), (OUT, 100, [(ask(1), {("answer", 4)})]),
        (IN, 900, [(drive(1), echo), (ask(1), echo), (tell(1), answers(1, 900))]),
        (OUT, 1000, [(drive(1), set())]), (OUT, 10, [(drive(2), set())]),
        (OUT, 10, [(ask(2), {("answer", 11)})]), (IN, 80, [(drive(1), echo)]),
        (IN, 80, [(drive(2), echo), (ask(2), echo)]), (IN, 300, [(tell(2), answers(7, 460))]),
        # An echo that is damaged.
        (OUT, 1000, [(drive(1), set())]), (OUT, 10, [(ask(1), {("answer", 16)})]),
        (IN, 900, [(damaged, {"bad_crc"}), (ask(1), echo), (tell(1), answers(13, 900))]),
        # Echoes behind a repeated request; one more of it is no echo.
        (OUT, 1000, [(ask(1), {"unanswered"})]), (OUT, 30_000, [(ask(1), {("answer", 21)})]),
        (IN, 100, [(ask(1), echo)]), (IN, 100, [(ask(1), echo), (tell(1), answers(18, 200))]),
        (IN, 100, [(ask(1), {"unanswered"})]),
        (OUT, 100, [(ask(4), {("answer", 25)})]),
        (IN, 300, [(ask(4), echo), (tell(4), answers(23, 300))]),
    ]
    # The first of sixteen is still known.
    steps += [(OUT, 10, [(drive(3, float(value)), set())]) for value in range(16)]
    steps += [(IN, 10, [(drive(3, 0.0), echo)])]
    for way, step, frames in steps:
        file.packet(line, b"".join(frame for frame, _ in frames), way, step)
        told += [facts for _, facts in frames]
    return file, told


def of_hazards():
    """What harms a shipped robot, and what is like it and does not. Whether a frame or gap is a
    hazard is written here by hand."""
    file = PcapNg()
    line = file.interface("ucp")
    def motor(speed=0, angular=0, front=0, back=0, version=0, first=0, second=0):
        return ucp(2, struct.pack("<5hHI", speed, angular, front, back, version, first, second))
    other = ucp(0x42)
    long = ucp(0x42, bytes(57))
    frames = [
        (OUT, ucp(8), True), (IN, ucp(8), False), (UNKNOWN, ucp(8), False),
        (OUT, ucp(8, bytes(18)), True), (OUT, ucp(8, bytes(20)), False),
        (OUT, ucp(8, bytes(19)), False), (OUT, ucp(2, bytes(15)), True),
        (OUT, ucp(2, bytes(17)), False), (IN, ucp(2, bytes(15)), False),
        (UNKNOWN, ucp(2, bytes(15)), True), (IN, ucp(5, bytes(38)), False),
        (OUT, ucp(5, bytes(38)), True), (UNKNOWN, ucp(5, bytes(38)), True),
        (IN, ucp(5, bytes(36)), False), (OUT, ucp(5, bytes(36)), True),
        (UNKNOWN, ucp(5, bytes(36)), False), (OUT, ucp(9, b"\x27\0"), True),
        (OUT, ucp(9, b"\x26\0"), False), (OUT, ucp(9, b"\xFF\xFF"), False),
        (OUT, ucp(9, b"\1"), True), (IN, ucp(9, b"\1"), False), (OUT, ucp(10, bytes(3)), False),
        (OUT, ucp(10), True), (OUT, ucp(3), True), (IN, ucp(3), False),
        (OUT, ucp(1, bytes(2)), False), (OUT, ucp(11, bytes(3)), False), (OUT, ucp(0), False),
        (OUT, motor(100, -100, 100), False), (OUT, motor(101), True), (OUT, motor(0, -101), True),
        (OUT, motor(front=7), True), (OUT, motor(back=-5), True), (OUT, motor(version=1), True),
        (OUT, motor(version=39), True), (OUT, motor(version=-1), True), (OUT, motor(first=1), True),
        (OUT, motor(second=1 << 16), True), (IN, motor(101), False), (UNKNOWN, motor(101), True),
    ]
    for bad, is_hazard in [
        (b"\xFD\xFF\0\0", True), (b"\xFD\xFF\3\0", True), (long, True),
        (long[:-1] + b"\0", True), (long[:4], True), (b"\1" * 3000 + long, True),
        (b"\xFD\xFF\0\1", True), (other[:-1] + b"\0", False), (b"\1\2", False),
    ]:
        for way in (OUT, IN, UNKNOWN):
            frames += [(way, bad, is_hazard and way != IN), (way, other, False)]
    for way, frame, _ in frames:
        file.packet(line, frame, way, 10)
    return file, [is_hazard for _, _, is_hazard in frames]


def of_times():
    """Late answers of boards with three motors, hours, clocks that are set back, packets without a
    time; and requests that are never answered, while the line goes on."""
    file = PcapNg()
    read, write, speed = 0xAA, 0xBB, 0x55
    line = file.interface("ikeya", "tcp:bridge:7000")
    file.simple_packet(bus(read, 1))
    file.simple_packet(rps(speed, 1, 1.5))
    file.packet(line, bus(read, 1), OUT)
    file.simple_packet(rps(speed, 1, 1.5))
    for step in (900, 3 * 3600 * 1_000_000, 4_294_967_296 + 1000, -500_000):
        file.packet(line, bus(read, 1), OUT)
        file.packet(line, rps(speed, 1, 1.5), IN, step)
    # An echo that is found at the end only.
    file.packet(line, bus(read, 1), OUT)
    file.packet(line, b"\xBB\1" + bus(read, 1), IN)
    three = file.interface("ikeya-3", "/dev/ttyAMA0")
    for request, wire_time in ((bus(read, 1), 400), (rps(write, 1, 1.0, 2.0, -3.5), 640)):
        for step in (20_000 + wire_time, 20_001 + wire_time):
            file.packet(three, request, OUT, 50_000)
            file.packet(three, rps(speed, 1, 1.0, 2.0, -3.5), IN, step)
    waits = [file.interface("ikeya", port) for port in ("/dev/pts/7", "COM3")]
    for line, nodes, step in ((waits[0], 60, 1_000_000), (waits[1], 1, 20_240)):
        file.packet(line, bus(read, 1), OUT)
        for _ in range(nodes):
            file.packet(line, rps(speed, 2, -0.5), IN, step)
    rovers = [file.interface("ucp", port) for port in ("/dev/ttyS0", "/dev/ttyS1")]
    for line, reports in ((rovers[0], 51), (rovers[1], 50)):
        file.packet(line, ucp(1), OUT)
        for index in range(reports):
            file.packet(line, ucp(5, bytes(36), index), IN, 20_000)
    return file


def of_words():
    """Each value that has words, with all numbers that have some and one that has none."""
    file = PcapNg()
    line = file.interface("ucp")
    for err in range(4):
        kinds = (1, b""), (3, bytes([err])), (4, bytes([err])), (9, b"")
        for id, kind in kinds:
            file.packet(line, ucp(id, kind + bytes([err])), IN)
        for id in (6, 7):
            file.packet(line, ucp(id, bytes([err])), OUT)
        file.packet(line, ucp(8, bytes([err]) + struct.pack("<9h", *range(-4000, 5000, 1000))), OUT)
    for state in range(6):
        file.packet(line, ucp(10, bytes([state])), OUT)
        file.packet(line, ucp(10, struct.pack("<I", state)), OUT)
    for lamp in (0, 1, 100, -1):
        file.packet(line, ucp(2, struct.pack("<5hHI", -100, 37, lamp, 0, 0, 0, 0)), OUT)
    for id, version in ((9, -2), (9, 12)):
        file.packet(line, ucp(id, struct.pack("<h", version)), OUT)
    return file


# What the first of two passes shows: bytes that may become a frame, and skipped bytes so far.
ONE_PASS = [("10", ""), ("", ""), ("", "3"), ("1", ""), ("", ""), ("7", ""), ("", ""),
            ("6", ""), ("5", ""), ("", "")]


def of_one_pass():
    """A frame in two packets, a gap, a frame in two behind a whole one, and a frame in three."""
    file, frame = PcapNg(), ucp(0x42, b"hello")
    line = file.interface("ucp")
    for bytes in (frame[:10], frame[10:], b"\0\1\2", b"\xFD", b"\1" + frame, frame + frame[:7],
                  frame[7:], frame[:6], frame[6:11], frame[11:]):
        file.packet(line, bytes, IN)
    return file


# Of captures with facts that are written by hand: those of each frame and gap.
TOLD = {"echo": of_echo()[1], "hazards": of_hazards()[1]}


def all_of():
    """Name and bytes of each capture."""
    made = {"story": of_story(), "echo": of_echo()[0], "hazards": of_hazards()[0],
            "times": of_times(), "words": of_words(), "one-pass": of_one_pass()}
    made |= {"vectors": of_vectors(), "captures": of_captures(1)}
    made |= {f"noise-{seed}": of_noise(seed) for seed in (1, 2, 3)}
    made = {name: bytes(file.bytes) for name, file in made.items()}
    for path in sorted((ROOT / "examples/captures").glob("*.pcapng")):
        made[path.stem] = path.read_bytes()
    return made
