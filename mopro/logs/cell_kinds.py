"""What is written in a cell: dates and times, numbers, lists of numbers, words.

Dates and times are told by the form of the cell, whatever its column is called.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

TIME = (
    r"(?P<hour>\d{1,3}):(?P<minute>\d\d)(?::(?P<second>\d\d)(?:[.,:](?P<part>\d{1,12}))?)?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?"
)
# Minutes and seconds, as Excel shows a time of day that it saves as text.
_SHORT = r"(?P<minute>\d{1,2}):(?P<second>\d\d)[.,](?P<part>\d{1,9})"
ZONE = r"(?: ?(?P<zone>Z|UTC|GMT|[+-]\d\d(?::?\d\d)?))?"
_NAME = r"(?P<name>[A-Za-z]{3,9})\.?"
# Year first; month by its name; two numbers of which either is the day.
_DATES = (
    r"(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})",
    r"(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)",
    r"(?P<a>\d{1,2})[-/.](?P<b>\d{1,2})[-/.](?P<year>\d{4}|\d\d)",
    rf"(?P<day>\d{{1,2}})[-/. ]{{1,2}}{_NAME}[-/ ,]{{1,2}}(?P<year>\d{{4}}|\d\d)",
    rf"{_NAME} (?P<day>\d{{1,2}}),? (?P<year>\d{{4}})",
)
_WEEKDAY = r"(?:[A-Za-z]{2,9},? )?"
_BETWEEN = r"(?:T|[ _,:]{1,2})"
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_STAMP_FORMS = (
    rf"{TIME}{ZONE}",
    _SHORT,
    *(f"{_WEEKDAY}{date}(?:{_BETWEEN}{TIME}{ZONE})?" for date in _DATES),
)
_PATTERNS = tuple(re.compile(form) for form in _STAMP_FORMS)
# A number of eight digits is a date beside a time of day only.
_COMPACT = re.compile(r"\d{8}")
_SAMPLE = 50
_MOST = 0.5


@dataclass(frozen=True)
class Form:
    """A form of stamps: its regular expression, and what it states: a date, a time, or both."""

    pattern: str
    dated: bool
    timed: bool


def form_of(cell: str) -> Form | None:
    """The form of a cell that is a date, a time of day or both; None for any other cell."""
    for nth, pattern in enumerate(_PATTERNS):
        match = pattern.fullmatch(cell.strip())
        if match is not None and not _COMPACT.fullmatch(cell.strip()):
            dated = "year" in match.groupdict()
            return Form(_STAMP_FORMS[nth], dated, match["minute"] is not None)
    return None


def is_stamp(cell: str) -> bool:
    """True for a date, a time of day, or both."""
    return form_of(cell) is not None


def common_form(cells: Sequence[str]) -> Form | None:
    """The form that most of the cells have which are stamps; None if few are stamps."""
    filled = [cell for cell in cells if cell.strip()][:_SAMPLE]
    forms = Counter(form for cell in filled if (form := form_of(cell)) is not None)
    if not forms or sum(forms.values()) < _MOST * len(filled):
        return None
    return forms.most_common(1)[0][0]


# -- numbers and words ------------------------------------------------------------------------
# Kinds of cells: numbers, however written, lists of numbers, stamps and words.

_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+|\d+)([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+|[+-]?\d{1,3}(,\d{3})+\.\d+")
_LIST = re.compile(r"(?:array\()?[\[(][-+0-9.eE,;\s]*(?:nan[-+0-9.eE,;\s]*)*[\])]\)?")
MISSING = frozenset({"", "nan", "n/a", "na", "null", "none", "-", "--", "#n/a"})
# Each as programs write it: `nan`, `NaN`, `NAN`, `None`, `N/A`.
_FORMS = (str.lower, str.upper, str.capitalize, str.title)
SPELLINGS = frozenset(form(word) for word in MISSING for form in _FORMS) | {"NaN"}


def is_number(cell: str) -> bool:
    """True for a number with a decimal point or comma."""
    return bool(_POINT.fullmatch(cell) or _COMMA.fullmatch(cell))


def as_number(cell: str) -> float | None:
    """The number in a cell; None for what is none."""
    return float(cell.replace(",", ".")) if is_number(cell) else None


def holds_data(cell: str) -> bool:
    """True for a number, however written, a list of numbers, and a time."""
    return is_number(cell) or is_grouped(cell) or is_list(cell) or is_stamp(cell)


def is_list(cell: str) -> bool:
    """True for a list of numbers in brackets: `[0.1, 0.2]`, `(1 2 3)`, `array([1, 2])`."""
    return bool(_LIST.fullmatch(cell.strip()))


def is_grouped(cell: str) -> bool:
    """True for a number whose digits are grouped by thousands: `1.234,5`."""
    return bool(_THOUSANDS.fullmatch(cell))


def is_word(cell: str) -> bool:
    """True for a cell that is no number, stamp or list, and does not stand for a missing one."""
    return cell.lower() not in MISSING and not holds_data(cell)


def has_point(cell: str) -> bool:
    return "." in cell and bool(_POINT.fullmatch(cell))


def has_comma(cell: str) -> bool:
    return "," in cell and bool(_COMMA.fullmatch(cell))
