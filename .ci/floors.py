#!/usr/bin/env python3
"""Checks that each file of src/ uses only files on its own floor or below, and that no files use
each other in a circle.

    .ci/floors.py              check; exit code 1 and a line for each finding
    .ci/floors.py --planted    plant faults in a copy of src/ and check that each is found
    .ci/floors.py --graph      print the edges: which file uses which
    .ci/floors.py --circles    print how many groups of files use each other in circles: with the
                               edges that are checked, exceptions included, and as it would be if
                               each module also used its children
    .ci/floors.py --src DIR    read DIR instead of src/

Why: a file that uses only what is below it can be read, tested and changed without what is above.
The compiler accepts any order, so the order is checked here.

An edge leads from a file that names an item to the file that defines the item, whichever `pub use`
lines are in between. A module that re-exports its children does not use them by that. Code under
`#[cfg(test)]`, comments and strings are not read, and calls of methods are not seen; rust_uses.py
says what else is not.
"""

import argparse
import re
import shutil
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True
from rust_uses import Item, Module, lookup, macro_of_ancestor, read_crate, resolve

# Bottom first. A module stands for everything in it that is not listed itself; `crate` is lib.rs.
# Modules on one floor may use each other where that closes no circle.
FLOORS = [
    ["machine", "time", "error"],
    ["crc16", "encode", "endpoint", "inbox", "map", "stats", "text"],
    ["fields::field"],
    ["fields::record"],
    ["events", "outbox"],
    # Bytes to frames.
    ["stream::ledger", "stream::fill"],
    ["stream::event", "stream::kernel"],
    ["stream::framing"],
    ["stream::portable", "stream::search"],
    ["stream::capture", "stream::decoder", "stream::frames", "stream::split"],
    ["stream"],
    ["fields::lines"],
    # The motor bus: packets, framings, then the two roles.
    ["ikeya::units"],
    ["ikeya::wire"],
    ["ikeya::three"],
    ["ikeya::judge"],
    ["ikeya::batch"],
    ["ikeya::framing"],
    ["ikeya::contents"],
    ["ikeya::board"],
    ["ikeya::fields"],
    ["ikeya::serialize"],
    ["ikeya::master::health", "ikeya::master::nodes", "ikeya::master::schedule"],
    ["ikeya::master::config", "ikeya::master::event", "ikeya::master::statistics"],
    ["ikeya::master::set_point", "ikeya::master::stop", "ikeya::master::turns"],
    ["ikeya::master::echo", "ikeya::master::node", "ikeya::master::window"],
    ["ikeya::master::role"],
    ["ikeya::master"],
    ["ikeya::slave::config", "ikeya::slave::dip"],
    ["ikeya::slave::event", "ikeya::slave::requests", "ikeya::slave::statistics"],
    ["ikeya::slave"],
    ["ikeya"],
    # The rover: frames, messages, framing, then the two roles.
    ["ucp::catalogue", "ucp::value"],
    ["ucp::header", "ucp::codes"],
    ["ucp::frame"],
    ["ucp::plain"],
    ["ucp::body"],
    ["ucp::motor", "ucp::report", "ucp::update"],
    ["ucp::message"],
    ["ucp::contents", "ucp::fields", "ucp::serialize"],
    ["ucp::batch"],
    ["ucp::framing"],
    ["ucp::role"],
    ["ucp::inbox"],
    ["ucp::host::config", "ucp::host::event", "ucp::host::link"],
    ["ucp::host::bias", "ucp::host::statistics"],
    ["ucp::host::motor", "ucp::host::outgoing", "ucp::host::ping", "ucp::host::results"],
    ["ucp::host::calibration"],
    ["ucp::host::state"],
    ["ucp::host"],
    ["ucp::robot::config", "ucp::robot::event", "ucp::robot::statistics"],
    ["ucp::robot::repeat"],
    ["ucp::robot::outgoing"],
    ["ucp::robot::state"],
    ["ucp::robot"],
    ["ucp"],
    ["fields"],
    # Two doors, and a line for tests.
    ["io", "drive", "sim"],
    # Pages, without code.
    ["guide"],
    ["crate"],
]

