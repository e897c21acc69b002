#!/usr/bin/env python3
"""Compares what tshark shows through axle.lua with `axle decode --json`, field by field.

    check.py                the captures of corpora.py, and live lines through `axle extcap`
    check.py --planted      plants damages in copies of axle.lua, and sees each of them found

The captures are the recorded frames of tests/vectors, those of examples/captures in pieces of many
sizes, exchanges and hazards, and noise. Checked are every field of every frame and gap, that there
is no other, the packet in which it is shown, its time and direction, response times, requests
without an answer, late and foreign answers, hazards. Exit code 1 if anything differs, 3 if tshark
is missing.

tshark runs as an ordinary user with a home of its own, into which install.sh installs; for root,
that is the user `nobody`, because tshark ignores folders of plugins that are root's choice.
"""
import argparse
import bisect
import json
import os
import pwd
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import corpora
import damages
import expected
import live

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
AXLE = Path(os.environ.get("AXLE") or ROOT / "target/debug/axle")
MISSING = 3
SHORT_WINDOW_US = 500
# Fewer values mean that hardly anything was compared.
LEAST_VALUES = 40_000
# Names of fields that say more than a line of JSON does, and are checked as facts.
FACTS = {"request_in", "answer_in", "response_time_us", "response_time_of"}
# That it is of a frame or gap that ends later, in one that is shown there.
PART = "ends_in"
WARNINGS = {"bad_crc", "gap", "unanswered", "late", "foreign", "mode_changed", "not_a_number",
            "hazard", "battery"}


class User:
    """An ordinary user with a home below a temporary folder."""

    def __init__(self, folder):
        self.home = Path(folder) / "home"
        self.home.mkdir()
        self.options = {}
        if os.geteuid() == 0:
            nobody = pwd.getpwnam("nobody")
            os.chown(self.home, nobody.pw_uid, nobody.pw_gid)
            self.options = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
        self.environment = {"HOME": str(self.home), "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}

    def popen(self, command, **more):
        environment = self.environment | more.pop("env", {})
        return subprocess.Popen(list(map(str, command)), env=environment, cwd=self.home,
                                **self.options, **more)

    def run(self, command, **more):
        process = self.popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more)
        out, err = process.communicate(timeout=300)
        if process.returncode != 0:
            sys.exit(f"{command[0]} failed ({process.returncode}): {err.decode(errors='replace')}")
        return out


def mentions(wanted, found):
    return found.endswith(f"({wanted})") or found.endswith(f": {wanted}") \
        or f": {wanted} (" in found


def decoded(path):
    """The frames and gaps of a capture, as the tool lists them."""
    out = subprocess.run([AXLE, "decode", "--json", path], stdout=subprocess.PIPE, check=True).stdout
    rows = [json.loads(line) for line in out.splitlines()]
    return [row for row in rows if row["event"] in ("frame", "skipped")]


class Shown:
    """A frame or a gap in a packet, as tshark shows it."""

    def __init__(self, packet, element):
        self.packet, self.protocol = packet, element.get("name")
        self.fields, self.warnings, self.names = {}, Counter(), {}
        self.text = element.get("showname").partition(", ")[2]
        for field in element:
            name = field.get("name")
            if name == "_ws.expert":
                warnings = (inner.get("name").rpartition(".")[2] for inner in field)
                self.warnings.update(name for name in warnings if name in WARNINGS)
                continue
            name = name.removeprefix(self.protocol + ".")
            self.fields.setdefault(name, []).append((field.get("show"), field.get("value", "")))
            self.names[name] = field.get("showname", "")

    def number(self, name):
        return int(self.fields[name][0][0])


class Packet:
    """A packet, with what Wireshark itself shows of it."""

    def __init__(self, element):
        frame = next(proto for proto in element if proto.get("name") == "frame")
        shown = {field.get("name"): field.get("show") for field in frame.iter("field")}
        self.number = int(shown["frame.number"])
        # A packet without a time has none of these.
        seconds, _, fraction = shown.get("frame.time_epoch", "0.0").partition(".")
        self.micros = 1_000_000 * int(seconds) + int(fraction[:6].ljust(6, "0"))
        flags = int(shown.get("frame.packet_flags_direction", "0"), 0)
        self.port = shown.get("frame.interface_name", "")
        self.direction = {1: "in", 2: "out"}.get(flags)
        self.line = (int(shown.get("frame.section_number", "1")), int(shown["frame.interface_id"]))


