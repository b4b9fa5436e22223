"""Layout of a text of columns: encoding, delimiter, decimal mark, headings, first row of data."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from mopro.errors import DataFileError, Diagnostic
from mopro.logs.dates import is_stamp
from mopro.logs.log import Decision
from mopro.logs.names import heading, is_time, unit_of
from mopro.logs.place import MOST_CHARACTERS, LogSource, cell_span, cells_of
from mopro.source import Span

_SAMPLE_BYTES = 1 << 18
_SAMPLE_ROWS = 200
# Share of zeros in each other byte beyond which characters have two bytes.
_WIDE = 0.5
MOST_COLUMNS = 500
_DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blank"}
# Python's splitlines() knows more of them than Arrow and editors do.
_LINE_END = re.compile(r"\r\n|\n|\r")
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+|\d+)([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+|[+-]?\d{1,3}(,\d{3})+\.\d+")
MISSING = frozenset({"", "nan", "n/a", "na", "null", "none", "-", "--", "#n/a"})
_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


@dataclass(frozen=True)
class Layout:
    """Layout of a text of rows: `first_line` is that of the first row of data.

    `names` are the headings, `units` the cells of a row of units below them (or None), `sample`
    the cells of the first rows.
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


def layout_of(path: Path, name: str) -> Layout:
    """The layout of the text in file `path`; DataFileError where none can be found."""
    with open(path, "rb") as file:
        data = file.read(_SAMPLE_BYTES)
        whole = not file.read(1)
    encoding, decisions = _encoding(data)
    source = LogSource(name, "", encoding, path=path)
    lines = _lines(data, encoding, whole)
    if not any(line.strip() for line in lines):
        raise _fault(source, "empty-file", "the file is empty: expected headings and data", 1)
    for number, line in enumerate(lines, start=1):
        if len(line) > MOST_CHARACTERS:
            message = f"a line of more than {MOST_CHARACTERS} characters"
            raise _fault(source, "too-long", message, number)
    delimiter = _delimiter(lines)
    rows = [cells_of(line, delimiter) for line in lines]
    width = _width(rows)
    if width > MOST_COLUMNS:
        raise _fault(source, "too-long", f"more than {MOST_COLUMNS} columns", 1)
    first = _first_row(rows, width)
    if first is None:
        message = "no row of numbers was found below the headings"
        raise _fault(source, "empty-file", message, len(lines))
    above = [i for i in range(first) if len(rows[i]) == width and any(rows[i])]
    names, units, header = _headings(rows, above, source, first)
    data_rows = [row for row in rows[first : first + _SAMPLE_ROWS] if len(row) == width]
    decimal = _decimal(data_rows, delimiter, source, first + 1)
    if delimiter != "," or decimal != ".":
        taken = f"{_DELIMITERS[delimiter]}s between cells, decimals with {decimal!r}"
        decisions.append(Decision("layout", taken, f"the first {len(data_rows)} rows"))
    if header > 1 and any(map(any, rows[: header - 1])):
        above_all = f"lines 1 to {header - 1}"
        decisions.append(Decision("lines above the headings", "skipped", above_all))
    return Layout(
        encoding, delimiter, decimal, names, units, header, first + 1,
        tuple(map(tuple, data_rows)), tuple(decisions),
    )  # fmt: skip


def _encoding(data: bytes) -> tuple[str, list[Decision]]:
    for mark, encoding in _MARKS.items():
        if data.startswith(mark):
            return encoding, [Decision("encoding", encoding, "the file begins with its mark")]
    for first, encoding in ((0, "utf-16-be"), (1, "utf-16-le")):
        if data[first::2].count(0) > _WIDE * len(data) / 2 and not data[1 - first :: 2].count(0):
            return encoding, [Decision("encoding", encoding, "each other byte is zero")]
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data)
    except UnicodeDecodeError:
        return "cp1252", [Decision("encoding", "Windows-1252", "the text is not UTF-8")]
    return "utf-8", []


def _lines(data: bytes, encoding: str, whole: bool) -> list[str]:
    lines = _LINE_END.split(data.decode(encoding, "replace"))
    if not lines[-1]:
        lines.pop()
    return lines if whole or len(lines) < 2 else lines[:-1]


