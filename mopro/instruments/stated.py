"""The keys of a [[sensor]] that state its tolerances, and their readers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mopro.engine.tolerances import CLOCK, GAIN, LINEARITY, RANGE, Tolerances
from mopro.tomlfile import Value
from mopro.tomlfile.schema import number, number_in


def _range(value: Value) -> tuple[float, float] | float:
    """`[low, high]`, or a length."""
    ends = value.data if isinstance(value.data, list) else [0.0, value.data]
    match [number_in(end) for end in ends]:
        case [float() as low, float() as high] if low < high:
            return (low, high) if isinstance(value.data, list) else high
    raise value.refused(
        f"expected {value.key} = [-10.0, 10.0], the ends in the unit of the column, or its length"
    )


TOLERANCES: dict[str, Callable[[Value], Any]] = {
    LINEARITY: number(0.0),
    GAIN: number(0.0, 1.0),
    CLOCK: number(0.0, 1.0),
    RANGE: _range,
}


def read_tolerances(entry: Value) -> Tolerances:
    """The tolerances of a [[sensor]]; faults are reported at their keys."""
    stated = {key: entry.get(key, read, None) for key, read in TOLERANCES.items() if key in entry}
    linearity, gain, clock = (stated.get(key) or 0.0 for key in (LINEARITY, GAIN, CLOCK))
    return Tolerances(linearity, gain, clock, stated.get(RANGE))
