"""Reads data files: columns of numbers; a fault is reported at its file, line and column.

CSV with a header (lines that begin with # before it are skipped), or a recording of mopro.
An empty cell, or `nan`, is a sample that the file lacks. A cell in quotes may have commas
but no line break.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn, TextIO

import numpy as np
from numpy.typing import NDArray

from mopro.engine.series import Floats
from mopro.errors import DataFileError, Diagnostic
from mopro.logs.file_kinds import kind_of
from mopro.logs.log import cell_span
from mopro.source import Source, Span
from mopro.text import wide_encoding

TIME = "time_s"
MOST_CHARACTERS = 10_000
MOST_ROWS = 20_000_000
# Share of a number by which a computer rounds it.
_ROUNDING = float(np.finfo(float).eps)
# Largest number that is read, also for a noise: the square of a sum of such squares is one, too.
MOST_SIZE = 1e70
_MOST_FAULTS = 50
_COMMA = ","
# Ends a text under DOS, and what may stand behind it there without being data.
_DOS_END, _FILLING = "\x1a", "\x1a\0 \t\r\n"
_TEXT_AFTER = "text-after-end"
_FILE = Span(1, 1, 1)
_RECORDINGS = (".parquet", ".npz")


@dataclass(frozen=True)
class FileSource(Source):
    """A file whose text is not held in memory; `line` reads the line that a message shows."""

    path: Path = field(default=Path())

    def line(self, number: int) -> str:
        if self.path.suffix.lower() in _RECORDINGS:
            return ""
        try:
            with _opened(self) as file:
                return next((text for n, text in _lines(file) if n == number), "").rstrip("\r\n")
        except OSError:
            return ""


@dataclass(frozen=True)
class DataFile:
    """Columns of equal length, and the line number of each row.

    `names` are all columns of the file, `columns` those that were asked for and are there.
    """

    source: FileSource
    names: tuple[str, ...]
    header_line: int
    columns: Mapping[str, Floats]
    lines: NDArray[np.int64]

    def place(self, row: int, column: str) -> Span:
        """Span of the cell of `column` in data row `row`."""
        line = int(self.lines[row])
        return cell_span(self.source.line(line), line, self.names.index(column), _COMMA)

    def refuse(
        self, rule: str, message: str, row: int, column: str, hint: str | None = None
    ) -> NoReturn:
        finding = Diagnostic(rule, message, self.place(row, column), hint=hint)
        raise DataFileError(self.source, [finding])

    def check_noise(self, column: str, sigma: float | None) -> None:
        """DataFileError for a stated noise (standard deviation) that the readings cannot show."""
        rounding = float(np.nanmax(np.abs(self.columns[column]))) * _ROUNDING
        if sigma is not None and not rounding <= sigma <= MOST_SIZE:
            stated = f"the noise of {column} is stated as {sigma:.2g}"
            least = f"its numbers are rounded to {rounding:.2g}"
            message = f"{stated}, and {least if sigma < rounding else f'{MOST_SIZE:g} is the most'}"
            self.refuse_header("wrong-noise", message, "state the noise of the sensor, in its unit")

    def refuse_header(self, rule: str, message: str, hint: str | None = None) -> NoReturn:
        header = self.source.line(self.header_line)
        span = Span(self.header_line, 1, max(2, len(header) + 1))
        raise DataFileError(self.source, [Diagnostic(rule, message, span, hint=hint)])

    def require(self, column: str) -> Floats:
        """The column; DataFileError that suggests what may be meant if it is not there."""
        if column not in self.columns:
            self._refuse_lacking(column)
        return self.columns[column]

    def _refuse_lacking(self, column: str) -> NoReturn:
        other = other_unit(column, self.names)
        if other:
            message = f"the file has {other}, and {column} was expected"
            hint = "units are not guessed: name the column as it is, or convert the data"
            self.refuse_header("mixed-units", message, hint)
        near = get_close_matches(column, self.names, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        self.refuse_header(
            "missing-column",
            f"there is no column {column}",
            f"{hint}The file has {', '.join(self.names)}",
        )


def other_unit(column: str, names: Iterable[str]) -> str | None:
    """The column of `names` that is `column` in another unit."""
    stem = column.rsplit("_", 1)[0]
    for name in names:
        if name != column and name.rpartition("_")[0] == stem:
            return name
    return None


def _reader(lines: Iterable[str]) -> Iterator[list[str]]:
    """The cells of each line; a blank after a comma does not belong to its cell."""
    return csv.reader(lines, skipinitialspace=True)


def read_data(path: Path, name: str, wanted: Collection[str]) -> DataFile:
    """The columns of `wanted` that file `path` has; `name` stands for it in messages.

    Raises DataFileError with all findings, or DataError for a recording that is none.
    """
    if path.suffix.lower() in _RECORDINGS:
        return _from_recording(path, name, wanted)
    source = FileSource(name, "", path=path)
    try:
        source = replace(source, encoding=_encoding(path, source))
        with _opened(source) as file:
            return _Rows(source, wanted).read(file)
    except OSError as error:
        raise refused(source, "unreadable", f"cannot be read: {error.strerror}") from error


def _encoding(path: Path, source: FileSource) -> str:
    """The encoding of a text; DataFileError that says what a file is that is none."""
    with open(path, "rb") as file:
        head = file.read(MOST_CHARACTERS)
    found = kind_of(head, path)
    if found is not None:
        raise refused(source, "foreign-format", f"this is {found[0]}, not CSV", found[1])
    return wide_encoding(head) or "utf-8-sig"


def refused(
    source: Source, rule: str, message: str, hint: str | None = None, span: Span = _FILE
) -> DataFileError:
    """The error of a file as a whole, or at one place."""
    return DataFileError(source, [Diagnostic(rule, message, span, hint=hint)])


def _from_recording(path: Path, name: str, wanted: Collection[str]) -> DataFile:
    from mopro.recording import read

    recording = read(path, wanted)
    columns = {c: np.asarray(v, float) for c, v in recording.columns.items() if c in wanted}
    lines = np.arange(1, len(recording) + 1)
    file = DataFile(FileSource(name, "", path=path), tuple(recording.columns), 1, columns, lines)
    for column, values in columns.items():
        if len(beyond := np.flatnonzero(np.abs(values) > MOST_SIZE)):
            row = int(beyond[0])
            hint = "NaN stands for a sample that is not there"
            message = f"{column} is {values[row]} in row {row + 1}: no number that can be measured"
            file.refuse("not-a-number", message, row, column, hint)
    return file


def _opened(source: FileSource) -> TextIO:
    return open(source.path, encoding=source.encoding, errors="replace", newline=None)


def _lines(file: TextIO) -> Iterator[tuple[int, str]]:
    """Numbered lines, each cut at MOST_CHARACTERS."""
    number = 0
    while text := file.readline(MOST_CHARACTERS):
        number += 1
        yield number, text


class _Rows:
    """Parses a CSV file and collects its faults."""

    def __init__(self, source: FileSource, wanted: Collection[str]) -> None:
        self._source = source
        self._wanted = wanted
        self._faults: list[Diagnostic] = []
        self._line, self._text = 1, ""
        self._complete = True

    def read(self, file: TextIO) -> DataFile:
        rows = _reader(self._texts(file))
        names = self._header(next(rows, []))
        header_line, header = self._line, self._text
        used = [(i, name) for i, name in enumerate(names) if name in self._wanted]
        numbers: list[int] = []
        values: list[list[float]] = [[] for _ in used]
        for cells in rows:
            self._complete = True
            if len(cells) != len(names):
                message = f"{len(cells)} cells, expected {len(names)} as in the header"
                self._report("wrong-cells", message, self._line, self._text, 0)
                continue
            numbers.append(self._line)
            if len(numbers) > MOST_ROWS:
                raise refused(self._source, "too-long", f"more than {MOST_ROWS} rows")
            for column, (i, _) in zip(values, used, strict=True):
                column.append(self._number(cells[i], i))
        if not numbers and not self._faults:
            self._report("empty-file", "there are no data below the header", header_line, header, 0)
        self._check()
        columns = {name: np.array(v) for v, (_, name) in zip(values, used, strict=True)}
        return DataFile(self._source, names, header_line, columns, np.array(numbers))

    def _texts(self, file: TextIO) -> Iterator[str]:
        """The significant lines, each of which must be a whole row."""
        for line, text in self._significant(file):
            self._line, self._text, self._complete = line, text, False
            yield text
            if not self._complete:
                hint = "a cell in quotes ends with a quote in the same line"
                message = "a quote is not closed"
                self._report("open-quote", message, self._line, self._text, 0, hint)
                self._check()

    def _significant(self, file: TextIO) -> Iterator[tuple[int, str]]:
        """Numbered lines that are not blank, without line ends; comments are skipped at the top."""
        at_top = True
        for number, text in _lines(file):
            comment = at_top and text.startswith("#")
            if _DOS_END in text:
                text = self._ended(number, text, file)
            if len(text) >= MOST_CHARACTERS and not comment:
                message = f"a line of more than {MOST_CHARACTERS - 1} characters"
                self._report("too-long", message, number, text[:200], 0)
                self._check()
            text = text.rstrip("\r\n")
            if text.strip() and not comment:
                at_top = False
                yield number, text

    def _ended(self, line: int, text: str, file: TextIO) -> str:
        """The text before a Ctrl-Z, which ends a file of DOS; what stands behind it is a fault."""
        kept, _, rest = text.partition(_DOS_END)
        while not rest.strip(_FILLING) and (rest := file.readline(MOST_CHARACTERS)):
            pass
        if rest:
            hint = "take the Ctrl-Z out if that belongs to the data, else cut the file there"
            message = "the data end at this Ctrl-Z (0x1A), and text stands behind it"
            self._faults.append(
                Diagnostic(
                    _TEXT_AFTER, message, Span(line, len(kept) + 1, len(kept) + 2), hint=hint
                )
            )
            self._check()
        return kept

    def _header(self, cells: list[str]) -> tuple[str, ...]:
        self._complete = True
        line, text = self._line, self._text
        names = tuple(cell.strip() for cell in cells)
        if not text:
            self._report("empty-file", "the file is empty: expected a header and data", 1, "", 0)
        elif all(_as_number(name) is not None for name in names):
            hint = f"name the columns in the first line, such as {TIME},position_1_in"
            self._report("no-header", "expected a header, found numbers", line, text, 0, hint)
        for i, name in enumerate(names):
            if name and name in names[:i]:
                self._report("double-column", f"there are two columns {name}", line, text, i)
        self._check()
        return names

    def _number(self, cell: str, nth: int) -> float:
        """The cell's number; NaN for one that is empty."""
        word = cell.strip()
        if not word:
            return math.nan
        number = _as_number(word)
        if number is None or abs(number) > MOST_SIZE:
            hint = "an empty cell stands for a sample that is not there"
            message = f"'{word[:40]}' is no number that can be measured"
            self._report("not-a-number", message, self._line, self._text, nth, hint)
            return math.nan
        return number

    def _report(
        self, rule: str, message: str, line: int, text: str, nth: int, hint: str | None = None
    ) -> None:
        self._faults.append(
            Diagnostic(rule, message, cell_span(text, line, nth, _COMMA), hint=hint)
        )
        if len(self._faults) >= _MOST_FAULTS:
            self._check()

    def _check(self) -> None:
        if self._faults:
            raise DataFileError(self._source, self._faults)


def _as_number(word: str) -> float | None:
    try:
        return None if "_" in word else float(word)
    except ValueError:
        return None
