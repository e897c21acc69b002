"""What ends, suspends or doubles a program without its exit functions, and with them its stops."""

from __future__ import annotations

import atexit
import os
import signal
import stat
import sys
import threading
from types import FrameType

from axlewire._axlewire import _leave_all

# The devices of the ports that were opened.
_devices: set[int] = set()


def _end(number: int, frame: FrameType | None) -> None:
    # As a shell tells it.
    sys.exit(128 + number)


def _suspend(number: int, frame: FrameType | None) -> None:
    # Nobody would repeat a stop meanwhile: the lines are left.
    _leave_all()
    os.kill(os.getpid(), signal.SIGSTOP)


def guard(path: str | os.PathLike[str]) -> None:
    """Has SIGTERM and SIGHUP end the program as `sys.exit` does, and Ctrl-Z stop the motors first.

    Only where nothing else was decided, and in the main thread, as Python wants it. A process that
    is forked from now on does not keep this port.
    """
    try:
        found = os.stat(path)
        if stat.S_ISCHR(found.st_mode):
            _devices.add(found.st_rdev)
    except OSError:
        pass  # it will not open either
    if threading.current_thread() is not threading.main_thread():
        return
    for name, handler in (("SIGTERM", _end), ("SIGHUP", _end), ("SIGTSTP", _suspend)):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, handler)


def _close_ports() -> None:
    """In a forked process, which cannot serve a line: it would keep others from opening it."""
    for name in os.listdir("/dev/fd"):
        try:
            found = os.fstat(int(name))
            if stat.S_ISCHR(found.st_mode) and found.st_rdev in _devices:
                os.close(int(name))
        except OSError:
            pass  # that of the listing itself


# Motors that still turn are stopped, and seen to stand still: before Python waits for threads which
# may use a line for ever, and once more, of lines that an exit function has opened.
getattr(threading, "_register_atexit", atexit.register)(_leave_all)
atexit.register(_leave_all)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_ports)
