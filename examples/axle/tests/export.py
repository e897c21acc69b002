#!/usr/bin/env python3
"""Reads what `axle export` writes with the libraries that people use, and compares each value with
`axle decode --json`.

    examples/axle/tests/export.py [--axle FILE]      check; exit code 1 and a line per finding
    examples/axle/tests/export.py --planted          damage what was read, and see each damage found
    examples/axle/tests/export.py --modules          only say whether the modules are there

It takes every capture of examples/captures, every vector of tests/vectors, and a capture with two
lines, gaps and a clock that goes back. MCAP is read by `mcap`, Parquet by `pyarrow` and `duckdb`,
CSV by Python and `duckdb`; JSON lines are compared byte by byte. The snippets of export.md are run.
"""

import argparse
import copy
import csv
import datetime
import functools
import importlib
import json
import math
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "examples/axle/export.md"
MODULES = ["duckdb", "mcap", "pandas", "pyarrow"]
FORMS = ["mcap", "csv", "csv by duckdb", "parquet", "parquet by duckdb"]
PLACE = {"t", "interface", "direction"}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--axle", default=ROOT / "target/debug/axle", type=Path)
    parser.add_argument("--planted", action="store_true")
    parser.add_argument("--modules", action="store_true")
    options = parser.parse_args()
    missing = [name for name in MODULES if not is_there(name)]
    if missing:
        sys.exit(f"missing modules: pip install {' '.join(missing)}")
    if options.modules:
        return 0
    with tempfile.TemporaryDirectory() as folder:
        exports = [Export(options.axle, Path(folder), *it) for it in inputs(Path(folder))]
        if options.planted:
            return plant(exports)
        faults = [fault for export in exports for fault in export.faults()]
        if not faults:
            faults = run_page(options.axle)
    rows = sum(len(export.lines) for export in exports)
    values = sum(len(row) for export in exports for rows in export.expected.values() for row in rows)
    print(f"{len(exports)} captures, {rows} frames and gaps, {values} values in {len(FORMS) + 1} ways")
    print(*faults, sep="\n", end="\n" if faults else "")
    if len(exports) < 8 or values < 10_000:
        sys.exit("too few: not all captures were read")
    return bool(faults)


def is_there(name):
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True


def inputs(folder):
    """Name, arguments and file of each capture."""
    for path in sorted((ROOT / "examples/captures").glob("*")):
        if path.suffix in (".bin", ".pcapng"):
            yield path.name, [], path
    protocols = {"ucp": "ucp", "ikeya-md": "ikeya", "ikeya-md-3motor": "ikeya-3"}
    vectors = [json.loads(line) for path in sorted((ROOT / "tests/vectors").glob("*.jsonl"))
               for line in path.read_text().splitlines()]
    for of, protocol in protocols.items():
        path = folder / f"vectors-{protocol}.bin"
        # Noise behind each, so that no damaged one takes the next with it.
        path.write_bytes(b"".join(bytes.fromhex(it["hex"]) + bytes(64)
                                  for it in vectors if it["protocol"] == of))
        yield path.name, ["--protocol", protocol], path
    path = folder / "speeds.bin"
    path.write_bytes(b"".join(with_crc(b"\x55\x01" + struct.pack("<f", speed)) for speed in [
        0.1, -0.0, 1e-40, 3.4028235e38, math.nan, math.inf, -math.inf, 16777217]))
    yield path.name, ["--protocol", "ikeya"], path
    path = folder / "lines.pcapng"
    path.write_bytes(two_lines())
    yield path.name, [], path


def with_crc(data):
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return data + struct.pack("<H", value)


