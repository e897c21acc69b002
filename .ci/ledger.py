"""Records of what was tried: a line for each thing, void once the thing itself has changed."""

import datetime
import hashlib
import re


class Ledger:
    """A file of lines such as `fmt 5298e762 9d1b2c3f: 3 s, 2026-11-24`, below a comment."""

    def __init__(self, path, comment, things, outcome):
        """`things`: what was tried, by name: a list, of each of which the SHA-256 is in the line.
        `outcome`: the form of what may have come out, a regular expression."""
        self.path, self.comment = path, comment
        self.starts = {name: f"{name} {' '.join(map(short_sha, parts))}: " for name, parts in things.items()}
        self.form = re.compile(rf"(?P<outcome>{outcome}), \d{{4}}-\d\d-\d\d")

    def lines(self):
        """The line of each thing that is on record and has not changed since, by name."""
        lines = self.path.read_text().splitlines() if self.path.exists() else []
        return {name: line for name, start in self.starts.items() for line in lines if line.startswith(start)}

    def faults(self):
        """Why it is not one line for each thing as it is now, with a possible outcome."""
        known = self.lines()
        faults = [f"{self.path.name}: no line for {name} as it is now" for name in self.starts if name not in known]
        comment, *lines = self.path.read_text().splitlines()
        faults += [f"{self.path.name}: twice, or of nothing that is there: {line}" for line in lines
                   if line not in known.values() or lines.count(line) > 1]
        faults += [f"{self.path.name}: not what can come out: {line}" for name, line in known.items()
                   if not self.form.fullmatch(line.removeprefix(self.starts[name]))]
        return faults + [f"{self.path.name}: does not begin as it should"] * (comment != self.comment)

    def outcomes(self):
        """What came out, by name."""
        found = {name: self.form.fullmatch(line.removeprefix(self.starts[name])) for name, line in self.lines().items()}
        return {name: match["outcome"] for name, match in found.items() if match}

    def keep(self, name, outcome):
        """Writes the outcome of today; `None` takes the line out."""
        lines = self.lines()
        lines.pop(name, None)
        if outcome is not None:
            lines[name] = f"{self.starts[name]}{outcome}, {datetime.date.today()}"
        kept = [lines[it] for it in self.starts if it in lines]
        self.path.write_text("".join(f"{line}\n" for line in [self.comment, *kept]))


def short_sha(thing):
    return hashlib.sha256(repr(thing).encode()).hexdigest()[:8]
