"""What the readers for Dask, Ray and Spark share: which files there are, and the rows in them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import fsspec
import pyarrow as pa

import axlewire

Path = str | os.PathLike[str]
Paths = Path | Sequence[Path]

# What a folder may hold besides captures is not looked at.
EXTENSIONS = (".pcapng", ".pcap", ".pcapng.gz", ".pcap.gz")

# A pcapng file that ends behind its first block. All its tables are empty.
NO_PACKETS = bytes.fromhex("0a0d0d0a 1c000000 4d3c2b1a 01000000 ffffffffffffffff 1c000000")

# `read` does not know the name of a file that fsspec opened. What it warns of is told by `rows`,
# with the name, and would be told twice.
warnings.filterwarnings("ignore", category=UserWarning, module=r"axlewire\._files$")


def find(paths: Paths, storage_options: Mapping[str, Any] | None = None) -> list[str]:
    """The captures that a path, a glob, a folder or several of these name, each once.

    A folder stands for the captures in it and in the folders below. What begins with something
    like `s3://` is opened by fsspec, and the options are for it. A path that names nothing
    raises FileNotFoundError.
    """
    found: dict[str, None] = {}
    for path in [paths] if isinstance(paths, (str, os.PathLike)) else paths:
        files, name = fsspec.core.url_to_fs(os.fspath(path), **(storage_options or {}))
        if files.isfile(name):
            names = [name]
        elif files.isdir(name):
            names = [it for it in files.find(name) if it.lower().endswith(EXTENSIONS)]
        else:
            names = [it for it in files.glob(name) if files.isfile(it)]
        if not names:
            raise FileNotFoundError(f"{os.fspath(path)!r} names no captures")
        local = "file" in files.protocol
        found.update((it if local else files.unstrip_protocol(it), None) for it in sorted(names))
    return list(found)


def in_groups(files: Sequence[str], files_per_partition: int) -> list[list[str]]:
    """The files, so many together."""
    if files_per_partition < 1:
        raise ValueError("files_per_partition is 1 or more")
    starts = range(0, len(files), files_per_partition)
    return [list(files[start : start + files_per_partition]) for start in starts]


class Wanted(NamedTuple):
    """Which rows of a capture are wanted, and their columns. It can be sent to other processes."""

    table: str
    protocol: str | None
    units: str | None
    storage_options: Mapping[str, Any]
    schema: pa.Schema


def wanted(
    message: str,
    protocol: str | None = None,
    units: str | None = None,
    storage_options: Mapping[str, Any] | None = None,
) -> Wanted:
    """Checks the arguments, before any worker has begun.

    Names are plain text, every column may be null, and the last column is `path`. A capture of
    raw bytes has no times: its `t`, `interface` and `direction` are null.
    """
    nothing = axlewire.read(NO_PACKETS, protocol=protocol, units=units)
    table = nothing[_one_table(nothing, message, protocol)]
    fields = [_plain(field) for field in pa.schema(table)]
    schema = pa.schema([*fields, pa.field("path", pa.string())], pa.schema(table).metadata)
    return Wanted(table.name, protocol, units, dict(storage_options or {}), schema)


def _one_table(nothing: axlewire.Capture, message: str, protocol: str | None) -> str:
    """The table of a message. All files must give the same columns, so it can only be one."""
    spelt = (protocol or "").replace("-", "")
    names: list[str] = []
    for of in ("ucp", "ikeya", "ikeya-3"):
        try:
            name = nothing[f"{of}.{message}"].name
        except KeyError:
            continue
        if not spelt or of.replace("-", "") == spelt:
            names.append(name)
    if len(names) > 1:
        raise ValueError(f"message {message!r} is one of {names}: say which")
    return names[0] if names else message


def _plain(field: pa.Field) -> pa.Field:
    type_ = pa.string() if pa.types.is_dictionary(field.type) else field.type
    return pa.field(field.name, type_, True, field.metadata)


def _warn(line: str) -> None:
    warnings.warn(line, UserWarning, stacklevel=3)


def rows(file: str, of: Wanted, tell: Callable[[str], None] = _warn) -> pa.Table:
    """The rows of one file.

    A damaged file gives what could be read of it, one that is no capture gives no rows; both are
    told. A file that cannot be opened raises OSError, so that the engine tries again.
    """
    try:
        if "://" in file:
            with fsspec.open(file, "rb", **of.storage_options) as opened:
                capture = axlewire.read(opened, protocol=of.protocol, units=of.units)
        else:
            capture = axlewire.read(file, protocol=of.protocol, units=of.units)
    except ValueError as error:
        tell(f'"{file}" is left out: {error}')
        return of.schema.empty_table()
    cut = capture.summary["cut"]
    if isinstance(cut, str):
        tell(cut.replace("the capture", f'"{file}"', 1))
    table = pa.table(capture[of.table])
    columns = {name: table[name] for name in table.column_names}
    columns["path"] = pa.repeat(pa.scalar(file, pa.string()), table.num_rows)
    nulls = pa.nulls(table.num_rows)
    arrays = [columns.get(field.name, nulls).cast(field.type) for field in of.schema]
    return pa.Table.from_arrays(arrays, schema=of.schema)