def two_lines():
    """A rover and a bus in one file, both directions, packets without a time, a clock that goes
    back, gaps of several reasons."""
    def block(kind, body):
        size = struct.pack("<I", len(body) + 12)
        return struct.pack("<I", kind) + size + body + size

    def packet(interface, micros, flags, data):
        body = struct.pack("<IIIII", interface, micros >> 32, micros & 0xFFFFFFFF, len(data), len(data))
        body += data + bytes(-len(data) % 4) + struct.pack("<HHIHH", 2, 4, flags, 0, 0)
        return block(6, body)

    micros = struct.pack("<HHB3xHH", 9, 1, 6, 0, 0)
    now = 1_732_489_200_123_456
    answer, write = with_crc(bytes.fromhex("5501cdcccc3d")), with_crc(bytes.fromhex("bb0100000000"))
    ping = with_crc(bytes.fromhex("fdff04000107"))
    damaged = ping[:-1] + bytes([ping[-1] ^ 1])
    return b"".join([
        block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)),
        block(1, struct.pack("<HHI", 147, 0, 0) + micros),
        block(1, struct.pack("<HHI", 150, 0, 0) + micros),
        packet(0, now, 2, write), packet(0, now + 1, 1, answer), packet(0, now + 999_999, 2, write),
        packet(1, now + 5, 1, b"\x00\x01" + damaged + ping), packet(1, now + 4, 2, ping),
        packet(1, now + 1_000_000, 0, ping[:5]),
        # Without a time, on the first interface.
        block(3, struct.pack("<I", len(answer)) + answer),
    ])


class Export:
    """A capture: the lines of `decode --json`, and what each form has of them."""

    def __init__(self, axle, folder, name, args, path):
        self.name, self.path = name, path
        self.has_times = path.suffix == ".pcapng"
        done = subprocess.run([axle, "decode", "--json", *args, path], capture_output=True, check=True)
        self.listing = done.stdout
        events = [json.loads(line, parse_float=str) for line in done.stdout.splitlines()]
        self.lines = [it for it in events if it["event"] in ("frame", "skipped")]
        self.expected, self.times = {}, {}
        for number, line in enumerate(self.lines):
            self.expected.setdefault(table_of(line), []).append(flat(line))
            # A packet without a time has that of the line before it; of raw bytes none has one.
            self.times[number] = nanos(line, self.times.get(number - 1) if self.has_times else None)
        self.out = {}
        for form in ["jsonl", "mcap", "csv", "parquet"]:
            self.out[form] = folder / f"{name}.{form}"
            run = subprocess.run([axle, "export", *args, path, "-o", self.out[form]], capture_output=True, text=True)
            if run.returncode or run.stderr:
                sys.exit(f"{name}: {form}: {run.stderr}")
        self.found = {form: self.read(form) for form in FORMS}
        self.found["jsonl"] = self.out["jsonl"].read_bytes()

    def read(self, form):
        """Rows by table, or for MCAP messages by topic, and the columns or schemas."""
        if form == "mcap":
            return read_mcap(self.out["mcap"])
        folder = self.out[form.split()[0]]
        with open(folder / "columns.csv", newline="") as file:
            columns = {}
            for row in csv.DictReader(file):
                columns.setdefault(row["table"], {})[row["column"]] = (row["unit"], row["type"])
        read = {"csv": read_csv, "csv by duckdb": read_csv_by_duckdb, "parquet": read_parquet,
                "parquet by duckdb": read_parquet_by_duckdb}[form]
        tables = {path.stem: read(path, columns.get(path.stem, {}))
                  for path in sorted(folder.iterdir()) if path.name != "columns.csv"}
        return {"columns": columns, "tables": tables}

    def faults(self):
        return [f"{self.name}: {form}: {fault}" for form in [*FORMS, "jsonl"] for fault in self.compare(form)]

    def compare(self, form):
        found = self.found[form]
        if form == "jsonl":
            return [] if found == self.listing else ["not the lines of decode --json"]
        return list(self.compare_mcap(found) if form == "mcap" else self.compare_tables(found))

    def compare_tables(self, found):
        columns, tables = found["columns"], found["tables"]
        if set(tables) != set(self.expected):
            yield f"tables {sorted(tables)}, not {sorted(self.expected)}"
        if set(columns) != set(tables):
            yield f"columns of {sorted(columns)}, not of {sorted(tables)}"
        for table, rows in self.expected.items():
            names, got = list(columns.get(table, {})), tables.get(table, {"names": [], "rows": [], "units": {}})
            if got["names"] != names:
                yield f"{table}: columns {got['names']}, not {names}"
            for name, (unit, _) in columns.get(table, {}).items():
                if unit != unit_of(table, name):
                    yield f"{table}: {name} in {unit}, not {unit_of(table, name)}"
                if got["units"] is not None and got["units"].get(name, "none") != unit:
                    yield f"{table}: {name} in {got['units'].get(name)} in the metadata, not {unit}"
            for name in PLACE & set(names):
                if not self.has_times:
                    yield f"{table}: {name}, although there are no times"
            if len(got["rows"]) != len(rows):
                yield f"{table}: {len(got['rows'])} rows, not {len(rows)}"
            for at, (row, wanted) in enumerate(zip(got["rows"], rows)):
                if set(wanted) - set(names):
                    yield f"{table}: row {at}: no {set(wanted) - set(names)}"
                for name in names:
                    if row.get(name) != wanted.get(name):
                        yield f"{table}: row {at}: {name} is {row.get(name)}, not {wanted.get(name)}"

    def compare_mcap(self, found):
        if len(found["messages"]) != len(self.lines):
            yield f"{len(found['messages'])} messages, not {len(self.lines)}"
        for number, (message, line) in enumerate(zip(found["messages"], self.lines)):
            if message["topic"] != table_of(line):
                yield f"message {number}: topic {message['topic']}, not {table_of(line)}"
            if message["sequence"] != number or message["times"] != [self.times[number]] * 2:
                yield f"message {number}: number {message['sequence']}, times {message['times']}"
            if message["line"] != line:
                yield f"message {number}: {message['line']}, not {line}"
        if set(found["schemas"]) != set(self.expected):
            yield f"schemas of {sorted(found['schemas'])}, not of {sorted(self.expected)}"
        for topic, schema in found["schemas"].items():
            for name, property in schema["properties"].items():
                if property.get("unit", "none") != unit_of(topic, name):
                    yield f"{topic}: {name} in {property.get('unit')}, not {unit_of(topic, name)}"
        for message in found["messages"]:
            schema = found["schemas"].get(message["topic"], {"properties": {}})
            for name, value in message["line"].items():
                if not fits(value, schema["properties"].get(name)):
                    yield f"{message['topic']}: {name} {value} is not of {schema['properties'].get(name)}"


