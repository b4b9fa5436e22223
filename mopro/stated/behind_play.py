"""Play before a sensor: what it reads follows the axis with a play of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mopro.formula import parse
from mopro.formula.written import MEASUREMENT, EffectParameter, Written, WrittenEffect
from mopro.stated.data import Sensor, StatedExperiment
from mopro.stated.model import AXIS

BEFORE = "play before "


def plays_of(experiment: StatedExperiment, sensors: Sequence[Sensor]) -> Iterator[WrittenEffect]:
    """The effect for each sensor of the place of an axis that is driven.

    The law of an axis has one place: an encoder at the load reads another one where there is play
    between motor and load.
    """
    if experiment.machine.kind != AXIS or not experiment.units:
        return
    for sensor in sensors:
        if sensor.quantity.tells_place:
            width = EffectParameter(
                "w", sensor.unit, low=0.0, high=parse("x_span"), start=parse("x_span / 100"),
                positive=True,
            )  # fmt: skip
            term = Written.of("play(y, w) - y")
            yield WrittenEffect(f"{BEFORE}{sensor.name}", MEASUREMENT, sensor.name, term, (width,))
