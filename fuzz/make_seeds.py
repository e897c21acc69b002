#!/usr/bin/env python3
"""Puts starting points for a campaign into corpus/, from the frames in ../tests/vectors.

The files are the same every time; `fuzz/campaign --minimise` makes seeds of what counts in them.
src/targets/streams.rs describes the format: framing, repair and number of ops, ops, stream.
"""

import json
import random
from pathlib import Path

HERE = Path(__file__).resolve().parent
VECTORS = HERE.parent / "tests" / "vectors"
CORPUS = HERE / "corpus"

# Ops as src/targets/streams.rs reads them: the upper three bits are the kind, the lower five the
# amount.
SLICE, SLICE8, COMMIT, COMMIT8, STOP1, STOP2, DRAIN, IDLE = (kind << 5 for kind in range(8))
PLANS = {
    "whole": [SLICE8 | 31],
    "bytes": [SLICE | 1],
    "chunks": [SLICE | 7, SLICE | 0, SLICE | 23],
    "port": [COMMIT | 5, DRAIN, COMMIT8 | 8, IDLE, DRAIN],
    "quiet": [SLICE | 11, IDLE, COMMIT | 3, IDLE, SLICE | 2],
    "stops": [STOP1 | 16, COMMIT | 9, STOP2 | 31, DRAIN],
}
NO_REPAIR, ADJACENT, NESTED, ALTERNATE = range(4)


def frames(protocol):
    """The distinct frames of one vector file, in order."""
    lines = (VECTORS / f"{protocol}.jsonl").read_text().splitlines()
    return list(dict.fromkeys(bytes.fromhex(json.loads(line)["hex"]) for line in lines if line))


def stream(choice, repair, ops, data):
    return bytes([choice, len(ops) << 2 | repair, *ops]) + data


def write(target, name, data):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data)


def noisy(frames, headers, dice):
    """Some frames, truncated and damaged, with false headers and noise between them."""
    out = bytearray()
    for frame in dice.sample(frames, 6):
        frame = bytearray(frame)
        fate = dice.randrange(4)
        if fate == 1:
            frame = frame[: dice.randrange(len(frame))]
        elif fate == 2:
            frame[dice.randrange(len(frame))] ^= 1 << dice.randrange(8)
        elif fate == 3:
            out += bytes(dice.choice(headers) for _ in range(dice.randrange(1, 6)))
        out += frame
    return bytes(out)


def streams(target, protocol, choices, headers):
    dice = random.Random(protocol)
    known = frames(protocol)
    for choice in range(choices):
        for name, ops in PLANS.items():
            some = b"".join(dice.sample(known, 4))
            write(target, f"{choice:02}-{name}-clean", stream(choice, NO_REPAIR, ops, some))
            bad = noisy(known, headers, dice)
            repair = dice.choice([NO_REPAIR, ADJACENT, NESTED, ALTERNATE])
            write(target, f"{choice:02}-{name}-noisy", stream(choice, repair, ops, bad))


def roundtrips():
    dice = random.Random("roundtrip")
    for number in range(36):
        length = 4 << number % 5
        data = bytes([number * 29 % 256]) + bytes(dice.randrange(256) for _ in range(length))
        write("roundtrip", f"{number:02}", data)


if __name__ == "__main__":
    streams("ikeya_stream", "ikeya", 12, [0xAA, 0xBB, 0x55, 0x56, 0x01, 0x09])
    streams("ucp_stream", "ucp", 6, [0xFD, 0xFF, 0x04, 0x3C, 0x00, 0x05])
    roundtrips()
