"""Kinds of cells: numbers, however written, lists of numbers, stamps and words."""

from __future__ import annotations

import re

from mopro.logs.dates import is_stamp

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
