"""What reading costs: prints ratios of one run.

    python bench.py [--gigabyte]

The captures are made of the reports of ../captures/drive.pcapng, as raw bytes. Answers are checked.
"""

from __future__ import annotations

import multiprocessing
import os
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import axlewire

REPORTS = Path(__file__).parent / "../captures/drive.pcapng"
LENGTH = 100_000_000
SAMPLE = 4_000_000
RUNS = 5
FIELDS = struct.Struct("<H4h3h3h3hhBBHH")
TABLE = []
for byte in range(256):
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    TABLE.append(byte)


def parsed(data: bytes) -> Iterator[tuple[int, ...]]:
    """A good parser in pure Python: `find`, a table for the CRC, `struct`; reports only."""
    view, at, table = memoryview(data), 0, TABLE
    while (at := data.find(b"\xfd\xff", at)) >= 0:
        end = at + 4 + data[at + 2] if at + 3 < len(data) else 0
        if at + 8 <= end <= len(data):
            crc = 0xFFFF
            for byte in view[at : end - 2]:
                crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
            if crc == data[end - 2] | data[end - 1] << 8:
                if data[at + 4] == 5 and end - at == 44:
                    yield FIELDS.unpack_from(view, at + 6)
                at = end
                continue
        at += 1


def columns(data: bytes) -> list[tuple[int, ...]]:
    """The same as columns."""
    return list(zip(*parsed(data)))


def fastest(call: Callable[[], object]) -> float:
    """Seconds of the fastest of some runs."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - begin)
        del result
    return min(times)


def count(path: str) -> int:
    """Reports in a file."""
    return len(axlewire.read(path, protocol="ucp")["report"])


def main() -> None:
    """Prints the ratios."""
    reports = axlewire.read(REPORTS)["report"]
    data = b"".join(reports["bytes"])
    data *= LENGTH // len(data)
    sample = data[: SAMPLE // 44 * 44]
    own, theirs = columns(sample), axlewire.read(sample, protocol="ucp")["report"]
    names = "battery_pct rpm_0 rpm_1 rpm_2 rpm_3 acc_0 acc_1 acc_2 gyro_0 gyro_1 gyro_2".split()
    names += "mag_0 mag_1 mag_2 heading power_w voltage_dv current_ca version".split()
    assert [list(column) for column in own] == [theirs[name] for name in names]

    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "reports.bin"))
        Path(path).write_bytes(data)
        os.sync()  # else the disk is written meanwhile
        speed = len(data) / fastest(lambda: axlewire.read(path, protocol="ucp"))
        nothing = lambda: list(axlewire.scan(path, protocol="ucp", message="skipped"))  # noqa: E731
        decoding = len(data) / fastest(nothing)
        pure = len(sample) / fastest(lambda: columns(sample))
        print(f"read, MB/s of capture: {speed / 1e6:.0f}")
        print(f"read / decoding into columns that are dropped: {speed / decoding:.2f}")
        print(f"read / pure Python: {speed / pure:.0f}")

        with multiprocessing.get_context("spawn").Pool(2) as pool:
            pool.map(count, [path] * 2)
            two = fastest(lambda: pool.map(count, [path] * 2))
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            pool.map(count, [path])
            one = fastest(lambda: pool.map(count, [path] * 2))
        print(f"two processes / one: {one / two:.2f}")

        if "--gigabyte" in sys.argv:
            with open(path, "wb") as file:
                for _ in range(10):
                    file.write(data)
            code = (
                "import axlewire, re, sys;"
                "status = lambda: open('/proc/self/status').read();"
                "peak = lambda: int(re.search(r'VmHWM:\\s+(\\d+)', status())[1]);"
                "begin = peak();"
                "rows = sum(map(len, axlewire.scan(sys.argv[1], protocol='ucp')));"
                "print(rows, (peak() - begin) // 1024)"
            )
            done = subprocess.run(
                [sys.executable, "-c", code, path], capture_output=True, text=True, check=True
            )
            rows, grown = done.stdout.split()
            assert int(rows) == 10 * len(data) // 44
            print(f"scan of 1 GB, MB of memory: {grown}")

    python = fastest(lambda: subprocess.run([sys.executable, "-c", "pass"], check=True))
    imported = fastest(lambda: subprocess.run([sys.executable, "-c", "import axlewire"], check=True))
    print(f"import, ms: {1e3 * (imported - python):.0f}")


if __name__ == "__main__":
    main()