# Neither of the two may use the other, whatever their floors.
APART = [("ikeya", "ucp"), ("io", "drive")]

# Items that children may import from their parent, with the reason, such as
# ("ikeya::master", "Master"): "its children implement methods on it".
FROM_PARENT = {}

# Fewer than these mean that the script did not read what it should.
LEAST_FILES, LEAST_EDGES = 40, 100

SRC = Path(__file__).resolve().parent.parent / "src"


class Graph:
    """The files and which of them use which."""

    def __init__(self, src):
        self.src = src
        self.modules = read_crate(src)
        self.owner = {}  # file -> the module that it is
        for module in self.modules.values():
            self.owner.setdefault(module.file, module)
        self.edges = {}  # (from, to) -> [(line, item)]
        for module in self.modules.values():
            self.read_edges(module)

    def read_edges(self, module):
        for path, line, is_glob, is_public in module.uses:
            found = resolve(module, path, in_code=True)
            if is_glob:
                found = [item for target in found for item in self.behind_glob(module, target)]
            for target in found:
                is_own = self.owner[module.file].holds(target.path if isinstance(target, Module)
                                                       else target.module.path)
                if not (is_public and is_own):
                    self.add(module, target, line)
        for path, line, is_macro in module.code:
            found = resolve(module, path, in_code=True)
            if not found and is_macro and len(path) == 1:
                found = macro_of_ancestor(module, path[0])
            for target in found:
                self.add(module, target, line)

    def behind_glob(self, module, target):
        """The items of a glob that the code of the module names."""
        if isinstance(target, Item):
            return [target]
        named = {path[0] for path, _, _ in module.code}
        return [item for name in sorted(named) for item in lookup(target, name, frozenset())]

    def add(self, module, target, line):
        """Adds an edge. A module that is named leads nowhere yet: the path behind it does."""
        if isinstance(target, Item) and target.module.file != module.file:
            edge = self.edges.setdefault((module.file, target.module.file), [])
            if (line, target.name) not in edge:
                edge.append((line, target.name))

    def show(self, file):
        return str(Path("src") / file.relative_to(self.src))

    def is_child(self, file, other):
        return file != other and self.owner[other].holds(self.owner[file].path)

    def from_parent(self, file, other):
        """What a child imports from its parent, as the keys of FROM_PARENT."""
        if not self.is_child(file, other):
            return set()
        return {(label(self.owner[other]), name) for _, name in self.edges[file, other]}

    def is_excused(self, file, other):
        names = self.from_parent(file, other)
        return bool(names) and names <= FROM_PARENT.keys()

    def to_children(self):
        """An edge from each file to each file of a child."""
        return [(module.parent.file, file) for file, module in self.owner.items() if module.parent]


def label(module):
    return "::".join(module.path) or "crate"


def circles_of(edges):
    """Groups of files that reach each other: (a shortest circle in it, number of files)."""
    after = {}
    for a, b in sorted(edges):
        after.setdefault(a, []).append(b)
    ways = {a: ways_from(a, after) for a in after}
    circles, done = [], set()
    for a in sorted(ways):
        group = [b for b in sorted(ways[a]) if a in ways.get(b, ())]
        if group and a not in done:
            circles.append((min((ways[b][b] for b in group), key=len), len(group)))
            done.update(group)
    return circles


def ways_from(start, after):
    """A shortest way from `start` to each file that it reaches, itself if it is in a circle."""
    ways, todo = {}, [[start]]
    for way in todo:
        for b in after.get(way[-1], ()):
            if b not in ways:
                ways[b] = [*way, b]
                todo.append(ways[b])
    return ways


# The checks.


def floor_of(module):
    """The index and the entry of the floor of a module, or None."""
    for length in range(len(module.path), 0, -1):
        entry = "::".join(module.path[:length])
        for index, floor in enumerate(FLOORS):
            if entry in floor:
                return index, entry
    return (len(FLOORS) - 1, "crate") if not module.path else None


