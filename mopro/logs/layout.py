"""Layout of a text of columns: encoding, delimiter, decimal mark, headings, first row of data."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from mopro.errors import DataFileError, Diagnostic
from mopro.logs.dates import is_stamp
from mopro.logs.headings import SAMPLE_ROWS, fault, first_row, headings_of
from mopro.logs.log import Decision
from mopro.logs.place import MOST_CHARACTERS, LogSource, cell_span, cells_of
from mopro.logs.written import MISSING, has_comma, has_point, holds_data, is_grouped, is_list
from mopro.text import wide_encoding

_SAMPLE_BYTES = 1 << 18
MOST_COLUMNS = 500
_DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blank"}
# Python's splitlines() knows more of them than Arrow and editors do.
_LINE_END = re.compile(r"\r\n|\n|\r")


@dataclass(frozen=True)
class Layout:
    """Layout of a text of rows: `first_line` is that of the first row of data.

    `names` are the headings, a name for each column; `headings` are their cells as they stand,
    `units` those of a row of units below them (or None), `sample` the cells of the first rows.
    """

    encoding: str
    delimiter: str
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...] | None
    header_line: int
    first_line: int
    sample: tuple[tuple[str, ...], ...]
    decisions: tuple[Decision, ...]
    headings: tuple[str, ...] = ()


def layout_of(path: Path, name: str, headless: bool = False) -> Layout:
    """The layout of the text in file `path`; DataFileError where none can be found.

    Columns of a text without headings are numbered if it may be `headless`.
    """
    with open(path, "rb") as file:
        data = file.read(_SAMPLE_BYTES)
        whole = not file.read(1)
    encoding, decisions = _encoding(data, whole)
    source = LogSource(name, "", encoding, path=path)
    lines = _lines(data, encoding, whole)
    if not any(line.strip() for line in lines):
        raise fault(source, "empty-file", "the file is empty: expected headings and data", 1)
    for number, line in enumerate(lines, start=1):
        if len(line) > MOST_CHARACTERS:
            message = f"a line of more than {MOST_CHARACTERS} characters"
            raise fault(source, "too-long", message, number)
    delimiter = _delimiter(lines)
    rows = [cells_of(line, delimiter) for line in lines]
    width = _width(rows)
    if width > MOST_COLUMNS:
        raise fault(source, "too-long", f"more than {MOST_COLUMNS} columns", 1)
    first = first_row(rows, width)
    if first is None:
        message = "no row of numbers was found below the headings"
        raise fault(source, "empty-file", message, len(lines))
    found = headings_of(rows, source, first, width, headless)
    names, units, header = found.names, found.units, found.line
    decisions += found.decisions
    lines_of_rows = [n for n in range(first, len(rows)) if len(rows[n]) == width][:SAMPLE_ROWS]
    data_rows = [rows[n] for n in lines_of_rows]
    decimal = _decimal(data_rows, delimiter, source, [n + 1 for n in lines_of_rows])
    if delimiter != "," or decimal != ".":
        taken = f"{_DELIMITERS[delimiter]}s between cells, decimals with {decimal!r}"
        decisions.append(Decision("layout", taken, f"the first {len(data_rows)} rows"))
    if header > 1 and any(map(any, rows[: header - 1])):
        above_all = f"lines 1 to {header - 1}"
        decisions.append(Decision("lines above the headings", "skipped", above_all))
    return Layout(
        encoding, delimiter, decimal, names, units, header, first + 1,
        tuple(map(tuple, data_rows)), tuple(decisions), found.cells,
    )  # fmt: skip


def _encoding(data: bytes, whole: bool) -> tuple[str, list[Decision]]:
    marked = "utf-8-sig" if data.startswith(codecs.BOM_UTF8) else None
    if encoding := marked or wide_encoding(data):
        zeros = encoding.endswith(("-le", "-be"))
        reason = "most bytes are zero" if zeros else "the file begins with its mark"
        return encoding, [Decision("encoding", encoding, reason)]
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data, final=whole)
    except UnicodeDecodeError:
        return "cp1252", [Decision("encoding", "Windows-1252", "the text is not UTF-8")]
    return "utf-8", []


def _lines(data: bytes, encoding: str, whole: bool) -> list[str]:
    lines = _LINE_END.split(data.decode(encoding, "replace"))
    if not lines[-1]:
        lines.pop()
    return lines if whole or len(lines) < 2 else lines[:-1]


def _delimiter(lines: list[str]) -> str:
    """The delimiter that gives most numbers and stamps to a row, and few other cells.

    Judged by their number in a row, of those of the usual width, times their share.
    """
    sample = [line for line in lines if line.strip()][-SAMPLE_ROWS:]

    def score(delimiter: str) -> tuple[float, float]:
        rows = [cells_of(line, delimiter) for line in sample]
        width = Counter(map(len, rows)).most_common(1)[0][0]
        if width < 2:
            return 0.0, 0.0
        cells = [_stamps_whole(row) if delimiter == " " else row for row in rows]
        usable = sum(
            holds_data(c) or c.lower() in MISSING
            for row, own in zip(rows, cells, strict=True)
            for c in own
            if len(row) == width
        )
        # Of as good ones, a blank is the last.
        good = usable / len(rows) * usable / sum(map(len, cells))
        return good, 0.0 if delimiter == " " else float(width)

    best = max(_DELIMITERS, key=score)
    return best if score(best)[0] > 0 else ","


def _stamps_whole(cells: list[str]) -> list[str]:
    """The cells between blanks, of which a date and the time behind it are one."""
    found: list[str] = []
    for cell in cells:
        if found and is_stamp(f"{found[-1]} {cell}"):
            found[-1] += f" {cell}"
        else:
            found.append(cell)
    return found


def _width(rows: list[list[str]]) -> int:
    """Mode of the number of cells in rows that are not blank; 0 if all rows are blank."""
    often = Counter(len(row) for row in rows if any(row)).most_common(1)
    return often[0][0] if often else 0


def _decimal(rows: list[list[str]], delimiter: str, source: LogSource, lines: list[int]) -> str:
    """The decimal mark; DataFileError where both occur or thousands are grouped."""
    cells = [cell for row in rows for cell in row if cell and not (is_stamp(cell) or is_list(cell))]
    for number, row in zip(lines, rows, strict=True):
        for nth, cell in enumerate(row):
            if is_grouped(cell):
                span = cell_span(source.line(number), number, nth, delimiter)
                hint = "write numbers without marks between thousands"
                message = f"'{cell}' groups its digits by thousands"
                raise DataFileError(source, [Diagnostic("bad-number", message, span, hint=hint)])
    commas = any(map(has_comma, cells))
    points = any(map(has_point, cells))
    if commas and points:
        message = "numbers with decimal points stand beside numbers with decimal commas"
        raise fault(source, "mixed-decimals", message, lines[0])
    return "," if commas else "."
