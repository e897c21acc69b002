"""Simulated motors and a simulated rover, for trying things without hardware.

    with axlewire.sim.bus({1: "velocity"}) as port, axlewire.Bus(port) as bus:
        bus.discover()
        bus[1].velocity = 2.0

Each is a process with a pseudo-terminal, which is why there is none on Windows. Options are those
of `axle sim`: `python -m axlewire sim ikeya --help`.
"""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
import time
import weakref
from collections.abc import Mapping
from types import TracebackType

START_WITHIN_S = 10.0

_running: weakref.WeakSet[Simulator] = weakref.WeakSet()


# After the motors of this program are stopped: what is registered later is called first.
@atexit.register
def _end_all() -> None:
    for simulator in list(_running):
        simulator.close()


class Simulator(os.PathLike[str]):
    """A simulator; its path is that of the port, and `log` what it tells."""

    def __init__(self, *arguments: str) -> None:
        self._folder = tempfile.mkdtemp(prefix="axle-")
        self._owner = os.getpid()
        self.path = os.path.join(self._folder, "port")
        self._log = os.path.join(self._folder, "log")
        command = [sys.executable, "-m", "axlewire", "sim", *arguments, "--link", self.path]
        self._told: str | None = None
        with open(self._log, "wb") as log:
            # Not with the signals of a terminal: Ctrl-C is for the program, whose motors are to be
            # stopped by it.
            self._process = subprocess.Popen(
                command, stdout=log, stderr=log, start_new_session=True
            )
        _running.add(self)
        end = time.monotonic() + START_WITHIN_S
        while not os.path.exists(self.path):
            if self._process.poll() is not None or time.monotonic() > end:
                told = self.log
                self.close()
                raise RuntimeError(f"the simulator did not start: {told}")
            time.sleep(0.01)

    @property
    def log(self) -> str:
        """What it has told so far, such as which motor turns."""
        if self._told is not None:
            return self._told
        with open(self._log, encoding="utf-8") as log:
            return log.read()

    def close(self) -> None:
        """Ends it, as if the cable were pulled. A process that was forked does not."""
        if os.getpid() != self._owner:
            return
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
        if self._told is None:
            self._told = self.log
            shutil.rmtree(self._folder, ignore_errors=True)

    def __del__(self) -> None:
        if hasattr(self, "_process"):
            self.close()

    def __fspath__(self) -> str:
        return self.path

    def __enter__(self) -> Simulator:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<axlewire.sim.Simulator on {self.path}>"


def bus(nodes: Mapping[int, str] | None = None, *options: str) -> Simulator:
    """A bus of motors; `nodes` gives the mode of each, `velocity` or `position`."""
    chosen = {1: "velocity"} if nodes is None else nodes
    flags = [flag for node, mode in chosen.items() for flag in ("--node", f"{node}:{mode}")]
    return Simulator("ikeya", *flags, *options)


def rover(*options: str) -> Simulator:
    """A rover."""
    return Simulator("ucp", *options)
