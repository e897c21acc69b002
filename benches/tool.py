#!/usr/bin/env python3
"""Speed and memory of `axle decode`: a line per figure, `name value goal`.

    python3 benches/tool.py [--quick] [--mb 100]

Builds the tool, writes captures of clean frames to a temporary folder, and runs each contender in
turns; a figure is the ratio of medians of one run. What two threads can gain is limited by what
the machine gives to two processes at once, which is measured too. Every output is checked: its
number of lines and its summary. It fails if an output is wrong, never because a figure is low.
"""

import argparse
import json
import os
import random
import re
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STYLES = {"text": [], "json": ["--json"], "summary": ["--summary"]}

ROOT = Path(__file__).resolve().parent.parent
AXLE = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release/axle"


def crc(data):
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


def reports(count):
    """Telemetry of a driving rover."""
    dice = random.Random(1)
    for index in range(count):
        values = [dice.randrange(101)] + [dice.randrange(-300, 300) for _ in range(4)]
        values += [dice.randrange(-17_000, 17_000) for _ in range(9)] + [dice.randrange(360)]
        body = struct.pack("<H14h", *values) + struct.pack("<BBHH", 9, 120, dice.randrange(300), 38)
        frame = b"\xfd\xff" + struct.pack("<HBB", len(body) + 4, 5, index % 256) + body
        yield frame + crc(frame)


def packets(count):
    """A bus of four velocity and four position nodes, polled and commanded."""
    dice = random.Random(2)
    for at in range(count):
        node = 1 + at // 3 % 8
        speed = struct.pack("<f", round(dice.uniform(-20, 20), 2))
        place = struct.pack("<hh", dice.randrange(-8191, 8192), dice.randrange(-50, 50))
        value = speed if node <= 4 else place
        frame = [
            bytes([0xAA, node]),
            bytes([0x55 if node <= 4 else 0x56, node]) + value,
            bytes([0xBB, node]) + value,
        ][at % 3]
        yield frame + crc(frame)


def run(args, path):
    """Seconds and peak memory in MB of a run."""
    begin = time.perf_counter()
    child = subprocess.Popen([AXLE, "decode", *args, path], stdout=subprocess.DEVNULL)
    peak = 0
    while child.poll() is None:
        try:
            # A high-water mark, so that the last look counts.
            status = Path(f"/proc/{child.pid}/status").read_text()
            peak = max(peak, *(int(kb) for kb in re.findall(r"VmHWM:\s+(\d+) kB", status)), 0)
        except OSError:
            pass
        time.sleep(0.002)
    seconds = time.perf_counter() - begin
    if child.returncode != 0:
        sys.exit(f"axle decode {args} failed")
    return seconds, peak / 1024


def at_once(args, path):
    """Seconds of two runs at the same time."""
    begin = time.perf_counter()
    command = [AXLE, "decode", *args, path]
    children = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for _ in range(2)]
    if any([child.wait() for child in children]):
        sys.exit(f"axle decode {args} failed")
    return time.perf_counter() - begin


def check(style, args, frames, path, protocol):
    """Every frame has a line, but in a summary; and the counts at the end are of them all."""
    output = subprocess.run([AXLE, "decode", *args, path], capture_output=True, check=True).stdout
    lines = output.splitlines()
    if style == "json":
        summary = json.loads(lines[-1])
        found, skipped, expected = summary["frames"], summary["skipped"], frames + 1
    else:
        found = int(lines[-2].split()[2])
        skipped, expected = int(lines[-1].split()[0]), frames + 5
    if style == "summary":
        expected -= frames + 2
    if (found, skipped, len(lines)) != (frames, 0, expected):
        sys.exit(f"{protocol} {args}: {found} of {frames} frames, {len(lines)} of {expected} lines")


def read(path):
    """Seconds that reading the file alone takes."""
    begin = time.perf_counter()
    with open(path, "rb", buffering=0) as file:
        block = bytearray(64 * 1024)
        while file.readinto(block):
            pass
    return time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one round on 1 MB, as a test")
    parser.add_argument("--mb", type=int, default=100, help="length of a capture")
    options = parser.parse_args()
    test_figures()
    length = (1 if options.quick else options.mb) * 1_000_000
    rounds = 1 if options.quick else 5
    subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "axle"], cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory() as folder:
        for protocol, make in [("ucp", reports), ("ikeya", packets)]:
            unit = list(make(2400))
            block = b"".join(unit)
            times = max(1, length // len(block))
            path, small = Path(folder, protocol), Path(folder, protocol + "-small")
            with open(path, "wb") as file:
                for _ in range(times):
                    file.write(block)
            small.write_bytes(block)
            size, frames = len(block) * times, len(unit) * times
            contenders = {}
            for style in STYLES:
                for jobs in ["1", "2"]:
                    args = [*STYLES[style], "--protocol", protocol, "--jobs", jobs]
                    contenders[style, jobs] = args
                    check(style, args, len(unit), small, protocol)
                    if style == "summary":
                        check(style, args, frames, path, protocol)
            seconds = {name: [] for name in [*contenders, "read", "at once"]}
            memory = 0
            for _ in range(rounds):
                seconds["read"].append(read(path))
                seconds["at once"].append(at_once(contenders["json", "1"], path))
                for name, args in contenders.items():
                    took, megabytes = run(args, path)
                    seconds[name].append(took)
                    memory = max(memory, megabytes)
            if memory <= 0:
                sys.exit(f"{protocol}: no memory was measured")
            median = {name: statistics.median(all) for name, all in seconds.items()}
            for name, value, goal in figures(median, size, memory):
                print(f"{name}_{protocol} {value:.3f} {goal}")


def figures(median, size, memory):
    """Name, value and goal of each figure, from seconds, bytes and MB."""
    yield "tool_text_over_json", median["json", "1"] / median["text", "1"], 1
    for style in STYLES:
        ratio = median[style, "1"] / median[style, "2"]
        yield f"tool_jobs2_over_jobs1_{style}", ratio, "-" if style == "text" else 1.7
    # What this machine gives to two processes that have nothing to do with each other.
    yield "tool_two_processes_over_one_json", 2 * median["json", "1"] / median["at once"], "-"
    best = min(median["summary", "1"], median["summary", "2"])
    half_read = size / median["read"] / 2 / 1e9
    yield "tool_summary_gb_per_s", size / best / 1e9, f"{min(1.5, half_read):.3f}"
    yield "tool_peak_memory_mb", memory, "<=20"
    for style in STYLES:
        yield f"tool_{style}_mb_per_s", size / median[style, "1"] / 1e6, "-"


def test_figures():
    """Timing never fails a test, so a ratio that is upside down shows only with known times."""
    seconds = {("text", "1"): 3, ("text", "2"): 2, ("json", "1"): 12, ("json", "2"): 7.5}
    seconds |= {("summary", "1"): 0.5, ("summary", "2"): 0.25, "read": 0.2, "at once": 16}
    due = [4, 1.5, 1.6, 2, 1.5, 4, 8, 1e3 / 3, 1e3 / 12, 2e3]
    names = [f"tool_jobs2_over_jobs1_{style}" for style in ("text", "json", "summary")]
    names = ["tool_text_over_json", *names, "tool_two_processes_over_one_json", "tool_summary_gb_per_s"]
    names += ["tool_peak_memory_mb", *(f"tool_{style}_mb_per_s" for style in ("text", "json", "summary"))]
    found = list(figures(seconds, 1e9, 8))
    assert [name for name, _, _ in found] == names, found
    assert all(abs(value - wanted) < 1e-9 for (_, value, _), wanted in zip(found, due)), found


if __name__ == "__main__":
    main()