def _delimiter(lines: list[str]) -> str:
    """The delimiter that gives most rows the same number of cells, most of them numbers."""
    sample = [line for line in lines if line.strip()][-_SAMPLE_ROWS:]

    def score(delimiter: str) -> tuple[float, float]:
        rows = [cells_of(line, delimiter) for line in sample]
        width, count = Counter(map(len, rows)).most_common(1)[0]
        if width < 2:
            return 0.0, 0.0
        cells = [cell for row in rows if len(row) == width for cell in row]
        usable = sum(_holds_data(c) or c.lower() in MISSING for c in cells)
        return count / len(rows) * usable / sum(map(len, rows)), float(width)

    best = max(_DELIMITERS, key=score)
    return best if score(best)[0] > 0 else ","


def is_number(cell: str) -> bool:
    """True for a number with a decimal point or comma."""
    return bool(_POINT.fullmatch(cell) or _COMMA.fullmatch(cell))


def as_number(cell: str) -> float | None:
    """The number in a cell; None for what is none."""
    return float(cell.replace(",", ".")) if is_number(cell) else None


def _holds_data(cell: str) -> bool:
    """True for a number, however written, and for a time."""
    return is_number(cell) or is_stamp(cell) or bool(_THOUSANDS.fullmatch(cell))


def _width(rows: list[list[str]]) -> int:
    """Mode of the number of cells in rows that are not blank; 0 if all rows are blank."""
    often = Counter(len(row) for row in rows if any(row)).most_common(1)
    return often[0][0] if often else 0


def _first_row(rows: list[list[str]], width: int) -> int | None:
    """Index of the first row of full width with at least one number or time, and few words."""
    for index, row in enumerate(rows):
        filled = [cell for cell in row if cell.lower() not in MISSING]
        usable = sum(_holds_data(cell) for cell in filled)
        if len(row) == width and usable and 2 * usable >= len(filled):
            return index
    return None


def _headings(
    rows: list[list[str]], above: list[int], source: LogSource, first: int
) -> tuple[tuple[str, ...], tuple[str, ...] | None, int]:
    """Names, units and the line of the names."""
    if not above:
        hint = "name the columns in the first line, such as time_s,position_1_mm"
        message = "expected headings above the numbers, found none"
        raise _fault(source, "no-header", message, first + 1, hint)
    units = None
    if len(above) > 1 and _are_units(rows[above[-1]]):
        units = tuple(rows[above.pop()])
    names = list(rows[above[-1]])
    names[0] = names[0].lstrip("#% ").strip('"')
    line = above[-1] + 1
    for nth, name in enumerate(names):
        if name in names[:nth] and is_time(heading(name).name):
            names[nth] = f"{name} ({names[:nth].count(name) + 1})"
        elif name and name in names[:nth]:
            span = cell_span(source.line(line), line, nth, ",")
            finding = Diagnostic("double-column", f"there are two columns {name}", span)
            raise DataFileError(source, [finding])
    return tuple(name or f"column {n + 1}" for n, name in enumerate(names)), units, line


def _are_units(cells: list[str]) -> bool:
    filled = [cell.strip("[](){}<> ") for cell in cells if cell.strip("[](){}<>-# ")]
    known = sum(unit_of(cell) is not None for cell in filled)
    return not filled or 2 * known > len(filled)


def _decimal(rows: list[list[str]], delimiter: str, source: LogSource, line: int) -> str:
    """The decimal mark; DataFileError where both occur or thousands are grouped."""
    cells = [cell for row in rows for cell in row if cell and not is_stamp(cell)]
    for row_index, row in enumerate(rows):
        for nth, cell in enumerate(row):
            if _THOUSANDS.fullmatch(cell):
                number = line + row_index
                span = cell_span(source.line(number), number, nth, delimiter)
                hint = "write numbers without marks between thousands"
                message = f"'{cell}' groups its digits by thousands"
                raise DataFileError(source, [Diagnostic("bad-number", message, span, hint=hint)])
    commas = any("," in cell and _COMMA.fullmatch(cell) for cell in cells)
    points = any("." in cell and _POINT.fullmatch(cell) for cell in cells)
    if commas and points:
        message = "numbers with decimal points stand beside numbers with decimal commas"
        raise _fault(source, "mixed-decimals", message, line)
    return "," if commas else "."


def _fault(
    source: LogSource, rule: str, message: str, line: int, hint: str | None = None
) -> DataFileError:
    span = Span(line, 1, max(2, len(source.line(line)) + 1))
    return DataFileError(source, [Diagnostic(rule, message, span, hint=hint)])