def shown_by_tshark(user, path, script=None, options=("-2", "-R", "frame")):
    """What tshark shows: the frames and gaps in order, and the parts of such."""
    command = ["tshark", "-r", path, *options, "-T", "pdml"]
    if script:
        command += ["-X", f"lua_script:{script}"]
    process = user.popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    whole, parts = [], []
    try:
        for _, element in xml.iterparse(process.stdout):
            if element.tag != "packet":
                continue
            packet = Packet(element)
            for field in element.iter("field"):
                if field.get("name") == "_ws.lua.error":
                    raise Broken(f"packet {packet.number}: {field.get('showname')}")
            for proto in element:
                if proto.get("name") in ("axle_ucp", "axle_ikeya"):
                    shown = Shown(packet, proto)
                    if {"message", "skipped.length"} & shown.fields.keys():
                        whole.append(shown)
                    else:
                        parts.append(shown)
                elif proto.get("name") not in ("geninfo", "frame", "fake-field-wrapper"):
                    whole.append(Shown(packet, proto))
            element.clear()
    except xml.ParseError as error:
        process.kill()
        sys.exit(f"{path}: tshark printed no XML: {error}")
    _, err = process.communicate()
    if process.returncode != 0 or b"Lua" in err:
        raise Broken(err.decode(errors="replace").strip())
    return whole, parts


class Broken(Exception):
    """The script does not load."""


