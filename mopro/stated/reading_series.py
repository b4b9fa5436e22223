"""Readings of a stated machine as the series that the diagnosis takes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.engine.series import Series, Settings
from mopro.formula.evaluate import Floats
from mopro.stated.data import Reading, Run, Sensor
from mopro.stated.model import AXIS, THERMAL
from mopro.stated.names import place_unit
from mopro.stated.simulation import Model

# Parts of a run that are held out, and the share of a part by which its end may move to a change
# of the motion.
PARTS = 8
_MOVED = 0.25


def series_of(model: Model, settings: Settings) -> list[Series]:
    """A Series for each reading, in order; its labels are those of the motion at `settings`."""
    motions = {run.name: model.motion(run, settings).states for run in model.experiment.trials}
    return [_series(model, run, reading, motions[run.name]) for run, reading in model.readings]


def plain_series(model: Model) -> list[Series]:
    """A Series for each reading, in order, without labels: no simulation is needed."""
    return [_series(model, run, reading, {}) for run, reading in model.readings]


def _series(model: Model, run: Run, reading: Reading, states: Mapping[str, Floats]) -> Series:
    sensor, time_s = reading.sensor, run.time_s[reading.rows]
    motion = _motion(model, run, reading, states) if _has_motion(model, run, reading) else {}
    labels = {name: values[reading.rows] for name, values in motion.items()}
    return Series(
        run=run.name,
        sensor=sensor.name,
        unit=sensor.unit,
        values=reading.values,
        sigma=sensor.noise_rms,
        time_s=time_s,
        folds=_folds(run, reading, labels.get("velocity")),
        nuisances=nuisances(reading, time_s),
        labels=labels,
        position_unit=_place_unit(model, sensor) if labels else "m",
        fed_back=run.feedback,
        path=(run.time_s, motion["position"]) if motion else None,
        tolerances=sensor.tolerances,
        record=run.record,
        count=sensor.step if sensor.quantity.tells_place else 0.0,
    )


def _place_unit(model: Model, sensor: Sensor) -> str:
    """The unit of the labels' positions: that of a position sensor, else SI."""
    return sensor.unit if sensor.quantity.tells_place else place_unit(model.experiment)


def _has_motion(model: Model, run: Run, reading: Reading) -> bool:
    """True if the motion of the model describes what is left of a reading.

    The place that an axis takes under its forces does not describe its own error.
    """
    placed = reading.sensor.quantity.tells_place
    return (
        model.machine.kind != THERMAL
        and not run.feedback
        and not (placed and model.machine.kind == AXIS)
    )


def nuisances(reading: Reading, time_s: Floats) -> Floats:
    """Shapes (n, m) that are always fitted: an offset, and a drift that may bend."""
    sensor, shapes = reading.sensor, []
    if sensor.zero is None:
        shapes.append(np.ones(len(time_s)))
    if sensor.drift_s == 0:
        shapes.append(time_s - time_s.mean())
    elif sensor.drift_s:
        knots = np.arange(time_s[0], time_s[-1] + sensor.drift_s, sensor.drift_s)
        shapes += list(np.maximum(1 - np.abs(time_s - knots[:, None]) / sensor.drift_s, 0))
    return np.array(shapes).reshape(len(shapes), len(time_s)).T


def _motion(
    model: Model, run: Run, reading: Reading, states: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Position, speed and acceleration of the model at all rows, as the labels have them.

    In the unit of a position sensor, or in SI.
    """
    if "x" not in states or len(run.time_s) < 2 or not np.isfinite(states["x"]).all():
        return {}
    if not np.ptp(states["x"]):
        return {}
    unit = reading.sensor.factor if reading.sensor.quantity.tells_place else 1.0
    rates = model.rates_of(run, states)
    return {
        "position": states["x"] / unit,
        "velocity": rates["v"] / unit,
        "acceleration": rates["a"] / unit,
    }


def _folds(run: Run, reading: Reading, velocity: Floats | None) -> NDArray[np.int64]:
    """Numbers of the parts of the run, alike in length, that can be held out.

    Their ends move to the nearest reversal, if there is one near.
    """
    time_s = run.time_s[reading.rows]
    begin, end = float(time_s[0]), float(time_s[-1])
    ends = np.linspace(begin, end, PARTS + 1)[1:-1]
    if velocity is not None:
        turns = time_s[1:][np.diff(np.sign(velocity)) != 0]
        reach = _MOVED * (end - begin) / PARTS
        for i, at in enumerate(ends.tolist()):
            near = turns[np.abs(turns - at) < reach]
            if len(near):
                ends[i] = near[np.argmin(np.abs(near - at))]
    return np.searchsorted(ends, time_s, side="right").astype(np.int64)
