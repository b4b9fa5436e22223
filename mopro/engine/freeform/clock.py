"""A clock that steps at regular intervals: each step makes all later readings as much later."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np
from scipy import fft

from mopro.engine.assumed import FEWEST, FITTED, ROUNDING
from mopro.engine.candidate import Candidate, Law, Parameter, ResidualView, Role
from mopro.engine.freeform.series_motion import LARGEST, Values, motion_of, step_of, values_of
from mopro.engine.residuals import projected_out
from mopro.engine.series import Floats, Series

# Parts of an interval at which the steps are tried to begin, and multiples of their rate that tell
# of them. Halved, a tenth of what steps explain is missed; doubled, the search takes four times as
# long.
_DIVIDED = 8
# Rates that are tried, in the inverse of a run's length. Halved, steps late in a run are missed.
_OVERSAMPLED = 4


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
                 view.residuals[row], view.tangents[row])
            for row, own in rows.items()
        ]  # fmt: skip
        likely, step = _likely(runs, FEWEST / longest, 1 / shortest)
        for every, at in dict.fromkeys(_moments(runs, *each, step) for each in likely):
            yield {"c": _explained(runs, every, at)[1], "T": every, "begun": at}

    size = LARGEST * longest
    parameters = (
        Parameter("c", "s", -size, size),
        Parameter("T", "s", shortest, longest, role=Role.SEARCHED),
        Parameter("begun", "1", 0.0, 1.0, role=Role.SEARCHED, cyclic=True),
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

    `tangent`: its rows of what other effects make up for. `basis`: its nuisances. `steady`: what a
    delay of 1 s and a rate of 1 s/s change, as columns. `jumpy`: the residual less what those would
    explain; a stepping clock differs from them by a sawtooth.
    """

    def __init__(self, own: Series, velocity: Floats, residual: Floats, tangent: Floats) -> None:
        self.time_s, self.interval_s = values_of(own, ""), step_of(own)
        self.velocity, self.left, self.tangent = velocity, residual, tangent
        self.basis, _ = np.linalg.qr(own.nuisance_shapes())
        self.steady = np.column_stack([velocity, velocity * self.time_s])
        apart = np.linalg.qr(projected_out(self.basis, self.steady))[0]
        self.jumpy = projected_out(apart, residual)

    def part(self, every: float, begun: float) -> Floats:
        """The whitened change (samples) by delays of 1 s a step."""
        return self.velocity * _steps(self.time_s, every, begun)


def _likely(runs: list[_Run], least: float, most: float) -> tuple[list[tuple[float, float]], float]:
    """Rates (1/s) and beginnings of the steps that explain most, and the spectrum's step (1/s).

    Rates are `least` to `most`, and equally likely by their logarithm. With u = t / T + b, steps
    are u - 1/2 and a sawtooth: floor(u) - u + 1/2, the sum over k of sin(2 pi k u) / (pi k), whose
    product with the residual is a sum over the spectrum of that, at the multiples of a rate.
    """
    interval = min(run.interval_s for run in runs)
    even = [run for run in runs if math.isclose(run.interval_s, interval, rel_tol=1e-3)]
    length = fft.next_fast_len(_OVERSAMPLED * max(len(run.left) for run in even))
    step = 1 / (length * interval)
    rates = step * np.arange(length // 2 + 1)
    # Beyond its end there is nothing.
    spectrum = np.append(np.zeros(len(rates), dtype=complex), 0.0)
    steady, gram = _products(even, [run.steady for run in even])
    square = 0.0
    for run in even:
        turned = np.exp(-2j * np.pi * rates * run.time_s[0])
        spectrum[:-1] += turned * fft.rfft(run.velocity * run.jumpy, length)
        square += float(run.velocity @ run.velocity) / 12
    number = np.flatnonzero((rates >= least) & (rates <= most))
    if not len(number) or not spectrum.any():
        return [], step
    begun = np.arange(_DIVIDED) / _DIVIDED
    explained = np.zeros((_DIVIDED, len(number)))
    for k in range(1, _DIVIDED + 1):
        multiple = spectrum[np.minimum(k * number, len(rates))]
        turned = np.exp(2j * np.pi * k * begun)[:, None]
        explained += (turned * multiple.conj()).imag / (np.pi * k)
    # Their delay and their rate, by beginning and rate.
    own = np.stack(np.broadcast_arrays(begun[:, None] - 0.5, rates[number]))
    explained += np.tensordot(steady, own, 1)
    whole = square + (own * np.tensordot(gram, own, 1)).sum(axis=0)
    likelihood = explained**2 / whole - 2 * np.log(rates[number])
    chosen: list[tuple[float, float]] = []
    while len(chosen) < FITTED and np.isfinite(likelihood).any():
        row, column = np.unravel_index(int(np.argmax(likelihood)), likelihood.shape)
        chosen.append((float(rates[number[column]]), float(begun[row])))
        likelihood[:, np.abs(number - number[column]) <= _OVERSAMPLED // 2] = -math.inf
    return chosen, step


def _moments(runs: list[_Run], rate: float, begun: float, step: float) -> tuple[float, float]:
    """Interval (s) and beginning of the steps that explain most, near `rate` (1/s) and `begun`.

    The neighbours are tried a `step` of the rate around, and at closer ones, until none is better.
    """
    best = 1 / rate, begun
    most, _ = _explained(runs, *best)
    for halvings in range(_DIVIDED // 2):
        near = np.arange(-1, 2) / 2**halvings
        while True:
            tried = [
                (1 / (1 / best[0] + df), (best[1] + db) % 1.0)
                for df, db in product((step * near).tolist(), (near / _DIVIDED).tolist())
                if 1 / best[0] + df > 0 and (df or db)
            ]
            explained, better = max((_explained(runs, *each)[0], each) for each in tried)
            if explained <= most:
                break
            best, most = better, explained
    return best


def _explained(runs: list[_Run], every: float, begun: float) -> tuple[float, float]:
    """The fall of chi-squared by steps of the best size, and that size (s)."""
    parts = [run.part(every, begun) for run in runs]
    product, square = map(float, _products(runs, parts))
    distinct = square > ROUNDING * sum(float(part @ part) for part in parts)
    return (product**2 / square, product / square) if distinct else (0.0, 0.0)


def _products(runs: list[_Run], parts: list[Floats]) -> tuple[Floats, Floats]:
    """Products of `parts` (one of each run, columns) with the residual, and with each other.

    Less what nuisances and other effects make up for; the residual of a fit has none of that.
    """
    pairs = list(zip(runs, parts, strict=True))
    absorbed = np.sum([run.tangent.T @ part for run, part in pairs], axis=0)
    offsets = [run.basis.T @ part for run, part in pairs]
    whole = np.sum([part.T @ run.left for run, part in pairs], axis=0)
    gram = np.sum([p.T @ p - o.T @ o for p, o in zip(parts, offsets, strict=True)], axis=0)
    return whole, gram - absorbed.T @ absorbed
