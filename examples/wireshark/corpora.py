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

    def block(self, kind, body):
        length = len(body) + 12
        self.bytes += struct.pack("<II", kind, length) + body + struct.pack("<I", length)


def read(file):
    """The number of the first interface of each section; and the bytes of each interface in each
    direction, with the ends of their packets. Little-endian files only, as the tool writes them."""
    at, first, interfaces, streams, ends = 0, {}, 0, {}, {}
    while at < len(file):
        kind, length = struct.unpack_from("<II", file, at)
        body = file[at + 8:at + length - 4]
        if kind == 0x0A0D0D0A:
            first[len(first) + 1] = interfaces
        elif kind == 1:
            interfaces += 1
        elif kind == 6:
            interface, _, _, held, _ = struct.unpack_from("<5I", body)
            flags = body[20 + len(padded(bytes(held))):][:8]
            way = struct.unpack("<HHI", flags)[2] if len(flags) == 8 else UNKNOWN
            key = (first[len(first)] + interface, {IN: "in", OUT: "out"}.get(way))
            streams[key] = streams.get(key, b"") + body[20:20 + held]
            ends.setdefault(key, []).append(len(streams[key]))
        at += length
    return first, streams, ends


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


def all_of():
    """Name and bytes of each capture."""
    made = {"story": of_story(), "vectors": of_vectors(), "captures": of_captures(1)}
    made |= {f"noise-{seed}": of_noise(seed) for seed in (1, 2, 3)}
    made = {name: bytes(file.bytes) for name, file in made.items()}
    for path in sorted((ROOT / "examples/captures").glob("*.pcapng")):
        made[path.stem] = path.read_bytes()
    return made
