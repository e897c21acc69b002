#!/usr/bin/env python3
"""Renders bytes on serial wires as logic analyzer captures of sigrok (.sr), sampled at 5 MHz.

    examples/sigrok/make.py demo.sr        motors on a bus: late, missing and damaged answers
    examples/sigrok/make.py rover.sr       a rover's link: pings, reports, hazards
    examples/sigrok/make.py CAPTURE.pcapng OUT.sr [FROM TO]
                                           what `axle` has recorded, or some seconds of it

All have the wires TX, of the master or host or of the program that has recorded, and RX. Beside the
capture lies a set-up for PulseView with the decoders (.pvs). The first two are always the same.

A recording has the time at which a program had got the last byte of a chunk, not the edges on a
wire: each chunk is drawn so that it ends at its time, or later if its wire is still busy. Response
times are then those of the program, its machine and its adapter.
"""

import io
import json
import random
import struct
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
SAMPLE_RATE = 5_000_000
IKEYA_BAUD, UCP_BAUD = 500_000, 115_200
# 8N1: a start bit, eight data bits, a stop bit (ruling B6).
BITS = 10


class Line:
    """One wire, as spans of a level: bytes follow each other with pauses."""

    def __init__(self, baud):
        self.bit = SAMPLE_RATE / baud
        self.spans = []
        # First sample and end of each byte.
        self.places = []
        self.bytes = bytearray()

    def send(self, data, at):
        """Sends bytes from sample `at` on; returns the end of the last."""
        for byte in data:
            for number, level in enumerate([0, *(byte >> bit & 1 for bit in range(8))]):
                if level == 0:
                    self.spans.append((round(at + number * self.bit),
                                       round(at + (number + 1) * self.bit)))
            self.places.append((at, at + BITS * self.bit))
            self.bytes.append(byte)
            at += BITS * self.bit
        return at


def write(path, names, lines, length):
    """Writes a capture of `length` samples with a wire for each name."""
    total = 0
    for bit, line in enumerate(lines):
        levels = bytearray([1]) * length
        for begin, end in line.spans:
            end = min(end, length)
            levels[begin:end] = bytes(end - begin)
        total |= int.from_bytes(levels, "little") << bit
    metadata = ["[global]", "sigrok version=0.5.2", "", "[device 1]", "capturefile=logic-1",
                "total probes=%d" % len(lines), "samplerate=5 MHz", "total analog=0"]
    metadata += ["probe%d=%s" % (number, name) for number, name in enumerate(names, 1)]
    metadata += ["unitsize=1", ""]
    with io.BytesIO() as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in [("version", b"2"), ("metadata", "\n".join(metadata).encode()),
                               ("logic-1-1", total.to_bytes(length, "little"))]:
                # A fixed date: the same capture gives the same file.
                archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
        Path(path).write_bytes(file.getvalue())


def micros(number):
    """In samples."""
    return number * SAMPLE_RATE / 1e6


def vectors(protocol):
    """The recorded frames of a protocol, by the name that `axle` has for it."""
    name = {"ikeya": "ikeya-md", "ikeya-3": "ikeya-md-3motor"}.get(protocol, protocol)
    path = ROOT / "tests" / "vectors" / (protocol.removesuffix("-3") + ".jsonl")
    lines = map(json.loads, path.read_text().splitlines())
    return [bytes.fromhex(line["hex"]) for line in lines if line["protocol"] == name]


def noisy(frames, seed, count=160):
    """Frames of which half are damaged, cut, lengthened or noise, for the checks."""
    dice, starts = random.Random(seed), bytes.fromhex("aabb5556fdff")
    for _ in range(count):
        frame, kind = dice.choice(frames), dice.randrange(10)
        at = dice.randrange(len(frame))
        yield (frame[:at] + bytes([frame[at] ^ 1 << dice.randrange(8)]) + frame[at + 1:],
               frame[:at] + bytes([dice.choice(starts)]) + frame[at:],
               frame[:at] + frame[at + 1:],
               frame[:at],
               dice.randbytes(dice.randint(3, 40)),
               bytes(dice.choices(starts, k=dice.randint(1, 6))) + frame,
               frame)[min(kind, 6)]


