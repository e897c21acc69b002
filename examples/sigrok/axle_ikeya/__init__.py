"""
Ikeya MD motor bus: RS485, 500 kbit/s, a master and up to eight motor boards (axlewire).

Packets, values with units, gaps, response times and hazards. The frames and gaps are those of
`axle decode`.
"""

from .pd import Decoder
