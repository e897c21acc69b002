"""Ikeya MD and UCP, two serial protocols for motors and rovers.

Captures as columns of Arrow: `read` and `scan`. Bytes: `Decoder`, `crc16`, and the builders of
`axlewire.ikeya` and `axlewire.ucp`. A line with motors or a rover: `Bus` and `Rover`, also
simulated ones: `axlewire.sim`.
"""

from axlewire._axlewire import (
    Bus,
    Capture,
    Decoder,
    Error,
    Frame,
    Gap,
    NoAnswer,
    Node,
    NotOnline,
    PortLost,
    Refused,
    Report,
    Reports,
    Rover,
    Scan,
    StillMoving,
    StopsOwed,
    Table,
    __version__,
    crc16,
    read,
    scan,
)

from axlewire import _signals, ikeya, sim, ucp  # noqa: F401

__all__ = [
    "Bus",
    "Capture",
    "Decoder",
    "Error",
    "Frame",
    "Gap",
    "NoAnswer",
    "Node",
    "NotOnline",
    "PortLost",
    "Refused",
    "Report",
    "Reports",
    "Rover",
    "Scan",
    "StillMoving",
    "StopsOwed",
    "Table",
    "__version__",
    "crc16",
    "ikeya",
    "read",
    "scan",
    "sim",
    "ucp",
]
