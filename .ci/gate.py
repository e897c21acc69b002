"""The steps of the gate, for the scripts that compare something with them."""

import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent


def steps():
    """Their names, in the order in which they run."""
    listing = subprocess.run(["bash", ".ci/run", "--list"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    return re.findall(r"^(\w+): ", listing.stdout, re.MULTILINE)


def body(step):
    """What the step does: its lines in `.ci/run`, those of the functions that it calls, and the
    variables that both share. Comments do not count."""
    text = (ROOT / ".ci" / "run").read_text()
    parts = {name: long or short for name, long, short in
             re.findall(r"^(\w+)\(\) (?:\{\n((?s:.*?))^\}|\{ (.*) \})$", text, re.MULTILINE)}
    parts |= dict(re.findall(r"^(\w+)=(.*)$", text, re.MULTILINE))
    found = [f"step_{step}"]
    for name in found:
        found += [other for other in parts if other not in found and re.search(rf"\b{other}\b", parts[name])]
    return [line for name in found for line in parts[name].splitlines() if not line.lstrip().startswith("#")]
