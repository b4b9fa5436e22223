"""A clock that steps at regular intervals: each step makes all later readings as much later."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np
from scipy import fft

from mopro.assumed import FEWEST, REPEATS
from mopro.candidate import Candidate, Law, Parameter, ResidualView, Role
from mopro.freeform.motion import LARGEST, Values, motion_of, step_of, values_of
from mopro.residuals import projected_out
from mopro.series import Floats, Series

# The spectrum's step, and an interval, are divided so often in the search for the moments of the
# steps. Halved, the last moment in a run is off by an eighth of an interval, and a clock of many
# small steps is missed; doubled, the search takes four times as long.
_DIVIDED = 8


def stepping_clock(sensor: str, rows: Mapping[int, Series]) -> Iterator[Candidate]:
    """The speed times a delay of `c` (s) more every `T` (s), first at (1 - `begun`) T.

    None where the times are not even enough for a spectrum, or no three steps go into a run.
    """
    series = list(rows.values())
    longest = max(float(np.ptp(values_of(s, ""))) for s in series)
    shortest = FEWEST * max(step_of(s) for s in series)
    if not shortest > 0 or FEWEST * shortest >= longest:
        return

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        steps = _steps(values_of(own, ""), values["T"], values["begun"])
        return np.asarray(values["c"] * motion_of(own, predicted).velocity * steps)

    def find(view: ResidualView) -> Iterator[Values]:
        runs = [
            _Run(own, motion_of(own, view.predictions[row]).velocity / view.sigmas[row],
                 view.residuals[row])
            for row, own in rows.items()
        ]  # fmt: skip
        if (found := _strongest_line(runs, FEWEST / longest, 1 / shortest)) is None:
            return
        every, at = _moments(runs, *found)
        yield {"c": _explained(runs, every, at)[1], "T": every, "begun": at}

    size = LARGEST * longest
    parameters = (
        Parameter("c", "s", -size, size),
        Parameter("T", "s", shortest, longest, role=Role.SEARCHED),
        Parameter("begun", "1", 0.0, 1.0, role=Role.SEARCHED),
    )
    law = Law(
        "measurement", "t", series[0].unit,
        lambda values: f"{values['c']:.4g} * v * floor(t / {values['T']:.5g} + "
        f"{values['begun']:.3g})", of_data,
    )  # fmt: skip
    yield Candidate(f"stepping clock in {sensor}", parameters, find_starts=find, law=law)


def _steps(time_s: Floats, every: float, begun: float) -> Floats:
    """Number of steps so far (samples)."""
    return np.asarray(np.floor(time_s / every + begun))


class _Run:
    """Speed over noise (1/s) and whitened residual of one run, both samples.

    What a delay and another rate would explain is projected out: a stepping clock differs from
    those by a sawtooth.
    """

    def __init__(self, own: Series, velocity: Floats, residual: Floats) -> None:
        self.time_s = values_of(own, "")
        self.velocity = velocity
        steady = np.column_stack([own.nuisance_shapes(), velocity, velocity * self.time_s])
        self.basis, _ = np.linalg.qr(steady)
        self.left = projected_out(self.basis, residual)

    def part(self, every: float, begun: float) -> Floats:
        """The whitened change (samples) by delays of 1 s a step that steady ones do not explain."""
        steps = self.velocity * _steps(self.time_s, every, begun)
        return projected_out(self.basis, steps)


def _strongest_line(runs: list[_Run], least: float, most: float) -> tuple[float, float] | None:
    """Rate (1/s) of the strongest line in the delay, `least` to `most`, and the spectrum's step.

    None where no delay shows.
    """
    length = fft.next_fast_len(2 * max(len(run.left) for run in runs))
    step = 1 / (length * min(float(np.median(np.diff(run.time_s))) for run in runs))
    power = np.zeros(length // 2)
    for run in runs:
        power += np.abs(fft.rfft(run.velocity * run.left, length)[1 : length // 2 + 1]) ** 2
    rates = step * np.arange(1, len(power) + 1)
    power[(rates < least) | (rates > most)] = 0.0
    return (float(rates[int(np.argmax(power))]), step) if power.any() else None


def _moments(runs: list[_Run], rate: float, step: float) -> tuple[float, float]:
    """Interval (s) and beginning of the steps that explain most, within `step` (1/s) of `rate`."""
    around = np.arange(-_DIVIDED, _DIVIDED + 1) / _DIVIDED
    best, finest = (rate, 0.0), np.array([step, 1.0]) / _DIVIDED
    tried = product((rate + step * around).tolist(), (np.arange(_DIVIDED) / _DIVIDED).tolist())
    for _ in range(REPEATS):
        best = max(tried, key=lambda each: _explained(runs, 1 / each[0], each[1])[0])
        finest = finest / 2
        tried = product(
            *((b + f * np.arange(-1, 2)).tolist() for b, f in zip(best, finest, strict=True))
        )
    return 1 / best[0], best[1] % 1.0


def _explained(runs: list[_Run], every: float, begun: float) -> tuple[float, float]:
    """The fall of chi-squared by steps of the best size, and that size (s)."""
    parts = [run.part(every, begun) for run in runs]
    square = sum(float(part @ part) for part in parts)
    product = sum(float(part @ run.left) for part, run in zip(parts, runs, strict=True))
    return (product**2 / square, product / square) if square else (0.0, 0.0)
