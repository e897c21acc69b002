"""Ikeya MD and UCP, two serial protocols for motors and rovers.

Captures as columns of Arrow: `read` and `scan`. Bytes: `Decoder`, `crc16`, and the builders of
`axlewire.ikeya` and `axlewire.ucp`. A line with motors or a rover: `Bus` and `Rover`.
"""

from axlewire._axlewire import Capture, Scan, Table, __version__, crc16, read, scan

__all__ = ["Capture", "Scan", "Table", "__version__", "crc16", "read", "scan"]
