"""Results of a sweep: rows kept as they come, and the table that they become.

Beside the file that is asked for, `OUT.rows` grows by lines of JSON, each with a checksum and on
the disk before more work is asked for. It becomes the file when all rows are there. Rows know
their task's name, and so the sweep that they are of.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from mopro.errors import DataError
from mopro.files import flush_folder, locked, output
from mopro.sweeps.figures import Figures
from mopro.sweeps.tasks import Row, Subject, Task
from mopro.sweeps.varied import Varied

if TYPE_CHECKING:
    import pyarrow as pa

PARQUET, CSV = SUFFIXES = (".parquet", ".csv")
# Bytes of a row on the disk; none that is written has as many.
MOST_ROW_BYTES = 4096
_AGAIN = "choose another name for the results (--out), or remove it"
_OTHER = "other-results"


def rows_file(out: Path) -> Path:
    """The file that holds the rows until all are there."""
    return out.with_name(out.name + ".rows")


class Journal:
    """The rows that are there, by point; `add` keeps more of them."""

    def __init__(self, tasks: Sequence[Task], width: int, file: BinaryIO | None = None) -> None:
        self.rows: dict[int, Row] = {}
        self._tasks = tasks
        self._width = width
        self._file = file

    def add(self, rows: Iterable[Row]) -> None:
        """Keep those of `rows` that are not there yet, on the disk before this ends."""
        new = {row[0]: row for row in rows if row[0] not in self.rows}
        if self._file is not None:
            self._file.write(b"".join(map(_line, new.values())))
            self._file.flush()
            os.fsync(self._file.fileno())
        self.rows |= new

    def read(self) -> None:
        """Take in the rows of the file, up to one that is not whole; DataError for others."""
        file = self._file
        assert file is not None
        if os.fstat(file.fileno()).st_size > MOST_ROW_BYTES * (len(self._tasks) + 1):
            raise DataError(f"{file.name} is longer than these results can be; {_AGAIN}", _OTHER)
        file.seek(0)
        end = 0
        while (row := _row(file.readline(MOST_ROW_BYTES))) is not None:
            self._check(row)
            self.rows.setdefault(row[0], row)
            end = file.tell()
        file.seek(end)
        file.truncate()

    def _check(self, row: Row) -> None:
        known = len(row) == self._width and row[0] in range(len(self._tasks))
        if not known or row[1] != self._tasks[row[0]].name:
            assert self._file is not None
            raise DataError(f"{self._file.name} has rows of another sweep; {_AGAIN}", _OTHER)


@contextmanager
def journal(out: Path | None, subject: Subject, tasks: Sequence[Task]) -> Iterator[Journal]:
    """The rows of `tasks` that are known already, and a place for the others.

    In memory alone without `out`. The file is removed when the block ends well, or without a row.
    Raises DataError where it cannot be written, is used by another process, or is of another sweep.
    """
    if out is None:
        yield Journal(tasks, len(subject.columns))
        return
    path = rows_file(out)
    try:
        file = _opened(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(f"{path}: cannot be written: {reason}", "unwritable-output") from error
    # An open file cannot be removed everywhere.
    with ExitStack() as closed, file:
        if not locked(file):
            raise DataError(f"{path}: another process works on this sweep; await it", "in-use")
        kept = Journal(tasks, len(subject.columns), file)
        kept.read()
        try:
            yield kept
        except BaseException:
            if not kept.rows:
                closed.callback(path.unlink)
            raise
        closed.callback(path.unlink)


def _opened(path: Path) -> BinaryIO:
    if path.exists() and not path.is_file():
        raise OSError("it is no regular file")
    file = open(path, "a+b")  # noqa: SIM115 (closed by who asked)
    flush_folder(path.parent)
    return file


def _line(row: Row) -> bytes:
    text = json.dumps(row, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _row(line: bytes) -> Row | None:
    """The row of a line; None if it is not whole."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(text):
        return None
    try:
        row = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return tuple(row) if isinstance(row, list) and row and isinstance(row[0], int) else None


# -- the table ----------------------------------------------------------------------------


def schema_of(varied: Sequence[Varied], others: Mapping[str, type]) -> pa.Schema:
    """The columns of a table with a row for each point of `varied`.

    They are the point, its name, the values, the figures, and `others` by their types.
    """
    import pyarrow as pa

    kinds = {"str": pa.string(), "int": pa.int32(), "float": pa.float64()}
    columns = [("point", pa.int32()), ("task", pa.string())]
    columns += [
        (each.column, pa.string() if each.target.choices else pa.float64()) for each in varied
    ]
    # By the annotations of the figures.
    columns += [(own.name, kinds[str(own.type).partition(" ")[0]]) for own in fields(Figures)]
    columns += [(name, kinds[kind.__name__]) for name, kind in others.items()]
    return pa.schema(columns)


def table_of(schema: pa.Schema, rows: Iterable[Mapping[str, Any]]) -> pa.Table:
    """The rows, cells by column, as a table; DataError for cells of another type."""
    import pyarrow as pa

    listed = list(rows)
    try:
        return pa.table(
            [pa.array([row[own.name] for row in listed], own.type) for own in schema],
            schema=schema,
        )
    except (pa.ArrowException, TypeError, OverflowError) as error:
        raise DataError(f"the rows that were kept are damaged: {error}; {_AGAIN}") from error


def write_table(out: Path, table: pa.Table) -> None:
    """`table` as the file `out`, by its suffix; DataError where it cannot be written."""
    import pyarrow.csv
    import pyarrow.parquet

    with output(out) as draft:
        if out.suffix.lower() == CSV:
            pyarrow.csv.write_csv(table, draft)
        else:
            pyarrow.parquet.write_table(table, draft)


def read_table(out: Path, schema: pa.Schema, names: Sequence[str]) -> pa.Table | None:
    """The results in `out`, whose rows have these names; None without such a file.

    DataError for those of another sweep.
    """
    import pyarrow as pa

    if not out.exists() or (out.is_file() and out.stat().st_size == 0):
        return None
    table = None
    if out.is_file() and out.stat().st_size <= MOST_ROW_BYTES * (len(names) + 10):
        try:
            table = _table_in(out, schema, len(names))
        except (pa.ArrowException, OSError, ValueError, LookupError):
            table = None
    if table is None or table["task"].to_pylist() != list(names):
        raise DataError(f"{out} is there, and is not the results of this sweep; {_AGAIN}", _OTHER)
    return table


def _table_in(out: Path, schema: pa.Schema, rows: int) -> Any:
    import pyarrow.csv
    import pyarrow.parquet

    if out.suffix.lower() == CSV:
        types = pyarrow.csv.ConvertOptions(
            column_types=schema,
            include_columns=schema.names,
            strings_can_be_null=True,
            quoted_strings_can_be_null=False,
        )
        return pyarrow.csv.read_csv(out, convert_options=types)
    with pyarrow.parquet.ParquetFile(out) as file:
        if file.metadata.num_rows != rows:
            raise ValueError("it has another number of rows")
        return file.read(columns=schema.names).select(schema.names).cast(schema)
