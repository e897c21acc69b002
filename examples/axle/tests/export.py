#!/usr/bin/env python3
"""Reads what `axle export` writes with the libraries that people use, and compares each value with
`axle decode --json`: of the captures of examples/captures, the frames of tests/vectors, and noise.
JSON lines are compared byte by byte. The snippets of export.md are run. export.sh installs the
modules, and runs it. AXLE is the program, by default that of target/debug. Exit code 1 if anything
differs.
"""
import csv
import datetime
import json
import math
import os
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import duckdb
import jsonschema
import pyarrow.parquet
from mcap.reader import make_reader

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "examples/wireshark"), str(ROOT / "examples/sigrok")]
import check
import make

AXLE = Path(os.environ.get("AXLE") or ROOT / "target/debug/axle").resolve()
LEAST_VALUES = 180_000
# The fleet: so many captures in all.
ROVERS, DAYS, FIRST_DAY = 20, 50, datetime.date(2026, 1, 1)
TYPES = {"u8": pyarrow.uint8(), "i16": pyarrow.int16(), "u16": pyarrow.uint16(),
         "u32": pyarrow.uint32(), "u64": pyarrow.uint64(), "f32": pyarrow.float32(),
         "time": pyarrow.timestamp("us", "UTC"), "name": pyarrow.string(),
         "bytes": pyarrow.binary()}


def inputs(folder):
    """File of each capture, and the options that it needs."""
    captures = ROOT / "examples/captures"
    yield from ((path, []) for path in captures.iterdir() if path.suffix in (".bin", ".pcapng"))
    # Speeds that are no numbers, or have more digits than a column might.
    speeds = [make.sealed("5501" + struct.pack("<f", speed).hex()) for speed in (
        0.1, -0.0, 1e-40, 3.4028235e38, math.nan, math.inf, -math.inf, 16777217)]
    for protocol in ("ucp", "ikeya", "ikeya-3"):
        frames = make.vectors(protocol)
        # Zeros behind each, so that no damaged one takes the next with it.
        parts = [part + bytes(64) for part in [*frames, *speeds * (protocol == "ikeya")]]
        for name, parts in (("vectors", parts), ("noise", make.noisy(frames, 1, 400))):
            path = folder / f"{name}-{protocol}.bin"
            path.write_bytes(b"".join(parts))
            yield path, ["--protocol", protocol]


def fleet(folder):
    """A capture for each rover and day: some packets, an hour between each two, and one a minute
    after the midnight that follows."""
    frames = make.vectors("ucp")[:8]
    for rover in range(1, ROVERS + 1):
        (folder / f"rover-{rover}").mkdir(parents=True)
        for day in range(DAYS):
            date = FIRST_DAY + datetime.timedelta(day)
            begin = (date - datetime.date(1970, 1, 1)).days * 24 * 3600 * 1_000_000
            hours = [1] * rover + [24 - rover + 1 / 60]
            packets = [(0, 1, round(step * 3_600_000_000), frames[at % len(frames)])
                       for at, step in enumerate(hours)]
            capture = check.pcapng([("ucp", "/dev/ttyS4")], packets, begin)
            (folder / f"rover-{rover}/{date}.pcapng").write_bytes(capture)


def micros_of(text):
    seconds, fraction = text.split(".")
    return int(seconds) * 1_000_000 + int(fraction.ljust(6, "0"))


def bits(number):
    """A speed as its bits; every NaN is the same, as JSON does not tell them apart."""
    number = float(number)
    return "nan" if math.isnan(number) else struct.pack("<f", number).hex()


def table_of(line):
    return f"{line['protocol']}.{line['message']}" if line["event"] == "frame" else "skipped"


def flat(line):
    """A line as a row: what every column should have."""
    row = {}
    for name, value in line.items():
        read = {"t": micros_of, "rps": bits}.get(name, lambda it: it)
        if isinstance(value, list):
            row |= {f"{name}_{at}": read(it) for at, it in enumerate(value)}
        elif isinstance(value, dict):
            row |= {f"{name}_{key}": it for key, it in value.items()}
        elif name not in ("event", "protocol", "message"):
            row[name] = read(value)
    return row


def from_text(text, kind, name):
    if text == "":
        # An unknown frame may have an empty body.
        return "" if name == "body" else None
    return {"time": micros_of, "f32": bits, "name": str, "bytes": str}.get(kind, int)(text)


