#!/usr/bin/env python3
"""Speed and memory of `axle export` to Parquet: a line per figure, `name value goal`.

    benches/export.py [--mb 200] [--quick]

The captures are those of `tool.py`. Speed is megabytes of capture per second of processor time, so
it is that of one core, and other work disturbs it little; the best of five runs counts. Each run is
checked: the summary, and the number of files. It fails if an output is wrong, never because a
figure is low. With `--quick`, one run on 1 MB with the debug build.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import tool

GOALS = {"ucp": (tool.reports, 150, "report"), "ikeya": (tool.packets, 60, "write")}


def export(axle, protocol, path, out):
    """Seconds of processor time and peak memory in MB of a run, and what it printed."""
    child = subprocess.Popen([axle, "export", "--force", "-P", protocol, path, "-o", out],
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    printed = child.stdout.read().decode() + child.stderr.read().decode()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"axle export of {protocol} failed: {printed}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, printed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one run on 1 MB, as a test")
    parser.add_argument("--mb", type=int, default=200, help="length of a capture")
    options = parser.parse_args()
    rounds, length = (1, 1) if options.quick else (5, options.mb)
    build = ["cargo", "build", "--quiet", "-p", "axle", "--features", "mcap,parquet"]
    subprocess.run(build + ["--release"] * (not options.quick), cwd=tool.ROOT, check=True)
    axle = tool.AXLE.parent.parent / ("debug" if options.quick else "release") / "axle"
    with tempfile.TemporaryDirectory() as folder:
        for protocol, (make, goal, message) in GOALS.items():
            unit = list(make(2400))
            block = b"".join(unit)
            times = max(1, length * 1_000_000 // len(block))
            path, out = Path(folder, protocol), Path(folder, protocol + ".parquet")
            with open(path, "wb") as file:
                for _ in range(times):
                    file.write(block)
            runs = []
            for _ in range(rounds):
                seconds, peak, printed = export(axle, protocol, path, out)
                if f" in {times * len(unit)} frames" not in printed or " 0 skipped" not in printed:
                    sys.exit(f"{protocol}: not {times * len(unit)} frames: {printed}")
                if not (out / f"{protocol}.{message}.parquet").is_file():
                    sys.exit(f"{protocol}: no table of {message}")
                runs.append((seconds, peak))
            best, size = min(seconds for seconds, _ in runs), path.stat().st_size / 1e6
            print(f"export_parquet_mb_per_s_{protocol} {size / best:.0f} {goal}")
            print(f"export_parquet_peak_memory_mb_{protocol} {max(peak for _, peak in runs):.1f} -")
            path.unlink()


if __name__ == "__main__":
    main()