class Comparison:
    """Counts what is compared, and keeps what differs."""

    def __init__(self):
        self.values = self.frames = self.gaps = self.facts = 0
        self.differences = []

    def differ(self, where, text):
        self.differences.append(f"{where}: {text}")

    def compare(self, name, capture, rows, shown, parts, columns,
                window=expected.REPLY_WINDOW_US):
        """Compares a capture."""
        # The tool counts interfaces through all sections, Wireshark in each.
        read = corpora.Read(capture)
        first = read.first
        places = [places_of(row, read) for row in rows]
        self.parts(name, rows, places, parts)
        complete(shown, columns)
        if window == expected.REPLY_WINDOW_US:
            self.columns(name, rows, places, read, shown + parts, columns)
        facts = expected.exchanges(rows, read.last, window)
        if window == expected.REPLY_WINDOW_US:
            self.told(name, rows, facts)
        wanted = {}
        for number, row in enumerate(rows):
            key = (row.get("interface"), row.get("direction"), row["offset"])
            wanted[key] = (number, row)
        pairs = {}
        for item in shown:
            offset = "offset" if "message" in item.fields else "skipped.offset"
            if offset not in item.fields:
                self.differ(name, f"packet {item.packet.number}: {item.protocol} has no offset")
                continue
            section, interface = item.packet.line
            key = (first[section] + interface, item.packet.direction, item.number(offset))
            if key not in wanted or wanted[key][0] in pairs:
                self.differ(name, f"packet {item.packet.number}: nothing begins at {key}")
                continue
            pairs[wanted[key][0]] = item
        for number, row in enumerate(rows):
            where = f"{name}: line {number + 1}"
            if number not in pairs:
                self.differ(where, f"not shown: {row}")
                continue
            self.row(where, row, pairs[number])
            self.exchange(where, row, facts[number], pairs, number)
            if not expected.is_text(row, facts[number], pairs[number].text):
                self.differ(where, f"its text is {pairs[number].text!r}")

    def told(self, name, rows, facts):
        """The facts of the rules against those that are written by hand."""
        for number, told in enumerate(corpora.TOLD.get(name, [])):
            row, found = rows[number], facts[number]
            if row["event"] == "skipped":
                found = set(expected.gap_warnings(row, "ucp" if name == "hazards" else "ikeya"))
            if told not in (found, "hazard" in found):
                self.differ(name, f"line {number + 1}: {found}, and by hand {told}")
        if name in corpora.TOLD and len(rows) != len(corpora.TOLD[name]):
            self.differ(name, f"{len(rows)} lines, and by hand {len(corpora.TOLD[name])}")

    def parts(self, name, rows, places, parts):
        """The beginnings of frames and gaps in earlier packets."""
        wanted = Counter()
        for row, at in zip(rows, places, strict=True):
            what = "frame" if row["event"] == "frame" else "gap"
            for packet, length in at[:-1]:
                text = f"{length} of {row['length']} bytes of a {what}"
                wanted[packet, str(at[-1][0]), text] += 1
        found = Counter((part.packet.number, part.fields.get(PART, [("", "")])[0][0], part.text)
                        for part in parts)
        for part in (wanted - found).keys() | (found - wanted).keys():
            self.differ(name, f"part {part}: {found[part]} instead of {wanted[part]}")

    def columns(self, name, rows, places, read, shown, columns):
        """Sender, receiver, protocol, and the texts of the frames and gaps of each packet."""
        wanted = {number: ["", "", "UCP" if protocol == "ucp" else "Ikeya MD", Counter()]
                  for number, protocol in enumerate(read.protocols, 1)}
        for row, at in zip(rows, places, strict=True):
            known = row["event"] == "frame" and expected.addresses(row)
            for packet, _ in at if known else []:
                wanted[packet][:2] = known
        for item in shown:
            wanted[item.packet.number][3].update(item.text.split("; "))
        for number, row in wanted.items():
            *found, info = columns.get(number, ["", "", "", ""])
            if [*found, Counter(info.split("; ") if info else [])] != row:
                self.differ(name, f"packet {number}: columns {found} {info!r}, not {row}")

    def row(self, where, row, item):
        """All fields of a frame or gap, and no other."""
        wanted = expected.fields_of(row)
        protocol = item.protocol.removeprefix("axle_")
        if row.get("protocol", protocol).removesuffix("-3") != protocol:
            self.differ(where, f"shown as {item.protocol}")
        for name, value in wanted.items():
            found = item.fields.get(name, [])
            if len(found) != 1 or not expected.is_equal(value, *found[0]):
                self.differ(where, f"{name} is {value!r}, shown as {found}")
            self.values += 1
        for name, word in expected.words(row).items():
            if not mentions(word, item.names.get(name, "")):
                self.differ(where, f"{name} is {word!r}, shown as {item.names.get(name)!r}")
        for name in item.fields.keys() - wanted.keys() - FACTS:
            self.differ(where, f"{name} is shown, and not in the line: {item.fields[name]}")
        for name, value, found in (("t", expected.micros(row), item.packet.micros),
                                   ("direction", row.get("direction"), item.packet.direction)):
            if value != found:
                self.differ(where, f"{name} is {value}, its packet has {found}")
            self.values += 1
        self.frames += row["event"] == "frame"
        self.gaps += row["event"] == "skipped"

    def exchange(self, where, row, facts, pairs, number):
        """Response time, request and answer, and the warnings."""
        values = {}
        for fact in facts:
            if isinstance(fact, tuple):
                kind, value = fact
                if kind == "echo":
                    continue
                if kind != "took":
                    value = pairs[value].packet.number if value in pairs else None
                values[{"took": "response_time_us", "request": "request_in",
                        "answer": "answer_in"}[kind]] = value
        item = pairs[number]
        shown = {name: item.number(name) for name in item.fields.keys() & FACTS
                 if name != "response_time_of"}
        if shown != values:
            self.differ(where, f"exchange {values}, shown as {shown}")
        clock = item.fields.get("response_time_of", [("", "")])[0][0]
        port = item.packet.port
        if "response_time_us" not in values:
            is_right = clock == ""
        else:
            is_right = expected.whose_time(port) in clock
        if not is_right:
            self.differ(where, f"whose time: {clock!r}")
        warnings = Counter(fact for fact in facts if isinstance(fact, str))
        if row["event"] == "skipped":
            warnings = expected.gap_warnings(row, item.protocol.removeprefix("axle_"))
        if +item.warnings != warnings:
            self.differ(where, f"warnings {dict(warnings)}, shown as {dict(item.warnings)}")
        self.facts += len(values) + sum(warnings.values())


def complete(shown, columns):
    """Wireshark cuts long texts of the tree; those of the packet list are whole."""
    texts = {number: row[-1].split("; ") for number, row in columns.items()}
    for item in shown:
        listed = texts.get(item.packet.number, [])
        if len(item.text.encode()) > 190:
            begin = item.text[:150]
            whole = next((text for text in listed if text.startswith(begin)), item.text)
            if whole in listed:
                listed.remove(whole)
            item.text = whole


