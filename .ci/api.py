#!/usr/bin/env python3
"""Keeps a listing of all that is public in axlewire, api.txt, so that each change shows in review.

    .ci/api.py             print the listing
    .ci/api.py --check     compare it with api.txt; exit code 1 and a diff if they differ
    .ci/api.py --record    write it to api.txt
    .ci/api.py --counts    print the number of items on each module page
    .ci/api.py --semver    compare api.txt with that of the release named in .ci/api-released; exit
                           code 1 if the version does not allow what has changed
    .ci/api.py --defmt     check that each public struct and enum implements defmt::Format

The listing is read from the pages that `cargo doc --all-features` writes, one line for each item,
method, field, variant and implementation of a trait, at the path where rustdoc documents it. Left
out: auto traits, blanket implementations, and methods of traits that a type implements.
"""

import argparse
import difflib
import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

# Types, or modules of types, that cannot or need not implement defmt::Format: path: reason. Enums
# without a variant are names for the compiler and are left out by themselves.
NO_FORMAT = {
    f"axlewire::{path}": reason
    for reason, paths in {
        "a port of the operating system": "drive::SerialPort drive::TokioSerialPort",
        "state: log its events, statistics and counters": (
            "drive::Driver drive::Rs485 ikeya::Master ikeya::Slave ikeya::master::Master"
            " ikeya::slave::Slave io::FrameReader io::FrameWriter stream::Decoder stream::Frames stream::Parts"
            " ucp::Host ucp::Robot ucp::host::Host ucp::robot::Robot"
        ),
        "a clock or a delay, nothing to log": (
            "drive::NoDelay drive::StdClock drive::TokioClock drive::WithDelay"
        ),
        "a name for a framing": "stream::Portable",
        "made by the derive of bytemuck": (
            "ikeya::three::PositionResponseBits ikeya::three::VelocityResponseBits"
            " ikeya::three::WriteRequestBits"
        ),
        "runs on a host": "sim",
    }.items()
    for path in paths.split()
}

# Fewer items mean that the script did not read what it should.
LEAST_ITEMS = 150

ROOT = Path(__file__).resolve().parent.parent
LISTING = ROOT / "api.txt"
CRATE = "axlewire"
# The sections of a page that are read; a type alias repeats those of its target.
SECTIONS = re.compile(
    r"fields|variants|implementations|trait-implementations|foreign-impls|implementors"
    r"|(required|provided)-(methods|associated-consts|associated-types)"
)
MEMBER = re.compile(r"((?:ty)?method|associatedconstant|associatedtype|variant)\.([^.]+?)(-\d+)?$")
FIELD = re.compile(r"structfield\.(\w+)$|variant\.(\w+)\.field\.(\w+)$")


class Page(HTMLParser):
    """What a page of rustdoc declares, in the order of the page."""

    def __init__(self, file):
        super().__init__()
        self.section = ""
        self.id = ""  # Of the section or field that was opened last.
        self.until = ""  # The tag that ends the text that is being read.
        self.text = []
        self.declaration = ""
        self.members = []  # (section, id, text)
        self.items = []  # Of a module: (kind, link)
        self.reexports = []
        self.feed(file.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        classes = (attributes.get("class") or "").split()
        id_ = attributes.get("id") or ""
        if self.until and tag in ("div", "br"):
            self.text.append(" ")
        if tag == "h2" and "section-header" in classes:
            self.section = id_
        elif tag == "section" or (tag == "span" and FIELD.match(id_)):
            self.id = id_
        elif tag == "dt" and self.section == "reexports":
            self.begin("dt")
        elif tag == "a" and self.section != "reexports" and "href" in attributes and not self.until:
            self.add_item(classes, attributes["href"])
        if tag == "pre" and "item-decl" in classes:
            self.id = "declaration"
            self.begin("pre")
        elif "code-header" in classes or (tag == "code" and FIELD.match(self.id)):
            self.begin(tag)

    def add_item(self, classes, link):
        kind, _, rest = link.rpartition("/")[2].partition(".")
        if [kind] == classes and rest.endswith(".html") and "/" not in link:
            self.items.append((kind, link))
        elif classes == ["mod"] and re.fullmatch(r"\w+/index\.html", link):
            self.items.append(("mod", link))

    def begin(self, tag):
        if not self.until:
            self.until, self.text = tag, []

    def handle_data(self, data):
        if self.until:
            self.text.append(data)

    def handle_endtag(self, tag):
        if self.until and tag == "div":
            self.text.append(" ")
        if tag != self.until:
            return
        self.until = ""
        text = plain("".join(self.text))
        if self.id == "declaration":
            # The page of a type alias also shows the declaration of its target.
            self.declaration = self.declaration or text
        elif self.section == "reexports":
            self.reexports.append(text)
        else:
            self.members.append((self.section, self.id, text))
        self.id = ""


def plain(text):
    """On one line, and without the commas and spaces of code on several."""
    text = re.sub(r"\s+", " ", text.replace("ⓘ", "")).strip()
    text = re.sub(r"([(\[]|[\w>]<) ", r"\1", text)
    return re.sub(r",? ([)\]])", r"\1", text).rstrip(",")


def document(features=("--all-features",)):
    """Runs rustdoc; returns the folder of its pages."""
    metadata = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version", "1"],
        cwd=ROOT, check=True, stdout=subprocess.PIPE)
    folder = Path(json.loads(metadata.stdout)["target_directory"]) / "doc" / CRATE
    # So that cargo does not take for fresh what was written with other features.
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run(["cargo", "doc", "--quiet", "--no-deps", *features, "-p", CRATE],
                   cwd=ROOT, check=True)
    return folder


