"""Doubts about a sensor's sign and scale: readings that a known factor would make fit."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from mopro.engine.candidate import Parameter
from mopro.engine.series import Series
from mopro.experiment.range_ends import end_notes
from mopro.experiment.steps import step_note
from mopro.formula.evaluate import Floats
from mopro.instruments.sensor import FOLD_SLIPS, UNIT_SLIPS
from mopro.stated.base import BaseFit, base_of, fitted_base, slope_of
from mopro.stated.data import Reading
from mopro.stated.model import KINEMATIC, THERMAL
from mopro.stated.reading_series import plain_series
from mopro.stated.simulation import START, Model

# Factors by which a reading may be off, and what they stand for.
_KNOWN: dict[float, str] = {
    **{factor: f"{own} are taken for {other}" for factor, (own, other) in UNIT_SLIPS.items()},
    10.0: "a factor of 10",
    0.1: "a factor of 1/10",
    100.0: "a factor of 100",
    0.01: "a factor of 1/100",
    1000.0: "a factor of 1000, such as mm for m",
    1e-3: "a factor of 1/1000, such as m for mm",
    5.0: "a factor of 5",
    0.2: "a factor of 1/5",
    6.0: "a factor of 6, such as deg/s for rpm",
    1 / 6: "a factor of 1/6, such as rpm for deg/s",
    30 / math.pi: "a factor of 9.549, such as rpm for rad/s",
    math.pi / 30: "a factor of 1/9.549, such as rad/s for rpm",
    60.0: "a factor of 60, such as 1/min for 1/s",
    1 / 60: "a factor of 1/60, such as 1/s for 1/min",
    **FOLD_SLIPS,
}
# Share of the variance that a straight line of measured against simulated must explain, share of
# it that it must leave unexplained at the stated scale, and nearness of a slope to a factor.
_EXPLAINED, _LEFT, _NEAR = 0.9, 0.5, 0.15
# Share of the variance that a scale must leave to be doubted, and the stated one to be refused: for
# another that is not to be doubted. To be told, another scale must leave so much less.
_TRIED, _POOR, _BETTER = 0.02, 0.3, 0.3
# Share of a run, and samples of each reading at least, that other scales are tried on at first.
_BEGINNING, _FEWEST = 0.15, 100
# Of the scales that fit a beginning best, those that are tried on the whole.
_LIKELY = 3
# Most change of readings and command, as a share of their level, that a level is doubted at, and
# nearness of its ratio to a known factor.
_CHANGES, _LEVEL_NEAR = 0.3, 0.02
# A room's temperature, and within how much two sensors have the same; up to this ratio two nodes
# may differ.
_ROOM_C, _SAME_C, _TWICE = 22.0, 1.0, 2.5


def check_scales(model: Model, data: Sequence[Series], base: BaseFit) -> list[str]:
    """Notes on sensors whose readings another sign or a known factor makes fit better.

    ModelError if they hardly fit as they are stated, and do so with the factor: where they do not,
    it is the law that is wrong. A sensor that states its scale is not refused, one of free scale
    not doubted.
    """
    predicted = model(base.settings)
    notes: dict[str, str] = {}
    parts = _fitted_together(model, data)
    for (_, reading), series, own in zip(model.readings, data, predicted, strict=True):
        sensor = reading.sensor
        if sensor.scale is None or sensor.value is None or model.foreign or sensor.name in notes:
            continue
        if not np.ptp(series.values):
            continue  # what is left of equal readings is rounding, which is of any scale
        factor, poor = _of_line(series, own), True
        if factor is None and base.parameters and model.machine.kind != KINEMATIC:
            factor, poor = _of_fits(parts, series, _left(series, own))
        if factor is None:
            continue
        message = f"{sensor.name}: {_words(series, factor)}"
        of = "sign" if factor == -1 else "scale"
        if poor and of not in sensor.value and _fits_all(parts, sensor.name, factor):
            hint = f"{_hint(factor)}; if the readings are right, state {of} = 1"
            raise sensor.value["column"].error(message, "wrong-scale", hint)
        notes[sensor.name] = f"{message}: {_hint(factor)}"
    return [*notes.values(), *_levels(model, predicted, notes.keys())]


def unstated_steps(model: Model) -> list[str]:
    """Notes on sensors whose readings are all multiples of a step that is not stated."""
    notes: dict[str, str] = {}
    for _, reading in model.readings:
        sensor = reading.sensor
        note = step_note(sensor.name, sensor.unit, reading.values, sensor.step, sensor.noise_rms)
        if note is not None:
            notes[sensor.name] = note
    return [*notes.values()]


def ends(model: Model, base: BaseFit) -> Iterator[str]:
    """Notes on sensors whose readings stay where the motion of the model, as fitted, goes on."""
    simulated = cache(partial(model, base.settings))
    for i, (run, reading) in enumerate(model.readings):
        where, time_s = f"{run.name}, {reading.sensor.name}", run.time_s[reading.rows]
        own = partial(lambda nth: simulated()[nth], i)
        yield from end_notes(where, reading.sensor.unit, time_s, reading.values, own)


# -- levels, where little changes ----------------------------------------------------------


def _levels(model: Model, predicted: Sequence[Floats], reported: Collection[str]) -> Iterator[str]:
    """Notes on sensors that stand at a known multiple of where they should stand."""
    for run in model.experiment.trials:
        rows = [i for i, (own, _) in enumerate(model.readings) if own is run]
        for i in rows:
            reading = model.readings[i][1]
            if reading.sensor.name in reported or reading.sensor.scale is None:
                continue
            if model.machine.kind == KINEMATIC:
                found = _level(reading.values, predicted[i], "the command")
            else:
                others = [model.readings[j][1] for j in rows if j != i]
                found = _first_level(reading, others) if model.machine.kind == THERMAL else None
            if found is not None:
                yield f"{reading.sensor.name}: the readings of {run.name} {found}"


def _level(measured: Floats, simulated: Floats, of: str) -> str | None:
    """The words for a level that is a known multiple of another; None where too much changes."""
    level, other = float(np.median(measured)), float(np.median(simulated))
    changes = max(float(np.ptp(measured)) / (abs(level) or 1.0), float(np.ptp(simulated)) / (
        abs(other) or 1.0
    ))  # fmt: skip
    if not level or not other or changes > _CHANGES:
        return None
    near = [f for f in (*_KNOWN, 1.0) if abs(abs(level / other) / f - 1) < _LEVEL_NEAR]
    if not near or (near[0] == 1.0 and level * other > 0):
        return None
    factor = math.copysign(near[0], level * other)
    what = "of the other sign" if factor < 0 else _KNOWN[abs(factor)]
    return f"are at {level:.6g} where {of} is at {other:.6g} ({what}): {_hint(factor)}"


def _first_level(reading: Reading, others: Sequence[Reading]) -> str | None:
    """As _level, for temperatures at the beginning, when all nodes have that of the room.

    That of most others is right; of two, the one that is farther from a room's is doubted.
    """
    same = [o for o in others if o.sensor.quantity is reading.sensor.quantity]
    if not same or any(r.sensor.zero != 0.0 for r in (reading, *same)):
        return None
    own, usual = reading.first, float(np.median([o.first for o in same]))
    if len(same) == 1 and abs(own - _ROOM_C) < abs(usual - _ROOM_C):
        return None
    if abs((own - 32.0) / 1.8 - usual) < _SAME_C:
        return f"begin at {own:.4g} where others begin at {usual:.4g} C: is it in Fahrenheit?"
    if own * usual > 0 and 1 / _TWICE < own / usual < _TWICE:
        return None
    return _level(np.array([own]), np.array([usual]), "the beginning of others")


def _words(series: Series, factor: float) -> str:
    sign = "of the other sign" if factor < 0 else ""
    known = _KNOWN.get(abs(factor))
    times, way = (abs(factor), "large") if abs(factor) > 1 else (1 / abs(factor), "small")
    size = f"{times:.4g} times too {way} ({known})" if known else ""
    what = " and ".join(part for part in (sign, size) if part)
    return f"the readings of {series.run} are as simulated if they are {what}"


def _hint(factor: float) -> str:
    scale = f", or scale = {abs(factor):.6g}" if abs(factor) != 1 else ""
    way = 'sign = -1 or "free"' if factor < 0 else 'the unit as it is, scale = "free"'
    return f"if that is so, state {way}{scale} in the sensor"


def _of_line(series: Series, predicted: Floats) -> float | None:
    """The known factor, or the sign, by which the readings are off the simulated ones."""
    measured, simulated = map(series.without_nuisances, (series.values, predicted))
    power = float(measured @ measured)
    slope = slope_of(measured, simulated)
    if not math.isfinite(slope) or not power:
        return None
    left = measured - slope * simulated
    stated = measured - simulated
    if left @ left > (1 - _EXPLAINED) * power or stated @ stated < _LEFT * power * min(
        1, slope**-2
    ):
        return None
    return _named(slope)


def _named(slope: float) -> float | None:
    near = [f for f in (*_KNOWN, 1.0) if abs(math.log(abs(slope) / f)) < _NEAR]
    if not near:
        return None
    factor = min(near, key=lambda f: abs(math.log(abs(slope) / f)))
    return None if factor == 1.0 and slope > 0 else math.copysign(factor, slope)


@dataclass(frozen=True)
class _Part:
    """Runs whose free numbers are fitted together, and their readings as series."""

    model: Model
    data: Sequence[Series]

    def of(self, name: str) -> _Part:
        """One run alone."""
        if len(self.model.experiment.trials) == 1:
            return self
        trials = tuple(run for run in self.model.experiment.trials if run.name == name)
        model = Model(replace(self.model.experiment, trials=trials))
        return _Part(model, [series for series in self.data if series.run == name])

    @property
    def begun(self) -> _Part:
        """The beginnings of the runs alone, which take less time to simulate."""
        trials = []
        for run in self.model.experiment.trials:
            last = max([round(_BEGINNING * len(run.time_s)), *map(_rows_of, run.readings)])
            readings = tuple(
                replace(r, rows=r.rows[r.rows < last], values=r.values[r.rows < last])
                for r in run.readings
            )
            inputs = {name: own[:last] for name, own in run.inputs.items()}
            trials.append(replace(run, time_s=run.time_s[:last], inputs=inputs, readings=readings))
        model = Model(replace(self.model.experiment, trials=tuple(trials)))
        return _Part(model, plain_series(model))

    def left(self, sensor: str, runs: Collection[str], factor: float) -> float:
        """Largest share of the sensor's series of `runs` that the model leaves if fitted to it.

        These readings are taken for `factor` too large.
        """
        rows = [i for i, s in enumerate(self.data) if s.sensor == sensor and s.run in runs]
        scaled = list(self.data)
        for i in rows:
            scaled[i] = replace(scaled[i], values=scaled[i].values / factor, sigma=None)
        names = {START.format(run, state) for run in runs for state in self.model.states}
        # From the file's numbers: those that were fitted have followed readings that may be wrong.
        own = base_of(self.model)
        parameters = [_scaled(p, factor) if p.name in names else p for p in own]
        fit = fitted_base(self.model, scaled, parameters, once=True)
        simulated = self.model(fit.settings)
        return max(_left(scaled[i], simulated[i]) for i in rows)


def _fitted_together(model: Model, data: Sequence[Series]) -> list[_Part]:
    """Each run by itself, or all of them where they share a number that is free."""
    whole = _Part(model, data)
    shared = any(number.free for number in model.machine.numbers.values())
    return [whole] if shared else [whole.of(run.name) for run in model.experiment.trials]


def _of_fits(parts: Sequence[_Part], doubted: Series, stated: float) -> tuple[float | None, bool]:
    """The known factor, or the sign, with which the model fits much better; if it is poor without.

    For a model of free numbers or of a free start, which follow the readings. At the stated scale
    it leaves a share `stated` of the doubted ones.
    """
    if stated < _TRIED:
        return None, False
    sensor, run = doubted.sensor, doubted.run
    part = next(p for p in parts if any(s.run == run for s in p.data))
    alone = part.of(run)
    # A wrong law may fit a little better at half or twice the scale.
    likely: list[float] = [-1.0, *(f for f in _KNOWN if not 0.5 <= f <= 2.0)]
    begun = alone.begun
    likely = sorted(likely, key=lambda f: begun.left(sensor, {run}, f))[:_LIKELY]
    # All runs together leave more of one than it does alone, and take more time.
    for own in [alone] if alone is part else [alone, part]:
        shares = {f: own.left(sensor, {run}, f) for f in likely}
        likely = [f for f in likely if shares[f] < _BETTER * min(stated, 1.0)]
    if not likely:
        return None, False
    best = min(likely, key=lambda f: shares[f])
    return best, stated >= _POOR


def _fits_all(parts: Sequence[_Part], sensor: str, factor: float) -> bool:
    """True if the model fits all runs of a sensor, which has one scale in them."""
    return all(
        part.left(sensor, runs, factor) < _TRIED
        for part in parts
        for runs in [{s.run for s in part.data if s.sensor == sensor}]
        if runs
    )


def _rows_of(reading: Reading) -> int:
    """Rows of a run in which a reading has as many samples as a fit needs."""
    fewest = min(_FEWEST, len(reading.rows))
    return int(reading.rows[fewest - 1]) + 1


def _left(own: Series, simulated: Floats) -> float:
    """Share of the variance of a series that is not as simulated."""
    left = own.without_nuisances(np.nan_to_num(own.values - simulated, nan=1e9))
    # Of a sensor whose zero is known the level is no part of what changes.
    whole = own.without_nuisances(own.values - own.values.mean())
    return float(left @ left) / (float(whole @ whole) or 1.0)


def _scaled(p: Parameter, factor: float) -> Parameter:
    """A free start as readings that are `factor` too large have it."""
    low, high = sorted((p.low / factor, p.high / factor))
    return replace(p, low=low, high=high, starts=(p.starts[0] / factor,))
