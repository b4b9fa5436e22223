"""Headings of a text of columns: where they stand, and which name each column has by them."""

from __future__ import annotations

from dataclasses import dataclass

from mopro.errors import DataFileError, Diagnostic
from mopro.logs.log import Decision
from mopro.logs.names import heading, is_time, unit_of
from mopro.logs.place import LogSource, cell_span
from mopro.logs.written import MISSING, holds_data, is_word
from mopro.source import Span

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
            told = Decision("headings", "none: columns by number", "above the first row is none")
            return Headings(names, None, max(first, 1), (), (told,))
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
    told = Decision("headings", f"those of line {line}, times in ms", "TwinCAT's Scope wrote them")
    return Headings(tuple(columns), tuple(units), line, tuple(row), (told,))


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
