"""Reads recordings, within bounds that are checked before any memory is taken for the data.

The files may come from anywhere: nothing in them is executed (no pickles), no number that
they claim is believed before it is compared with a bound.
"""

from __future__ import annotations

import csv
import json
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from dataclasses import MISSING, fields
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError
from mopro.recording import npz
from mopro.recording.record import CSV_MARK, INTEGER_COLUMNS, KEY, Columns, Header, Recording
from mopro.recording.run import run_of

MOST_ROWS = 20_000_000
MOST_COLUMNS = 200
MOST_VALUES = 200_000_000
MOST_HEADER_BYTES = 1 << 20
_MOST_LINE = 1 << 16
# Before numpy 2, mopro 0.1.0 stored an option of the writer beside the columns.
_NO_COLUMNS = {KEY, "allow_pickle"}

# What the libraries raise for a file that is not what its name says: zipfile and pyarrow
# NotImplementedError for a compression that they do not know, json RecursionError for nesting,
# pyarrow subclasses of ValueError for the rest.
_FAULTS = (
    EOFError, NotImplementedError, RecursionError, ValueError, csv.Error, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip

Wanted = Collection[str] | None


def read(path: str | Path, wanted: Wanted = None) -> Recording:
    """The recording in file `path`, with the columns of `wanted` (all unless given).

    DataError if it is none, or beyond the bounds.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise DataError(f"{path}: expected one of {', '.join(_READERS)}", "unknown-format")
    try:
        header, found = reader(path, wanted)
        stated = json.loads(header)
        run = run_of(stated.pop("run")) if isinstance(stated, dict) and "run" in stated else None
        return Recording(_header(stated), _checked(found), run)
    except OSError as error:
        if error.errno is None:  # a library's, about the content
            raise _refusal(path, error) from error
        reason = error.strerror or str(error)
        raise DataError(f"{path}: cannot be read: {reason}", "unreadable") from error
    except MemoryError as error:
        raise _refusal(path, "it claims to need more memory than there is") from error
    except _FAULTS as error:
        raise _refusal(path, error) from error


def _header(stated: object) -> Header:
    known = {key.name: key for key in fields(Header)}
    needed = {name for name, key in known.items() if key.default is key.default_factory is MISSING}
    if not isinstance(stated, dict) or not needed <= stated.keys() <= known.keys():
        raise ValueError(f"its header is no object with the keys {', '.join(sorted(known))}")
    return Header(**stated)


def is_recording(path: Path) -> bool:
    """True if the file at `path` has the header of a recording, in the format of its suffix."""
    try:
        return _HEADERS[path.suffix.lower()](path)
    except (OSError, *_FAULTS):
        return False


def _has_parquet_header(path: Path) -> bool:
    import pyarrow.parquet as pq

    return KEY.encode() in (pq.read_schema(path).metadata or {})


def _has_csv_header(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(len(CSV_MARK)) == CSV_MARK.encode()


def _has_npz_header(path: Path) -> bool:
    with zipfile.ZipFile(path) as archive:
        return f"{KEY}.npy" in archive.namelist()


def _refusal(path: Path, reason: object) -> DataError:
    text = " ".join(str(reason).split())[:200] or type(reason).__name__
    return DataError(f"{path}: is no recording: {text}")


def _check_size(rows: int, columns: int, wanted: int) -> None:
    if not 0 < columns <= MOST_COLUMNS:
        raise ValueError(f"{columns} columns, expected 1 to {MOST_COLUMNS}")
    if rows <= 0:
        raise ValueError("it has no rows")
    if rows > MOST_ROWS or rows * wanted > MOST_VALUES:
        raise ValueError(
            f"{rows} rows of {wanted} columns, expected at most {MOST_ROWS} rows "
            f"and {MOST_VALUES} values"
        )


def _checked(columns: Columns) -> Columns:
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise ValueError(f"its columns have different lengths: {sorted(lengths)[:4]}")
    if "time_s" not in columns:
        raise ValueError("it has no column time_s")
    return columns


def _chosen(names: Collection[str], wanted: Wanted) -> list[str]:
    """The columns to read; time_s is always among them."""
    return [n for n in names if wanted is None or n in wanted or n == "time_s"]


def _header_in(data: bytes | None) -> str:
    if data is None:
        raise ValueError("it has no header of mopro")
    if len(data) > MOST_HEADER_BYTES:
        raise ValueError(f"its header has more than {MOST_HEADER_BYTES} bytes")
    return data.decode()


# -- Parquet -----------------------------------------------------------------------


def _read_parquet(path: Path, wanted: Wanted) -> tuple[str, Columns]:
    import pyarrow.parquet as pq
    from pyarrow import types

    with pq.ParquetFile(path) as file:
        schema, names = file.schema_arrow, file.schema_arrow.names
        chosen = _chosen(names, wanted)
        _check_size(file.metadata.num_rows, len(names), len(chosen))
        if len(set(names)) < len(names):
            raise ValueError("two columns have the same name")
        for name in chosen:
            kind = schema.field(name).type
            if not types.is_integer(kind) and not types.is_floating(kind):
                raise ValueError(f"column {name[:60]!r} has values of type {kind}, not numbers")
        header = _header_in((schema.metadata or {}).get(KEY.encode()))
        table = file.read(chosen)
    return header, {name: table[name].to_numpy() for name in chosen}


# -- CSV ---------------------------------------------------------------------------


def _read_csv(path: Path, wanted: Wanted) -> tuple[str, Columns]:
    with open(path, encoding="utf-8", newline="") as file:
        first = file.readline(MOST_HEADER_BYTES)
        if not first.startswith(CSV_MARK):
            raise ValueError(f"the first line does not begin with '{CSV_MARK.strip()}'")
        rows = csv.reader(_lines(file))
        names = next(rows, [])
        chosen = _chosen(names, wanted)
        _check_size(1, len(names), len(chosen))
        values = _columns_of(rows, names)
    columns = {name: _numbers(name, values[name]) for name in chosen}
    return first.removeprefix(CSV_MARK), columns


def _lines(file: TextIO) -> Iterator[str]:
    while line := file.readline(_MOST_LINE):
        if len(line) == _MOST_LINE:
            raise ValueError(f"a line of more than {_MOST_LINE - 1} characters")
        yield line


def _columns_of(rows: Iterator[list[str]], names: list[str]) -> dict[str, tuple[str, ...]]:
    most = min(MOST_ROWS, MOST_VALUES // len(names))
    held = list(islice(rows, most + 1))
    _check_size(len(held), len(names), len(names))
    if wrong := next((i for i, row in enumerate(held, start=3) if len(row) != len(names)), None):
        raise ValueError(f"line {wrong} has not {len(names)} cells")
    return dict(zip(names, zip(*held, strict=True), strict=True))


def _numbers(name: str, cells: tuple[str, ...]) -> NDArray[Any]:
    if name not in INTEGER_COLUMNS:
        return np.array(list(map(float, cells)), dtype=np.float64)
    whole = list(map(int, cells))
    least, most = np.iinfo(np.int32).min, np.iinfo(np.int32).max
    if not least <= min(whole) <= max(whole) <= most:
        raise ValueError(f"{name} has a number of more than 32 bits")
    return np.array(whole, dtype=np.int32)


# -- NPZ ---------------------------------------------------------------------------


def _read_npz(path: Path, wanted: Wanted) -> tuple[str, Columns]:
    with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
        held = npz.members(archive)
        names = [name for name in held if name not in _NO_COLUMNS]
        chosen = _chosen(names, wanted)
        if KEY not in held:
            raise ValueError("it has no header of mopro")
        rows = [npz.rows_of(archive, held[name]) for name in chosen]
        _check_size(max(rows, default=0), len(names), len(chosen))
        if npz.rows_of(archive, held[KEY]) > MOST_HEADER_BYTES:
            raise ValueError(f"its header has more than {MOST_HEADER_BYTES} bytes")
        header = _header_in(npz.column_of(archive, held[KEY]).tobytes())
        return header, {name: npz.column_of(archive, held[name]) for name in chosen}


_READERS: dict[str, Callable[[Path, Wanted], tuple[str, Columns]]] = {
    ".parquet": _read_parquet,
    ".csv": _read_csv,
    ".npz": _read_npz,
}
_HEADERS: dict[str, Callable[[Path], bool]] = {
    ".parquet": _has_parquet_header,
    ".csv": _has_csv_header,
    ".npz": _has_npz_header,
}
