"""Forms of dates and times in cells: which one a cell has, whatever its column is called."""

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
_FORMS = (
    rf"{TIME}{ZONE}",
    _SHORT,
    *(f"{_WEEKDAY}{date}(?:{_BETWEEN}{TIME}{ZONE})?" for date in _DATES),
)
_PATTERNS = tuple(re.compile(form) for form in _FORMS)
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
            return Form(_FORMS[nth], dated, match["minute"] is not None)
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
