"""Agreement of a measured column with a command: delay with interval, scale, sign, offset."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, signal

from mopro.instruments.sensor import FOLD_SLIPS, UNIT_SLIPS

Floats = NDArray[np.float64]

_MOST_POINTS = 1 << 16
_FEWEST_POINTS = 16
_Z95 = 1.96
# Shifts that are tried, and the excess of a sum of squares that counts as none.
_SHIFTS = 12
_AS_GOOD = 1.02
_LONGEST_STRIDE = 64
# Correlation of command and measurement below which nothing is said of their relation.
LEAST_CORRELATION = 0.5
# Relative distance of a scale from a known factor at which it is called that, and from 1 at which
# it is called a scale at all.
_NEAR = 0.05
_FAR = 0.15
_DEGREES = 180 / math.pi
# Factor -> what it looks like; powers of ten are distinguished.
_FACTORS = {
    **{factor: f"{own} taken for {other}" for factor, (own, other) in UNIT_SLIPS.items()},
    3600 * _DEGREES: "arc seconds taken for radians",
    1 / (3600 * _DEGREES): "radians taken for arc seconds",
    2 * math.pi: "radians taken for turns",
    1 / (2 * math.pi): "turns taken for radians",
    5.0: "a factor of 5",
    0.2: "a factor of 5",
    **FOLD_SLIPS,
}


@dataclass(frozen=True)
class Agreement:
    """measured(t) = scale * command(t - delay) + offset, fitted by least squares.

    `delay_s` has half its 95 % interval, of residuals that are correlated; `correlation` is that
    at this delay, `points` the number of common times.
    """

    delay_s: float
    delay_ci_s: float
    scale: float
    offset: float
    correlation: float
    interval_s: float

    @property
    def related(self) -> bool:
        return abs(self.correlation) >= LEAST_CORRELATION

    @property
    def scaled(self) -> bool:
        """True if the readings have another sign or scale than the command."""
        return self.scale < 0 or abs(self.scale - 1) > _FAR

    @property
    def delayed(self) -> bool:
        """True if the delay is beyond its interval and beyond a sample."""
        return abs(self.delay_s) > max(self.delay_ci_s, self.interval_s)

    def words(self, alike: bool = True) -> list[str]:
        """Words for a person to check: delay, and scale and sign of units that are `alike`."""
        if not self.related:
            return []
        found = [text for text in (_scale_words(self.scale),) if text and alike]
        if self.delayed:
            size = f"{abs(self.delay_s):.4g} ± {self.delay_ci_s:.2g} s"
            late = self.delay_s > 0
            how = "after the command: a lag, or another" if late else "before the command: another"
            found.append(f"the readings come {size} {how} clock")
        return found


def _scale_words(scale: float) -> str | None:
    size = abs(scale)
    words = []
    if scale < 0:
        words.append("the sign is opposite")
    if abs(size - 1) > _FAR:
        words.append(f"the readings are {size:.4g} times the command{_resembles(size)}")
    return " and ".join(words) or None


def _resembles(size: float) -> str:
    for factor, name in _FACTORS.items():
        if abs(size / factor - 1) < _NEAR:
            return f": {name}?"
    power = round(math.log10(size)) if size > 0 else 0
    if power and abs(size / 10.0**power - 1) < _NEAR:
        return f": a unit off by 10^{power}?"
    return ""


def agreement(
    command_s: Floats, command: Floats, measured_s: Floats, measured: Floats, held: bool
) -> Agreement | None:
    """The relation of two columns without NaN, each with its times (s); None if they are too short.

    A `held` command keeps its value until the next row.
    """
    grid = _grid(command_s, measured_s)
    if len(grid) < _FEWEST_POINTS or np.ptp(command) == 0 or np.ptp(measured) == 0:
        return None
    step = float(grid[1] - grid[0])
    seen = np.interp(grid, measured_s, measured)
    commanded = _at(grid, command_s, command, held)

    stride = -(-len(measured) // _MOST_POINTS)
    own_s, own = measured_s[::stride], measured[::stride]

    def cost(delay_s: float) -> float:
        return _residual(_at(own_s - delay_s, command_s, command, held), own)[0]

    # Of shifts that fit as well (a periodic command) the smallest.
    shifts = _shifts(commanded, seen, step)
    costs = [cost(shift) for shift in shifts]
    coarse = next(s for s, c in zip(shifts, costs, strict=True) if c <= _AS_GOOD * min(costs))
    coarse = _descended(cost, coarse, step)
    found = optimize.minimize_scalar(
        cost, bounds=(coarse - 1.5 * step, coarse + 1.5 * step), method="bounded"
    )
    delay = float(found.x) if found.fun < cost(coarse) else coarse
    shifted = _at(own_s - delay, command_s, command, held)
    _, scale, offset, residual = _residual(shifted, own)
    correlation = float(np.corrcoef(shifted, own)[0, 1]) if np.ptp(shifted) else 0.0
    slope = scale * np.gradient(shifted, own_s)
    interval = max(_interval(slope, residual), _held_interval(command_s, held))
    return Agreement(delay, interval, scale, offset, correlation, step)


def expected(
    command_s: Floats, command: Floats, times_s: Floats, values: Floats, held: bool,
    used: NDArray[np.bool_],
) -> Floats | None:  # fmt: skip
    """The readings (n,) that a command gives by its relation to those of `values` that are `used`.

    None where these do not follow it.
    """
    if np.count_nonzero(used) < 2:
        return None
    found = agreement(command_s, command, times_s[used], values[used], held)
    if found is None or not found.related:
        return None
    return _followed(found, command_s, command, times_s, held)


def _followed(
    found: Agreement, command_s: Floats, command: Floats, times_s: Floats, held: bool
) -> Floats:
    """The readings at `times_s` that the relation gives for a command."""
    return found.scale * _at(times_s - found.delay_s, command_s, command, held) + found.offset


def _grid(command_s: Floats, measured_s: Floats) -> Floats:
    """Regular times over both columns, as close as the measured ones, at most _MOST_POINTS.

    They cover the longer column: two clocks may overlap nowhere.
    """
    start, end = float(measured_s[0]), float(measured_s[-1])
    step = float(np.median(np.diff(measured_s)))
    count = int(min((end - start) / step + 1, _MOST_POINTS))
    return np.linspace(start, end, max(count, 2))


def _at(times_s: Floats, command_s: Floats, command: Floats, held: bool) -> Floats:
    if not held:
        return np.interp(times_s, command_s, command)
    rows = np.clip(np.searchsorted(command_s, times_s, side="right") - 1, 0, len(command) - 1)
    values: Floats = command[rows]
    return values


def _shifts(commanded: Floats, seen: Floats, step: float) -> list[float]:
    """Shifts at which the columns, each less its mean, correlate most; and none."""
    a, b = seen - seen.mean(), commanded - commanded.mean()
    products = np.abs(signal.correlate(a, b, mode="full", method="fft"))
    lags = signal.correlation_lags(len(a), len(b), mode="full")
    overlap = np.minimum(len(a), len(b) + lags) - np.maximum(lags, 0)
    # By the overlap alone: a long shift wins; not at all: a short one.
    found = {0}
    for score in (products, products / np.maximum(overlap, len(a) / 4)):
        peaks, _ = signal.find_peaks(score, distance=max(len(a) // 200, 1))
        best = peaks[np.argsort(score[peaks])[-_SHIFTS:]]
        found |= {int(lag) for lag in lags[best]}
    return [lag * step for lag in sorted(found, key=abs)]


def _descended(cost: Callable[[float], float], start: float, step: float) -> float:
    """The whole steps from `start` to the nearest minimum, in strides of half the last length."""
    best, least = start, cost(start)
    stride = _LONGEST_STRIDE
    while stride >= 1:
        near = [best - stride * step, best + stride * step]
        costs = [cost(shift) for shift in near]
        if min(costs) < least:
            best, least = near[int(np.argmin(costs))], min(costs)
        else:
            stride //= 2
    return best


def _residual(commanded: Floats, seen: Floats) -> tuple[float, float, float, Floats]:
    """Sum of squares, scale, offset and residual of seen = scale * told + offset."""
    centred = commanded - commanded.mean()
    power = float(centred @ centred)
    scale = float(centred @ seen) / power if power > 0 else 0.0
    offset = float(seen.mean() - scale * commanded.mean())
    residual = seen - offset - scale * commanded
    return float(residual @ residual), scale, offset, residual


def _interval(slope: Floats, residual: Floats) -> float:
    """Half the 95 % interval of the delay: least squares with correlated residuals."""
    information = float(slope @ slope)
    if information == 0:
        return math.inf
    weighted = slope * residual
    spectrum = np.abs(np.fft.rfft(weighted - weighted.mean())) ** 2 / len(weighted)
    lowest = max(len(spectrum) // 50, 1)
    long_run = max(float(spectrum[1 : lowest + 1].mean()), float(weighted.var()))
    return _Z95 * math.sqrt(long_run * len(weighted)) / information


def _held_interval(command_s: Floats, held: bool) -> float:
    """A command that holds is known to a row only."""
    return float(np.median(np.diff(command_s))) / math.sqrt(12) if held else 0.0
