"""Signals that end a program without its exit functions, and with them its stops."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType


def _end(number: int, frame: FrameType | None) -> None:
    # As a shell tells it.
    sys.exit(128 + number)


def guard() -> None:
    """Has SIGTERM and SIGHUP end the program as `sys.exit` does, so that motors are stopped.

    Only where nothing else was decided, and in the main thread, as Python wants it.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _end)
