"""Report on the noise of one column, where its signal stands still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mopro.noise.spectral import Line, Memory, lines_of, memory_of, without_lines
from mopro.noise.values import Floats, held_of, outliers_of, rms_before_rounding, step_of, stuck_of

# -- standstill -------------------------------------------------------------------------------
# Stretches of a record in which the signal stands still.


Stretch = tuple[int, int]

# Readings of one window, a share of all within limits; a stretch has at least two windows. Halved,
# a window's noise is known worse, and moves pass for it; doubled, short rests are not found.
_WINDOWS = (8, 32)
_WINDOW_SHARE = 40
_FEWEST_WINDOWS = 2
# Window RMS about its mean, in that of the quietest tenth. Of 8 normal readings one window in
# 3000 exceeds it, of 32 none; noise with a memory stays below it too. Doubled, slow motion is rest.
_STILL = 3.0
# Share of the windows that are taken to be at rest. Halved, a window that is quiet by chance sets
# the level; doubled, records that rest for less than a fifth of their time set it by a motion.
_QUIET_SHARE = 0.1
# Windows of one stretch whose medians differ by more than this many window RMS are apart: those
# of 8 normal readings differ by 0.6. Doubled, creep of a noise's width per window is rest.
_APART = 4.0
# Share of a stretch's variance that a parabola may take: more is a motion. Halved, slow noise is.
_MOST_TREND = 0.5


def stretches_of(values: Floats, step: float = 0.0) -> list[Stretch]:
    """Index ranges (start, end) of standstill, in order; none if the signal never stands.

    `values` (n) have no NaN. The first window after a motion settles and is left out. A signal
    that crosses between two codes of a converter of `step` still stands.
    """
    least, most = _WINDOWS
    window = min(max(len(values) // _WINDOW_SHARE, least), most)
    windows = len(values) // window
    if windows < _FEWEST_WINDOWS:
        return []
    blocks = values[: windows * window].reshape(windows, window)
    means, rms = np.median(blocks, axis=1), _robust_rms(blocks)
    quiet = max(float(np.quantile(rms, _QUIET_SHARE)), 0.5 * step)
    still = rms <= max(_STILL * quiet, 0.6 * step)
    joined = np.abs(np.diff(means)) <= _APART * np.maximum(quiet, 0.5 * step)
    found = [_settled(run, still) for run in _runs(still, joined)]
    limits = [(first * window, last * window) for first, last in found]
    return [
        (start, end)
        for start, end in limits
        if end - start >= _FEWEST_WINDOWS * window and _stands(values[start:end], step)
    ]


def _robust_rms(blocks: Floats) -> Floats:
    """RMS of each row about its median, without the reading farthest from it (an outlier)."""
    squares = (blocks - np.median(blocks, axis=1)[:, None]) ** 2
    rest = np.maximum(squares.sum(axis=1) - squares.max(axis=1), 0.0)
    rms: Floats = np.sqrt(rest / (blocks.shape[1] - 1))
    return rms


def _runs(still: NDArray[np.bool_], joined: NDArray[np.bool_]) -> list[Stretch]:
    """Runs of windows that are still and joined to their neighbours."""
    edges = np.concatenate(([True], ~(joined & still[1:] & still[:-1]), [True]))
    starts = np.flatnonzero(edges)
    pairs = zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)
    return [(a, b) for a, b in pairs if still[a]]


def _settled(run: Stretch, still: NDArray[np.bool_]) -> Stretch:
    """The run without its first and last windows where they touch a motion, if it is long."""
    first, last = run
    if last - first < 2 * _FEWEST_WINDOWS:
        return run
    return first + (first > 0), last - (last < len(still))


def _stands(values: Floats, step: float) -> bool:
    """False if a parabola takes most of the variance and more than a converter's rounding."""
    x = np.linspace(-1.0, 1.0, len(values))
    residual = values - np.polynomial.Polynomial.fit(x, values, 2)(x)
    total, left = float(values.var()), float(residual.var())
    return total <= (0.6 * step) ** 2 or left >= (1 - _MOST_TREND) * total


