"""Runs of a stated machine that were not made: its own ones slower, faster, shorter, reversed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mopro.formula import dimension_of_unit
from mopro.formula.evaluate import Floats
from mopro.stated.data import Reading, Run
from mopro.stated.model import AXIS, KINEMATIC, PYTHON, THERMAL
from mopro.stated.names import axis_law
from mopro.stated.simulation import Model

_KELVIN = dimension_of_unit("K")


@dataclass(frozen=True)
class Motion:
    """Change of a run: `time` and `size` scale its length and its driving inputs.

    `words`: its description, after "a run". `mirrored`: in the opposite direction. `times`: cycles
    forth and back, 0 for once forth. `load`: the other input that is doubled, None for none.
    """

    words: str
    time: float = 1.0
    size: float = 1.0
    mirrored: bool = False
    times: int = 0
    load: str | None = None


def other_motions(model: Model) -> Iterator[Motion]:
    """The motions that a machine may be asked for beside those that were measured.

    None of one whose inputs were made from the readings by a closed loop, or that is a program.
    """
    kind = model.machine.kind
    if kind == PYTHON or any(run.feedback for run in model.experiment.trials):
        return
    drive = "stroke" if kind == KINEMATIC else "drive"
    yield Motion("half as fast", time=2.0)
    yield Motion("twice as fast", time=0.5)
    yield Motion(f"with half the {drive}", size=0.5)
    yield Motion(f"with twice the {drive}", size=2.0)
    yield Motion(f"with half the {drive}, in half the time", time=0.5, size=0.5)
    yield Motion(f"with twice the {drive}, in twice the time", time=2.0, size=2.0)
    short = f"with a quarter of the {drive}"
    yield Motion(f"{short}, 4 times forth and back", 1 / 4, size=1 / 4, times=4)
    yield Motion(f"{short}, twice as fast, 8 times forth and back", 1 / 8, size=1 / 4, times=8)
    if kind != THERMAL:
        yield Motion("the other way about", mirrored=True)
    yield Motion("at rest", size=0.0)
    for name, unit in model.experiment.units.items():
        if name not in driving(model) and dimension_of_unit(unit) != _KELVIN:
            yield Motion(f"with twice the {name}", load=name)


def driving(model: Model) -> frozenset[str]:
    """The inputs that the law of the machine follows, but for temperatures."""
    law = axis_law(model.experiment) if model.machine.kind == AXIS else None
    laws = [own.formula for own in model.machine.laws.values()] + ([law] if law else [])
    units = model.experiment.units
    return frozenset(
        name
        for formula in laws
        for name in formula.names & units.keys()
        if dimension_of_unit(units[name]) != _KELVIN
    )


def moved(model: Model, motion: Motion, run: Run) -> Run:
    """The run as it would be with another motion, with no data."""
    begin, step = float(run.time_s[0]), float(np.median(np.diff(run.time_s)))
    time_s = run.time_s
    length = float(np.ptp(run.time_s)) * motion.time
    if motion.time != 1.0 or motion.times:
        rows = round(length * max(2 * motion.times, 1) / step) + 1
        time_s = np.asarray(begin + step * np.arange(rows), dtype=float)
    # Forth and back is a wave between 0 and the length.
    along = length - np.abs(length - (time_s - begin) % (2 * length))
    asked = begin + along / motion.time
    inputs = {name: _at(run, name, asked) for name in run.inputs}
    for name in driving(model):
        inputs[name] = _driven(model.machine.kind, motion, inputs[name])
    if motion.load is not None:
        inputs[motion.load] = 2 * inputs[motion.load]
    readings = tuple(_unread(reading, len(time_s)) for reading in run.readings)
    return replace(run, time_s=time_s, inputs=inputs, readings=readings)


def _at(run: Run, name: str, times: Floats) -> Floats:
    """An input of a run at other times (s)."""
    if name not in run.held:
        return np.asarray(np.interp(times, run.time_s, run.inputs[name]), dtype=float)
    rows = np.searchsorted(run.time_s, times, side="right") - 1
    return run.inputs[name][np.clip(rows, 0, len(run.time_s) - 1)]


def _driven(kind: str, motion: Motion, values: Floats) -> Floats:
    """Driving input (rows, SI), scaled: a place about its first value, a force or power about 0."""
    if kind != KINEMATIC:
        return values * (-motion.size if motion.mirrored else motion.size)
    if motion.mirrored:
        values = values.min() + values.max() - values
    first = values[0]
    return np.asarray(first + motion.size * (values - first))


def _unread(reading: Reading, count: int) -> Reading:
    """The sensor of a reading at as many rows among `count` as it has of each of its own run."""
    stride = max(int(np.median(np.diff(reading.rows))), 1)
    rows = np.arange(int(reading.rows[0]) % stride, count, stride)
    return Reading(reading.sensor, rows, np.zeros(len(rows)), reading.first)