def check(src):
    """The findings, and the numbers of files and edges."""
    graph = Graph(src)
    found = unplaced(graph) + unread(graph)
    used = set()
    for (file, other), names in sorted(graph.edges.items()):
        if not graph.is_child(file, other):
            found += against_floors(graph, file, other, names[0][0])
        used |= graph.from_parent(file, other)
        wrong = graph.from_parent(file, other) - FROM_PARENT.keys()
        if wrong:
            line = min(line for line, name in names if name in {name for _, name in wrong})
            found.append(f"child imports from its parent: {graph.show(file)}:{line} uses "
                         f"{', '.join(sorted(name for _, name in wrong))} of {graph.show(other)}")
    for circle, count in circles_of([edge for edge in graph.edges if not graph.is_excused(*edge)]):
        of = f" ({count} files use each other)" if count + 1 > len(circle) else ""
        found.append("circle: " + " → ".join(map(graph.show, circle)) + of)
    found += [f"FROM_PARENT: {module}::{name} is no longer needed"
              for module, name in sorted(FROM_PARENT.keys() - used)]
    return found, len(graph.owner), len(graph.edges)


def unplaced(graph):
    """Files on no floor, and entries of floors without a file."""
    labels = {label(module) for module in graph.owner.values()}
    found = [f"{graph.show(file)}: on no floor" for file, module in sorted(graph.owner.items())
             if floor_of(module) is None]
    return found + [f"FLOORS: there is no {entry}" for floor in FLOORS for entry in floor
                    if entry not in labels]


def unread(graph):
    """Files of src/ that no `mod` line leads to, other than tests."""
    return [f"{graph.show(file)}: not read, no module declares it"
            for file in sorted(graph.src.rglob("*.rs"))
            if file not in graph.owner and "tests" not in (file.stem, file.parent.name)]


def against_floors(graph, file, other, line):
    where = f"{graph.show(file)}:{line} uses {graph.show(other)}"
    a, b = graph.owner[file], graph.owner[other]
    for pair in APART:
        if {a.path[:1], b.path[:1]} == {(pair[0],), (pair[1],)}:
            return [f"{where}: apart ({pair[0]} and {pair[1]} do not use each other)"]
    low, high = floor_of(a), floor_of(b)
    if low and high and low[0] < high[0]:
        return [f"{where}: up (floor {low[0]}, {low[1]} → floor {high[0]}, {high[1]})"]
    return []


# The faults that must be found.


def planted(src):
    """Plants each fault in its own copy. Prints what was not found; 0 if all were."""
    graph = Graph(src)
    missed = 0
    for name, expected, edits in plants(graph):
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "src"
            shutil.copytree(src, copy)
            for file, text in edits.items():
                path = copy / file
                path.write_text((path.read_text() if path.exists() else "") + "\n" + text)
            found, _, _ = check(copy)
            hit = [line for line in found if re.search(expected, line)]
        is_clean = name.startswith("not ")
        if bool(hit) == is_clean:
            missed += 1
            print(f"{name}: {'found, and is no fault' if is_clean else 'NOT FOUND'}: {expected}")
        else:
            print(f"{name}: {'left alone' if is_clean else hit[0]}")
    return missed