def places_of(row, read):
    """The packets in which a frame or gap is, with the number of its bytes in each."""
    places, begin = [], 0
    ends = read.ends[row.get("interface"), row.get("direction")]
    at = bisect.bisect_right(ends, (row["offset"], float("inf")))
    begin = ends[at - 1][0] if at > 0 else 0
    for end, packet in ends[at:]:
        if begin >= row["offset"] + row["length"]:
            break
        length = min(end, row["offset"] + row["length"]) - max(begin, row["offset"])
        if length > 0:
            places.append((packet, length))
        begin = end
    return places


def columns_of(user, path, script=None):
    """Source, destination, protocol and text of each packet in the packet list."""
    command = ["tshark", "-2", "-R", "frame", "-r", path, "-T", "psml"]
    if script:
        command += ["-X", f"lua_script:{script}"]
    found = {}
    for packet in xml.fromstring(user.run(command)).iter("packet"):
        number, _, *ends, protocol, _, info = [cell.text or "" for cell in packet]
        found[int(number)] = [*ends, protocol, info]
    return found


def check_captures(user, captures, script=None):
    """Compares all captures; `script` is instead of the one that is installed."""
    comparison = Comparison()
    for name, (path, bytes, rows) in captures.items():
        shown, parts = shown_by_tshark(user, path, script)
        columns = columns_of(user, path, script)
        comparison.compare(name, bytes, rows, shown, parts, columns)
        if name == "one-pass":
            check_first_pass(user, path, comparison, script)
        if name == "times":
            options = ("-2", "-R", "frame", "-o", f"axle_ikeya.reply_window_us:{SHORT_WINDOW_US}")
            shown, parts = shown_by_tshark(user, path, script, options)
            comparison.compare("a short reply window", bytes, rows, shown, parts, columns,
                               window=SHORT_WINDOW_US)
    return comparison


def check_first_pass(user, path, comparison, script):
    """What is not decided yet, as far as one pass shows it."""
    command = ["tshark", "-r", path, "-T", "fields", "-e", "axle_ucp.pending",
               "-e", "axle_ucp.skipped_so_far", "-e", "_ws.col.Info"]
    if script:
        command += ["-X", f"lua_script:{script}"]
    lines = [line.split("\t") for line in user.run(command).decode().splitlines()]
    for number, (line, wanted) in enumerate(zip(lines, corpora.ONE_PASS, strict=True), 1):
        pending, so_far = wanted
        texts = [text for text in (so_far and f"{so_far} bytes skipped so far: header",
                                   pending and f"{pending} bytes that may still") if text]
        if tuple(line[:2]) != wanted or not all(text in line[2] for text in texts) \
                or line[2].count("so far") != bool(so_far):
            comparison.differ("first pass", f"packet {number} is {line}, not {wanted}")


def write_captures(folder):
    """Writes the captures, and decodes them with the tool."""
    written = {}
    for name, bytes in corpora.all_of().items():
        path = Path(folder) / f"{name}.pcapng"
        path.write_bytes(bytes)
        written[name] = (path, bytes, decoded(path))
    return written


def planted(user, captures, folder):
    """Plants each damage in its own copy of axle.lua. Prints what was not found; 0 if all were."""
    text, missed = (HERE / "axle.lua").read_text(), 0
    whole = folder / "axle.lua"
    whole.write_text(text)
    if check_captures(user, captures, whole).differences:
        print("there are differences without a damage")
        return 1
    def plant(numbered):
        number, (old, new) = numbered
        if text.count(old) != 1:
            return f"its text is there {text.count(old)} times"
        script = folder / f"damage-{number}.lua"
        script.write_text(text.replace(old, new))
        return problem_with(user, captures, script)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        problems = list(pool.map(plant, enumerate(damages.DAMAGES, 1)))
    for (old, new), problem in zip(damages.DAMAGES, problems, strict=True):
        if problem:
            missed += 1
            print(f"{old!r} as {new!r}: {problem}")
    print(f"{len(damages.DAMAGES) - missed} of {len(damages.DAMAGES)} damages found")
    return missed > 0