def read_pages(folder):
    """All pages: {path: (kind, page)}, checked against rustdoc's own list."""
    pages = {}
    todo = [(CRATE, folder)]
    while todo:
        path, here = todo.pop()
        page = Page(here / "index.html")
        pages[path] = ("mod", page)
        for kind, link in page.items:
            if kind == "mod":
                name = link.split("/")[0]
                todo.append((f"{path}::{name}", here / name))
            else:
                item = f"{path}::{link.split('.')[1]}"
                # A function may have the name of a type.
                pages[item + "()" * (kind == "fn")] = (kind, Page(here / link))
    listed = re.findall(r'<li><a href="([^"]+)">[\w:]+</a></li>', (folder / "all.html").read_text())
    read = sum(kind != "mod" for kind, _ in pages.values())
    if read != len(listed) or len(pages) < LEAST_ITEMS:
        sys.exit(f"read {read} items and {len(pages) - read} modules, but all.html lists "
                 f"{len(listed)} items; at least {LEAST_ITEMS} are expected")
    return pages


def listing(pages):
    lines = set()
    of_types = set()  # Implementations that are listed with their types.
    for key, (kind, page) in pages.items():
        path = key.removesuffix("()")
        lines |= {f"{path}: {text}" for text in page.reexports}
        lines.add(f"{path}: {head(kind, path, page.declaration)}")
        if kind not in ("mod", "type", "trait"):
            members = list(members_of(path, page))
            lines |= {line for _, line in members}
            of_types |= {without_paths(impl) for impl, _ in members}
    for path, (kind, page) in pages.items():
        if kind == "trait":
            lines |= {line for impl, line in members_of(path, page)
                      if not impl or without_paths(impl) not in of_types}
    return sorted(lines)


def head(kind, path, declaration):
    """A declaration without its members, which have lines of their own."""
    if kind == "mod":
        return f"pub mod {path.rpartition('::')[2]}"
    if kind not in ("struct", "enum", "trait", "union") or not declaration.endswith("}"):
        return declaration
    depth = 0
    for start in range(len(declaration) - 1, -1, -1):
        depth += (declaration[start] == "}") - (declaration[start] == "{")
        if depth == 0:
            break
    body = declaration[start:]
    mark = "{}" if body == "{}" else "{ /* private fields */ }" if "private" in body else "{ .. }"
    return declaration[:start].rstrip(", ") + " " + mark


def members_of(path, page):
    """The members of an item: (the trait implementation that it is or is in, its line)."""
    inherent = {text for section, _, text in page.members
                if section == "implementations" and text.startswith("impl")}
    impl = ""
    for section, id_, text in page.members:
        member, field = MEMBER.match(id_), FIELD.match(id_)
        if not SECTIONS.fullmatch(section):
            continue
        if id_.startswith("impl-"):
            impl = text
            if "StructuralPartialEq" not in text:
                yield impl, f"{path}: {impl}"
        elif field:
            yield "", "::".join([path, *filter(None, field.groups())]) + f": {text}"
        elif section == "implementations":
            where = f" (in {impl})" if len(inherent) > 1 else ""
            yield "", f"{path}::{member[2]}: {text}{where}"
        elif section in ("trait-implementations", "foreign-impls", "implementors"):
            if member[1].startswith("associated"):
                yield impl, f"{path}: {impl}: {text}"
        elif member:
            mark = " { provided }" if section.startswith("provided") else ""
            yield "", f"{path}::{member[2]}: {text}{mark}"


def behind_features(pages):
    """What is there only with features beyond the default ones, a line each."""
    by_default = read_pages(document(features=()))
    absent = sorted(set(pages) - set(by_default))
    return [f"{path}: not with the default features" for path in absent]


def without_paths(text):
    return re.sub(rf"\b{CRATE}::(\w+::)*", "", text)