# -- the report -------------------------------------------------------------------------------
# Report on the noise of one column: everything that an experiment file should state.

# Readings at standstill from which the noise is known to 9 %. Halved, to 13 %.
FEWEST_READINGS = 64
# Largest deviation of a sampling interval from the median one, for a spectrum to mean something.
# Doubled, lines above a quarter of the sampling rate are smeared.
_MOST_JITTER = 0.2
# Chance at either end of a 95 % interval.
_TAIL = 0.025
# Share of the noise below which a step of the readings does not matter: it adds its square over 12,
# 0.01 % of the noise. Doubled, 0.04 %.
_SMALL_STEP = 0.05
# Readings of a stretch whose spectrum is taken, for memory (8 MB). Doubled, twice of it.
_MOST_SPECTRUM = 1 << 20
# Share of outliers above which there is no level that the others are far from. Doubled, a tenth of
# the readings may be replaced by the median, and the rest passes for the noise.
_MOST_OUTLIERS = 0.05
# Time constants that a stretch lasts at least, and the steepest rise: else it may be moving, as its
# level is known from less than ten independent readings. Doubled, slow noise is called a motion.
_FEWEST_CONSTANTS = 20.0
_STEEPEST = -1.8
# Amplitude of a line, in noise: a larger one is a motion rather than hum. Halved, strong hum is
# called a motion; doubled, the swing of a stage at rest passes for hum.
_LARGEST_LINE = 30.0


class TooShort(ValueError):
    """Too few readings at standstill to say anything."""


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class NoiseReport:
    """The noise of a column at standstill, in its unit.

    `rms` is the standard deviation of a reading without outliers and lines, before the
    converter rounded it; `noise_rms` and `adc_step` are what to state. `step` is that of the
    readings, 0 if there is none. `stretches` are index ranges of standstill, `outliers` indices,
    `stuck` index ranges. `held` is the number of readings for which a value is repeated.
    `memory` is None where sampling is irregular or the stretches are short.
    """

    readings: int
    duration_s: float
    rate_hz: float
    regular: bool
    stretches: tuple[Stretch, ...]
    rms: Estimate
    step: float
    memory: Memory | None
    lines: tuple[Line, ...]
    outliers: tuple[int, ...]
    stuck: tuple[Stretch, ...]
    held: int

    @property
    def adc_step(self) -> float:
        """The converter's step to state; 0 if it is too small to matter."""
        return self.step if self.step > _SMALL_STEP * self.rms.value else 0.0

    @property
    def noise_rms(self) -> float:
        """The noise to state; 0 if the converter's step hides it."""
        return self.rms.value

    @property
    def wanders(self) -> bool:
        """True if the signal wanders as long as it was watched, or swings: it may be moving."""
        if any(line.amplitude > _LARGEST_LINE * self.rms.value > 0 for line in self.lines):
            return True
        if self.memory is None:
            return False
        slow = self.memory.time_constant_s * _FEWEST_CONSTANTS > self.duration_s
        return slow or self.memory.slope < _STEEPEST

    @property
    def hidden(self) -> bool:
        """True if no reading left its code: the noise is known to be less than the step only."""
        return self.rms.value == 0.0


def report(time_s: Floats, values: Floats, whole: bool = False) -> NoiseReport:
    """The noise of `values` at `time_s` (s), both (n) and without NaN.

    With `whole` all readings count as standstill. Raises TooShort if there are fewer than
    FEWEST_READINGS at standstill.
    """
    if len(values) and float(np.ptp(values)) == 0.0:
        raise TooShort("the column does not change")
    held = held_of(values) if len(values) > 1 else 1
    if held > 1:
        return _of_updates(time_s, values, held, whole)
    return _report(time_s, values, 1, whole, np.arange(len(values)))


