"""Captures as a Ray Dataset: `pip install axlewire[ray]`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

try:
    import pyarrow as pa
    import ray.data

    from axlewire import _files
except ImportError as error:
    line = f"axlewire.ray needs Ray ({error}): pip install axlewire[ray]"
    raise ImportError(line) from error


def read_captures(
    paths: _files.Paths,
    *,
    message: str,
    protocol: str | None = None,
    units: str | None = None,
    files_per_partition: int = 1,
    storage_options: Mapping[str, Any] | None = None,
    ray_remote_args: Mapping[str, Any] | None = None,
) -> ray.data.Dataset:
    """The rows of one message in many captures, as a lazy Dataset.

    `paths` is a file, a glob, a folder, or a list of these; URLs such as `s3://...` too, which
    fsspec opens with `storage_options`. `message`, `protocol` and `units` are those of
    `axlewire.read`. A task reads so many files; if these are small, take more of them, so that a
    task is some seconds of work. `ray_remote_args` are those of Ray's own readers, such as
    `{"num_cpus": 2}`.

    The columns have the types of Arrow, and `path` says which file a row is from. A damaged file
    gives what could be read of it and a UserWarning, which Ray shows among the lines of its
    workers.
    """
    of = _files.wanted(message, protocol, units, storage_options)
    files = _files.find(paths, storage_options)
    tasks = len(_files.in_groups(files, files_per_partition))

    def read(batch: pa.Table) -> Iterator[pa.Table]:
        for file in batch["path"].to_pylist():
            yield _files.rows(file, of)

    listed = ray.data.from_items([{"path": file} for file in files], override_num_blocks=tasks)
    return listed.map_batches(
        read, batch_size=None, batch_format="pyarrow", **(ray_remote_args or {})
    )
