"""Logs in binary containers: Parquet, NPZ, HDF5, MCAP. Each gives the same table as a text."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError
from mopro.logs.log import MOST_ROWS, Decision, LogSource, Table

MOST_COLUMNS = 500
MOST_MESSAGE_BYTES = 1 << 20
_LATEST_NS = (1 << 63) - 1
# What the libraries raise for a file that is not what its name says.
_FAULTS = (
    EOFError, KeyError, OverflowError, RuntimeError, TypeError, ValueError, struct.error,
)  # fmt: skip


def read_parquet(path: Path, name: str) -> Table:
    """Columns of a Parquet file: numbers, words and time stamps."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            schema = file.schema_arrow
            _check(path, file.metadata.num_rows, len(schema.names))
            if len(set(schema.names)) < len(schema.names):
                raise ValueError("two columns have the same name")
            table = file.read()
        columns = {
            field.name: column
            for field in schema
            if (column := _arrow_column(table[field.name].combine_chunks(), field.type)) is not None
        }
    except (*_FAULTS, pa.ArrowException) as error:
        raise _refusal(path, error) from error
    return _table(path, name, columns)


def _arrow_column(column: Any, kind: Any) -> Any:
    """Numbers, stamps in ns or words; None for anything else."""
    import pyarrow as pa
    from pyarrow import types

    if types.is_timestamp(kind):
        stamps = column.cast(pa.timestamp("ns", kind.tz)).cast(pa.int64())
        return stamps.to_numpy(zero_copy_only=False)
    if types.is_integer(kind) or types.is_floating(kind):
        return _floats(column.to_numpy(zero_copy_only=False))
    if types.is_list(kind) or types.is_fixed_size_list(kind):
        return column
    if types.is_string(kind) or types.is_large_string(kind):
        column.validate(full=True)  # the words are UTF-8
        return column.cast(pa.string())
    return None


def read_npz(path: Path, name: str) -> Table:
    """Arrays of one length in an NPZ archive; what is no column of numbers is left out."""
    import zipfile

    from mopro.recording import npz

    arrays: dict[str, NDArray[Any]] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            for key, info in npz.members(archive).items():
                try:
                    rows = npz.rows_of(archive, info)
                except npz.NoColumn:
                    continue
                _check(path, rows, len(arrays) + 1)
                arrays[key] = npz.column_of(archive, info)
    except (*_FAULTS, zipfile.BadZipFile, zlib.error) as error:
        raise _refusal(path, error) from error
    return _table(path, name, _longest(arrays))


def read_hdf5(path: Path, name: str) -> Table:
    """One-dimensional data sets of one length in an HDF5 file, by their full names.

    The attribute `unit` or `units` of a data set is its unit.
    """
    import importlib.util

    from mopro.logs.hdf5 import arrays_of

    if importlib.util.find_spec("h5py") is None:
        raise _lacking(path, "HDF5", "h5py", "hdf5")
    with open(path, "rb"):
        pass  # what the system says of the file is told as for any other
    try:
        arrays, units = arrays_of(path, partial(_check, path))
    except _FAULTS as error:
        raise _refusal(path, error) from error
    return _table(path, name, _longest(arrays), units)