class Number(str):
    """A number with a fraction, with the digits of the file."""


# What schemas of topics have.
KEYWORDS = {"type", "items", "minItems", "maxItems", "properties", "oneOf", "enum", "unit", "description"}


def table_of(line):
    return f"{line['protocol']}.{line['message']}" if line["event"] == "frame" else "skipped"


def micros_of(text):
    seconds, fraction = text.split(".")
    return int(seconds) * 1_000_000 + int(fraction.ljust(6, "0"))


def nanos(line, before):
    """Log time of MCAP: that of the line, or of the one before, or a nanosecond per byte."""
    if "t" in line:
        return micros_of(line["t"]) * 1000
    return line["offset"] if before is None else before


def bits(number):
    """A number of 32 bits as its bits; every NaN is the same, as JSON does not tell them apart."""
    number = float(number)
    return "nan" if math.isnan(number) else struct.pack("<f", number).hex()


def flat(line):
    """A line as a row: what every column should have."""
    row = {}
    for name, value in line.items():
        if name == "t":
            row[name] = micros_of(value)
        elif name == "rps" and not isinstance(value, list):
            row[name] = bits(value)
        elif isinstance(value, list):
            row |= {f"{name}_{at}": bits(it) if name == "rps" else it for at, it in enumerate(value)}
        elif isinstance(value, dict):
            row |= {f"{name}_{key}": it for key, it in value.items()}
        elif name not in ("event", "protocol", "message"):
            row[name] = value
    return row


