"""Captures in Dask, Ray and Spark: real engines, with two processes each."""

from __future__ import annotations

import gzip
import os
import random
import signal
import struct
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import axlewire

pytest.importorskip("fsspec")
pytest.importorskip("pyarrow")

import fsspec
import pyarrow as pa
import pyarrow.compute as pc

pytestmark = pytest.mark.engines

CAPTURES = 1_000
FILES_PER_PARTITION = 25
ENGINES = ("dask", "ray", "spark")
NUMBERS = ("battery_pct", "rpm_0", "acc_2", "heading", "current_ca", "offset")
SECONDS_AT_MOST = 120

# Workers are new processes. They need this package and, for `kill_once`, this file.
HERE = Path(__file__).resolve().parent
PYTHONPATH = os.pathsep.join([str(Path(axlewire.__file__).parent.parent), str(HERE)])


# --- Captures, written by hand


def block(kind: int, body: bytes) -> bytes:
    length = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + length + body + length


def option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def pcapng(frames: list[bytes], begin_us: int, link_type: int = 150) -> bytes:
    """A frame every 20 ms. 150 is UCP, 147 is Ikeya MD."""
    section = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    time_unit = option(9, bytes([6])) + option(0, b"")
    blocks = [section, block(1, struct.pack("<HHI", link_type, 0, 0) + time_unit)]
    for number, frame in enumerate(frames):
        high, low = divmod(begin_us + number * 20_000, 1 << 32)
        head = struct.pack("<IIIII", 0, high, low, len(frame), len(frame))
        flags = option(2, struct.pack("<I", 1)) + option(0, b"")
        blocks.append(block(6, head + frame + bytes(-len(frame) % 4) + flags))
    return b"".join(blocks)


def with_crc(frame: bytes) -> bytes:
    return frame + struct.pack("<H", axlewire.crc16(frame))


def report(index: int, chance: random.Random) -> bytes:
    rpm = [chance.randint(-200, 200) for _ in range(4)]
    sensors = [chance.randint(-20_000, 20_000) for _ in range(9)]
    values = [chance.randint(0, 100), *rpm, *sensors, chance.randint(0, 360)]
    values += [chance.randint(0, 90), chance.randint(90, 126), chance.randint(0, 900), 38]
    return with_crc(struct.pack("<HHBBH4h9hhBBHH", 0xFFFD, 40, 5, index % 256, *values))


def capture(number: int) -> bytes:
    """10 to 40 reports with other numbers in each capture; every tenth has a ping alone."""
    chance = random.Random(number)
    ping = with_crc(bytes.fromhex("fdff0400 01 00"))
    reports = [report(index, chance) for index in range(chance.randint(10, 40))]
    return pcapng([ping] if number % 10 == 0 else [ping, *reports], number * 60_000_000)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """1,000 captures, some of them compressed and in a folder below."""
    folder = tmp_path_factory.mktemp("captures")
    (folder / "below").mkdir()
    (folder / "notes.txt").write_text("no capture")
    for number in range(CAPTURES):
        if number % 7 == 0:
            name = folder / "below" / f"{number:04}.pcapng.gz"
            name.write_bytes(gzip.compress(capture(number), 1))
        else:
            (folder / f"{number:04}.pcapng").write_bytes(capture(number))
    return folder


@pytest.fixture
def few(tmp_path: Path) -> Path:
    """A good capture, one that ends too early, one without reports, and one that is none."""
    (tmp_path / "few").mkdir()
    for number in (0, 1, 2):
        (tmp_path / "few" / f"{number}.pcapng").write_bytes(capture(number))
    damaged = tmp_path / "few" / "damaged.pcapng"
    damaged.write_bytes(capture(3)[:-30])
    (tmp_path / "few" / "none.pcapng").write_bytes(b"no capture")
    return tmp_path / "few"


# --- What a single process finds in them


def read_alone(folder: Path) -> pa.Table:
    """The reports of all captures, read one by one in this process."""
    tables = []
    for file in sorted(it for it in folder.rglob("*.pcapng*") if it.name != "none.pcapng"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            table = pa.table(axlewire.read(file)["report"])
        path = pa.array([str(file)] * table.num_rows, pa.string())
        tables.append(table.append_column("path", path))
    return pa.concat_tables(tables)


def figures(table: pa.Table) -> dict[str, Any]:
    found: dict[str, Any] = {"rows": table.num_rows}
    found["files"] = len(table["path"].unique())
    for name in NUMBERS:
        found |= {f"{it}({name})": getattr(pc, it)(table[name]).as_py() for it in AGGREGATES}
    return found


AGGREGATES = ("sum", "min", "max")


@pytest.fixture(scope="module")
def alone(folder: Path) -> dict[str, Any]:
    found = figures(read_alone(folder))
    assert found["files"] == CAPTURES * 9 // 10 and found["rows"] > 20_000
    return found


# --- The engines


@pytest.fixture(autouse=True)
def deadline() -> Iterator[None]:
    """An engine that waits for ever fails its test."""

    def late(*_: object) -> None:
        raise TimeoutError(f"not done in {SECONDS_AT_MOST} seconds")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS_AT_MOST)
    yield
    signal.alarm(0)