def _of_updates(time_s: Floats, values: Floats, held: int, whole: bool) -> NoiseReport:
    """Of a sensor that holds its value: its updates are the readings."""
    kept = np.arange(len(values) % held, len(values), held)
    return _report(time_s[kept], values[kept], held, whole, kept)


def _report(
    time_s: Floats, values: Floats, held: int, whole: bool, places: NDArray[np.intp]
) -> NoiseReport:
    step = step_of(values)
    found = [(0, len(values))] if whole else stretches_of(values, step)
    readings = sum(end - start for start, end in found)
    if readings < FEWEST_READINGS:
        message = f"{readings} readings at standstill, and at least {FEWEST_READINGS} are needed"
        raise TooShort(message)
    intervals = np.diff(time_s)
    usual = float(np.median(intervals))
    regular = bool(np.quantile(np.abs(intervals - usual), 0.98) < _MOST_JITTER * usual)
    stuck = stuck_of(values) if _alive(values, found, step) else []
    cleaned, outliers = _cleaned(values, found, stuck, step)
    rate_hz = 1 / usual
    lines = lines_of(max(cleaned, key=len), rate_hz) if regular else []
    quiet = [without_lines(c, lines, rate_hz) for c in cleaned]
    memory = memory_of([q[:_MOST_SPECTRUM] for q in quiet], rate_hz) if regular else None
    duration_s = sum(float(time_s[end - 1] - time_s[start]) for start, end in found)
    return NoiseReport(
        readings,
        duration_s,
        rate_hz,
        regular,
        tuple((int(places[a]), int(places[b - 1]) + 1) for a, b in found),
        _level(quiet, lines, memory, step),
        step,
        memory,
        tuple(lines),
        tuple(int(places[i]) for i in outliers),
        tuple((int(places[a]), int(places[b - 1]) + held) for a, b in stuck),
        held,
    )


def _alive(values: Floats, found: list[Stretch], step: float) -> bool:
    """True if readings at standstill leave their code, so that a run of equal ones is odd."""
    return step == 0 or float(np.median([values[a:b].std() for a, b in found])) > step


def _cleaned(
    values: Floats, found: list[Stretch], stuck: list[Stretch], step: float
) -> tuple[list[Floats], list[int]]:
    """The stretches with outliers replaced by the median, and the outliers' indices."""
    cleaned: list[Floats] = []
    outliers: list[int] = []
    alive = np.ones(len(values), dtype=bool)
    for first, last in stuck:
        alive[first + 1 : last] = False
    for start, end in found:
        kept = start + np.flatnonzero(alive[start:end])
        if len(kept) < 2:
            continue
        part = values[kept]
        odd = outliers_of(part, step)
        outliers += kept[odd].tolist()
        part[odd] = np.median(part)
        cleaned.append(part)
    if not cleaned:
        raise TooShort("all readings at standstill are one stuck value")
    readings = sum(end - start for start, end in found)
    if len(outliers) > _MOST_OUTLIERS * readings:
        message = f"{len(outliers)} of {readings} readings are far from the others"
        raise TooShort(f"{message}: that is no noise about a level")
    return cleaned, outliers


def _level(quiet: list[Floats], lines: list[Line], memory: Memory | None, step: float) -> Estimate:
    """The pooled standard deviation with its chi-squared interval."""
    count = sum(map(len, quiet))
    # Each stretch has its own level, and its own size and phase of each line.
    lost = sum(1 + 2 * sum(line.lasts(len(q)) for line in lines) for q in quiet)
    squares = sum(float(np.sum((q - q.mean()) ** 2)) for q in quiet)
    rounded = float(np.sqrt(squares / max(count - lost, 1)))
    rms = rms_before_rounding(quiet, rounded, step)
    freedom = max((count - lost) / (memory.inflation if memory else 1.0), 1.0)
    low, high = (
        rms * float(np.sqrt(freedom / 2 / special.gammaincinv(freedom / 2, q)))
        for q in (1 - _TAIL, _TAIL)
    )
    return Estimate(rms, low, high)
