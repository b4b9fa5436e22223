"""The free-form terms of the sensors of some data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from mopro.engine.candidate import Candidate
from mopro.engine.freeform.clock import stepping_clock
from mopro.engine.freeform.lines import bump, line_in_position, line_in_time
from mopro.engine.freeform.proportional import (
    FADING,
    LATE,
    SHAPES,
    TIME,
    bends_about_the_middle,
    fading,
    lag_term,
    proportional,
)
from mopro.engine.freeform.resonance import resonance
from mopro.engine.freeform.series_motion import POSITION, labelled, values_of
from mopro.engine.freeform.step import step_in_time
from mopro.engine.series import Series


def measurement_laws(data: Sequence[Series], complete: bool = False) -> list[Candidate]:
    """The free-form terms of each sensor that its series have labels for.

    A label that repeats the series' own values describes nothing. `complete`: without those of a
    single run, where listed effects leave noise. Such a term describes an event and is no rival of
    an effect: lost steps, which take a whole number and a move, look the same as any step.
    """
    answer: list[Candidate] = []
    ordered = sorted(enumerate(data), key=lambda each: each[1].sensor)
    for sensor, group in groupby(ordered, key=lambda each: each[1].sensor):
        rows = dict(group)
        answer += _of_sensor(sensor, rows)
    return [c for c in answer if not (complete and c.law and c.law.run)]


def _of_sensor(sensor: str, rows: Mapping[int, Series]) -> Iterator[Candidate]:
    series = list(rows.values())
    for shape in SHAPES:
        if all(labelled(series, label) for label in shape.labels):
            yield from proportional(sensor, series, shape)
    if all(s.time_s is not None for s in series):
        for shape in LATE if _with_rests(series) else ():
            yield from proportional(sensor, series, shape)
        yield from proportional(sensor, series, TIME)
        for shape in FADING:
            if all(labelled(series, label) for label in shape.labels):
                yield from fading(sensor, rows, shape)
        yield from lag_term(sensor, series)
        yield line_in_time(sensor, rows)
        yield from resonance(sensor, rows)
        for row, own in rows.items():
            yield step_in_time(sensor, row, own)
        if labelled(series, "velocity"):
            yield from stepping_clock(sensor, rows)
    if labelled(series, POSITION):
        for shape in bends_about_the_middle(series):
            yield from proportional(sensor, series, shape)
        yield line_in_position(sensor, rows)
        yield bump(sensor, rows)


def _with_rests(series: Sequence[Series]) -> bool:
    """True if the labels tell of moves with rests between them."""
    known = all("velocity" in s.labels and "acceleration" in s.labels for s in series)
    return known and any(bool((values_of(s, "velocity") == 0).any()) for s in series)