@functools.cache
def unit_of(table, column):
    """The unit on the page of fields."""
    protocol, _, message = table.rpartition(".")
    group = {"ucp": "UCP", "ikeya": "Ikeya", "ikeya-3": "Ikeya", "": "skipped"}[protocol]
    field = re.sub(r"^(rpm|acc|gyro|mag|acc_bias|gyro_bias|mag_bias|rps|count|rotation)_[0-3]$", r"\1", column)
    field = re.sub(r"^reasons_[a-z]+$", "reasons", field)
    for row in (ROOT / "src/fields.md").read_text().splitlines():
        cells = [cell.strip() for cell in row.split("|")]
        if len(cells) == 8 and cells[1].strip("`") == field:
            places = [place.strip("`") for place in cells[2].split(", ")]
            if {message, group, "every line", "every frame" if protocol else "skipped"} & set(places):
                return cells[4]
    return "not on the page"


def fits(value, schema):
    """Whether a value is of the schema, which is checked with the few words that ours use. A number
    with a fraction is of the class Number here, so that no text is taken for one."""
    if schema is None or not set(schema) <= KEYWORDS:
        return False
    if "oneOf" in schema and sum(fits(value, one) for one in schema["oneOf"]) != 1:
        return False
    if "enum" in schema and value not in schema["enum"]:
        return False
    kind = schema.get("type")
    if kind is None:
        return bool({"oneOf", "enum"} & set(schema))
    if kind == "array":
        return (isinstance(value, list) and schema["minItems"] == len(value) == schema["maxItems"]
                and all(fits(it, schema["items"]) for it in value))
    if kind == "object":
        return isinstance(value, dict) and all(fits(it, schema["properties"].get(name)) for name, it in value.items())
    if kind == "number":
        return type(value) in (int, Number)
    return type(value) is {"integer": int, "string": str}.get(kind)


