"""The origin of places: a sensor's zero, or where a run starts, where data cannot part them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mopro.engine.assumed import ROUNDING
from mopro.formula.evaluate import Floats
from mopro.stated.base import BaseFit, base_of
from mopro.stated.data import Reading, Run, Sensor, StatedExperiment
from mopro.stated.reading_series import nuisances
from mopro.stated.simulation import BASE, START, Model

_TOLD = (
    "sensor {}: its zero and the start of the runs are one number to these data: places are those "
    "that it shows, in all runs"
)


def with_one_origin(experiment: StatedExperiment, model: Model) -> StatedExperiment:
    """The experiment, the zero of each sensor at 0 that the free start of a run makes up for.

    Where the machine does not depend on the place, a reading moves by as much as the start does.
    With both of them free the place wanders along what they share, and every effect of the place
    with it. A machine with such an effect in its file tells them apart, and both stay free.
    """
    names = {sensor.name for run in experiment.trials for sensor in _made_up_for(model, run)}
    if not names:
        return experiment
    trials = tuple(
        replace(run, readings=tuple(_at_zero(r, names) for r in run.readings))
        for run in experiment.trials
    )
    notes = (*experiment.notes, *(_TOLD.format(name) for name in sorted(names)))
    return replace(experiment, trials=trials, notes=notes)


def _at_zero(reading: Reading, names: set[str]) -> Reading:
    sensor = reading.sensor
    return replace(reading, sensor=replace(sensor, zero=0.0)) if sensor.name in names else reading


def _made_up_for(model: Model, run: Run) -> Iterator[Sensor]:
    """The sensors of a run whose free zero does what a free start does."""
    rows = [i for i, (own, _) in enumerate(model.readings) if own is run]
    free = [i for i in rows if model.readings[i][1].sensor.zero is None]
    if not free or model.foreign is not None:
        return
    base = base_of(model)
    settings = BaseFit(tuple(base)).settings
    starts = {START.format(run.name, state) for state, at in run.start.items() if at is None}
    for p in (p for p in base if p.name in starts):
        step = p.difference * (p.high - p.low)
        moved = {BASE: {**settings[BASE], p.name: p.starts[0] + step}}
        changes = [b - a for a, b in zip(model(settings), model(moved), strict=True)]
        whole = sum(float(changes[i] @ changes[i]) for i in rows)
        left = sum(_left(model.readings[i][1], run, changes[i]) for i in rows)
        if left <= ROUNDING * whole:
            shown = max(free, key=lambda i: float(changes[i] @ changes[i]))
            yield model.readings[shown][1].sensor


def _left(reading: Reading, run: Run, change: Floats) -> float:
    """Sum of squares of a change of a reading that its offset and drift do not make up for."""
    shapes = nuisances(reading, run.time_s[reading.rows])
    if shapes.shape[1]:
        change = change - shapes @ np.linalg.lstsq(shapes, change, rcond=None)[0]
    return float(change @ change)
