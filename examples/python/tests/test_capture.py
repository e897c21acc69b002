"""Captures: the values of `axle decode --json`, as columns."""

import collections
import datetime
import gc
import gzip
import io
import json
import math
import os
import random
import signal
import struct
import subprocess
import sys
import time
import xml.etree.ElementTree
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import axlewire
import duckdb
import nanoarrow
import pandas
import polars
import pyarrow
import pytest
from axlewire import ikeya, ucp

REPO = Path(__file__).resolve().parents[3]
DRIVE = REPO / "examples/captures/drive.pcapng"
MOTORS = REPO / "examples/captures/motors.pcapng"
PROTOCOLS = ["ucp", "ikeya", "ikeya-3"]
EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
MICROSECOND = datetime.timedelta(microseconds=1)




def vectors(protocol):
    kind = {"ucp": "ucp", "ikeya": "ikeya-md", "ikeya-3": "ikeya-md-3motor"}[protocol]
    files = sorted((REPO / "tests/vectors").glob("*.jsonl"))
    rows = [json.loads(line) for file in files for line in file.read_text().splitlines()]
    return [bytes.fromhex(row["hex"]) for row in rows if row["protocol"] == kind]


def noise(protocol, pieces=4000):
    """Random bytes, and frames: whole, cut, damaged, with any values."""
    chance, known, all_bytes = random.Random(f"{protocol} 34"), vectors(protocol), b""
    heads = [b"\x55", b"\x56", b"\xaa", b"\xbb", b"\xfd\xff\x28\x00\x05", b"\xfd\xff\x04\x00"]
    for _ in range(pieces):
        frame, at = chance.choice(known), chance.randrange(40)
        body = {"ucp": frame[:5] + chance.randbytes(max(len(frame) - 7, 0)),
                "ikeya": frame[:2] + chance.randbytes(4),
                "ikeya-3": frame[:2] + chance.randbytes(12)}[protocol]
        bits = chance.choice([b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", b"\x01\0\0\0"])
        special = b"\x55\x03" + bits * (3 if protocol == "ikeya-3" else 1)
        any_values = [it + struct.pack("<H", axlewire.crc16(it)) for it in (body, special)]
        any_id = b"\xfd\xff\x06\0" + chance.randbytes(4)
        any_values.append(any_id + struct.pack("<H", axlewire.crc16(any_id)))
        damaged = frame[:at] + chance.randbytes(1) + frame[at + 1 :]
        junk = [chance.choice(heads), chance.randbytes(at)]
        all_bytes += chance.choice([frame, frame, frame[:at], damaged, *any_values, *junk])
    return all_bytes


def said(data, protocol, folder):
    """The lines of the tool, by table; each value in its column."""
    path = data if isinstance(data, Path) else Path(folder, "said")
    if path is not data:
        path.write_bytes(data)
    command = [sys.executable, "-m", "axlewire", "decode", "--json", "-P", protocol, str(path)]
    told = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    tables, summary, frames = collections.defaultdict(list), None, []
    for line in map(json.loads, told.stdout.splitlines()):
        event, row = line.pop("event"), {}
        if event == "summary":
            summary = line
            continue
        name = f"{line['protocol']}.{line['message']}" if event == "frame" else "skipped"
        for key, value in line.items():
            if isinstance(value, list):
                row |= {f"{key}_{at}": it for at, it in enumerate(value)}
            elif isinstance(value, dict):
                row |= {f"{key}_{inner}": it for inner, it in value.items()}
            else:
                row[key] = value
        frames += [row] if event == "frame" else []
        tables[name].append(row)
    return tables, frames, summary


def same(column, ours, theirs):
    """Whether both say the same."""
    if theirs is None or ours is None:
        return theirs is ours
    if column == "t":
        return (ours - EPOCH) // MICROSECOND == round(theirs * 1e6)
    if isinstance(ours, bytes):
        return ours == bytes.fromhex(theirs)
    if isinstance(ours, float):
        theirs = struct.unpack("<f", struct.pack("<f", float(theirs)))[0]
        return ours == theirs or (math.isnan(ours) and math.isnan(theirs))
    return type(ours) is type(theirs) and ours == theirs


def check(capture, told):
    tables, frames, summary = told
    assert set(capture) == set(tables) and len(capture) == len(tables)
    for name, lines in tables.items():
        table = capture[name]
        names = table.column_names
        listed = [dict(zip(names, row)) for row in zip(*(table[name] for name in names))]
        for ours in (pyarrow.table(table).to_pylist(), listed):
            for row, line in zip(ours, lines, strict=True):
                assert line.keys() - {"protocol", "message"} <= row.keys()
                for column, value in row.items():
                    assert same(column, value, line.get(column)), (name, column, value, line)
    for row, line in zip(pyarrow.table(capture.frames).to_pylist(), frames, strict=True):
        for column in row.keys() - {"number"}:
            assert same(column, row[column], line.get(column)), (row, line)
    for key in ["received", "framed", "skipped", "frames"]:
        assert capture.summary[key] == summary[key]


@pytest.mark.parametrize("path,protocol", [(DRIVE, "ucp"), (MOTORS, "ikeya")])
def test_a_recording_says_what_the_tool_says(path, protocol, tmp_path):
    check(axlewire.read(path), said(path, protocol, tmp_path))


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("kind", ["vectors", "noise"])
def test_raw_bytes_say_what_the_tool_says(protocol, kind, tmp_path):
    data = noise(protocol) if kind == "noise" else b"".join(vectors(protocol))
    capture = axlewire.read(data, protocol=protocol)
    assert capture.summary["frames"] >= len(vectors(protocol)) * 0.8 > 10
    check(capture, said(data, protocol, tmp_path))


def rows(capture):
    return {name: pyarrow.table(capture[name]).to_pylist() for name in [*capture, "skipped"]}


def test_every_source_gives_the_same(tmp_path):
    data, packed = DRIVE.read_bytes(), tmp_path / "drive.pcapng.gz"
    packed.write_bytes(gzip.compress(data))
    expected = rows(axlewire.read(DRIVE))
    sources = [str(DRIVE), [DRIVE], (str(DRIVE),), data, bytearray(data), memoryview(data)]
    sources += [io.BytesIO(data), packed, packed.read_bytes(), memoryview(data * 2)[: len(data)]]
    with open(DRIVE, "rb") as file, open(DRIVE, "rb", 0) as raw, gzip.open(packed) as unpacked:
        for source in [*sources, file, raw, unpacked]:
            assert rows(axlewire.read(source)) == expected, type(source)


def test_five_libraries_take_a_table_without_a_copy():
    report = axlewire.read(DRIVE)["report"]
    heading, number = report["heading"], report.column_names.index("heading")
    arrow = [pyarrow.table(report)["heading"].chunk(0).buffers()[1].address for _ in "ab"]
    frames = [polars.DataFrame(report)["heading"] for _ in "ab"]
    views = [it.to_numpy(allow_copy=False).__array_interface__["data"][0] for it in frames]
    nano = [nanoarrow.ArrayStream(report).read_all() for _ in "ab"]
    nano = [next(it.child(number).iter_chunks()).buffers[1]._addr() for it in nano]
    assert {*arrow, *nano, *views} == {arrow[0]}
    assert pyarrow.table(report)["heading"].to_pylist() == heading == frames[0].to_list()
    assert pandas.DataFrame.from_arrow(report)["heading"].tolist() == heading
    assert nanoarrow.Array(report).child(number).to_pylist() == heading
    found = duckdb.sql("SELECT heading, rpm_3, epoch_us(t) FROM report").fetchall()
    times = [(it - EPOCH) // MICROSECOND for it in report["t"]]
    assert found == list(zip(heading, report["rpm_3"], times))


def test_columns_have_units_meanings_and_sources():
    table = axlewire.read(DRIVE)["report"]
    fields = {field.name: field.metadata or {} for field in pyarrow.table(table).schema}
    assert fields["voltage_dv"][b"unit"] == b"0.1 V" and fields["acc_0"][b"unit"] == b"1/16384 g"
    for name, told in fields.items():
        assert name in ("t", "interface", "direction") or told[b"meaning"] and told[b"source"]
        for key, value in table.columns[name].items():
            assert value == told.get(key.encode(), b"").decode()


def test_si_columns_stand_beside_the_raw_ones():
    table = axlewire.read(DRIVE, units="si")["report"]
    factors = dict(voltage_dv=0.1, current_ca=0.01, power_w=1, battery_pct=0.01)
    factors |= dict(heading=math.pi / 180, rpm_0=math.tau / 60, gyro_2=math.pi / 180 / 16.4)
    for name, factor in (factors | dict(acc_2=9.80665 / 16384)).items():
        assert table[f"{name}_si"] == pytest.approx([it * factor for it in table[name]])
    assert [table.columns[f"{it}_si"]["unit"] for it in ("acc_2", "rpm_0")] == ["m/s²", "rad/s"]
    assert not any(it.endswith("_si") for it in axlewire.read(DRIVE)["report"].column_names)


@pytest.mark.parametrize("units", [None, "si"])
def test_scan_gives_what_read_gives(units):
    data = noise("ucp") + ucp.report(heading=5) * 100_000
    capture, found = axlewire.read(data, protocol="ucp", units=units), collections.defaultdict(list)
    for table in axlewire.scan(data, protocol="ucp", units=units):
        found[table.name].append(pyarrow.table(table))
    assert found.keys() == set(capture) and max(len(it) for it in found.values()) > 1
    for name, tables in found.items():
        assert pyarrow.concat_tables(tables).equals(pyarrow.table(capture[name]))
        scan = axlewire.scan(data, protocol="ucp", message=name, units=units)
        assert pyarrow.table(scan).equals(pyarrow.table(capture[name]))
    scan = axlewire.scan(io.BytesIO(data), protocol="ucp", message="report")
    assert duckdb.sql("SELECT count(*) FROM scan").fetchall() == [(len(capture["report"]),)]
    with pytest.raises(ValueError, match="message="):
        pyarrow.table(axlewire.scan(data, protocol="ucp"))


def python(code, *arguments, **options):
    command = [sys.executable, "-X", "faulthandler", "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            **options)


@pytest.fixture(scope="module")
def long_capture(tmp_path_factory):
    path, part = tmp_path_factory.mktemp("long") / "long.bin", ucp.report(rpm=[1, 2, 3, 4]) * 5000
    with open(path, "wb") as file:
        for _ in range(1000):
            file.write(part)
    path.with_suffix(".bin.gz").write_bytes(gzip.compress(part) * 1000)
    yield path
    path.unlink()


def test_scan_takes_constant_memory(long_capture):
    code = """import axlewire, sys
def peak(): return int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
before = peak()
print(sum(len(it) for it in axlewire.scan(sys.argv[1], protocol="ucp")), peak() - before)"""
    out, err = python(code, long_capture).communicate(timeout=60)
    rows, grown = map(int, out.split())
    assert rows == 5_000_000 and grown < 80_000, (grown, err)


@pytest.mark.parametrize("call", [
    "axlewire.read(path, protocol='ucp')",
    "axlewire.read(open(path, 'rb'), protocol='ucp')",
    "axlewire.read(gzip.open(path + '.gz'), protocol='ucp')",
    "for table in axlewire.scan(path, protocol='ucp'): len(table)",
    "pyarrow.table(axlewire.scan(path, protocol='ucp', message='pong'))",
])
def test_ctrl_c_ends_a_long_read_quickly(call, long_capture):
    code = f"""import axlewire, gzip, pyarrow, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
path = sys.argv[1]
print("begins", flush=True)
try:
    {call}
except KeyboardInterrupt: print(time.monotonic())"""
    child = python(code, long_capture)
    assert child.stdout.readline() == "begins\n"
    time.sleep(0.05)
    sent = time.monotonic()
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=60)
    assert out, err or "it was not interrupted"
    print(f"Ctrl-C in {call}: {(float(out) - sent) * 1e3:.0f} ms")
    assert float(out) - sent < 0.5


class Fails(io.BytesIO):
    def read(self, size=-1):
        if self.tell() >= 4400:
            raise self.error
        return super().read(400)


@pytest.mark.filterwarnings("ignore:cannot read")
@pytest.mark.parametrize("error", [KeyboardInterrupt("it"), ZeroDivisionError("it")])
def test_what_a_file_raises_is_raised(error):
    file = Fails(ucp.report() * 1000)
    file.error = error
    with pytest.raises(type(error)):
        axlewire.read(file, protocol="ucp")


def test_a_cut_capture_warns_and_loses_nothing_intact(tmp_path):
    data, whole = DRIVE.read_bytes(), axlewire.read(DRIVE).frames["bytes"]
    for cut in (len(data) - 1, len(data) // 2, 1010):
        with pytest.warns(UserWarning) as warned:
            capture = axlewire.read(data[:cut])
        frames = capture.frames["bytes"]
        assert frames == whole[: len(frames)] and capture.summary["cut"] == str(warned[0].message)
        assert len(frames) > len(whole) * (cut / len(data)) * 0.9 - 5
        with pytest.warns(UserWarning):
            assert sum(map(len, axlewire.scan(data[:cut], message="ping"))) == len(capture["ping"])
    with pytest.warns(UserWarning):
        assert axlewire.read(gzip.compress(data)[:-9]).frames["bytes"] == whole


def test_damaged_bytes_cost_only_the_frames_they_hit():
    frames = [ucp.report(index=at % 256, heading=at) for at in range(360)]
    data = bytearray(b"".join(frames))
    for at in range(100, len(data), 1000):
        data[at] ^= 0x55
    hit = {at // 44 for at in range(100, len(data), 1000)}
    kept = [it for at, it in enumerate(frames) if at not in hit]
    capture = axlewire.read(data, protocol="ucp")
    assert capture.frames["bytes"] == kept and sum(capture.gaps["length"]) == 44 * len(hit)


def test_empty_foreign_and_missing_files_are_told(tmp_path):
    for empty in (b"", io.BytesIO()):
        capture = axlewire.read(empty, protocol="ucp")
        assert capture.summary["received"] == len(capture) == len(capture["report"]) == 0
    wrong = [(b"hello world" * 9, ValueError), (tmp_path, ValueError), (5, TypeError)]
    wrong += [([], ValueError), (None, TypeError), (tmp_path / "none", OSError)]
    for take in (axlewire.read, axlewire.scan):
        for source, error in wrong:
            with pytest.raises(error):
                take(source)
    with pytest.raises(OSError, match="rb"), open(__file__) as file:
        axlewire.read(file)


def test_a_missing_file_is_file_not_found(tmp_path):
    pytest.raises(FileNotFoundError, axlewire.read, tmp_path / "none")


def test_unknown_names_are_told_with_the_known_ones():
    capture = axlewire.read(DRIVE)
    assert "report" in capture and "ucp.report" in capture
    assert "nonsense" not in capture and "ota_ack" not in capture and len(capture["ota_ack"]) == 0
    with pytest.raises(KeyError, match="nonsense.*ucp.report"):
        capture["nonsense"]
    with pytest.raises(KeyError, match="nonsense.*battery_pct"):
        capture["report"]["nonsense"]
    with pytest.raises(KeyError, match="nonsense.*ucp.report"):
        axlewire.scan(DRIVE, message="nonsense")
    for options in (dict(protocol="nonsense"), dict(units="nonsense")):
        with pytest.raises(ValueError, match="nonsense"):
            axlewire.read(DRIVE, **options)


def test_eight_threads_read_at_once():
    expected = str(rows(axlewire.read(MOTORS)))
    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda _: str(rows(axlewire.read(MOTORS))), range(16)))
    assert all(it == expected for it in found)
    scan, seen = axlewire.scan(noise("ucp", 20000), protocol="ucp", message="report"), []
    with ThreadPoolExecutor(8) as threads:
        for _ in range(8):
            threads.submit(lambda: seen.extend(row for it in scan for row in it["offset"]))
    assert sorted(seen) == axlewire.read(noise("ucp", 20000), protocol="ucp")["report"]["offset"]


def test_plot_gives_svg(tmp_path):
    for source in (DRIVE, str(DRIVE), [DRIVE], DRIVE.read_bytes(), bytearray(DRIVE.read_bytes())):
        picture = axlewire.read(source).plot()
        assert xml.etree.ElementTree.fromstring(picture._repr_svg_()).tag.endswith("}svg")
    picture.save(tmp_path / "drive.svg")
    assert (tmp_path / "drive.svg").read_text(encoding="utf-8") == picture.svg
    with pytest.raises(ValueError, match="open file"):
        axlewire.read(io.BytesIO(DRIVE.read_bytes())).plot()


def test_html_and_repr_tell_what_is_in_it(tmp_path):
    path = tmp_path / "<b onload='x'>&amp;.pcapng"
    path.write_bytes(DRIVE.read_bytes())
    html = axlewire.read(path)._repr_html_()
    assert "<b onload" not in html and "&lt;b onload" in html and "5 gaps" in html
    assert xml.etree.ElementTree.fromstring(f"<p>{html}</p>") is not None
    capture = axlewire.read(DRIVE.read_bytes())
    told = repr(capture) + repr(capture["report"]) + repr(axlewire.scan(DRIVE, message="report"))
    assert "1247 frames, 350 bytes skipped" in told and "ucp.report: 849 rows of offset" in told


def test_a_repr_is_short():
    capture = axlewire.read(bytearray(DRIVE.read_bytes()))
    assert len(repr(capture)) < 1000 and len(capture._repr_html_()) < 2000


def test_a_table_outlives_its_capture():
    expected = axlewire.read(DRIVE)["report"]["heading"]
    table = axlewire.read(DRIVE)["report"]
    arrow, frame = pyarrow.table(table), polars.DataFrame(table)
    del table
    gc.collect()
    junk = [bytearray(200_000) for _ in range(50)]
    assert arrow["heading"].to_pylist() == frame["heading"].to_list() == expected and junk


def test_what_a_file_raises_ends_a_stream_of_arrow_too():
    class Broken(io.BytesIO):
        def read(self, size=-1):
            if self.tell() > 1_000_000:
                raise ZeroDivisionError("broken")
            return super().read(size)

    data = axlewire.ucp.report(rpm=[1, 2, 3, 4]) * 60_000
    with pytest.raises(pyarrow.ArrowInvalid, match="broken"):
        pyarrow.table(axlewire.scan(Broken(data), protocol="ucp", message="report"))
    scan = axlewire.scan(Broken(data), protocol="ucp")
    with pytest.raises(ZeroDivisionError):
        list(scan)
    assert next(scan, None) is None


def test_gaps_are_scanned_by_the_name_that_they_have_in_a_capture():
    data = b"noise" + axlewire.ucp.ping()
    assert pyarrow.table(axlewire.scan(data, protocol="ucp", message="gaps"))["length"].to_pylist() == [5]


def test_a_float_of_a_frame_is_the_number_of_the_json():
    (frame,) = axlewire.Decoder("ikeya").feed(axlewire.ikeya.velocity(1, 0.1))
    assert repr(frame.fields).count("0.1,") or repr(frame.fields).endswith("0.1}")


def test_an_impossible_time_is_a_warning_of_python(capfd):
    block = bytes.fromhex("0a0d0d0a1c0000004d3c2b1a01000000ffffffffffffffff1c000000")
    block += struct.pack("<IIHHII", 1, 20, 147, 0, 0, 20)
    ping = axlewire.ucp.ping()
    for high in (0, 0xFFFFFFFF):
        length = 32 + len(ping)
        block += struct.pack("<IIIIIII", 6, length, 0, high, 1, len(ping), len(ping)) + ping
        block += struct.pack("<I", length)
    with pytest.warns(UserWarning, match="impossible time"):
        axlewire.read(block)
    assert capfd.readouterr().err == ""
