#!/usr/bin/env python3
"""Checks that every test that safety.md and SECURITY.md name is run by the gate.

    .ci/named.py               asks the programs of `cargo test` and of the step `ports`
    .ci/named.py --cells       only that each cell is made of names, as it should be
    .ci/named.py --planted     that a test which is switched off is found, and a cell that is not
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# How a table begins that names tests, its cells in a row, which of them has the names, and what is
# between these.
TABLES = {
    "src/safety.md": ("| hazard |", 5, 3, "<br>"),
    "SECURITY.md": ("| what comes |", 3, 2, ", "),
}
# Its rows, and the tests that they name: change these only if you mean to take one out, or add one.
COUNTS = {"src/safety.md": (40, 92), "SECURITY.md": (10, 11)}
# What a cell may also say.
BEYOND = "nothing can be done"
SAID = {
    "SECURITY.md": [
        "; every fuzz target; `examples/firmware/no_panic.sh`",
        "`axle noise`, and the proofs of `tests/exhaustive.rs`",
        "the [safety page](src/safety.md): a test for each row, unless nothing can be done",
        "the [safety page](src/safety.md)",
        "`bash .ci/run deny`",
    ],
}


def rows(text, head):
    """The rows of the tables that begin so: all lines up to an empty one."""
    is_table = False
    for line in text.splitlines():
        if is_table and line.strip() and not re.fullmatch(r"[|: -]+", line):
            yield line
        is_table = line.startswith(head) or is_table and bool(line.strip())


def named(pages):
    """The tests that the pages name, and the cells that are not as they should be."""
    names, faults = set(), []
    for page, (head, count, at, between) in TABLES.items():
        rows_of_page, names_of_page = list(rows(pages[page], head)), 0
        for row in rows_of_page:
            cells = [cell.strip() for cell in row.split("|")]
            if not row.startswith("| ") or not row.endswith(" |") or len(cells) != count + 2:
                faults.append(f"{page}: not {count} cells: {row}")
                continue
            cell, promise = cells[at + 1], cells[at]
            # A row against which nothing can be done, and one that promises nothing.
            if page == "src/safety.md" and promise.startswith(BEYOND) and cell == "-":
                continue
            if page == "SECURITY.md" and "**no promise**" in promise and cell == "":
                continue
            for words in SAID.get(page, []):
                if cell.endswith(words):
                    cell = cell.removesuffix(words)
                    break
            else:
                if not cell:
                    faults.append(f"{page}: no test: {row}")
            for name in cell.split(between) if cell else []:
                if not re.fullmatch(r"`\w+`", name):
                    faults.append(f"{page}: not a name of a test: {name}")
                names.add(name.strip("`"))
                names_of_page += 1
        if (len(rows_of_page), names_of_page) != COUNTS[page]:
            faults.append(f"{page}: {len(rows_of_page)} rows with {names_of_page} tests, not {COUNTS[page]}")
    return names, faults


def run():
    """The tests that the steps `test` and `ports` run."""
    def listed(programs, *words):
        command = ["cargo", "test", "--quiet", *programs, "--", "--list", "--format=terse", *words]
        out = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
        return set(re.findall(r"^(\S+): test$", out, re.MULTILINE))
    names = set()
    for programs in ["--lib", "--bins", "--tests"], ["-p", "axle", "--test", "ports", "--test", "memory"]:
        names |= listed(programs) - listed(programs, "--ignored")
    return {name.rsplit("::", 1)[-1] for name in names}


def faults(names, are_run):
    return [f"named, but not run: {name}" for name in sorted(names - are_run)] + ["hardly any test is named"] * (len(names) < 100)


def planted(pages):
    """Writes each name in ways in which it would not be read; those that are not found."""
    missed = []
    for page, (head, _, at, between) in TABLES.items():
        for row in rows(pages[page], head):
            cell = row.split("|")[at + 1].strip()
            for name in re.findall(r"`\w+`", cell):
                bare = name.strip("`")
                for other in (bare, f"[{bare}](x)", f"`{bare}()`", f"`{bare}` \\| `x`", f"`{bare}`;", f"**{name}**", f"`{bare} `"):
                    changed = row.replace(name, other, 1)
                    if not named(pages | {page: pages[page].replace(row, changed, 1)})[1]:
                        missed.append(f"not found: {other}")
                # Gone, with what is between it and the next one.
                for shorter in (row.replace(name + between, "", 1), row.replace(between + name, "", 1)):
                    if shorter != row and not named(pages | {page: pages[page].replace(row, shorter, 1)})[1]:
                        missed.append(f"not found: without {name}")
            if not named(pages | {page: pages[page].replace(row + "\n", "", 1)})[1]:
                missed.append(f"not found: without {row}")
            # A row that does not begin as the others do, and one without a test.
            for changed in (" " + row, row.replace("| ", "|", 1), row.replace(f" {cell} |", "  |") if cell.startswith("`") else ""):
                if changed and not named(pages | {page: pages[page].replace(row, changed, 1)})[1]:
                    missed.append(f"not found: {changed}")
    return missed


def main(options):
    pages = {page: (ROOT / page).read_text() for page in TABLES}
    names, found = named(pages)
    if options != ["--cells"]:
        are_run = run()
        found += faults(names, are_run)
    if options == ["--planted"]:
        # One test that is gone, and a page that names none.
        found += ["a test that is switched off is not found"] * (not faults(names, are_run - {min(names)}))
        found += ["a page without tests is not found"] * (not faults(set(), are_run))
        found += planted(pages)
    print(*found, f"{len(names)} tests are named, {len(found)} faults", sep="\n")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