def crc(data):
    """CRC-16/MODBUS, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def sealed(text):
    """A packet from its hex digits without CRC."""
    data = bytes.fromhex(text)
    return data + crc(data)


def ucp(number, body, index=0):
    head = bytes([0xFD, 0xFF, 4 + len(body), 0, number, index])
    return head + body + crc(head + body)


def read(node):
    return sealed("aa%02x" % node)


def answer(node, rps):
    return sealed("55%02x" % node + struct.pack("<f", rps).hex())


def motors():
    """A master and three motors. The master writes a NaN; the second motor answers late; the third
    damages an answer, and later loses its plug for a while."""
    master, slaves = Line(IKEYA_BAUD), Line(IKEYA_BAUD)
    at = micros(280)
    for cycle in range(9):
        for node, time in ((1, 21.4), (2, 63.0 - 5 * cycle), (3, 24.8)):
            is_first = cycle == 0
            for attempt in range(2 if is_first and node == 3 else 1):
                at = master.send(read(node), at + micros(30))
                reply = bytearray(answer(node, 0.25 * cycle + 0.5))
                if is_first and node == 3 and attempt == 0:
                    reply[4] ^= 0x10
                if node == 3 and 3 <= cycle <= 5:
                    at += micros(500)
                else:
                    at = slaves.send(reply, at + micros(time))
            if cycle % 3 == 0:
                speed = float("nan") if is_first and node == 1 else 2.5
                at = master.send(sealed("bb%02x" % node + struct.pack("<f", speed).hex()),
                                 at + micros(30))
    return master, slaves


def rover():
    """A host and its rover: pings, commands, reports, one of them damaged, and hazards."""
    host, robot = Line(UCP_BAUD), Line(UCP_BAUD)
    reports = [frame for frame in vectors("ucp") if frame[4] == 5 and len(frame) == 44]
    at = micros(2000)
    for number in range(6):
        report = bytearray(reports[1 + number % 3])
        report[5] = number
        report[-2:] = crc(report[:-2])
        if number == 2:
            report[20] ^= 0x04
        robot.send(report, at)
        speed = 20 * number
        # From 101 % on it is out of range; the last one would start an update.
        command = struct.pack("<hhhhHHI", speed + 1 if number == 5 else speed, -10, 100, 0,
                              39 if number == 4 else 0, 0, 0)
        end = host.send(ucp(2, command, number), at + micros(5000))
        if number % 2 == 0:
            end = host.send(ucp(1, b"", number), end + micros(300))
            robot.send(ucp(1, b"\0"), end + micros(350 + 200 * number))
        at += micros(20_000)
    return host, robot


# Width of a window.
PIXELS = 1300

# By name: the lines, the decoder, the bit rate, and the time to be seen first, µs.
DEMOS = {
    "demo.sr": (motors, "axle_ikeya", IKEYA_BAUD, 1750),
    "rover.sr": (rover, "axle_ucp", UCP_BAUD, 14_000),
}


def put(path, lines, decoder, baud, seen, options):
    """Writes the capture, and the set-up of PulseView beside it."""
    end = max(line.places[-1][1] for line in lines if line.places)
    write(path, ["TX", "RX"], lines, int(end + micros(25_000)))
    Path(path).with_suffix(".pvs").write_text(setup(decoder, baud, seen, options))


class Unusable(Exception):
    """A recording that cannot be drawn."""


# Longest part of a recording that is drawn, seconds: five million samples each.
MOST_SECONDS = 20

# By the description that `axle record` gives an interface: decoder and its options.
PROTOCOLS = {
    "ikeya": ("axle_ikeya", {}),
    "ikeya-3": ("axle_ikeya", {"boards": "three"}),
    "ucp": ("axle_ucp", {}),
}


def recording(path, out, begin, end):
    """Draws the first line of a pcapng file, from and until these seconds."""
    interface, packets = first_line(Path(path).read_bytes(), path)
    name = interface.get(3, b"").decode(errors="replace")
    if name not in PROTOCOLS or len(interface.get(8, b"")) != 8:
        raise Unusable("not a line that axle has recorded: " + (name or "no protocol"))
    baud = int.from_bytes(interface[8], "little")
    if not 300 <= baud <= SAMPLE_RATE // 5:
        raise Unusable("%d bit/s cannot be drawn at 5 MHz" % baud)
    # A clock that was set back leaves packets that are earlier than the first.
    packets.sort(key=lambda packet: packet[0])
    chosen = [((time - packets[0][0]) / 1e6 - begin, is_sent, chunk)
              for time, is_sent, chunk in packets
              if chunk and begin <= (time - packets[0][0]) / 1e6 <= end]
    if not chosen:
        raise Unusable("no bytes are in this part")
    # Each chunk ends at its time. Room for all of the first, and an idle line in front of it.
    lead = max(0.002, *(len(chunk) * BITS / baud - seconds + 2 * BITS / baud
                        for seconds, _, chunk in chosen))
    free, begins = {True: 0.0, False: 0.0}, []
    for seconds, is_sent, chunk in chosen:
        duration = len(chunk) * BITS / baud
        begins.append(max(seconds + lead - duration, free[is_sent]))
        free[is_sent] = begins[-1] + duration
    # The bytes may take longer than the time in which a program gave or got them.
    if max(free.values()) > MOST_SECONDS + 1:
        raise Unusable("longer than %d s on the wire: choose a part by FROM and TO, seconds"
                       % MOST_SECONDS)
    lines = {True: Line(baud), False: Line(baud)}
    for (_, is_sent, chunk), at in zip(chosen, begins):
        lines[is_sent].send(chunk, at * SAMPLE_RATE)
    decoder, options = PROTOCOLS[name]
    put(out, [lines[True], lines[False]], decoder, baud, 2000, options)


def first_line(data, path):
    """The options of the first interface, and its packets: time, whether sent, bytes."""
    if data[:4] != b"\x0a\x0d\x0d\x0a" or data[8:12] != b"\x4d\x3c\x2b\x1a":
        raise Unusable("not pcapng as axle writes it")
    at, interface, packets = 0, None, []
    while at + 12 <= len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if length < 12 or at + length > len(data):
            # Cut off: what is before counts.
            break
        body = data[at + 8:at + length - 4]
        if kind == 0x0A0D0D0A and at > 0:
            # Each section has a first interface of its own.
            print("make.py: %s: only the first of its sections is drawn" % path, file=sys.stderr)
            break
        if kind == 1 and interface is None:
            interface = options_of(body[8:])
            if interface.get(9) != b"\x06":
                raise Unusable("its times are not in microseconds")
        elif kind == 6 and len(body) >= 20:
            number, high, low, held = struct.unpack_from("<IIII", body)
            flags = options_of(body[20 + (held + 3) // 4 * 4:]).get(2, b"")
            is_sent = int.from_bytes(flags, "little") & 3 == 2
            if number == 0:
                packets.append((high << 32 | low, is_sent, body[20:20 + held]))
        at += length
    if interface is None:
        raise Unusable("no interface")
    return interface, packets


def options_of(data):
    found, at = {}, 0
    while at + 4 <= len(data):
        code, length = struct.unpack_from("<HH", data, at)
        if code == 0:
            break
        found[code] = data[at + 4:at + 4 + length]
        at += 4 + (length + 3) // 4 * 4
    return found


def setup(decoder, baud, seen, options):
    """The set-up of PulseView that it restores with a capture of the same name: the two wires, the
    decoders, their settings, and what is in view."""
    lines = ["[General]", "decode_signals=1", "generated_signals=0", "views=1"]
    bytes_of_baud = "".join("\\x%02x" % byte for byte in baud.to_bytes(8, "little"))
    signal = {
        "name": decoder, "enabled": "true", "decoders": 2, "channels": 2,
        "decoder0\\id": "uart", "decoder0\\visible": "true", "decoder0\\options": 1,
        "decoder0\\option0\\name": "baudrate", "decoder0\\option0\\type": "x",
        "decoder0\\option0\\value": '"@ByteArray(%s)"' % bytes_of_baud,
        "decoder0\\row0\\visible": "false", "decoder0\\row5\\visible": "false",
        "decoder1\\id": decoder, "decoder1\\visible": "true", "decoder1\\options": len(options),
        "channel0\\name": "RX", "channel0\\initial_pin_state": 2,
        "channel0\\assigned_signal_name": "RX",
        "channel1\\name": "TX", "channel1\\initial_pin_state": 2,
        "channel1\\assigned_signal_name": "TX",
    }
    for number, (name, value) in enumerate(options.items()):
        group = "decoder1\\option%d\\" % number
        signal |= {group + "name": name, group + "type": "s",
                   group + "value": '"@ByteArray(%s\\0)"' % value}
    lines += ["", "[decode_signal0]"] + ["%s=%s" % item for item in signal.items()]
    # Seconds per pixel.
    lines += ["", "[view0]", "scale=%g" % (seen / 1e6 / PIXELS)]
    return "\n".join(lines) + "\n"


def main():
    arguments = sys.argv[1:]
    try:
        if len(arguments) == 1 and Path(arguments[0]).name in DEMOS:
            lines, *settings = DEMOS[Path(arguments[0]).name]
            put(arguments[0], lines(), *settings, {})
        elif len(arguments) in (2, 4) and arguments[1].endswith(".sr"):
            recording(*arguments[:2], *map(float, arguments[2:] or (0, "inf")))
        else:
            sys.exit(__doc__.strip())
    except OSError as problem:
        sys.exit("make.py: %s: %s" % (problem.filename, problem.strerror))
    except (Unusable, ValueError) as problem:
        sys.exit("make.py: %s: %s" % (arguments[0], problem))


if __name__ == "__main__":
    main()
