"""
UCP: the link between the Linux board and the motor board of a rover, 115200 bit/s (axlewire).

Messages, values with units, gaps, response times and hazards. The frames and gaps are those of
`axle decode`. Needs the folder `axle_ikeya` beside this one.
"""

import importlib.util
import os
import sys


def shared(name):
    """Loads a module of the other decoder by its file. To import the decoder itself would make
    libsigrokdecode take it for loaded."""
    if name not in sys.modules:
        here = os.path.dirname(os.path.abspath(__file__))
        path = os.path.join(os.path.dirname(here), "axle_ikeya", name + ".py")
        if not os.path.exists(path):
            raise ImportError("axle_ucp needs the folder axle_ikeya beside it: " + path)
        spec = importlib.util.spec_from_file_location(name, path)
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])


shared("axle_wire")
shared("axle_text")

from .pd import Decoder