@pytest.fixture(scope="module", autouse=True)
def workers_find_the_package() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", PYTHONPATH)
        patch.setenv("PYSPARK_PYTHON", sys.executable)
        yield


@pytest.fixture(scope="module")
def dask_client() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        yield client


@pytest.fixture(scope="module")
def ray_session() -> Iterator[Any]:
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=2, include_dashboard=False)
    ray.data.DataContext.get_current().enable_progress_bars = False
    yield ray
    ray.shutdown()


@pytest.fixture(scope="module")
def spark_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What Spark and its workers say."""
    return tmp_path_factory.mktemp("spark") / "log"


@pytest.fixture(scope="module")
def spark(spark_log: Path) -> Iterator[Any]:
    """Two workers; a task may fail three times, as on a cluster."""
    sql = pytest.importorskip("pyspark.sql")
    from axlewire.spark import CaptureDataSource

    builder = sql.SparkSession.builder.master("local[2,4]")
    for key, value in {
        "spark.ui.enabled": "false",
        "spark.driver.host": "127.0.0.1",
        "spark.sql.shuffle.partitions": "2",
    }.items():
        builder = builder.config(key, value)
    # Java takes over our standard error for good.
    ours = os.dup(2)
    with spark_log.open("wb") as log:
        os.dup2(log.fileno(), 2)
        session = builder.getOrCreate()
    os.dup2(ours, 2)
    os.close(ours)
    session.dataSource.register(CaptureDataSource)
    session.dataSource.register(killing_data_source())
    yield session
    session.stop()


def rows_of(engine: str, request: pytest.FixtureRequest, paths: Any, **options: Any) -> pa.Table:
    """All reports that an engine finds, with the types that it has for them."""
    if engine == "dask":
        request.getfixturevalue("dask_client")
        from axlewire.dask import read_captures as read_with_dask

        frame = read_with_dask(paths, message="report", **options).compute()
        return pa.Table.from_pandas(frame, preserve_index=False)
    if engine == "ray":
        ray = request.getfixturevalue("ray_session")
        from axlewire.ray import read_captures as read_with_ray

        data = read_with_ray(paths, message="report", **options)
        return pa.concat_tables(ray.get(data.to_arrow_refs()))
    reader = request.getfixturevalue("spark").read.format("axlewire").option("message", "report")
    return reader.options(**options).load(paths).toArrow()


def kill_once(flag: str) -> None:
    """Ends this process as if it had run out of memory, unless one has ended for this already."""
    try:
        with open(flag, "x") as file:
            file.write(str(os.getpid()))
    except FileExistsError:
        return
    os.kill(os.getpid(), signal.SIGKILL)


def assert_one_was_killed(flag: Path) -> None:
    assert int(flag.read_text()) != os.getpid()


def killing_data_source() -> type:
    """The data source of Spark, but a worker is killed in the middle of reading."""
    from axlewire.spark import CaptureDataSource, CaptureReader

    class KillingReader(CaptureReader):
        flag: str

        def read(self, partition: Any) -> Iterator[Any]:
            for batch in super().read(partition):
                yield batch
                if "0501" in batch["path"][0].as_py():
                    kill_once(self.flag)

    class KillingDataSource(CaptureDataSource):
        @classmethod
        def name(cls) -> str:
            return "axlewire_killing"

        def reader(self, schema: Any) -> CaptureReader:
            usual = super().reader(schema)
            reader = KillingReader(usual.of, usual.groups)
            reader.flag = self.options["flag"]
            return reader

    return KillingDataSource


# --- 1,000 captures


def dask_figures(frame: Any) -> dict[str, Any]:
    from dask.base import compute

    wanted = {"rows": frame["path"].count(), "files": frame["path"].nunique()}
    for name in NUMBERS:
        wanted |= {f"{it}({name})": getattr(frame[name], it)() for it in AGGREGATES}
    (found,) = compute(wanted)
    return {name: int(value) for name, value in found.items()}


def test_dask_finds_in_1000_captures_what_a_single_process_finds(
    folder: Path, alone: dict[str, Any], dask_client: Any
) -> None:
    from axlewire.dask import read_captures

    frame = read_captures(folder, message="report", files_per_partition=FILES_PER_PARTITION)
    assert frame.npartitions == CAPTURES // FILES_PER_PARTITION
    assert dask_figures(frame) == alone


def test_a_dask_worker_that_is_killed_loses_nothing(
    folder: Path, alone: dict[str, Any], dask_client: Any, tmp_path: Path
) -> None:
    from axlewire.dask import read_captures

    flag = str(tmp_path / "flag")

    def with_kill(rows: Any) -> Any:
        if rows["path"].str.contains("0501").any():
            kill_once(flag)
        return rows

    frame = read_captures(folder, message="report", files_per_partition=FILES_PER_PARTITION)
    assert dask_figures(frame.map_partitions(with_kill, meta=frame._meta)) == alone
    assert_one_was_killed(Path(flag))


def ray_figures(data: Any) -> dict[str, Any]:
    from ray.data.aggregate import Count, CountDistinct, Max, Min, Sum

    of = {"sum": Sum, "min": Min, "max": Max}
    wanted = [of[it](name, alias_name=f"{it}({name})") for name in NUMBERS for it in AGGREGATES]
    files = CountDistinct("path", alias_name="files")
    found = data.aggregate(Count(alias_name="rows"), files, *wanted)
    return {name: int(value) for name, value in found.items()}


def test_ray_finds_in_1000_captures_what_a_single_process_finds(
    folder: Path, alone: dict[str, Any], ray_session: Any
) -> None:
    from axlewire.ray import read_captures

    data = read_captures(folder, message="report", files_per_partition=FILES_PER_PARTITION)
    assert ray_figures(data) == alone


def test_a_ray_worker_that_is_killed_loses_nothing(
    folder: Path, alone: dict[str, Any], ray_session: Any, tmp_path: Path
) -> None:
    from axlewire.ray import read_captures

    flag = str(tmp_path / "flag")

    def with_kill(batch: Any) -> Any:
        if any("0501" in path for path in batch["path"].to_pylist()):
            kill_once(flag)
        return batch

    data = read_captures(folder, message="report", files_per_partition=FILES_PER_PARTITION)
    data = data.map_batches(with_kill, batch_format="pyarrow", batch_size=None)
    assert ray_figures(data) == alone
    assert_one_was_killed(Path(flag))


def spark_figures(reader: Any, folder: Path) -> dict[str, Any]:
    from pyspark.sql import functions

    wanted = [functions.count("path").alias("rows")]
    wanted.append(functions.count_distinct("path").alias("files"))
    for name in NUMBERS:
        wanted += [getattr(functions, it)(name).alias(f"{it}({name})") for it in AGGREGATES]
    options = {"message": "report", "files_per_partition": FILES_PER_PARTITION}
    (row,) = reader.options(**options).load(str(folder)).agg(*wanted).collect()
    found: dict[str, Any] = row.asDict()
    return found


def test_spark_finds_in_1000_captures_what_a_single_process_finds(
    folder: Path, alone: dict[str, Any], spark: Any
) -> None:
    assert spark_figures(spark.read.format("axlewire"), folder) == alone


def test_a_spark_worker_that_is_killed_while_it_reads_loses_nothing(
    folder: Path, alone: dict[str, Any], spark: Any, tmp_path: Path
) -> None:
    reader = spark.read.format("axlewire_killing").option("flag", str(tmp_path / "flag"))
    assert spark_figures(reader, folder) == alone
    assert_one_was_killed(tmp_path / "flag")


# --- Damage


CUT = r'damaged\.pcapng": the file ends inside the pcapng block'
NONE = r'none\.pcapng" is left out: no frame of any protocol'


def assert_same_rows(found: pa.Table, few: Path) -> None:
    expected = read_alone(few)
    assert found.column_names == expected.column_names
    # Spark's numbers are wider, and names of Arrow's dictionaries are plain text in all three.
    order = [("path", "ascending"), ("offset", "ascending")]
    rows = found.sort_by(order).to_pylist()
    assert rows == expected.sort_by(order).to_pylist()
    assert any("damaged" in row["path"] for row in rows)


def test_a_damaged_file_gives_its_readable_rows_and_dask_tells_it(
    few: Path, request: pytest.FixtureRequest
) -> None:
    request.getfixturevalue("dask_client")
    with pytest.warns(UserWarning, match=CUT), pytest.warns(UserWarning, match=NONE):
        found = rows_of("dask", request, str(few))
        time.sleep(1)  # A warning of a worker comes on a way of its own.
    assert_same_rows(found, few)


def test_a_damaged_file_gives_its_readable_rows_and_ray_tells_it(
    few: Path, request: pytest.FixtureRequest, capfd: pytest.CaptureFixture[str]
) -> None:
    assert_same_rows(rows_of("ray", request, str(few)), few)
    said = ""
    while "damaged.pcapng" not in said or "none.pcapng" not in said:
        time.sleep(0.2)
        said += "".join(capfd.readouterr())
    assert "the file ends inside the pcapng block" in said and "is left out" in said


def test_a_damaged_file_gives_its_readable_rows_and_spark_tells_it(
    few: Path, request: pytest.FixtureRequest, spark_log: Path
) -> None:
    assert_same_rows(rows_of("spark", request, str(few)), few)
    while "is left out" not in (said := spark_log.read_text(errors="replace")):
        time.sleep(0.2)
    assert 'damaged.pcapng": the file ends inside the pcapng block' in said


# --- Names, paths and arguments


@pytest.mark.parametrize("engine", ENGINES)
def test_files_globs_and_units_are_the_same_for_all_engines(
    engine: str, few: Path, request: pytest.FixtureRequest
) -> None:
    paths = [str(few / "[1].pcapng"), f"file://{few}/2.pcapng", str(few / "1.pcapng")]
    found = rows_of(engine, request, paths, units="si", files_per_partition=2)
    captures = [axlewire.read(few / f"{it}.pcapng", units="si") for it in (1, 2)]
    expected = [pa.table(it["report"]) for it in captures]
    assert found.column_names == [*expected[0].column_names, "path"]
    assert found.num_rows == sum(table.num_rows for table in expected)
    sums = [sum(table["rpm_0_si"].to_pylist()) for table in expected]
    assert sum(found["rpm_0_si"].to_pylist()) == pytest.approx(sum(sums))
    assert set(found["path"].to_pylist()) == {str(few / "1.pcapng"), str(few / "2.pcapng")}


def test_a_url_is_opened_by_fsspec() -> None:
    from axlewire.dask import read_captures

    fsspec.filesystem("memory").pipe("/store/1.pcapng", capture(1))
    fsspec.filesystem("memory").pipe("/store/3.pcapng.gz", gzip.compress(capture(3)[:-30]))
    frame = read_captures("memory://store", message="report", files_per_partition=2)
    cut = r'"memory://\S*3\.pcapng\.gz": the file ends'
    with pytest.warns(UserWarning, match=cut):
        found = frame.compute(scheduler="synchronous")
    assert set(found["path"]) == {"memory:///store/1.pcapng", "memory:///store/3.pcapng.gz"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        alone = [len(axlewire.read(it)["report"]) for it in (capture(1), capture(3)[:-30])]
    assert len(found) == sum(alone)


def test_a_capture_of_raw_bytes_has_null_for_its_times(tmp_path: Path) -> None:
    from axlewire.dask import read_captures

    (tmp_path / "raw.bin").write_bytes(report(0, random.Random(0)))
    frame = read_captures(tmp_path / "raw.bin", message="report", protocol="ucp")
    rows = frame.compute(scheduler="synchronous")
    assert rows["length"].tolist() == [44] and rows["t"].isna().all()


def test_what_is_wrong_is_told_before_a_worker_begins(few: Path, tmp_path: Path) -> None:
    from axlewire.dask import read_captures

    with pytest.raises(FileNotFoundError, match="names no captures"):
        read_captures(tmp_path / "*.pcap", message="report")
    with pytest.raises(KeyError, match="no message 'foo'|no message \"foo\""):
        read_captures(few, message="foo")
    with pytest.raises(ValueError, match="units"):
        read_captures(few, message="report", units="imperial")
    with pytest.raises(ValueError, match="files_per_partition"):
        read_captures(few, message="report", files_per_partition=0)


def test_a_message_of_two_protocols_is_asked_for_with_its_protocol(few: Path) -> None:
    from axlewire.dask import read_captures

    with pytest.raises(ValueError, match="ikeya.velocity_response.*ikeya-3.*say which"):
        read_captures(few, message="velocity_response")
    assert "rps_2" in read_captures(few, message="ikeya-3.velocity_response").columns
    frame = read_captures(few, message="velocity_response", protocol="ikeya-3")
    assert "rps_2" in frame.columns


@pytest.mark.parametrize(("engine", "package"), [*zip(ENGINES, ("dask", "ray", "pyspark"))])
def test_an_engine_that_is_missing_is_told_with_the_name_of_the_extra(
    engine: str, package: str
) -> None:
    code = f"import sys; sys.modules[{package!r}] = None; import axlewire.{engine}"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.stderr.endswith(f"pip install axlewire[{engine}]\n")
