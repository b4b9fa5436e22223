"""Effects between an axis and its sensors: a play before one, and crosstalk.

Crosstalk is a share in a reading of an input that no formula of the machine uses.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from mopro.engine.assumed import LEAST_SHARE, MAJORITY, ROUNDING
from mopro.engine.residuals import difference_variance
from mopro.formula import dimension_of_unit, factor_of, inverse, parse, product
from mopro.formula.evaluate import Floats
from mopro.formula.written import MEASUREMENT, EffectParameter, Written, WrittenEffect
from mopro.stated.data import Reading, Sensor, StatedExperiment
from mopro.stated.model import AXIS

_CROSSTALK = "crosstalk of "
_BEFORE = "play before "
# How the names of these effects begin.
BEGINNINGS = (_CROSSTALK, _BEFORE)
# Largest share of an input of the sensor's own quantity: more of it measures the same thing.
_LARGEST = 0.5
# The unit of a difference of temperatures.
_OF_DIFFERENCE = {"C": "K"}


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
            yield WrittenEffect(f"{_BEFORE}{sensor.name}", MEASUREMENT, sensor.name, term, (width,))


def crosstalk_of(
    experiment: StatedExperiment, sensors: Sequence[Sensor], used: Collection[str]
) -> Iterator[WrittenEffect]:
    """The effect for each sensor and each input that is not `used`, or that the machine has.

    None of an input that a closed loop made.
    """
    fed_back = any(run.feedback for run in experiment.trials)
    for name, unit in experiment.units.items():
        everywhere = all(name in run.inputs for run in experiment.trials)
        for sensor in sensors if everywhere else ():
            effect = _effect(name, unit, sensor)
            if effect.name in experiment.machine.active or not (name in used or fed_back):
                yield effect


def _effect(of: str, unit: str, sensor: Sensor) -> WrittenEffect:
    """Counted from the first value of a run: where a zero is stated, a level is no crosstalk."""
    of_sensor, of_input = (_OF_DIFFERENCE.get(own, own) for own in (sensor.unit, unit))
    size, of_size = "c" if of != "c" else "c_1", product(of_sensor, inverse(of_input))
    most = _LARGEST / factor_of(of_size) if sensor.dimension == dimension_of_unit(unit) else None
    parameter = EffectParameter(size, of_size, low=most and -most, high=most)
    term = Written.of(f"{size} * ({of} - first({of}))")
    name = f"{_CROSSTALK}{of} in {sensor.name}"
    return WrittenEffect(name, MEASUREMENT, sensor.name, term, (parameter,), crosses=of)


def stands_apart(readings: Sequence[tuple[Reading, Mapping[str, Floats]]], of: str) -> bool:
    """True if an input `of` can be told in readings from all that is in them anyway.

    `readings`: with the values (n) of all that formulas use in that run, beside `of`. What these
    make up, but for a tenth of its size, is a copy of them; what makes up the readings better than
    their noise allows was made from them, as a following error is.
    """
    columns = [(_signals(reading, known, of), reading, known) for reading, known in readings]
    basis = np.concatenate([own for own, _, _ in columns])
    crossing = np.concatenate([_centred(known[of][r.rows]) for _, r, known in columns])
    read = np.concatenate([_centred(r.values) for _, r, _ in columns])
    if not _rms(_left(basis, crossing)) > LEAST_SHARE * _rms(crossing):
        return False
    noise = readings[0][0].sensor.noise_rms or difference_variance(_left(basis, read)) ** 0.5
    return _rms(_left(np.column_stack([basis, crossing]), read)) > MAJORITY * noise


def _signals(reading: Reading, known: Mapping[str, Floats], of: str) -> Floats:
    """The other signals (samples x signals) at a reading's samples, about their means."""
    others = [_centred(values[reading.rows]) for name, values in known.items() if name != of]
    return np.stack(others, axis=1)


def _centred(values: Floats) -> Floats:
    centred: Floats = values - values.mean()
    return centred


def _left(basis: Floats, values: Floats) -> Floats:
    """Residual (n) of a least-squares fit of the columns of `basis` (n x m) to `values` (n)."""
    sizes = np.linalg.norm(basis, axis=0)
    scaled = basis / np.where(sizes > 0, sizes, 1.0)
    left: Floats = values - scaled @ np.linalg.lstsq(scaled, values, rcond=ROUNDING)[0]
    return left


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
