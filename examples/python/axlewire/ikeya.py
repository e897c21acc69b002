"""Ikeya MD: a function per packet, which gives it as bytes.

Speeds are turns per second, positions turns: a number for a board with one motor, three for one
with three.
"""

from axlewire._axlewire import (
    ikeya_position as position,
    ikeya_read as read,
    ikeya_velocity as velocity,
    ikeya_write_position as write_position,
    ikeya_write_velocity as write_velocity,
)

__all__ = ["position", "read", "velocity", "write_position", "write_velocity"]
