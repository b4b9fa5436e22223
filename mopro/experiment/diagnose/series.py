"""An experiment's readings as the series that the diagnosis takes."""

from __future__ import annotations

from mopro.engine.series import Series
from mopro.experiment.compare.labels import labels, labels_of
from mopro.experiment.model import Reading
from mopro.experiment.predict.forward_model import ForwardModel
from mopro.program import AXES


def series_of(model: ForwardModel) -> list[Series]:
    """A Series for each reading of the runs, in order, with the folds to hold out."""
    return [
        _series(model, index, reading)
        for index, trial in enumerate(model.experiment.trials)
        for reading in trial.readings
    ]


def _series(model: ForwardModel, index: int, reading: Reading) -> Series:
    experiment, sensor = model.experiment, reading.sensor
    own = labels_of(reading, model.schedule(index), experiment.machine.microstep_m)
    quantity = sensor.quantity
    # Positions are in the unit of a sensor that measures them, else in metres.
    unit = "m" if quantity.follows_motion and not quantity.sees_place else sensor.unit
    scale = 1 / sensor.unit_si if quantity.sees_place else 1.0
    other = next(axis for axis in AXES if axis != sensor.axis)
    beside = labels(model.schedule(index), other, reading.time_s, experiment.machine.microstep_m)
    motion = {
        "position": own.command_m * scale,
        "velocity": own.velocity_m_s * scale,
        "acceleration": own.acceleration_m_s2 * scale,
        "other_position": beside.command_m * scale,
    }
    return Series(
        run=experiment.trials[index].name,
        sensor=sensor.name,
        unit=sensor.unit,
        values=reading.values,
        sigma=sensor.sigma or None,
        time_s=reading.time_s,
        folds=own.move,
        # What heat alone makes is not described by the place and speed of the axis.
        labels={"line": own.line, **(motion if quantity.follows_motion else {})},
        position_unit=unit,
        of_place=quantity.sees_place,
        tolerances=sensor.tolerances,
    )
