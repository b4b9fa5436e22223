"""Times of a log as seconds: dates, times of day, and numbers of any unit."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.logs.cell_kinds import MONTHS, Form, common_form

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60, "h": 1 / 3600}
# Seconds since 1970 of 2001 and 2096: a larger number of seconds is no stamp of today.
_EPOCH_S = (1e9, 4e9)
_DAY_S = 86_400.0
_SAMPLE = 1000
_ZONE = re.compile(r"(Z|[+-]\d\d:?\d\d)$")
_ISO = re.compile(r"^\d{4}-\d\d-\d\d[T ]\d\d:")
_OF_DAY = re.compile(r"^\d{1,2}:\d\d(:\d\d([.,]\d+)?)?$")
# Years of two digits are those of 1970 to 2069.
_CENTURY = 70
# Years whose nanoseconds since 1970 an integer holds.
_YEARS = (1700, 2262)


class NoStamp(ValueError):
    """A cell that is no time; `row` is its row."""

    def __init__(self, row: int, message: str) -> None:
        super().__init__(message)
        self.row = row


def epoch_unit(first: float) -> str | None:
    """The unit in which a number is a date of 2001 to 2096: s, ms, us or ns; None if none is."""
    for unit in ("s", "ms", "us", "ns"):
        low, high = (bound * PER_S[unit] for bound in _EPOCH_S)
        if low <= first < high:
            return unit
    return None


def seconds_of_numbers(values: NDArray[Any], unit: str) -> tuple[Floats, float]:
    """Times in s from the first one, and the first one in s; integers keep all digits."""
    present = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    first = present[0] if len(present) else 0
    elapsed = np.asarray(values - first, float) / PER_S[unit]
    return elapsed, float(first) / PER_S[unit]


def form_of_words(words: Any) -> Form | None:
    """The form of the stamps in an Arrow array of words; None if it holds no stamps."""
    return common_form([str(w) for w in words.slice(0, _SAMPLE).to_pylist() if w])


def seconds_of_words(words: Any) -> tuple[Floats, float, str]:
    """Times in s from the first stamp, the first one in s, and how they were read.

    `words` is an Arrow array of dates with times, or of times of day, which go on over
    midnight. Raises NoStamp.
    """
    import pyarrow.compute as pc

    text = pc.utf8_trim_whitespace(words)
    form = form_of_words(text)
    if form is None:
        raise NoStamp(0, f"'{str(text[0])[:40]}' is no date and time")
    found = _cast(text, form)
    nanoseconds, how = _parsed(text, form) if found is None else (found, "")
    known = nanoseconds != _NONE
    if not known.any():
        raise NoStamp(0, "no cell is a date and time")
    origin = int(nanoseconds[known][0])
    elapsed = (nanoseconds - origin) / 1e9
    elapsed[~known] = np.nan
    if not form.dated:
        elapsed = _over_midnight(elapsed)
    kind = "dates and times" if form.dated else "times of day"
    return elapsed, origin / 1e9, f"{kind}{how}"


_NONE = np.iinfo(np.int64).min


def _cast(text: Any, form: Form) -> Ints | None:
    """Stamps in ns of ISO dates of one zone, and of times of day; None where others are."""
    import pyarrow as pa
    import pyarrow.compute as pc

    first = next((str(w) for w in text.slice(0, _SAMPLE).to_pylist() if w), "")
    zone = _ZONE.search(first) if form.dated and form.timed else None
    if not (_ISO.match(first) if form.dated else _OF_DAY.match(first)):
        return None
    if zone is not None:
        if not pc.all(pc.fill_null(pc.ends_with(text, zone[1]), True)).as_py():
            return None
        text = pc.utf8_slice_codeunits(text, 0, -len(zone[1]))
    text = pc.replace_substring(text, ",", ".")
    if not form.dated:
        two_digits = pc.replace_substring_regex(text, r"^(\d):", r"0\1:")
        text = pc.binary_join_element_wise("1970-01-01T", two_digits, "")
    try:
        stamps = pc.cast(text, pa.timestamp("ns"))
    except pa.ArrowInvalid:
        return None
    shift = 0 if zone is None else int(_offsets_s([zone[1]])[0] * 1e9)
    numbers: Ints = stamps.to_numpy(zero_copy_only=False).astype(np.int64)
    return numbers if not shift else np.where(numbers == _NONE, _NONE, numbers - shift)


def _parsed(text: Any, form: Form) -> tuple[Ints, str]:
    """Stamps in ns of any form, and how a date was read; NoStamp for the first that has another."""
    import pyarrow.compute as pc

    # Arrow's expressions are RE2's: linear in time, as is what Python's would match here.
    fields = pc.extract_regex(text, f"^(?:{form.pattern})$")
    bad = pc.and_(pc.is_valid(text), pc.is_null(fields)).to_numpy(zero_copy_only=False)
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise NoStamp(row, f"'{str(text[row])[:40]}' is no stamp like those above it")
    parts = _Fields(fields)
    bad = (parts.number("minute") > 59) | (parts.number("second") > 60)
    if form.dated:
        bad |= parts.number("hour") > 24
    if bad.any():
        raise NoStamp(int(np.flatnonzero(bad)[0]), "there is no such time")
    days, how = _days(parts) if form.dated else (np.zeros(len(text), np.int64), "")
    seconds = 3600 * _hours(parts) + 60 * parts.number("minute") + parts.number("second")
    seconds = seconds + days * int(_DAY_S) - _shifts_s(parts)
    found = seconds * 1_000_000_000 + parts.fraction_ns()
    found[pc.is_null(text).to_numpy(zero_copy_only=False)] = _NONE
    return found, how


class _Fields:
    """The named parts of stamps, as Arrow's expressions found them."""

    def __init__(self, fields: Any) -> None:
        self._fields = fields
        self._names = {f.name for f in fields.type}

    def words(self, name: str) -> Any:
        import pyarrow as pa
        import pyarrow.compute as pc

        if not self.has(name):
            return pa.repeat("", len(self._fields))
        return pc.fill_null(pc.struct_field(self._fields, name), "")

    def has(self, name: str) -> bool:
        return name in self._names

    def number(self, name: str) -> Ints:
        import pyarrow as pa
        import pyarrow.compute as pc

        words = self.words(name)
        filled = pc.if_else(pc.equal(words, ""), "0", words)
        numbers: Ints = pc.cast(filled, pa.int64()).to_numpy(zero_copy_only=False)
        return numbers

    def fraction_ns(self) -> Ints:
        """The part after the seconds, in ns."""
        import pyarrow as pa
        import pyarrow.compute as pc

        padded = pc.utf8_slice_codeunits(pc.utf8_rpad(self.words("part"), 9, "0"), 0, 9)
        numbers: Ints = pc.cast(padded, pa.int64()).to_numpy(zero_copy_only=False)
        return numbers


