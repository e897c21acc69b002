"""The steps of the gate, for the scripts that compare something with them."""

import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent


def steps():
    """Their names, in the order in which they run."""
    listing = subprocess.run(["bash", ".ci/run", "--list"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    return re.findall(r"^(\w+): ", listing.stdout, re.MULTILINE)
