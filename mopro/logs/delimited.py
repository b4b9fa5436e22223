"""Reads a text of columns with Arrow's CSV reader, in one pass and in linear time."""

from __future__ import annotations

import mmap
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataFileError, Diagnostic
from mopro.logs.cell_kinds import SPELLINGS, as_number, is_grouped, is_number
from mopro.logs.layout import Layout, layout_of
from mopro.logs.log import MOST_CHARACTERS, MOST_ROWS, Decision, LogSource, Table, cell_span
from mopro.logs.tidy import DOS_END, Tidied, tidied
from mopro.source import Span

_MOST_FAULTS = 50
CUT = "cut off at the end"
_BLANKS = " \t\r\n\v\f"
_BAD_COLUMN = re.compile(r"In CSV column #(\d+)")
_BLOCK_BYTES = 1 << 22
# Of a column's readings: below this share of numbers it is a column of words.
_NUMBERS_SHARE = 0.5
# Digits of an integer of which a float does not hold all.
_LONG_STAMP = 16


def read_text(
    path: Path, name: str, missing: tuple[str, ...] = (), headless: bool = False
) -> Table:
    """The columns of the text in file `path`; DataFileError with the place of each bad cell.

    The words of `missing`, besides the usual ones, stand for a reading that is not there. A text
    without headings is read if it may be `headless`.
    """
    layout = layout_of(path, name, headless)
    source = LogSource(name, "", layout.encoding, path=path)
    tidy = tidied(path, layout) if _has_end(path) else None
    try:
        return _Reader(path, source, layout, missing, tidy).table()
    except DataFileError:
        # Lines between the rows are looked for where the file is no plain table: it takes longer.
        tidy = None if tidy else tidied(path, layout)
        if tidy is None:
            raise
    return _Reader(path, source, layout, missing, tidy).table()


def _has_end(path: Path) -> bool:
    """True if the file has the byte of a Ctrl-Z somewhere."""
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return data.find(DOS_END.encode("ascii")) >= 0


