#!/usr/bin/env python3
"""Speed and memory of `axle decode` and of `axle export` to Parquet: `name value goal` per figure.

    benches/tool.py [--quick] [--goals]

Builds the tool, writes captures of clean frames to a temporary folder, and runs each contender in
turns; a figure is the ratio of medians of one run. Exports count processor time, the best of five
runs. Every output is checked: its number of lines and its summary. `--quick` takes one round on
1 MB, as a test. With `--goals` a figure that misses its goal is a failure.
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

ROOT = Path(__file__).resolve().parent.parent
AXLE = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release/axle"
STYLES = {"text": [], "json": ["--json"], "summary": ["--summary"]}


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
        value = speed if node <= 4 else struct.pack("<hh", dice.randrange(-8191, 8192), dice.randrange(-50, 50))
        answer = bytes([0x55 if node <= 4 else 0x56, node]) + value
        frame = [bytes([0xAA, node]), answer, bytes([0xBB, node]) + value][at % 3]
        yield frame + crc(frame)


# Frames, a message with a table of its own, and the goal of the export.
PROTOCOLS = {"ucp": (reports, "report", 150), "ikeya": (packets, "write", 60)}


def run(args):
    """Seconds, processor seconds, peak memory in MB and output of a run of axle."""
    peak, done = 0, 0
    with tempfile.TemporaryFile() as output:
        begin = time.perf_counter()
        child = subprocess.Popen([AXLE, *args], stdout=output if "export" in args else subprocess.DEVNULL, stderr=output)
        while not done:
            # A high-water mark, so that the last look counts.
            status = Path(f"/proc/{child.pid}/status").read_text()
            peak = max([peak, *(int(kb) for kb in re.findall(r"VmHWM:\s+(\d+) kB", status))])
            time.sleep(0.002)
            done, status, usage = os.wait4(child.pid, os.WNOHANG)
        seconds = time.perf_counter() - begin
        child.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        printed = output.read().decode()
    assert child.returncode == 0, f"axle {args}: {printed}"
    return seconds, usage.ru_utime + usage.ru_stime, peak / 1024, printed


def at_once(args):
    """Seconds of two runs at the same time."""
    begin = time.perf_counter()
    children = [subprocess.Popen([AXLE, *args], stdout=subprocess.DEVNULL) for _ in range(2)]
    assert not any([child.wait() for child in children]), f"axle {args} failed"
    return time.perf_counter() - begin


def check(style, args, frames):
    """Every frame has a line, but in a summary; and the counts at the end are of them all."""
    lines = subprocess.run([AXLE, *args], capture_output=True, check=True).stdout.splitlines()
    if style == "json":
        summary = json.loads(lines[-1])
        found = (summary["frames"], summary["skipped"], len(lines))
    else:
        found = (int(lines[-2].split()[2]), int(lines[-1].split()[0]), len(lines))
    wanted = (frames, 0, {"json": frames + 1, "text": frames + 5, "summary": 3}[style])
    assert found == wanted, f"axle {args}: {found}, not {wanted}"


def read(path):
    """Seconds that reading the file alone takes."""
    begin = time.perf_counter()
    with open(path, "rb", buffering=0) as file:
        block = bytearray(64 * 1024)
        while file.readinto(block):
            pass
    return time.perf_counter() - begin


def decoding(protocol, path, small, frames, size, rounds):
    """Name, value and goal of each figure of `axle decode`."""
    runs = {(style, jobs): ["decode", *args, "--protocol", protocol, "--jobs", jobs, path]
            for style, args in STYLES.items() for jobs in "12"}
    for (style, _), args in runs.items():
        check(style, [*args[:-1], small], 2400)
    check("summary", runs["summary", "2"], frames)
    seconds = {name: [] for name in [*runs, "read", "at once"]}
    memory = 0
    for _ in range(rounds):
        seconds["read"].append(read(path))
        seconds["at once"].append(at_once(runs["json", "1"]))
        for name, args in runs.items():
            took, _, megabytes, _ = run(args)
            seconds[name].append(took)
            memory = max(memory, megabytes)
    assert memory > 0, "no memory was measured"
    median = {name: statistics.median(all) for name, all in seconds.items()}
    yield "tool_text_over_json", median["json", "1"] / median["text", "1"], 1
    for style in STYLES:
        yield f"tool_jobs2_over_jobs1_{style}", median[style, "1"] / median[style, "2"], None if style == "text" else 1.7
    # What this machine gives to two processes that have nothing to do with each other.
    yield "tool_two_processes_over_one_json", 2 * median["json", "1"] / median["at once"], None
    best = min(median["summary", "1"], median["summary", "2"])
    # Half the speed of reading the file, if that is less.
    yield "tool_summary_gb_per_s", size / best / 1e9, round(min(1.5, size / median["read"] / 2 / 1e9), 3)
    yield "tool_peak_memory_mb", memory, "<=20"
    for style in ("text", "json"):
        yield f"tool_{style}_mb_per_s", size / median[style, "1"] / 1e6, None


def exporting(protocol, path, frames, size, rounds):
    """The same of `axle export`."""
    _, message, goal = PROTOCOLS[protocol]
    out, seconds, memory = path.with_suffix(".parquet"), [], 0
    for _ in range(rounds):
        _, took, megabytes, printed = run(["export", "--force", "-P", protocol, path, "-o", out])
        assert f" in {frames} frames" in printed and " 0 skipped" in printed, printed
        assert (out / f"{protocol}.{message}.parquet").is_file(), f"no table of {message}"
        seconds.append(took)
        memory = max(memory, megabytes)
    yield "export_parquet_mb_per_s", size / min(seconds) / 1e6, goal
    yield "export_parquet_peak_memory_mb", memory, None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one round on 1 MB, as a test")
    parser.add_argument("--goals", action="store_true", help="fail if a figure misses its goal")
    options = parser.parse_args()
    rounds = 1 if options.quick else 5
    build = ["cargo", "build", "--release", "--quiet", "-p", "axlewire-cli"]
    subprocess.run(build, cwd=ROOT, check=True)
    missed = False
    for protocol, (make, *_) in PROTOCOLS.items():
        with tempfile.TemporaryDirectory() as folder:
            block, path, small = b"".join(make(2400)), Path(folder, protocol), Path(folder, "small")
            small.write_bytes(block)
            for work, megabytes in ((decoding, 100), (exporting, 200)):
                times = max(1, (1 if options.quick else megabytes) * 1_000_000 // len(block))
                path.write_bytes(block * times)
                arguments = (path, small) if work is decoding else (path,)
                for name, value, goal in work(protocol, *arguments, 2400 * times, len(block) * times, rounds):
                    print(f"{name}_{protocol} {value:.3f} {'-' if goal is None else goal}", flush=True)
                    limit = float(str(goal or 0).removeprefix("<="))
                    missed |= value > limit if str(goal).startswith("<=") else value < limit
    return options.goals and missed


if __name__ == "__main__":
    sys.exit(main())