def read_mcap(path: Path, name: str) -> Table:
    """Numbers in the JSON messages of an MCAP file, a column for each topic and key.

    Messages of several topics are rows of their own, at their log times (`log_time_ns`).
    """
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError as error:
        raise _lacking(path, "MCAP", "mcap", "mcap") from error
    rows: dict[int, dict[str, float]] = {}
    foreign: set[str] = set()
    try:
        with open(path, "rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                if channel.message_encoding != "json" or len(message.data) > MOST_MESSAGE_BYTES:
                    foreign.add(f"{channel.topic} ({channel.message_encoding})")
                    continue
                numbers = dict(_numbers(channel.topic.strip("/"), json.loads(message.data)))
                if message.log_time > _LATEST_NS:
                    raise ValueError(f"a message of {message.log_time} ns")
                rows.setdefault(message.log_time, {}).update(numbers)
                _check(path, len(rows), 1)
    except (McapError, OSError, RecursionError, *_FAULTS) as error:
        raise _refusal(path, error) from error
    if not rows:
        found = f"; it has {', '.join(sorted(foreign)[:5])}" if foreign else ""
        if any(topic.endswith(("(cdr)", "(ros1)")) for topic in foreign):
            found += ": messages of ROS; export the topic as CSV, for example with ros2 topic echo"
        raise DataError(f"{path}: expected messages in JSON, found none{found}", "bad-data")
    names = dict.fromkeys(key for numbers in rows.values() for key in numbers)
    _check(path, len(rows), len(names))
    columns: dict[str, Any] = {"log_time_ns": np.array(list(rows), np.int64)}
    for key in names:
        columns[key] = np.array([numbers.get(key, np.nan) for numbers in rows.values()])
    skipped = [
        Decision(f"topic {topic}", "left out", "its messages are not JSON")
        for topic in sorted(foreign)
    ]
    return _table(path, name, columns, decisions=tuple(skipped))


def _numbers(prefix: str, value: object) -> Iterator[tuple[str, float]]:
    """Numbers of a message with their names: `topic.key.0`."""
    if isinstance(value, bool | int | float):
        yield prefix, float(value)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers(f"{prefix}.{key}", inner)
    elif isinstance(value, list):
        for index, inner in enumerate(value[:64]):
            yield from _numbers(f"{prefix}.{index}", inner)


def _longest(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The arrays of numbers that have the most frequent length."""
    usable = {k: a for k, a in arrays.items() if a.ndim == 1 and a.dtype.kind in "iuf"}
    lengths = [len(a) for a in usable.values()]
    length = max(set(lengths), key=lambda n: (lengths.count(n), n), default=0)
    return {k: _floats(a) for k, a in usable.items() if len(a) == length}


def _floats(values: NDArray[Any]) -> NDArray[Any]:
    """Floats, or 64-bit integers too long for them."""
    if values.dtype.kind in "iu" and len(values) and np.abs(values).max() >= 10**15:
        return values.astype(np.int64)
    return values.astype(float)


def _table(
    path: Path,
    name: str,
    columns: dict[str, Any],
    units: dict[str, str] | None = None,
    decisions: tuple[Decision, ...] = (),
) -> Table:
    if not columns:
        raise DataError(f"{path}: has no columns of numbers", "bad-data")
    for key, values in columns.items():
        if getattr(values, "dtype", None) == np.float64 and np.isinf(values).any():
            row = int(np.flatnonzero(np.isinf(values))[0]) + 1
            message = f"{path}: column {key}, row {row}: an infinite number"
            raise DataError(f"{message}; NaN stands for a missing reading", "not-a-number")
    return Table(LogSource(name, "", path=path, is_text=False), columns, units or {}, decisions)


def _check(path: Path, rows: int, columns: int) -> None:
    if rows > MOST_ROWS or columns > MOST_COLUMNS:
        bounds = f"at most {MOST_ROWS} rows of {MOST_COLUMNS} columns"
        raise DataError(f"{path}: {rows} rows of {columns} columns, expected {bounds}", "too-long")


def _refusal(path: Path, error: Exception) -> DataError:
    text = " ".join(str(error).split())[:200] or type(error).__name__
    return DataError(f"{path}: cannot be read as {path.suffix.lower()}: {text}", "bad-data")


def _lacking(path: Path, format_name: str, library: str, extra: str) -> DataError:
    message = f"{path}: {format_name} needs the library {library}: pip install 'mopro[{extra}]'"
    return DataError(message, "missing-library")


READERS: dict[str, Callable[[Path, str], Table]] = {
    ".parquet": read_parquet,
    ".npz": read_npz,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mcap": read_mcap,
}
