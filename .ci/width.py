#!/usr/bin/env python3
"""Checks that no comment and no line of prose is wider than 100 columns.

    .ci/width.py             print each line that is too wide; exit code 1 if there is one
    .ci/width.py --counts    print the number of such lines per file

Why: rustfmt leaves comments as wide as they are, and nothing else in the gate measures them.

The files are those that git knows; scripts without a suffix are told by their first line. In Rust,
Python, shell scripts and TOML, the lines that are or contain comments are measured, in Python also
those of strings in triple quotes; in Markdown, all lines but those between two fences of code. Rows
of tables, in Markdown and in the docs of Rust, and lines that are only a link cannot be broken and
may be wider.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

LIMIT = 100
# Fewer files mean that the script did not read what it should.
LEAST_FILES = 100
HASH_SUFFIXES = (".sh", ".toml")
FIRST_OF_PYTHON = "#!/usr/bin/env python3"
ONLY_LINK = re.compile(r"\W*(\[[^\]]*\][(:]?\s*)?<?https?://\S+\W*$|\[[^\]]*\](: ?\S+|\(\S+\))\W*$")

ROOT = Path(__file__).resolve().parent.parent


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--counts", action="store_true")
    args = parser.parse_args()
    names = files()
    wide = {name: wide_lines(name) for name in names}
    for name, lines in wide.items():
        if args.counts and lines:
            print(f"{len(lines):4} {name}")
        elif not args.counts:
            for number, line in lines:
                print(f"{name}:{number}: {len(line)} columns")
    total = sum(map(len, wide.values()))
    few = len(names) < LEAST_FILES
    print(f"{len(names)} files, {total} lines wider than {LIMIT} columns" + ": too few files" * few)
    return total > 0 or few


def files():
    """The files to look at."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, stdout=subprocess.PIPE)
    names = listed.stdout.decode().split("\0")[:-1]
    return [name for name in names if reader(name) and (ROOT / name).is_file()]


def reader(name):
    """The function that picks the comments or the prose, by the name of the file."""
    path = Path(name)
    first = first_line(ROOT / name) if not path.suffix else ""
    if path.suffix == ".rs":
        # `/*` as well: the crate has no such comments.
        return lambda lines: [*comments("//")(lines), *comments("/*")(lines)]
    if path.suffix == ".md":
        return prose
    if path.suffix == ".py" or first == FIRST_OF_PYTHON:
        return python
    if path.suffix in HASH_SUFFIXES or first.startswith("#!/"):
        return comments("#")
    return None


def first_line(path):
    return path.read_bytes().split(b"\n", 1)[0].decode(errors="replace") if path.is_file() else ""


def wide_lines(name):
    lines = (ROOT / name).read_text().splitlines()
    has_tables = Path(name).suffix in (".md", ".rs")
    return [(number, line) for number, line in reader(name)(lines)
            if len(line) > LIMIT and not is_whole(line, has_tables)]


def comments(mark):
    """Lines that begin with it, or have it behind code."""
    return lambda lines: [(number, line) for number, line in enumerate(lines, 1)
                          if line.lstrip().startswith(mark) or f" {mark}" in line]


def python(lines):
    is_text = False
    for number, line in enumerate(lines, 1):
        was_text, is_text = is_text, is_text ^ (line.count('"""') % 2 == 1)
        if was_text or '"""' in line or line.lstrip().startswith("#") or " #" in line:
            yield number, line


def prose(lines):
    fence, code = None, []
    for number, line in enumerate(lines, 1):
        mark = re.match(r"\s*(```+|~~~+)", line)
        if fence:
            code.append((number, line))
            if mark and mark[1].startswith(fence) and line.strip() == mark[1]:
                fence, code = None, []
        elif mark:
            fence = mark[1]
        else:
            yield number, line
    # Behind a fence that is not closed is no code.
    yield from code


def is_whole(line, has_tables):
    """Whether it cannot be broken."""
    text = line.lstrip(" /!#")
    return has_tables and text.startswith("|") or bool(ONLY_LINK.match(text))


if __name__ == "__main__":
    sys.exit(main())