class Check:
    """Counts what is compared, and keeps what differs."""

    def __init__(self, folder):
        self.folder, self.values, self.lines, self.differences = folder, 0, 0, []

    def expect(self, where, found, wanted):
        self.values += 1
        if found != wanted:
            self.differences.append(f"{where}: {found!r}, not {wanted!r}")

    def capture(self, path, options):
        def run(*command):
            return subprocess.run([AXLE, *command], stdout=subprocess.PIPE, check=True).stdout
        listing = run("decode", "--json", *options, path)
        # A number with a fraction stays a text: its digits count.
        events = [json.loads(line, parse_float=str) for line in listing.splitlines()]
        lines = [line for line in events if line["event"] in ("frame", "skipped")]
        self.lines += len(lines)
        forms = ("jsonl", "mcap", "csv", "parquet")
        out = {form: self.folder / f"{path.name}.{form}" for form in forms}
        for form in forms:
            run("export", *options, path, "-o", out[form])
        self.expect(f"{path.name}: jsonl", out["jsonl"].read_bytes() == listing, True)
        self.mcap(f"{path.name}: mcap", out["mcap"], lines, path.suffix == ".pcapng")
        tables = {}
        for line in lines:
            tables.setdefault(table_of(line), []).append(flat(line))
        self.tables(f"{path.name}: csv", out["csv"], tables, self.csv)
        self.tables(f"{path.name}: parquet", out["parquet"], tables, self.parquet)

    def tables(self, name, folder, tables, read):
        columns = {}
        for row in csv.DictReader((folder / "columns.csv").open(newline="")):
            columns.setdefault(row["table"], {})[row["column"]] = (row["unit"], row["type"])
        files = {path.stem: path for path in folder.iterdir() if path.name != "columns.csv"}
        self.expect(f"{name}: tables", (files.keys(), columns.keys()), (tables.keys(),) * 2)
        for table in tables.keys() & files.keys() & columns.keys():
            where = f"{name}: {table}"
            names, rows = read(where, files[table], columns[table])
            self.expect(where, (names, len(rows)), (list(columns[table]), len(tables[table])))
            for number, (row, wanted) in enumerate(zip(rows, tables[table]), 1):
                for key in row.keys() | wanted.keys():
                    self.expect(f"{where}: row {number}: {key}", row.get(key), wanted.get(key))

    def csv(self, _, path, columns):
        rows = [{name: from_text(text, columns[name][1], name) for name, text in row.items()}
                for row in csv.DictReader(path.open(newline=""))]
        return list(rows[0]), rows

    def parquet(self, name, path, columns):
        table = pyarrow.parquet.read_table(path)
        lists = {}
        for field in table.schema:
            unit, kind = columns[field.name]
            told = (table.schema.metadata or {}).get(f"unit:{field.name}".encode(), b"none")
            self.expect(f"{name}: {field.name}", (field.type, told.decode()), (TYPES[kind], unit))
            column = table[field.name]
            column = column.cast(pyarrow.int64()) if kind == "time" else column
            read = {"f32": bits, "bytes": bytes.hex}.get(kind, lambda it: it)
            lists[field.name] = [it if it is None else read(it) for it in column.to_pylist()]
        return list(lists), [dict(zip(lists, values)) for values in zip(*lists.values())]

    def mcap(self, name, path, lines, has_times):
        with path.open("rb") as file:
            found = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
        self.expect(f"{name}: messages", len(found), len(lines))
        validators, before = {}, None
        for number, ((schema, channel, message), line) in enumerate(zip(found, lines)):
            where = f"{name}: message {number}"
            self.expect(where, (channel.topic, schema.name, schema.encoding,
                                channel.message_encoding, message.sequence),
                        (table_of(line), table_of(line), "jsonschema", "json", number))
            # A packet without a time has that of the line before it; raw bytes have their place.
            if "t" in line:
                before = micros_of(line["t"]) * 1000
            time = before if has_times else line["offset"]
            self.expect(f"{where}: time", (message.log_time, message.publish_time), (time, time))
            shown = json.loads(message.data, parse_float=str)
            for field in shown.keys() | line.keys():
                self.expect(f"{where}: {field}", shown.get(field), line.get(field))
            if schema.id not in validators:
                # Every field has to be there.
                of = json.loads(schema.data) | {"additionalProperties": False}
                validators[schema.id] = jsonschema.Draft202012Validator(of)
            faults = validators[schema.id].iter_errors(json.loads(message.data))
            self.expect(f"{where}: schema", [fault.message for fault in faults], [])

    def fleet(self):
        """Each frame of a fleet is in the partition of its day and line, and nowhere else."""
        fleet(self.folder / "fleet")
        out = self.folder / "whole.parquet"
        subprocess.run([AXLE, "export", self.folder / "fleet", "-o", out], check=True,
                       stdout=subprocess.DEVNULL)
        wanted, found = {}, {}
        for path in (self.folder / "fleet").glob("*/*.pcapng"):
            lines = subprocess.run([AXLE, "decode", "--json", path], stdout=subprocess.PIPE,
                                   check=True).stdout.splitlines()
            for line in map(json.loads, lines):
                if line["event"] in ("frame", "skipped"):
                    date = datetime.datetime.fromtimestamp(line["t"], datetime.UTC).date()
                    key = (table_of(line), date, f"{path.parent.name}/ttyS4", line["t"])
                    wanted[key] = wanted.get(key, 0) + 1
        self.expect("fleet: frames", sum(wanted.values()) >= 1000, True)
        for table in {key[0] for key in wanted}:
            files = f"{out}/{table}.parquet/**/*.parquet"
            rows = duckdb.sql(f"SELECT day, line, epoch_us(t) FROM '{files}'")
            for day, line, micros in rows.fetchall():
                key = (table, day, line, micros / 1e6)
                found[key] = found.get(key, 0) + 1
        self.expect("fleet: rows", found, wanted)
        days, lines = ({key[at] for key in wanted} for at in (1, 2))
        self.expect("fleet: days and lines", (len(days), len(lines)), (DAYS + 1, ROVERS))

    def page(self):
        """The snippets of export.md print what is there, in a folder with what they write."""
        page, count = (ROOT / "examples/axle/export.md").read_text(), 0
        blocks = re.findall(r"```(sh|python|sql)\n(.*?)```(?:\n+```text\n(.*?)```)?", page, re.S)
        for kind, code, wanted in blocks:
            if kind == "sh" and "axle export" not in code:
                continue
            code = code.replace("examples/", f"{ROOT}/examples/")
            if kind == "sql":
                code = f"import duckdb\nprint(duckdb.sql({code!r}))"
            shell = ["bash", "-ec", f'axle() {{ {AXLE} "$@"; }}\n{code}']
            command = shell if kind == "sh" else [sys.executable, "-c", code]
            ran = subprocess.run(command, cwd=self.folder, text=True, stdout=subprocess.PIPE,
                                 stderr=subprocess.STDOUT)
            # Not the spaces at the ends of lines.
            said = re.sub(" +$", "", ran.stdout, flags=re.M).rstrip()
            wanted = said if kind == "sh" else wanted.rstrip()
            self.expect(f"export.md: {code.strip()}", (said, ran.returncode), (wanted, 0))
            count += 1
        self.expect("export.md: enough snippets", count >= 6, True)
        # The formula for spreadsheets: the column of the time, and days from their first one.
        titles = (self.folder / "motors.csv/ikeya.write.csv").open().readline().split(",")
        column, days = re.search(r"`=([A-Z])2/86400\+(\d+)`", page).groups()
        first = datetime.date(1970, 1, 1) - datetime.timedelta(int(days))
        self.expect("export.md: the time of a spreadsheet", (titles[ord(column) - ord("A")], first),
                    ("t", datetime.date(1899, 12, 30)))


def main():
    with tempfile.TemporaryDirectory() as folder:
        check = Check(Path(folder))
        for path, options in inputs(check.folder):
            check.capture(path, options)
        check.fleet()
        check.page()
    print(f"{check.values} values of {check.lines} frames and gaps: "
          f"{len(check.differences)} differences")
    print(*check.differences[:20], sep="\n", end="\n" if check.differences else "")
    if check.values < LEAST_VALUES:
        sys.exit(f"fewer than {LEAST_VALUES} values were compared")
    return bool(check.differences)


if __name__ == "__main__":
    sys.exit(main())
