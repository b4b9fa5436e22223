"""Hidden changes of machines beside the motor, less what their free numbers take up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from mopro.blind.making.machine_drawn import Machine
from mopro.blind.reference.motor import Floats, Hidden
from mopro.blind.reference.stepped_machines import PLANTS, Columns

# Relative step of a number for its derivative.
_STEP = 1e-4
_EVALUATIONS = 40


def stacked(machine: Machine, runs: Sequence[Columns], numbers: Mapping[str, float],
            effects: Hidden) -> Floats:  # fmt: skip
    """Readings of all runs, (rows of all sensors of all runs,), each series less its mean.

    The mean goes where the zero of the sensor is free.
    """
    series = [own for run in runs for own in seen(machine.kind, run, numbers, effects)]
    return np.concatenate([own if machine.zero else own - own.mean() for own in series])


def seen(kind: str, run: Columns, numbers: Mapping[str, float], effects: Hidden) -> Floats:
    """Readings (sensors, rows) of a run; NaN where the machine runs away."""
    try:
        return PLANTS[kind](run, numbers, effects)
    except OverflowError:
        return np.full((1, len(run["time_s"])), np.nan)


def visible(machine: Machine, runs: Sequence[Columns], effects: Hidden) -> dict[str, float]:
    """Size of each effect in the readings (their unit, root of the sum of squares).

    Of its change the part that no change of the free numbers makes, to first order.
    """
    every = stacked(machine, runs, machine.numbers, effects)
    taken = np.array([
        stacked(machine, runs, {**machine.numbers, name: value * (1 + _STEP)}, effects) - every
        for name, value in machine.numbers.items()
        if name in machine.free or name in machine.off
    ])  # fmt: skip
    base = np.linalg.qr(taken.T)[0] if len(taken) else np.zeros((len(every), 0))
    found = {}
    for name in effects:
        others = {key: own for key, own in effects.items() if key != name}
        change = every - stacked(machine, runs, machine.numbers, others)
        found[name] = float(np.linalg.norm(change - base @ (base.T @ change)))
    return found


def left_by(
    machine: Machine, runs: Sequence[Columns], truth: Hidden, named: Hidden, sigma: float
) -> float:
    """Chi-squared that the effects `named`, refitted with the free numbers, leave of `truth`."""
    target = stacked(machine, runs, machine.numbers, truth)
    fitted = [*machine.free, *machine.off]
    keys = [(name, parameter) for name, own in named.items() for parameter in own]
    start = np.array(
        [machine.numbers[n] for n in fitted] + [named[n][parameter] for n, parameter in keys]
    )
    scale = np.where(start == 0, 1e-6, np.abs(start))

    def rest(z: Floats) -> Floats:
        values = z * scale
        numbers = {
            **machine.numbers,
            **dict(zip(fitted, values[: len(fitted)].tolist(), strict=True)),
        }
        effects: dict[str, dict[str, float]] = {name: {} for name in named}
        for (name, parameter), value in zip(keys, values[len(fitted) :].tolist(), strict=True):
            effects[name][parameter] = value
        found: Floats = (stacked(machine, runs, numbers, effects) - target) / sigma
        return np.nan_to_num(found, nan=1e6, posinf=1e6, neginf=-1e6)

    first = rest(start / scale)
    if not len(start):
        return float(first @ first)
    best = least_squares(rest, start / scale, max_nfev=_EVALUATIONS, diff_step=1e-5)
    return float(min(first @ first, 2 * best.cost))
