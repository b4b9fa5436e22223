"""Parses what is varied and over which values: `VEL1=10:60:2`, `PARA1=+,-`, `payload=0:5:0.5lb`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

from mopro.machine import Machine
from mopro.program import Program
from mopro.sweeps.targets import Target, Value, Variant, VaryError, target_named

MOST_POINTS = 200_000
MOST_VARIED = 16
_MOST_CHARACTERS = 10_000
# Digits of a number that is drawn: with more of them it could not be typed again.
_DRAWN_DIGITS = 6
_ITEM = re.compile(r"\s*([+-]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30}))\s*([A-Za-z%1].*?)?\s*", re.ASCII)
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9]+")


@dataclass(frozen=True)
class Varied:
    """A target with its values, in `unit` ("" for choices).

    `levels` are the values in their order; a range without a step has the two ends instead,
    between which a design draws (`drawn`).
    """

    name: str
    target: Target
    unit: str
    levels: tuple[Value, ...]
    drawn: bool = False

    @property
    def column(self) -> str:
        """The name in a table, with the unit: `VEL1_in_s`."""
        unit = self.unit.replace("%", "percent") if self.unit != "1" else ""
        return self.name + ("_" + _NOT_IN_NAMES.sub("_", unit).strip("_") if unit else "")

    def at(self, share: float) -> Value:
        """The value at a `share` from 0 to below 1 of the levels, or of the range."""
        if not self.drawn:
            return self.levels[int(share * len(self.levels))]
        low, high = (float(end) for end in self.levels)
        return Fraction(f"{low + share * (high - low):.{_DRAWN_DIGITS}g}")

    def changed(self, variant: Variant, value: Value) -> Variant:
        """`variant` with this `value`."""
        if not isinstance(value, str):
            value = value * self.target.units[self.unit]
        return self.target.changed(variant, value)


def all_varied(
    vary: Iterable[tuple[str, str | Sequence[object]]], program: Program, machine: Machine
) -> tuple[Varied, ...]:
    """What `vary` names, each with its text or values; VaryError for what cannot be varied."""
    found = [_varied(name, values, program, machine) for name, values in vary]
    if not found:
        raise VaryError("nothing is varied: name something, such as VEL1=10:60:2")
    if len(found) > MOST_VARIED:
        raise VaryError(f"{len(found)} quantities are varied: expected at most {MOST_VARIED}")
    for one, other in combinations(found, 2):
        if one.target.places & other.target.places:
            what = "twice" if one.name == other.name else f"by {one.name} and by {other.name}"
            raise VaryError(f"{other.name} is varied {what}: give all its values at once")
    return tuple(found)


def _varied(
    name: str, values: str | Sequence[object], program: Program, machine: Machine
) -> Varied:
    text = values if isinstance(values, str) else ",".join(map(_written, values))
    try:
        if len(text) > _MOST_CHARACTERS:
            raise VaryError(f"its values have more than {_MOST_CHARACTERS} characters")
        target = target_named(name, program, machine)
        return (
            _of_choices(name, target, text) if target.choices else _of_numbers(name, target, text)
        )
    except VaryError as error:
        shown = text if len(text) <= 40 else f"{text[:40]}…"
        raise VaryError(f"vary {name}={shown}: {error}") from error


def _written(value: object) -> str:
    """A value of a Python sequence as text; numbers may come from numpy."""
    return value if isinstance(value, str) else f"{float(value):.15g}"  # type: ignore[arg-type]


def _of_choices(name: str, target: Target, text: str) -> Varied:
    words = [word.strip() for word in text.split(",")]
    for word in words:
        if word not in target.choices:
            known = " and ".join(target.choices)
            raise VaryError(f"'{word}' is none of its values: expected {known}, with commas")
    return Varied(name, target, "", _once(words))


def _of_numbers(name: str, target: Target, text: str) -> Varied:
    ranged = ":" in text
    parts = text.split(":" if ranged else ",")
    if ranged and len(parts) not in (2, 3):
        raise VaryError("expected START:STOP:STEP, or START:STOP to draw from")
    numbers, unit = _numbers(parts, target.units)
    if not ranged:
        levels: Sequence[Value] = _once(numbers)
    elif len(numbers) == 2:
        levels = numbers
        if numbers[0] >= numbers[1]:
            raise VaryError("the range is empty: STOP must be greater than START")
    else:
        levels = _steps(*numbers)
    for level in (min(levels), max(levels)):
        assert isinstance(level, Fraction)
        if fault := target.fault(level * target.units[unit]):
            raise VaryError(fault)
    return Varied(name, target, unit, tuple(levels), ranged and len(numbers) == 2)


def _numbers(parts: Sequence[str], units: Mapping[str, Fraction]) -> tuple[list[Fraction], str]:
    """The numbers, and the unit that they have: the one that the last of them states."""
    matches = [_ITEM.fullmatch(part) for part in parts]
    for part, match in zip(parts, matches, strict=True):
        if match is None:
            raise VaryError(
                f"'{part}' is no number: expected START:STOP:STEP or numbers with commas"
            )
    stated = {match[2] for match in matches if match and match[2]}
    if len(stated) > 1:
        raise VaryError(f"its numbers have several units, {', '.join(sorted(stated))}: state one")
    unit = stated.pop() if stated else next(iter(units))
    if unit not in units:
        raise VaryError(f"'{unit}' is not its unit: expected one of {', '.join(units)}")
    return [Fraction(match[1]) for match in matches if match], unit


def _steps(start: Fraction, stop: Fraction, step: Fraction) -> list[Fraction]:
    """From `start` on in steps, `stop` included where they meet it."""
    if not step or (stop - start) / step < 0:
        raise VaryError("the range is empty: STEP must lead from START to STOP")
    count = int((stop - start) / step) + 1
    if count > MOST_POINTS:
        raise VaryError(f"it has {count} values: expected at most {MOST_POINTS}")
    return [start + n * step for n in range(count)]


def _once(values: Sequence[Value]) -> tuple[Value, ...]:
    """`values`, of which none may come twice."""
    for n, value in enumerate(values):
        if value in values[:n]:
            shown = value if isinstance(value, str) else f"{float(value):g}"
            raise VaryError(f"{shown} stands there twice")
    return tuple(values)
