#!/usr/bin/env python3
"""Builds ikeya.bin and ucp.bin from the recorded frames in tests/vectors, with noise in between.

Every frame in them was sent or accepted by a running implementation. The additions are typical
line faults: stray bytes, a flipped bit, a truncated frame, a false header. The result is
deterministic.

The two captures with times, motors.pcapng and drive.pcapng, are simulated instead:
`cargo run -p host-examples --features sim --bin stories -- examples/captures` makes them.
"""
import json
from pathlib import Path

here = Path(__file__).parent
vectors = here.parent.parent / "tests" / "vectors"


def load(name):
    lines = (vectors / name).read_text().splitlines()
    return {row["hex"]: bytes.fromhex(row["hex"]) for row in map(json.loads, lines)}


def flipped(frame, bit):
    """The frame with one bit flipped."""
    frame = bytearray(frame)
    frame[bit // 8] ^= 1 << bit % 8
    return bytes(frame)


ikeya, ucp = load("ikeya.jsonl"), load("ucp.jsonl")
i, u = ikeya.__getitem__, ucp.__getitem__

# A master discovers its nodes, sets speeds and positions, and reads them back.
(here / "ikeya.bin").write_bytes(b"".join([
    i("aa01bed0"),                        # READ 1
    i("55010000000031de"),                # node 1: at rest
    b"\x00",                              # a stray byte, as from a driver switching on
    i("aa033f11"),                        # READ 3
    i("5603001001004878"),                # node 3: 1.5 turns
    i("aa047ed3"),                        # READ 4, unanswered
    i("aa09bf16"),                        # READ 9: node 9 is invalid
    i("bb010000803f0740"),                # WRITE 1: 1 rps
    flipped(i("5603001001004878"), 20),   # an answer with a flipped bit
    i("bb0600f0ffff92d3"),                # WRITE 6: -1.5 turns
    i("5603001001004878")[:5],            # a truncated answer
    i("aa06ff12"),                        # READ 6
    i("5601aa01bed031c9"),                # an answer whose payload looks like a READ
    b"\xbb\x55\x3c\x7e",                  # noise containing headers
    i("55050000c07fd1fe"),                # node 5 reports NaN
    i("aa073ed2"),                        # READ 7
]))

# A rover boots, is driven, reports, and is calibrated.
reports = [frame for hex, frame in ucp.items() if hex.startswith("fdff280005")]
(here / "ucp.bin").write_bytes(b"".join([
    b"\xff\x00\xfd",                      # the line settles
    u("fdff040008000712"),                # the robot requests its biases
    u("fdff17000800010080ff7f0080ff7f0080ff7f0080ff7ffdff79a2"),
    u("fdff040001ff4102"),                # ping
    u("fdff0500010000be00"),              # pong
    reports[1],
    b"\xfd\xff\x3c\x00",                  # a false header announcing 64 bytes
    reports[2],
    flipped(reports[3], 100),             # a report with a flipped bit
    reports[3],
    u("fdff140002003c0068010000000000000000000000004b4e"),  # angular 360, from a careless host
    reports[4][:17],                      # a truncated report
    u("fdff0500030001de00"),              # calibrate the magnetometer
    u("fdff060003000100806b"),
    u("fdff0a000700fdfffdfffdff98b4"),    # the result
    u("fdff05000700019fc1"),
    u("fdff08000a0303000000e482"),        # network connected, in four bytes
    u("fdff14000a0000000000000000000000000000000000b314"),  # id 0A with a body that fits no message
    u("fdff260005fdfffffffffefffdfffcfffdfdfdff0100020003000400050006000700080009006701bef8"),
    reports[5][:9],                       # the capture ends inside a report
]))