def problem_with(user, captures, script):
    """Why this damage is not found; None if it is."""
    for capture in captures.items():
        try:
            if check_captures(user, dict([capture]), script).differences:
                return None
        except Broken as broken:
            # A script that fails while it reads is found as well; one that does not load is not
            # the damage that was meant.
            return None if "packet" in str(broken) else f"does not load: {broken}"
    return "NOT FOUND"


def check_one_pass(user, captures, comparison):
    """A first pass shows the frames as they come. A second one tells if the first knew no
    interfaces."""
    path, _, rows = captures["vectors"]
    frames = sum(row["event"] == "frame" for row in rows)
    shown, _ = shown_by_tshark(user, path, options=())
    found = sum("message" in item.fields for item in shown)
    if found != frames:
        comparison.differ("one pass", f"{found} frames instead of {frames}")
    path, _, _ = captures["noise-1"]
    command = ["tshark", "-2", "-r", path, "-T", "fields", "-e", "_ws.col.Info"]
    told = user.run(command).decode().count("as if there were one interface only")
    if told < 100:
        comparison.differ("without -R frame", f"told of {told} packets")


def check_filters(user, captures, comparison):
    """Each filter of README.md and of the colours finds something in one of the captures."""
    filters = re.findall(r"^\| `(.*?)` \|", (HERE / "README.md").read_text(), re.MULTILINE)
    filters += re.findall(r"^@.*?@(.*?)@", (HERE / "colours").read_text(), re.MULTILINE)
    for wanted in filters:
        found = b""
        for path, _, _ in captures.values():
            found = found or user.run(["tshark", "-2", "-R", "frame", "-r", path, "-Y", wanted])
        if not found:
            comparison.differ("filters", f"nothing is found by {wanted}")
    if len(filters) < 12:
        comparison.differ("filters", f"only {len(filters)} filters")


def check_live(user, comparison):
    """Captures live lines, and compares what was captured. Returns the number of packets."""
    axle = user.home / "axle"
    for command in live.of_failures(user, axle):
        comparison.differ("live", f"it does not end: {command}")
    count = 0
    for name, run in (("rover", live.of_rover), ("bus", live.of_bus)):
        path = user.home / f"{name}.pcapng"
        lines = run(user, axle, path)
        if len(lines) < 100:
            comparison.differ(f"live {name}", f"only {len(lines)} packets")
        if sum(len(line) == 2 and line[1] != "" for line in lines) < 70:
            comparison.differ(f"live {name}", f"hardly any frames: {lines[:5]}")
        if not all(line[0].startswith("/dev/") for line in lines):
            comparison.differ(f"live {name}", f"no name of the port: {lines[:5]}")
        shown, parts = shown_by_tshark(user, path)
        comparison.compare(f"live {name}", path.read_bytes(), decoded(path), shown, parts,
                           columns_of(user, path))
        count += len(lines)
    return count


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--planted", action="store_true")
    args = parser.parse_args()
    if not shutil.which("tshark"):
        print("tshark is missing: install the Debian package tshark", file=sys.stderr)
        return MISSING
    if not AXLE.exists():
        print(f"{AXLE} is missing: cargo build -p axle, or set AXLE", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        user, captures = User(folder), write_captures(folder)
        if args.planted:
            return planted(user, captures, Path(folder))
        # The user may not be allowed to read the folders that the tool is in.
        axle = shutil.copy(AXLE, user.home / "axle")
        install = ["bash", HERE / "install.sh", "--to", user.home, "--axle", axle]
        subprocess.run(install, check=True, stdout=subprocess.DEVNULL)
        found = check_captures(user, captures)
        check_one_pass(user, captures, found)
        check_filters(user, captures, found)
        packets = check_live(user, found)
        if found.values < LEAST_VALUES:
            found.differ("check", f"only {found.values} values were compared")
        print(f"{found.values} values of {found.frames} frames and {found.gaps} gaps in "
              f"{len(captures)} captures and {packets} live packets, {found.facts} answer times, requests, answers and "
              f"warnings: {len(found.differences)} differences")
        print(*found.differences[:20], sep="\n", end="\n" if found.differences else "")
        return bool(found.differences)


if __name__ == "__main__":
    sys.exit(main())
