"""Writes recordings: Parquet, CSV and NPZ, all without loss of digits."""

from __future__ import annotations

import csv
import inspect
import io
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError
from mopro.files import output
from mopro.recording.record import CSV_MARK, KEY, Columns, FileSink, Header
from mopro.recording.run import Run, story_of


def open_sink(path: Path, header: Header) -> AbstractContextManager[FileSink]:
    """A sink that writes `path` in the format of its suffix; the file appears when it closes.

    Its `header` and `run` may be replaced until then.
    """
    opener = FORMATS.get(path.suffix.lower())
    if opener is None:
        known = ", ".join(FORMATS)
        message = f"{path}: '{path.suffix}' is not a recording's suffix: expected one of {known}"
        raise DataError(message, "unknown-format")
    return opener(path, header)


# Rows of a group in Parquet, which is written and read as one, and the memory (bytes) that those
# waiting for it may take. The longer a page, the more often a repetition in it costs nothing.
_MOST_ROWS = 1 << 20
_MOST_HELD = 24 << 20
_PAGE_BYTES = 8 * _MOST_ROWS


@contextmanager
def _parquet_sink(path: Path, header: Header) -> Iterator[FileSink]:
    """Parquet in groups of up to _MOST_ROWS rows, written as they are complete."""
    with output(path) as draft:
        sink = _ParquetSink(draft, header)
        try:
            yield sink
            sink.flush()
        finally:
            sink.close()


class _ParquetSink:
    """Writes groups of rows of Parquet, and the header below them when it closes."""

    run: Run | None = None

    def __init__(self, draft: Path, header: Header) -> None:
        self.header = header
        self._draft = draft
        self._held = _Held()
        self._writer: Any = None

    def write(self, columns: Columns) -> None:
        self._held.add(columns)
        if self._held.rows >= _MOST_ROWS or self._held.bytes >= _MOST_HELD:
            self.flush()

    def flush(self) -> None:
        """Write the rows that wait."""
        import pyarrow as pa

        parts, self._held = self._held.parts, _Held()
        if not parts:
            return
        columns = {n: pa.chunked_array([_arrow_array(p[n]) for p in parts]) for n in parts[0]}
        table = pa.table(columns)
        if self._writer is None:
            self._writer = _parquet_writer(self._draft, table.schema)
        self._writer.write_table(table)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.add_key_value_metadata({KEY: _header_text(self)})
            self._writer.close()


def _arrow_array(values: NDArray[Any]) -> Any:
    """Arrow array on the same memory; pa.array would import pandas for a type check."""
    import pyarrow as pa

    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, buffer])


def _parquet_writer(draft: Path, schema: Any) -> Any:
    """Writer of Parquet with floats split by bytes: neighbours share the upper ones."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    floats = [f.name for f in schema if pa.types.is_floating(f.type)]
    # Of old, pages had no limit of rows.
    limits = {"max_rows_per_page": _MOST_ROWS} if _has_row_limit(pq.ParquetWriter) else {}
    return pq.ParquetWriter(
        draft,
        schema,
        # A stored schema would hide metadata that are added after it.
        store_schema=False,
        compression="zstd",
        compression_level=3,
        use_dictionary=[f.name for f in schema if f.name not in floats],
        column_encoding=dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
        data_page_size=_PAGE_BYTES,
        **limits,
    )


def _has_row_limit(writer: type) -> bool:
    return "max_rows_per_page" in inspect.signature(writer).parameters


class _Held:
    """Chunks that wait, their rows, and the memory that they take, shared arrays counted once."""

    def __init__(self) -> None:
        self.parts: list[Columns] = []
        self.rows = self.bytes = 0
        self._known: set[int] = set()

    def add(self, columns: Columns) -> None:
        self.parts.append(columns)
        self.rows += len(columns["time_s"])
        for values in columns.values():
            whole = values.base if isinstance(values.base, np.ndarray) else values
            if id(whole) not in self._known:
                self._known.add(id(whole))
                self.bytes += whole.nbytes


class _CsvSink:
    """Writes rows of CSV with as many digits as exact reading needs."""

    run: Run | None = None

    def __init__(self, body: IO[bytes], header: Header) -> None:
        self.header = header
        self._text = io.TextIOWrapper(body, encoding="utf-8", newline="")
        self._rows = csv.writer(self._text, lineterminator="\n")
        self._named = False

    def write(self, columns: Columns) -> None:
        if not self._named:
            self._rows.writerow(columns)
            self._named = True
        self._rows.writerows(zip(*(v.tolist() for v in columns.values()), strict=True))

    def pour(self, file: IO[bytes]) -> None:
        """Write the header and, below it, all rows to `file`."""
        file.write(f"{CSV_MARK}{_header_text(self)}\n".encode())
        body = self._text.detach()
        body.seek(0)
        shutil.copyfileobj(body, file)


@contextmanager
def _csv_sink(path: Path, header: Header) -> Iterator[FileSink]:
    """Collect rows in a temporary file, as the header precedes them and is known last."""
    with output(path) as draft, _nameless(draft.parent) as body:
        sink = _CsvSink(body, header)
        yield sink
        with open(draft, "wb") as file:
            sink.pour(file)


@contextmanager
def _npz_sink(path: Path, header: Header) -> Iterator[FileSink]:
    """Collect columns in temporary files, as an array's length precedes its data in NPZ."""

    class NpzSink:
        run: Run | None = None

        def __init__(self, files: ExitStack, header: Header) -> None:
            self.files = files
            self.header = header
            self.growing: dict[str, tuple[IO[bytes], np.dtype[Any]]] = {}

        def write(self, columns: Columns) -> None:
            for name, values in columns.items():
                if name not in self.growing:
                    file = self.files.enter_context(_nameless(draft.parent))
                    self.growing[name] = (file, values.dtype)
                self.growing[name][0].write(np.ascontiguousarray(values).data)

        def columns(self) -> dict[str, NDArray[Any]]:
            return {name: _mapped(*grown) for name, grown in self.growing.items()}

    with output(path) as draft, ExitStack() as files:
        sink = NpzSink(files, header)
        yield sink
        with open(draft, "wb") as file:
            text = np.frombuffer(_header_text(sink).encode(), np.uint8)
            arrays: dict[str, Any] = {**sink.columns(), KEY: text}
            np.savez(file, **arrays)


@contextmanager
def _nameless(folder: Path) -> Iterator[IO[bytes]]:
    """A temporary file that disappears with the process, even if it is killed."""
    with tempfile.TemporaryFile(dir=folder) as file:
        yield file


def _mapped(file: IO[bytes], dtype: np.dtype[Any]) -> NDArray[Any]:
    file.flush()
    return np.memmap(file, dtype, "r")


def _header_text(sink: FileSink) -> str:
    story = {} if sink.run is None else {"run": story_of(sink.run)}
    return json.dumps({**sink.header.as_json(), **story})


# suffix -> opener of a sink
FORMATS: dict[str, Callable[[Path, Header], AbstractContextManager[FileSink]]] = {
    ".parquet": _parquet_sink,
    ".csv": _csv_sink,
    ".npz": _npz_sink,
}