class _Reader:
    """One file that is being read; `_words` are the columns that are not all numbers."""

    def __init__(
        self, path: Path, source: LogSource, layout: Layout, missing: tuple[str, ...],
        tidy: Tidied | None = None,
    ) -> None:  # fmt: skip
        self._path = path
        self._source = source
        self._layout = layout
        self._missing = sorted(SPELLINGS | set(missing))
        self._tidy = tidy
        # Arrow counts the lines above its first row.
        self._above = layout.first_line - 1 if tidy is None else 0
        self._words: set[int] = set()
        self._ragged: list[Any] = []

    def table(self) -> Table:
        for nth, cells in enumerate(zip(*self._layout.sample, strict=True)):
            filled = [c for c in cells if c not in self._missing]
            if filled and not any(map(is_number, filled)):
                self._words.add(nth)
        arrays = self._arrays()
        lines = self._lines(len(arrays[0]))
        cut = self._cut_row()
        decisions = list(self._layout.decisions) + cut
        left_out = {CUT: len(cut)} if cut else {}
        if self._tidy is not None:
            left_out |= self._tidy.left_out
            decisions += self._tidy.decisions
        columns: dict[str, Any] = {}
        faults: list[Diagnostic] = []
        for nth, (name, array) in enumerate(zip(self._layout.names, arrays, strict=True)):
            column, found = self._column(nth, array, lines)
            columns[name] = column
            faults += found
        if faults:
            raise DataFileError(self._source, faults[:_MOST_FAULTS])
        stated = self._layout.units or ("",) * len(self._layout.names)
        units = dict(zip(self._layout.names, stated, strict=True))
        return Table(
            self._source, columns, {n: u for n, u in units.items() if u}, tuple(decisions),
            self._layout.header_line, self._layout.first_line, lines, self._layout.delimiter,
            left_out,
        )  # fmt: skip

    # -- Arrow -------------------------------------------------------------------

    def _arrays(self) -> list[Any]:
        """An array for each column; one that turns out to have words is read again as words."""
        import pyarrow as pa

        while True:
            self._ragged.clear()
            try:
                table = self._read()
            except UnicodeDecodeError as error:
                reason = f"byte 0x{error.object[error.start]:02x} is no character of "
                message = f"{reason}{self._layout.encoding}"
                raise self._fault("bad-data", message, self._layout.first_line) from error
            except pa.ArrowInvalid as error:
                match = _BAD_COLUMN.search(str(error))
                if match is None or int(match[1]) in self._words:
                    reason = " ".join(str(error).split())[:200]
                    raise self._fault("bad-data", reason, self._layout.first_line) from error
                self._words.add(int(match[1]))
                continue
            if not table.num_rows:
                message = "there are no data below the headings"
                raise self._fault("empty-file", message, self._layout.header_line)
            return [table.column(nth).combine_chunks() for nth in range(table.num_columns)]

    def _read(self) -> Any:
        import pyarrow as pa
        from pyarrow import csv

        layout = self._layout
        names = [str(n) for n in range(len(layout.names))]
        types = {n: pa.string() if int(n) in self._words else self._number(int(n)) for n in names}
        return csv.read_csv(
            self._input(),
            csv.ReadOptions(
                use_threads=False,
                block_size=_BLOCK_BYTES,
                skip_rows=self._above,
                column_names=names,
                encoding=self._encoding,
            ),
            csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=self._ragged_row),
            csv.ConvertOptions(
                column_types=types,
                null_values=self._missing,
                strings_can_be_null=True,
                decimal_point=layout.decimal,
            ),
        )

    @property
    def _encoding(self) -> str:
        own = self._layout.encoding
        return "utf-8" if own == "utf-8-sig" or self._tidy is not None else own

    def _number(self, nth: int) -> Any:
        """Integers for long stamps, whose last digits a float would lose."""
        import pyarrow as pa

        cells = [row[nth] for row in self._layout.sample if row[nth]]
        long = cells and all(c.isascii() and c.isdigit() and len(c) >= _LONG_STAMP for c in cells)
        return pa.int64() if long else pa.float64()

    def _input(self) -> Any:
        """The file, or its bytes with one blank between cells where blanks separate them."""
        import pyarrow as pa

        if self._layout.delimiter != " ":
            return str(self._path) if self._tidy is None else pa.BufferReader(self._tidy.data)
        data = self._path.read_bytes() if self._tidy is None else self._tidy.data
        data = re.sub(rb"[ \t]+", b" ", data)
        return pa.BufferReader(re.sub(rb"(?m)^ | (?=\r?$)", b"", data))

    def _ragged_row(self, row: Any) -> str:
        if len(self._ragged) < _MOST_FAULTS + 1:
            self._ragged.append(row)
        return "skip"

    def _cut_row(self) -> list[Decision]:
        """A last row that is cut off is left out; any other row of the wrong width is a fault."""
        if not self._ragged:
            return []
        expected = len(self._layout.names)
        *others, last = self._ragged
        last_line, text = _last_line(self._path, self._layout.encoding)
        if not others and last.text.strip() == text.strip() and last.actual_columns < expected:
            found = f"{last.actual_columns} of {expected} cells"
            return [Decision(f"line {last_line}, the last one", "left out", f"cut off: {found}")]
        findings = []
        numbers = self._numbers()
        for row in self._ragged[:_MOST_FAULTS]:
            line = int(numbers[min(self._nth(row), len(numbers) - 1)])
            message = f"{row.actual_columns} cells, expected {expected} as in the headings"
            findings.append(Diagnostic("wrong-cells", message, Span(line, 1, len(row.text) + 1)))
        raise DataFileError(self._source, findings)

    # -- columns -----------------------------------------------------------------

    def _column(
        self, nth: int, array: Any, lines: NDArray[np.int64] | None
    ) -> tuple[Any, list[Diagnostic]]:
        """Numbers, or the array of words; and the faults of a column of numbers."""
        if nth not in self._words:
            values = array.to_numpy(zero_copy_only=False)
            return values, self._infinite(nth, values, lines)
        words = array.to_pylist()
        values = np.full(len(words), np.nan)
        bad: list[int] = []
        for row, word in enumerate(words):
            # Arrow knows a missing cell only if no blanks stand beside it.
            if word is not None and word.strip() not in self._missing:
                number = as_number(word.strip())
                if number is None:
                    bad.append(row)
                else:
                    values[row] = number
        numbers = int(np.count_nonzero(~np.isnan(values)))
        if numbers < _NUMBERS_SHARE * (numbers + len(bad)) or not numbers:
            return array, []
        hint = "an empty cell stands for a missing reading, as do words given with --missing"
        return values, [
            self._cell(nth, row, _fault_of(words[row]), lines, hint) for row in bad[:_MOST_FAULTS]
        ]

    def _infinite(
        self, nth: int, values: NDArray[Any], lines: NDArray[np.int64] | None
    ) -> list[Diagnostic]:
        if values.dtype.kind != "f":
            return []
        rows = np.flatnonzero(np.isinf(values))[:_MOST_FAULTS]
        return [self._cell(nth, int(r), "an infinite number", lines) for r in rows]

    def _cell(
        self, nth: int, row: int, message: str, lines: NDArray[np.int64] | None,
        hint: str | None = None,
    ) -> Diagnostic:  # fmt: skip
        line = self._layout.first_line + row if lines is None else int(lines[row])
        span = cell_span(self._source.line(line), line, nth, self._layout.delimiter)
        column = self._layout.names[nth]
        return Diagnostic("not-a-number", f"{column}: {message}", span, hint=hint)

    def _lines(self, rows: int) -> NDArray[np.int64] | None:
        """Line numbers of the rows, None where they follow each other; checks the bounds."""
        if rows > MOST_ROWS:
            raise self._fault("too-long", f"more than {MOST_ROWS} rows", self._layout.first_line)
        numbers = self._numbers()
        if len(numbers) == rows and numbers[-1] - numbers[0] + 1 == rows:
            return None
        refused = [nth for row in self._ragged if (nth := self._nth(row)) < len(numbers)]
        kept = np.delete(numbers, refused)
        return kept if len(kept) == rows else None

    def _nth(self, row: Any) -> int:
        """Index of a refused row among the rows of data; Arrow counts no blank lines in them."""
        return int(row.number) - self._above - 1

    def _numbers(self) -> NDArray[np.int64]:
        """Numbers of the lines of data that are not blank."""
        return _rows_of(self._path, self._layout) if self._tidy is None else self._tidy.numbers

    def _fault(self, rule: str, message: str, line: int) -> DataFileError:
        span = Span(line, 1, max(2, len(self._source.line(line)) + 1))
        return DataFileError(self._source, [Diagnostic(rule, message, span)])


def _fault_of(word: str) -> str:
    if is_grouped(word.strip()):
        return f"'{word}' groups its digits by thousands"
    return f"'{word[:40]}' is no number"


def _rows_of(path: Path, layout: Layout) -> NDArray[np.int64]:
    """Numbers of the lines of data that are not blank."""
    # Of the other encodings each character that ends a line, or is blank, is one byte.
    encoding = layout.encoding if layout.encoding.startswith(("utf-16", "utf-32")) else "latin-1"
    with open(path, encoding=encoding, errors="replace", newline=None) as file:
        full = [bool(line.strip(_BLANKS)) for line in file]
    numbers = np.flatnonzero(full).astype(np.int64) + 1
    return numbers[numbers >= layout.first_line]


def _last_line(path: Path, encoding: str) -> tuple[int, str]:
    number, last = 0, ""
    with open(path, encoding=encoding, errors="replace") as file:
        for number, line in enumerate(file, start=1):  # noqa: B007 (the last one is used)
            last = line if line.strip(_BLANKS + DOS_END) else last
    return number, last[:MOST_CHARACTERS]