def header():
    version = subprocess.run(["rustc", "--version"], cwd=ROOT, check=True, stdout=subprocess.PIPE)
    return [
        f"# Everything public in {CRATE}, with all features. Written by .ci/api.py --record",
        f"# {version.stdout.decode().strip()}",
    ]


def check(lines):
    if not LISTING.exists():
        print("there is no api.txt; write it with: .ci/api.py --record")
        return 1
    recorded = LISTING.read_text().splitlines()
    if recorded[1:2] != header()[1:]:
        print("note: api.txt was written with another compiler:", *recorded[1:2])
    diff = list(difflib.unified_diff(recorded[2:], lines, "api.txt", "now", lineterm="", n=0))
    if diff:
        print(*diff, sep="\n")
        print("the public items changed; if that is meant: .ci/api.py --record, and commit api.txt")
    return bool(diff)


def semver():
    """Whether the version in Cargo.toml allows what has changed since the release on record."""
    released, commit = (ROOT / ".ci" / "api-released").read_text().split()
    old = subprocess.run(["git", "show", f"{commit}:{LISTING.name}"], cwd=ROOT, text=True,
                         stdout=subprocess.PIPE)
    if old.returncode:
        print(f"the commit of {released}, {commit}, is not in this clone: git fetch --unshallow")
        return 1
    version = re.search(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)[1]
    old, new = old.stdout.splitlines()[2:], LISTING.read_text().splitlines()[2:]
    broken = breaks(old, new)
    # Below 1.0 the second number counts for breaks.
    allowed, given = ([int(part) for part in it.split(".")[:2]] for it in (released, version))
    allowed = given > allowed
    print(f"{released} had {len(old)} lines, {version} has {len(new)}; {len(broken)} break its users")
    if broken and not allowed:
        print(*broken, sep="\n")
        print(f"after {released} this needs a version of which the second number is higher;"
              " if that release never left this tree, put the present commit into .ci/api-released")
    return bool(broken) and not allowed


def breaks(old, new):
    """Lines that users of `old` may depend on, and new ones that they would have to handle."""
    broken = [f"gone: {line}" for line in sorted(set(old) - set(new))]
    heads = {line.split(": ", 1)[0]: line.split(": ", 1)[1] for line in reversed(old)
             if re.search(r": (#\[.*\] )?pub (struct|enum|trait) ", line)}
    for line in sorted(set(new) - set(old)):
        path, text = line.split(": ", 1)
        head = heads.get(path.rpartition("::")[0], "")
        is_open = "non_exhaustive" in head or "private fields" in head or not head
        if "pub trait" in head:
            if "{ provided }" not in text:
                broken.append(f"has to be implemented: {line}")
        elif not is_open and not re.match(r"(pub )?(const |unsafe |async )*(fn|impl|const|type)\b", text):
            broken.append(f"has to be given or matched: {line}")
    return broken


def counts(pages):
    rows = []
    for path, (kind, page) in pages.items():
        if kind == "mod":
            kinds = [kind for kind, _ in page.items] + ["re-export"] * len(page.reexports)
            parts = [f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds))]
            rows.append((-len(kinds), path, ", ".join(parts)))
    for count, path, parts in sorted(rows):
        print(f"{-count:4} {path}: {parts}")


def without_format(pages):
    """Prints the public types that do not implement defmt::Format; returns how many are wrong."""
    missing = []
    types = 0
    for path, (kind, page) in pages.items():
        is_name = kind == "enum" and page.declaration.endswith("{}")
        if kind in ("struct", "enum") and not is_name:
            types += 1
            if not any(re.match(r"impl(<.*>)? Format for ", text) for _, _, text in page.members):
                missing.append(path)
    wrong = [path for path in sorted(missing) if not any(is_in(path, top) for top in NO_FORMAT)]
    stale = [top for top in sorted(NO_FORMAT) if not any(is_in(path, top) for path in missing)]
    for path in wrong:
        print(f"{path}: no defmt::Format")
    for path in stale:
        print(f"{path}: in NO_FORMAT, and not needed there")
    print(f"{types} types, {len(missing)} without defmt::Format, {len(wrong + stale)} findings")
    return len(wrong + stale)


def is_in(path, top):
    return path == top or path.startswith(top + "::")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    option = parser.add_mutually_exclusive_group()
    for name in ("--check", "--record", "--counts", "--defmt", "--semver"):
        option.add_argument(name, action="store_true")
    args = parser.parse_args()
    if args.semver:
        return semver()
    pages = read_pages(document())
    if args.counts:
        return counts(pages)
    if args.defmt:
        return without_format(pages) > 0
    lines = listing(pages) + behind_features(pages)
    if args.check:
        return check(lines)
    if args.record:
        LISTING.write_text("\n".join(header() + lines) + "\n")
        print(f"{LISTING.name}: {len(lines)} lines, {len(pages)} items")
    else:
        print(*lines, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
