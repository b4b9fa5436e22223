"""Layout of a text of columns: encoding, delimiter, decimal mark, headings, first row of data.

Headings: where they stand, and which name each column has by them.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from mopro.errors import DataFileError, Diagnostic
from mopro.logs.cell_kinds import (
    MISSING,
    has_comma,
    has_point,
    holds_data,
    is_grouped,
    is_list,
    is_stamp,
    is_word,
)
from mopro.logs.column_names import heading, is_time, unit_of
from mopro.logs.log import MOST_CHARACTERS, Decision, LogSource, cell_span, cells_of
from mopro.source import Span
from mopro.text import wide_encoding

# Rows of data that are looked at.
SAMPLE_ROWS = 200
# Lines of pairs above the rows from which they are those of TwinCAT's Scope.
_FEWEST_FACTS = 2
_REMARKS = frozenset({"comment", "remark", "note", "annotation", "bemerkung", "kommentar"})


def first_row(rows: list[list[str]], width: int) -> int | None:
    """Index of the first row of full width with at least one number or time, and few words.

    Facts with numbers (`Delta_X 0.001`) may stand above the headings: rows that begin with a word
    where others begin with a number are none if headings follow.
    """
    data = [i for i, row in enumerate(rows) if len(row) == width and _is_row(row)]
    if not data:
        return None
    plain = next((i for i in data if not is_word(rows[i][0])), data[0])
    between = range(data[0], plain)
    if any(_are_headings(rows[i], width) for i in between if i not in data):
        return plain
    return data[0]


def _is_row(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell.lower() not in MISSING]
    usable = sum(map(holds_data, filled))
    return usable > 0 and 2 * usable >= len(filled)


def _are_headings(cells: list[str], width: int) -> bool:
    """True for a line of words that could be headings of a table of this width."""
    filled = [cell for cell in cells if cell]
    return 2 <= len(filled) <= width + 1 and not any(map(holds_data, filled))


@dataclass(frozen=True)
class Headings:
    """Headings: a name for each column, cells of a row of units, the line, the cells as written."""

    names: tuple[str, ...]
    units: tuple[str, ...] | None
    line: int
    cells: tuple[str, ...]
    decisions: tuple[Decision, ...] = ()


def headings_of(
    rows: list[list[str]], source: LogSource, first: int, width: int, headless: bool
) -> Headings:
    if (paired := _paired(rows[:first], width)) is not None:
        return paired
    sample = [row for row in rows[first : first + SAMPLE_ROWS] if len(row) == width]
    # A comma behind each row makes a column without cells.
    filled = max(n + 1 for row in sample for n, cell in enumerate(row) if cell)
    fits = {i: cells for i in range(first) if (cells := _fitted(rows[i], width, filled))}
    nearest = next((i for i in reversed(range(first)) if any(rows[i])), None)
    extra: tuple[Decision, ...] = ()
    if nearest is not None and nearest not in fits and _has_remark(rows[nearest], width):
        fits[nearest] = rows[nearest][:width]
        reason = "the rows have no cell for it"
        extra = (Decision(f"column {rows[nearest][width]}", "left out", reason, check=True),)
    above = sorted(fits)
    if not above:
        if headless:
            names = tuple(f"column {n + 1}" for n in range(width))
            why = "above the first row is none"
            decision = Decision("headings", "none: columns by number", why)
            return Headings(names, None, max(first, 1), (), (decision,))
        raise _no_headings(rows, source, first, width, nearest)
    units = None
    if len(above) > 1 and _are_units(fits[above[-1]]):
        units = tuple(fits[above.pop()])
    line = above[-1] + 1
    names = _named(fits[above[-1]], source, line)
    return Headings(names, units, line, tuple(rows[above[-1]][:width]), extra)


def _paired(above: list[list[str]], width: int) -> Headings | None:
    """Headings of TwinCAT's Scope: a pair of a key and a value above each pair of time and column.

    Its times are in ms. None where no such line has the names.
    """
    facts = {
        row[0].lower(): (n + 1, row)
        for n, row in enumerate(above)
        if len(row) == width and width % 2 == 0 and row[0] and set(row[::2]) == {row[0]}
    }
    line, row = facts.get("name") or facts.get("symbolname") or (0, [])
    names = row[1::2]
    if not names or not all(names) or len(set(names)) < len(names) or len(facts) < _FEWEST_FACTS:
        return None
    _, stated = facts.get("unit") or (0, [""] * width)
    columns = [cell for name in names for cell in (f"{name} time", name)]
    units = [cell for unit in stated[1::2] for cell in ("ms", unit)]
    which = f"those of line {line}, times in ms"
    decision = Decision("headings", which, "TwinCAT's Scope wrote them")
    return Headings(tuple(columns), tuple(units), line, tuple(row), (decision,))


def _named(cells: list[str], source: LogSource, line: int) -> tuple[str, ...]:
    """A name for each column; DataFileError for two of one name, unless they are times."""
    names = [cells[0].lstrip("#% ").strip('"'), *cells[1:]]
    for nth, name in enumerate(names):
        if name in names[:nth] and is_time(heading(name).name):
            names[nth] = f"{name} ({names[:nth].count(name) + 1})"
        elif name and name in names[:nth]:
            span = cell_span(source.line(line), line, nth, ",")
            finding = Diagnostic("double-column", f"there are two columns {name}", span)
            raise DataFileError(source, [finding])
    return tuple(name or f"column {n + 1}" for n, name in enumerate(names))


def _fitted(cells: list[str], width: int, filled: int) -> list[str] | None:
    """The cells as headings of a table of `width`; None if more or fewer columns have cells."""
    count = max((n + 1 for n, cell in enumerate(cells) if cell), default=0)
    if not count or not (len(cells) == width or filled <= count <= width):
        return None
    return (cells + [""] * width)[:width] if count <= width else None


def _has_remark(cells: list[str], width: int) -> bool:
    """True for headings of which the last one names remarks that no row has."""
    own = [cell for cell in cells if cell]
    return len(own) == width + 1 and own[-1].lower().rstrip("s") in _REMARKS


def _no_headings(
    rows: list[list[str]], source: LogSource, first: int, width: int, nearest: int | None
) -> DataFileError:
    if nearest is not None and len([c for c in rows[nearest] if c]) > 1:
        count = len([c for c in rows[nearest] if c])
        message = f"{count} headings stand over rows of {width} cells"
        return fault(source, "no-header", message, nearest + 1, "name each column, and no other")
    hint = (
        "name the columns in the first line, such as time_s,position_1_mm; or state --rate HZ,"
        ' or --time "column 1", to read them by number'
    )
    message = "expected headings above the numbers, found none"
    return fault(source, "no-header", message, first + 1, hint)


def _are_units(cells: list[str]) -> bool:
    filled = [cell.strip("[](){}<> ") for cell in cells if cell.strip("[](){}<>-# ")]
    known = sum(unit_of(cell) is not None for cell in filled)
    return not filled or 2 * known > len(filled)


def fault(
    source: LogSource, rule: str, message: str, line: int, hint: str | None = None
) -> DataFileError:
    """The error about a line."""
    span = Span(line, 1, max(2, len(source.line(line)) + 1))
    return DataFileError(source, [Diagnostic(rule, message, span, hint=hint)])


# -- the layout of a text ---------------------------------------------------------------------

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