def read_mcap(path):
    from mcap.reader import make_reader
    messages, schemas = [], {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            assert schema.name == channel.topic, schema.name
            schemas[channel.topic] = json.loads(schema.data)
            messages.append({"topic": channel.topic, "sequence": message.sequence,
                             "times": [message.log_time, message.publish_time],
                             "line": json.loads(message.data, parse_float=Number)})
        count = reader.get_summary().statistics.message_count
        assert count == len(messages), count
    return {"messages": messages, "schemas": schemas}


def from_text(text, kind):
    if text is None or text == "":
        return None
    if kind == "time":
        return micros_of(text)
    if kind == "f32":
        return bits(text)
    return text if kind in ("name", "bytes") else int(text)


def read_csv(path, columns):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
        names = list(rows[0])
    kinds = {name: kind for name, (_, kind) in columns.items()}
    # An empty text of a column that every row has is a text.
    rows = [{name: "" if value == "" and name == "body" else from_text(value, kinds.get(name)) for name, value in row.items()}
            for row in rows]
    return {"names": names, "rows": rows, "units": None}


def read_csv_by_duckdb(path, columns):
    import duckdb
    found = duckdb.sql(f"SELECT * FROM read_csv('{path}', header = true, all_varchar = true)")
    kinds = {name: kind for name, (_, kind) in columns.items()}
    rows = [{name: "" if value in (None, "") and name == "body" else from_text(value, kinds.get(name))
             for name, value in zip(found.columns, row)} for row in found.fetchall()]
    return {"names": found.columns, "rows": rows, "units": None}


def from_value(value, kind):
    if value is None:
        return None
    return bits(value) if kind == "f32" else value.hex() if kind == "bytes" else value


def read_parquet(path, columns):
    import pyarrow
    import pyarrow.parquet
    table = pyarrow.parquet.read_table(path)
    units = {key.decode()[len("unit:"):]: value.decode() for key, value in (table.schema.metadata or {}).items()
             if key.startswith(b"unit:")}
    types = {"u8": pyarrow.uint8(), "i16": pyarrow.int16(), "u16": pyarrow.uint16(), "u32": pyarrow.uint32(),
             "u64": pyarrow.uint64(), "f32": pyarrow.float32(), "time": pyarrow.timestamp("us", "UTC"),
             "name": pyarrow.string(), "bytes": pyarrow.binary()}
    lists = {}
    for field in table.schema:
        kind = columns.get(field.name, (None, None))[1]
        assert field.type == types[kind], f"{path}: {field}"
        column = table[field.name]
        if kind == "time":
            column = column.cast(pyarrow.int64())
        lists[field.name] = [from_value(value, kind) for value in column.to_pylist()]
    rows = [dict(zip(lists, values)) for values in zip(*lists.values())]
    return {"names": table.schema.names, "rows": rows, "units": units}


def read_parquet_by_duckdb(path, columns):
    import duckdb
    names = duckdb.sql(f"SELECT * FROM read_parquet('{path}')").columns
    chosen = ", ".join(f"epoch_us({name}) AS {name}" if name == "t" else f'"{name}"' for name in names)
    found = duckdb.sql(f"SELECT {chosen} FROM read_parquet('{path}')").fetchall()
    kinds = {name: kind for name, (_, kind) in columns.items()}
    rows = [{name: from_value(value, kinds.get(name)) for name, value in zip(names, row)} for row in found]
    metadata = duckdb.sql(f"SELECT key, value FROM parquet_kv_metadata('{path}')").fetchall()
    units = {key.decode()[len("unit:"):]: value.decode() for key, value in metadata if key.startswith(b"unit:")}
    return {"names": names, "rows": rows, "units": units}


def plant(exports):
    """Damages what was read in every way, one at a time; each must be found."""
    planted, missed = 0, []
    # Each damage is a comparison of the whole capture: the short ones have every message.
    for export in (it for it in exports if len(it.lines) < 300):
        clean = {form: export.compare(form) for form in export.found}
        if any(clean.values()):
            sys.exit(f"{export.name}: not clean before anything was planted: {clean}")
        for form in export.found:
            for what, damage in damages(export, form):
                kept = export.found[form]
                export.found[form] = damage(copy.deepcopy(kept))
                planted += 1
                if not export.compare(form):
                    missed.append(f"not found: {export.name}: {form}: {what}")
                export.found[form] = kept
    print(f"{planted} planted, {len(missed)} not found", *missed, sep="\n")
    return bool(missed) or planted < 1000


def damages(export, form):
    found = export.found[form]
    if form == "jsonl":
        yield "a digit", lambda it: it.replace(b"1", b"2", 1)
        yield "a line less", lambda it: it[it.index(b"\n") + 1:]
        return
    def changed(change):
        def damage(it):
            change(it)
            return it
        return damage
    if form == "mcap":
        messages = found["messages"]
        for at in {0, len(messages) // 2, len(messages) - 1}:
            yield "a time", changed(lambda it, at=at: it["messages"][at]["times"].__setitem__(0, 5))
            yield "a topic", changed(lambda it, at=at: it["messages"][at].__setitem__("topic", "x"))
            yield "a number", changed(lambda it, at=at: it["messages"][at].__setitem__("sequence", -1))
            yield "a message less", changed(lambda it, at=at: it["messages"].pop(at))
            yield "a message twice", changed(lambda it, at=at: it["messages"].insert(at, it["messages"][at]))
            for name, value in messages[at]["line"].items():
                yield f"{name} other", changed(lambda it, at=at, name=name, value=value:
                                               it["messages"][at]["line"].__setitem__(name, other(value)))
                yield f"{name} gone", changed(lambda it, at=at, name=name: it["messages"][at]["line"].pop(name))
        for topic, schema in found["schemas"].items():
            yield "a schema less", changed(lambda it, topic=topic: it["schemas"].pop(topic))
            used = {name for message in messages if message["topic"] == topic for name in message["line"]}
            for name, property in schema["properties"].items():
                yield f"{topic}: unit of {name}", changed(
                    lambda it, topic=topic, name=name: it["schemas"][topic]["properties"][name].__setitem__("unit", "x"))
                if name in used:
                    yield f"{topic}: type of {name}", changed(
                        lambda it, topic=topic, name=name: it["schemas"][topic]["properties"][name].__setitem__("type", "boolean"))
                    yield f"{topic}: no {name}", changed(
                        lambda it, topic=topic, name=name: it["schemas"][topic]["properties"].pop(name))
        return
    yield "a table more", changed(lambda it: it["tables"].__setitem__("x", it["tables"][next(iter(it["tables"]))]))
    for table, rows in export.expected.items():
        yield f"no {table}", changed(lambda it, table=table: it["tables"].pop(table))
        yield f"no columns of {table}", changed(lambda it, table=table: it["columns"].pop(table))
        yield f"{table}: a row less", changed(lambda it, table=table: it["tables"][table]["rows"].pop())
        yield f"{table}: a row twice", changed(
            lambda it, table=table: it["tables"][table]["rows"].append(it["tables"][table]["rows"][-1]))
        if len(rows) > 1:
            yield f"{table}: rows swapped", changed(lambda it, table=table: it["tables"][table]["rows"].reverse())
        for name, (unit, kind) in found["columns"][table].items():
            yield f"{table}: unit of {name}", changed(
                lambda it, table=table, name=name, kind=kind: it["columns"][table].__setitem__(name, ("x", kind)))
            yield f"{table}: {name} renamed", changed(
                lambda it, table=table, name=name: it["tables"][table]["names"].__setitem__(
                    it["tables"][table]["names"].index(name), "x"))
            yield f"{table}: no {name}", changed(
                lambda it, table=table, name=name: it["columns"][table].pop(name))
            if found["tables"][table]["units"] is not None and unit != "none":
                yield f"{table}: no unit of {name}", changed(
                    lambda it, table=table, name=name: it["tables"][table]["units"].pop(name))
            for at in {0, len(rows) // 2, len(rows) - 1}:
                for value in {repr(it): it for it in wrong(rows[at].get(name))}.values():
                    yield f"{table}: row {at}: {name} {value}", changed(
                        lambda it, table=table, at=at, name=name, value=value:
                        it["tables"][table]["rows"][at].__setitem__(name, value))


def other(value):
    if isinstance(value, int):
        return value + 1
    if isinstance(value, str):
        return value + "0"
    return value[1:] if isinstance(value, list) else {}


def wrong(value):
    """Values that a cell should not have."""
    if value is None:
        return [0, "", "nan"]
    if isinstance(value, int):
        return [value + 1, -value - 1, value ^ 0x80, None]
    return [value + "0", value[:-1] + "x", None]


def run_page(axle):
    """Runs the snippets of the page, in a folder with what its commands write."""
    page = PAGE.read_text()
    faults, count = [], 0
    with tempfile.TemporaryDirectory() as folder:
        blocks = re.findall(r"```(sh|python|sql)\n(.*?)```(?:\n+```text\n(.*?)```)?", page, re.S)
        for kind, code, wanted in blocks:
            if kind == "sh" and "axle export" not in code:
                continue
            count += 1
            said = run_block(axle, folder, kind, code)
            # Not the spaces at the ends of lines.
            said = "\n".join(line.rstrip() for line in said.rstrip().splitlines())
            if kind != "sh" and said != wanted.rstrip():
                faults.append(f"export.md: {code.strip()}\nsays:\n{said}\nnot:\n{wanted}")
        table = next(iter(sorted(Path(folder).glob("motors.csv/ikeya.*.csv"))))
        titles = table.read_text().splitlines()[0].split(",")
    # The formula for spreadsheets: the column of the time, and days from their first one to 1970.
    formula = re.search(r"`=([A-Z])2/86400\+(\d+)`", page)
    if not formula or titles[ord(formula[1]) - ord("A")] != "t" or (
            datetime.date(1899, 12, 30) + datetime.timedelta(int(formula[2])) != datetime.date(1970, 1, 1)):
        faults.append(f"export.md: {formula and formula[0]} is not the time")
    if count < 6:
        faults.append(f"export.md: only {count} snippets")
    return faults


def run_block(axle, folder, kind, code):
    if kind == "sh":
        said = ""
        for line in code.strip().splitlines():
            words = [str(ROOT / it) if it.startswith("examples/") else it for it in line.split("#")[0].split()]
            run = subprocess.run([axle, *words[1:]], cwd=folder, capture_output=True, text=True)
            if run.returncode:
                sys.exit(f"export.md: {line}: {run.stderr}")
            said += run.stdout
        return said
    if kind == "sql":
        code = f"import duckdb\nprint(duckdb.sql({code!r}))\n"
    run = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)
    return run.stdout + run.stderr


if __name__ == "__main__":
    sys.exit(main())
