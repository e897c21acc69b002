"""Captures as a Dask DataFrame: `pip install axlewire[dask]`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

try:
    import dask.dataframe as dd
    import pandas as pd
    import pyarrow as pa

    from axlewire import _files
except ImportError as error:
    line = f"axlewire.dask needs Dask ({error}): pip install axlewire[dask]"
    raise ImportError(line) from error


def read_captures(
    paths: _files.Paths,
    *,
    message: str,
    protocol: str | None = None,
    units: str | None = None,
    files_per_partition: int = 1,
    storage_options: Mapping[str, Any] | None = None,
) -> dd.DataFrame:
    """The rows of one message in many captures, as a lazy DataFrame.

    `paths` is a file, a glob, a folder, or a list of these; URLs such as `s3://...` too, which
    fsspec opens with `storage_options`. `message`, `protocol` and `units` are those of
    `axlewire.read`. A partition has the rows of so many files; if these are small, take more of
    them, so that a partition is some seconds of work.

    The columns have the types of Arrow, and `path` says which file a row is from. A damaged file
    gives what could be read of it and a UserWarning, in the process of the client, too.
    """
    of = _files.wanted(message, protocol, units, storage_options)
    groups = _files.in_groups(_files.find(paths, storage_options), files_per_partition)
    meta = _frame(of.schema.empty_table())
    frame: dd.DataFrame = dd.from_map(_partition, groups, of=of, meta=meta, label="read-captures")
    return frame


def _partition(files: list[str], of: _files.Wanted, columns: list[str] | None = None) -> Any:
    """The rows of some files. Dask says which columns it needs, if it does not need all."""
    table = pa.concat_tables([_files.rows(file, of, _tell) for file in files])
    return _frame(table if columns is None else table.select(columns))


def _frame(table: pa.Table) -> pd.DataFrame:
    return table.to_pandas(types_mapper=pd.ArrowDtype)


def _tell(line: str) -> None:
    """Warns here and, if this is a worker of a cluster, in the process of the client."""
    try:
        from distributed import warn
    except ImportError:
        from warnings import warn
    warn(line, UserWarning)