def plants(graph):
    """(name, what must be printed, text to append by file). The files are any that fit."""
    files = sorted((floor_of(m)[0], f) for f, m in graph.owner.items() if m.path and floor_of(m))
    items = {f: n for f, m in graph.owner.items() for n, b in m.names.items()
             if ("item",) in b and n != "_"}
    low, high = files[0][1], [f for _, f in files if f in items][-1]
    item = items[high]
    *way, last = ["crate", *graph.owner[high].path]
    group = f"{'::'.join(way)}::{{{last}::{{{item} as Planted}}}}"
    path = "::".join([*way, last, item])
    up = f"{graph.show(low)}:\\d+ uses {graph.show(high)}: "
    # A module with children whose items they may not import.
    circular = {file for circle, _ in circles_of(graph.edges) for file in circle}
    parent = next(m for f, m in sorted(graph.owner.items()) if m.path and f.name == "mod.rs"
                  and f not in circular)
    home = parent.file.parent.relative_to(graph.src)
    mod, a, b = home / "mod.rs", home / "planted_a.rs", home / "planted_b.rs"
    here = "crate::" + "::".join(parent.path)
    circle = f"circle: src/{a} → src/{b} → src/{a}"
    mods = "mod planted_a; mod planted_b;"
    low = low.relative_to(graph.src)
    return [
        ("upward use", up, {low: f"use {group};"}),
        ("upward path in code", up, {low: f"fn planted() {{ {path}(0); }}"}),
        ("upward use in a function", up, {low: f"fn planted() {{ use {path} as _; }}"}),
        ("not upward: under cfg(test)", up, {low: f"#[cfg(test)] mod t {{ use {path}; }}"}),
        ("not upward: under cfg(all(test, ..))", up, {
            low: f"#[cfg(all(test, any(unix, windows)))] mod t {{ use {path}; }}"}),
        ("upward under cfg(any(test, ..))", up, {
            low: f"#[cfg(any(test, unix))] mod t {{ use {path}; }}"}),
        ("not upward: in a comment", up, {low: f"// {path}\n/* {path} */ /// [`{path}`]"}),
        ("circle through super", circle, {
            mod: mods + "pub use planted_b::B as C; pub use planted_a::*;",
            a: "use super::C; pub struct A(C);",
            b: "use super::A; pub struct B(A);"}),
        ("circle between siblings", circle, {
            mod: mods,
            a: f"use {here}::planted_b::{{self, B}}; pub struct A(B);",
            b: "pub struct B(super::planted_a::A);"}),
        ("circle through a macro", circle, {
            mod: mods,
            a: "use super::planted_b::planted; pub struct A;",
            b: f"macro_rules! planted {{ () => {{ $crate::{here[7:]}::planted_a::A }} }}\n"
               "pub(super) use planted;"}),
        ("circle with the parent", f"circle: src/{mod} → src/{a} → src/{mod}", {
            mod: "mod planted_a; use planted_a::A; pub struct Planted(A);",
            a: "use super::Planted; pub struct A(Planted);"}),
        ("child imports from its parent",
         f"child imports from its parent: src/{a}:\\d+ uses Planted of src/{mod}", {
            mod: "mod planted_a; pub struct Planted;",
            a: "use super::Planted; pub struct A(Planted);"}),
        ("not a circle: a parent re-exports", f"circle: .*{a}|parent: .*{a}", {
            mod: "mod planted_a; mod planted_b; pub use planted_a::A;",
            a: "pub struct A;", b: "use super::A; pub struct B(A);"}),
        ("file without a module", f"src/{a}: not read", {a: "pub struct A;"}),
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    for option in ("--planted", "--graph", "--circles"):
        parser.add_argument(option, action="store_true")
    parser.add_argument("--src", type=lambda text: Path(text).resolve(), default=SRC)
    args = parser.parse_args()
    if args.planted:
        return planted(args.src) > 0
    graph = Graph(args.src)
    if args.graph:
        for (file, other), names in sorted(graph.edges.items()):
            items = ", ".join(sorted({name for _, name in names}))
            print(f"{graph.show(file)} → {graph.show(other)}: {items}")
        return 0
    if args.circles:
        for what, more in ("as checked", []), ("with parent → child", graph.to_children()):
            circles = circles_of([*graph.edges, *more])
            print(f"{what}: {len(circles)} circles, {sum(n for _, n in circles)} files in them")
        return 0
    found, files, edges = check(args.src)
    print(*found, sep="\n", end="\n" if found else "")
    few = files < LEAST_FILES or edges < LEAST_EDGES
    print(f"{files} files, {edges} edges, {len(found)} findings" + ": read too little" * few)
    return bool(found) or few


if __name__ == "__main__":
    sys.exit(main())