def _hours(parts: _Fields) -> Ints:
    hours = parts.number("hour")
    halves = np.char.lower(parts.words("half").to_numpy(zero_copy_only=False).astype(str))
    twelve = np.where(halves != "", hours % 12, hours)
    return np.where(halves == "p", twelve + 12, twelve)


def _shifts_s(parts: _Fields) -> Ints:
    zones = parts.words("zone")
    if len(distinct := zones.unique()) == 1:
        return np.full(len(zones), _offsets_s(distinct.to_pylist())[0])
    coded = zones.dictionary_encode()
    offsets = _offsets_s(coded.dictionary.to_pylist())
    shifts: Ints = offsets[coded.indices.to_numpy(zero_copy_only=False)]
    return shifts


def _offsets_s(zones: list[str]) -> Ints:
    """Offsets of time zones from UTC in s: `Z`, `+01`, `-0530`, `+01:00`."""

    def offset(zone: str) -> int:
        digits = zone[1:].replace(":", "").ljust(4, "0")
        if zone[:1] not in ("+", "-"):
            return 0
        return (1 if zone[0] == "+" else -1) * (int(digits[:2]) * 3600 + int(digits[2:]) * 60)

    return np.array([offset(zone) for zone in zones], np.int64)


def _days(parts: _Fields) -> tuple[Ints, str]:
    """Days since 1970, and how the date was read if that is not plain."""
    year = parts.number("year")
    year = np.where(year < _CENTURY, year + 2000, np.where(year < 100, year + 1900, year))
    how = ""
    if parts.has("a"):
        (day, month), how = _day_and_month(parts.number("a"), parts.number("b"), year)
    else:
        day, month = parts.number("day"), _month(parts)
    bad = (month < 1) | (month > 12) | (day < 1) | (day > 31)
    bad |= (year < _YEARS[0]) | (year >= _YEARS[1])
    if bad.any():
        raise NoStamp(int(np.flatnonzero(bad)[0]), "there is no such date")
    return _day_number(year, month, day), how


def _day_number(year: Ints, month: Ints, day: Ints) -> Ints:
    months = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    days: Ints = months.astype("datetime64[D]").astype(np.int64) + day - 1
    return days


def _month(parts: _Fields) -> Ints:
    import pyarrow as pa
    import pyarrow.compute as pc

    if parts.has("month"):
        return parts.number("month")
    short = pc.utf8_lower(pc.utf8_slice_codeunits(parts.words("name"), 0, 3))
    nth = pc.fill_null(pc.index_in(short, value_set=pa.array(MONTHS)), -1)
    months: Ints = nth.to_numpy(zero_copy_only=False).astype(np.int64) + 1
    return months


def _day_and_month(a: Ints, b: Ints, year: Ints) -> tuple[tuple[Ints, Ints], str]:
    """Which of two numbers is the day: one above 12 is, else the one that makes fewer days pass."""
    if (a > 12).any():
        return (a, b), ", the day first"
    if (b > 12).any():
        return (b, a), ", the month first"
    spans = [np.ptp(_day_number(year, *both)) for both in ((b, a), (a, b))]
    if spans[0] <= spans[1]:
        return (a, b), ", the day first" if spans[0] < spans[1] else UNSURE
    return (b, a), ", the month first"


# What is told where the cells do not say which number is the day.
UNSURE = ", the day first: the cells do not say"


def _over_midnight(elapsed: Floats) -> Floats:
    """Times of day (s from the first) that go on over midnight.

    A recording that passed midnight may be followed by another one that begins before it again.
    """
    known = np.flatnonzero(~np.isnan(elapsed))
    times = elapsed[known]
    steps = np.diff(times)
    jumps = np.flatnonzero(np.abs(steps) > _DAY_S / 2)
    if not len(jumps):
        return elapsed
    days, shift = np.zeros(len(times)), 0.0
    for i in jumps:
        before, after = float(times[i]) + shift, float(times[i + 1]) + shift
        if steps[i] < 0:
            days[i + 1] = _DAY_S
        elif abs(after - _DAY_S) <= before:
            days[i + 1] = -_DAY_S
        shift += float(days[i + 1])
    unwrapped = elapsed.copy()
    unwrapped[known] += np.cumsum(days)
    return unwrapped
