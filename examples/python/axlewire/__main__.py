"""The tool `axle`: `python -m axlewire`."""

from __future__ import annotations

import signal
import sys

from axlewire._axlewire import _tool


def main() -> int:
    """Runs the tool with the arguments of this process."""
    # The tool has handlers of its own: it stops what moves.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _tool(["axle", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
