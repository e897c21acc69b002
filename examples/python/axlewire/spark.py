"""Captures as a data source of Spark: `pip install axlewire[spark]`."""

from __future__ import annotations

import json
from collections.abc import Iterator

try:
    import pyarrow as pa
    from pyspark.sql import types
    from pyspark.sql.datasource import DataSource, DataSourceReader, InputPartition

    from axlewire import _files
except ImportError as error:
    line = f"axlewire.spark needs Spark 4 ({error}): pip install axlewire[spark]"
    raise ImportError(line) from error

# Spark has no unsigned numbers: each is the next wider signed one there. Only an offset of eight
# bytes has no wider one, and no capture is that long.
_TYPES: dict[pa.DataType, tuple[pa.DataType, types.DataType]] = {
    pa.uint8(): (pa.int16(), types.ShortType()),
    pa.int8(): (pa.int8(), types.ByteType()),
    pa.uint16(): (pa.int32(), types.IntegerType()),
    pa.int16(): (pa.int16(), types.ShortType()),
    pa.uint32(): (pa.int64(), types.LongType()),
    pa.int32(): (pa.int32(), types.IntegerType()),
    pa.uint64(): (pa.int64(), types.LongType()),
    pa.float32(): (pa.float32(), types.FloatType()),
    pa.float64(): (pa.float64(), types.DoubleType()),
    pa.timestamp("us", "UTC"): (pa.timestamp("us", "UTC"), types.TimestampType()),
    pa.string(): (pa.string(), types.StringType()),
    pa.binary(): (pa.binary(), types.BinaryType()),
}


class CaptureDataSource(DataSource):
    """The rows of one message in many captures.

        spark.dataSource.register(axlewire.spark.CaptureDataSource)
        spark.read.format("axlewire").option("message", "report").load("captures")

    What is loaded is a file, a glob, a folder, or a list of these; URLs such as `s3://...` too,
    which fsspec opens with the option `storage_options`, an object of JSON. The options `message`,
    `protocol` and `units` are those of `axlewire.read`. A task reads `files_per_partition` files,
    1 if it is not given; if these are small, take more of them.

    The column `path` says which file a row is from. A damaged file gives what could be read of it
    and a UserWarning in the log of the executor.
    """

    @classmethod
    def name(cls) -> str:
        return "axlewire"

    def _wanted(self) -> _files.Wanted:
        if "message" not in self.options:
            raise ValueError('which rows? Say it, such as option("message", "report")')
        return _files.wanted(
            self.options["message"],
            self.options.get("protocol"),
            self.options.get("units"),
            json.loads(self.options.get("storage_options", "{}")),
        )

    def schema(self) -> types.StructType:
        fields = [(field.name, _TYPES[field.type][1]) for field in self._wanted().schema]
        return types.StructType([types.StructField(name, type_) for name, type_ in fields])

    def reader(self, schema: types.StructType) -> CaptureReader:
        # Spark has one path in "path", several in "paths".
        paths = json.loads(self.options.get("paths", "[]")) or self.options["path"]
        of = self._wanted()
        groups = _files.in_groups(
            _files.find(paths, of.storage_options), int(self.options.get("files_per_partition", 1))
        )
        return CaptureReader(of, groups)


class CaptureReader(DataSourceReader):
    """Reads groups of files, each in a task of its own."""

    def __init__(self, of: _files.Wanted, groups: list[list[str]]) -> None:
        self.of = of
        self.groups = groups
        self.types = pa.schema([(field.name, _TYPES[field.type][0]) for field in of.schema])

    def partitions(self) -> list[InputPartition]:
        return [InputPartition(group) for group in self.groups]

    def read(self, partition: InputPartition) -> Iterator[pa.RecordBatch]:
        for file in partition.value:
            yield from _files.rows(file, self.of).cast(self.types).to_batches()
