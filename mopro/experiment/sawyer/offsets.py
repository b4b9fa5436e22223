"""Offsets of sensors that all runs share: calibrations, unless a force may as well make them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from mopro.effects import Effect, catalogue_of
from mopro.engine.residuals import Residuals, noise_of
from mopro.engine.series import Series, Simulate
from mopro.engine.verdict import Estimate, Named, Verdict
from mopro.experiment.sawyer.trials import Experiment
from mopro.instruments.sensor import Sensor
from mopro.machine import Machine

# In σ: least size of an offset that is reported.
_OFFSET_SIGMAS = 6.0
# P-value below which the offsets of the runs are not the same.
_SAME_OFFSET_P = 1e-3
_FEWEST_RUNS = 2


def with_offset(
    verdict: Verdict,
    data: Sequence[Series],
    model: Simulate,
    experiment: Experiment,
    left_out: Collection[str],
) -> Verdict:
    """`verdict` (none) with the sensor offsets that all runs share, if there are any.

    A zero that is off is a calibration; one that may as well be a force is told with that.
    """
    effects = catalogue_of(experiment.machine).values()
    kept = [effect for effect in effects if effect.name not in left_out]
    offset_in = next(((e, e.constant_offset) for e in kept if e.constant_offset), None)
    if offset_in is None:
        return verdict
    residuals = Residuals(model, data).calibrated_at(verdict.base_before)
    # A verdict of `none` has no effects, so no parameters were fitted.
    residual, offsets = residuals.at(verdict.settings), []
    left = residuals.of_exact_sensors(verdict.settings)
    power = noise_of(residuals, residual, 0).power_of_means(residual)
    sensors = {r.sensor.name: r.sensor for t in experiment.trials for r in t.readings}
    for sensor in dict.fromkeys(s.sensor for s in data):
        rows = [i for i, s in enumerate(data) if s.sensor == sensor and s.sigma]
        means = [float(np.mean(left[i])) for i in rows]
        memory = math.sqrt(float(np.mean(power[rows]))) if rows else 1.0
        offset = _common_offset(*offset_in, [data[i] for i in rows], means, memory)
        if offset:
            rivals = _deflections(offset, sensors.get(sensor), experiment.machine, kept)
            offsets.append(
                replace(offset, form=sensor, rivals=rivals, indistinguishable_from=[*rivals])
            )
    doubtful = tuple(offset for offset in offsets if offset.rivals)
    zeros = tuple(offset for offset in offsets if not offset.rivals)
    word = "ambiguous" if doubtful else verdict.verdict
    return replace(verdict, verdict=word, effects=doubtful, sensors=(*verdict.sensors, *zeros))


def _deflections(
    offset: Named, sensor: Sensor | None, machine: Machine, effects: Iterable[Effect]
) -> dict[str, float]:
    """Those of `effects` that shift all readings as far by a plausible force, each with ΔEBIC zero.

    Empty for a table, which has no sensor, and for a quantity that a force does not change.
    """
    under_load = None if sensor is None else sensor.quantity.under_load
    if sensor is None or under_load is None:
        return {}
    nearest = min(abs(end) for e in offset.parameters.values() for end in e.ci95) * sensor.unit_si
    stiffness_N_m = machine.axis.stiffness_N_m
    return {
        effect.name: 0.0
        for effect in effects
        if nearest <= under_load(effect.static_deflection_m(machine), stiffness_N_m)
    }


def _common_offset(
    effect: Effect, parameter: str, data: Sequence[Series], of_runs: Sequence[float], memory: float
) -> Named | None:
    """The offset of one sensor over its runs as `parameter` of `effect`.

    of_runs: that of each run, in the sensor's unit; memory: standard deviation of a mean over that
    of white noise. None for a single run (its position at the start is unknown), for an offset
    below _OFFSET_SIGMAS, or for runs that differ.
    """
    if len(data) < _FEWEST_RUNS:
        return None
    means = np.array(of_runs)
    errors = np.array([memory * (s.sigma or 0.0) / math.sqrt(len(s)) for s in data])
    weights = 1 / errors**2
    offset, error = float(means @ weights / weights.sum()), 1 / math.sqrt(weights.sum())
    scatter = float(((means - offset) ** 2) @ weights)
    if (
        abs(offset) < _OFFSET_SIGMAS * error
        or special.chdtrc(len(data) - 1, scatter) < _SAME_OFFSET_P
    ):
        return None
    others = (means @ weights - means * weights) / (weights.sum() - weights)
    sigmas = abs(offset) / error
    interval = (offset - 1.96 * error, offset + 1.96 * error)
    return Named(
        name=effect.name,
        form="",
        parameters={parameter: Estimate(offset, data[0].unit, interval, False)},
        indistinguishable_from=[],
        rivals={},
        alternatives={},
        log10_bayes_factor=(sigmas**2 - math.log(sum(map(len, data)))) / (2 * math.log(10)),
        sigmas=sigmas,
        held_out=float((means - others) ** 2 @ weights) < float(means**2 @ weights),
    )
