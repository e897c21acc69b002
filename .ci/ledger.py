"""Records of what was tried: a line for each thing, void once the thing itself has changed."""

import datetime
import hashlib


class Ledger:
    """A file of lines such as `fmt 5298e762: 3 s, 2026-11-24`, below a comment."""

    def __init__(self, path, comment, things):
        """`things`: what was tried, by name. Its SHA-256 is in its line."""
        self.path, self.comment = path, comment
        self.starts = {name: f"{name} {hashlib.sha256(repr(thing).encode()).hexdigest()[:8]}: "
                       for name, thing in things.items()}

    def lines(self):
        """The line of each thing that is on record and has not changed since, by name."""
        lines = self.path.read_text().splitlines() if self.path.exists() else []
        return {name: line for name, start in self.starts.items() for line in lines if line.startswith(start)}

    def missing(self):
        known = self.lines()
        return [name for name in self.starts if name not in known]

    def keep(self, name, outcome):
        """Writes the outcome of today; `None` takes the line out."""
        lines = self.lines()
        lines.pop(name, None)
        if outcome is not None:
            lines[name] = f"{self.starts[name]}{outcome}, {datetime.date.today()}"
        kept = [lines[it] for it in self.starts if it in lines]
        self.path.write_text("".join(f"{line}\n" for line in [self.comment, *kept]))
