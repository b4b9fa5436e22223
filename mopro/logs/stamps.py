"""Times of a log as seconds: dates, times of day, and numbers of any unit."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PER_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60, "h": 1 / 3600}
# Seconds since 1970 of 2001 and 2096: a larger number of seconds is no stamp of today.
_EPOCH_S = (1e9, 4e9)
_DAY_S = 86_400.0
_ZONE = re.compile(r"(Z|[+-]\d\d:?\d\d)$")
_DATE = re.compile(r"^\d{4}-\d\d-\d\d")


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


def seconds_of_words(words: Any) -> tuple[Floats, float, str]:
    """Times in s from the first stamp, the first one in s, and how they were read.

    `words` is an Arrow array of dates with times (ISO 8601), or of times of day, which go on
    over midnight. Raises NoStamp.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    first = next((str(w) for w in words.slice(0, 1000).to_pylist() if w), "")
    zone = _ZONE.search(first) if ":" in first else None
    text = pc.utf8_trim_whitespace(words)
    if zone is not None:
        text = _without_zone(text, zone[1])
    dated = bool(_DATE.match(first))
    text = pc.replace_substring(text, ",", ".")
    if not dated:
        text = pc.binary_join_element_wise("1970-01-01T", _two_digits(text), "")
    try:
        stamps = pc.cast(text, pa.timestamp("ns"))
    except pa.ArrowInvalid as error:
        raise _first_bad(text) from error
    numbers = stamps.to_numpy(zero_copy_only=False)
    known = ~np.isnat(numbers)
    origin = numbers[known][0]
    elapsed = (numbers - origin).astype("timedelta64[ns]").astype(float) / 1e9
    elapsed[~known] = np.nan
    how = "dates and times" if dated else "times of day"
    if not dated:
        elapsed = _over_midnight(elapsed)
    shift = 0.0 if zone is None else _offset_s(zone[1])
    return elapsed, float(origin.astype("int64")) / 1e9 - shift, how


def _without_zone(text: Any, zone: str) -> Any:
    import pyarrow.compute as pc

    same = pc.ends_with(text, zone)
    wrong = np.flatnonzero(~np.asarray(pc.fill_null(same, True).to_numpy(zero_copy_only=False)))
    if len(wrong):
        raise NoStamp(int(wrong[0]), f"a stamp of another time zone than {zone}")
    return pc.utf8_slice_codeunits(text, 0, -len(zone))


def _two_digits(text: Any) -> Any:
    """Times of day with two digits of hours."""
    import pyarrow.compute as pc

    return pc.replace_substring_regex(text, r"^(\d):", r"0\1:")


def _offset_s(zone: str) -> float:
    if zone == "Z":
        return 0.0
    digits = zone[1:].replace(":", "")
    return (1 if zone[0] == "+" else -1) * (int(digits[:2]) * 3600.0 + int(digits[2:]) * 60.0)


def _over_midnight(elapsed: Floats) -> Floats:
    steps = np.diff(elapsed)
    days = np.cumsum(np.concatenate(([0.0], np.where(steps < -_DAY_S / 2, _DAY_S, 0.0))))
    unwrapped: Floats = elapsed + days
    return unwrapped


def _first_bad(text: Any) -> NoStamp:
    import pyarrow as pa
    import pyarrow.compute as pc

    low, high = 0, len(text)
    while high - low > 1:
        middle = (low + high) // 2
        try:
            pc.cast(text.slice(low, middle - low), pa.timestamp("ns"))
        except pa.ArrowInvalid:
            high = middle
        else:
            low = middle
    return NoStamp(low, f"'{str(text[low])[:40]}' is no date and time")
