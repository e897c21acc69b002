#!/usr/bin/env python3
"""Renders bytes on serial wires as logic analyzer captures of sigrok (.sr), sampled at 5 MHz.

    examples/sigrok/make.py demo.sr        motors on a bus: late, missing and damaged answers
    examples/sigrok/make.py rover.sr       a rover's link: pings, reports, hazards

Both have the wires TX (master or host) and RX. The frames are those of tests/vectors; the result
is deterministic.
"""

import json
import os
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

    def send(self, data, at, is_broken=False):
        """Sends bytes from sample `at` on; returns the end of the last. Broken bytes have a stop
        bit of the wrong level."""
        for byte in data:
            bits = [0, *(byte >> bit & 1 for bit in range(8)), 0 if is_broken else 1]
            for number, level in enumerate(bits):
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
    samples = total.to_bytes(length, "little")
    metadata = ["[global]", "sigrok version=0.5.2", "", "[device 1]", "capturefile=logic-1",
                "total probes=%d" % len(lines), "samplerate=5 MHz", "total analog=0"]
    metadata += ["probe%d=%s" % (number, name) for number, name in enumerate(names, 1)]
    metadata += ["unitsize=1", ""]
    beside = Path("%s.part" % path)
    with zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in [("version", b"2"), ("metadata", "\n".join(metadata).encode()),
                           ("logic-1-1", samples)]:
            # A fixed date: the same capture gives the same file.
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    os.replace(beside, path)


def micros(number):
    """In samples."""
    return number * SAMPLE_RATE / 1e6


def vectors(protocol):
    """The recorded frames."""
    lines = (ROOT / "tests" / "vectors" / (protocol + ".jsonl")).read_text().splitlines()
    return [bytes.fromhex(json.loads(line)["hex"]) for line in lines]


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
