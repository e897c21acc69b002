"""Pictures of captures, as `axle plot` draws them."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path


class Picture:
    """A picture of a capture; a notebook shows it."""

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes it to a file that ends in .svg; `python -m axlewire plot` draws PNG and HTML."""
        if Path(path).suffix.lower() != ".svg":
            raise ValueError(f"{os.fspath(path)!r} does not end in .svg")
        Path(path).write_text(self.svg, encoding="utf-8")

    def __repr__(self) -> str:
        return f"<axlewire.Picture of {len(self.svg)} characters of SVG>"


def plot(source: object, protocol: str | None) -> Picture:
    """Draws a capture in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="axle-") as folder:
        if isinstance(source, (bytes, bytearray, memoryview)):
            capture = Path(folder, "capture")
            capture.write_bytes(source)
            paths = [str(capture)]
        elif isinstance(source, (str, os.PathLike)):
            paths = [os.fspath(source)]
        elif isinstance(source, (list, tuple)):
            paths = [os.fspath(path) for path in source]
        else:
            raise ValueError("a capture that was read from an open file is not there any more")
        output = Path(folder, "capture.svg")
        named = ["--protocol", protocol] if protocol else []
        command = [sys.executable, "-m", "axlewire", "plot", *named, "--output", str(output)]
        done = subprocess.run(
            [*command, "--", *paths], capture_output=True, text=True, check=False
        )
        if not output.exists():
            raise ValueError(done.stderr.strip().removeprefix("axle: "))
        return Picture(output.read_text(encoding="utf-8"))
