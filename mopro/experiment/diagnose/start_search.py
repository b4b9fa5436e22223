"""Searches for effects that no fixed start finds: periods, lines, steps, ticks."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis import ResidualView
from mopro.diagnosis.model import FindStarts
from mopro.diagnosis.noise_tests import cusum_step
from mopro.diagnosis.spectrum import position_spectrum
from mopro.experiment.model import Floats
from mopro.experiment.predict.forward_model import RUN, Motor, angle_in
from mopro.motion import PlannedMove

_PERIODS_TRIED = 3
_FINEST_PERIOD_M = 1e-4
_FEWEST_PERIODS = 2.0
# A delay this many standard deviations clear of zero may be a tick.
_CLEARLY = 5.0
# Where its grid shows by as many, only ticks that are close have its phase throughout.
_GRID_SHOWS = 2.0
_TICKS_TRIED = 21
_WHOLE = 0.25
_CONTRAST = 6.0
_FEWEST_FOR_SPEED = _FEWEST_FOR_A_STEP = 2

Values = Mapping[str, float]


class Seeker:
    """Searches in what a fit leaves of the positions that `motor`'s experiment measured.

    Series come in the order of the runs' readings, temperatures among them, and tables last.
    """

    def __init__(self, motor: Motor) -> None:
        self._motor = motor
        # The series' numbers, with the run and the reading of each.
        self._positions = motor.positions()

    # -- lines -------------------------------------------------------------------

    def period(self, left: ResidualView) -> Iterator[Values]:
        """The strongest lines in position, their amplitudes and angles."""
        ways = self._places_m(left)
        rows = [row for row, place in ways.items() if np.ptp(place) > 0]
        if not rows:
            return
        places = [ways[row] for row in rows]
        cycles, power = position_spectrum(
            places, [left.residuals[i] for i in rows], _FINEST_PERIOD_M
        )
        reach = max(float(np.ptp(place)) for place in places)
        power[cycles * reach < _FEWEST_PERIODS] = 0.0
        for peak in _peaks(power)[:_PERIODS_TRIED]:
            q = 2 * math.pi * float(cycles[peak])
            x = np.concatenate(places)
            r = np.concatenate([self._metres(left, i) for i in rows])
            sine, cosine = _sinusoid(q * x, r)
            yield {
                "A": math.hypot(sine, cosine),
                "lambda": 2 * math.pi / q,
                "phi": math.atan2(cosine, sine),
            }

    def hum(self, mains_hz: float, harmonics: Sequence[int] = ()) -> FindStarts:
        """A line of `mains_hz` in time, and one at so many times that for each of `harmonics`."""

        def seek(left: ResidualView) -> Iterator[Values]:
            values = self._line_in_time(left, mains_hz, "A", "phi")
            for n in harmonics:
                values |= self._line_in_time(left, n * mains_hz, f"A{n}", f"phi{n}")
            yield values

        return seek

    def _line_in_time(
        self, left: ResidualView, hz: float, amplitude: str, angle: str
    ) -> dict[str, float]:
        """Its amplitude over all runs, and its angle in each."""
        runs = range(len(self._motor.experiment.trials))
        lines = dict.fromkeys(runs, 0j)
        sizes = []
        for row, (run, reading) in self._positions.items():
            sine, cosine = _sinusoid(2 * math.pi * hz * reading.time_s, self._metres(left, row))
            lines[run] += complex(sine, cosine)
            sizes.append(math.hypot(sine, cosine))
        angles = {angle_in(run, angle): cmath.phase(line) for run, line in lines.items()}
        return {amplitude: float(np.sqrt(np.mean(np.square(sizes)))), **angles}

    # -- ticks -------------------------------------------------------------------

    def interpolated_tick(self, left: ResidualView) -> Iterator[Values]:
        """Late by a tick: all the delay that is left."""
        return self._ticks(left, 1.0, 1.0)

    def held_tick(self, left: ResidualView) -> Iterator[Values]:
        """Late by half a tick."""
        return self._ticks(left, 2.0, 0.0)

    def _ticks(self, left: ResidualView, ticks: float, interpolate: float) -> Iterator[Values]:
        """The tick that the delay speaks of; where its grid shows, the best one around."""
        delay_s, error_s = self._delay(left)
        tick_s = ticks * delay_s
        if not (delay_s > _CLEARLY * error_s and 1e-4 < tick_s < 0.015):
            return
        if self._grid_shows(left, tick_s) < _GRID_SHOWS:
            yield {"T": tick_s}
            return
        last_s = max(float(reading.time_s[-1]) for _, reading in self._positions.values())
        reach_s = max(ticks * 2 * error_s, tick_s**2 / last_s)
        around = np.linspace(tick_s - reach_s, tick_s + reach_s, _TICKS_TRIED)
        trials = [float(t) for t in (*around, *_round_numbers(tick_s)) if 1e-4 < t < 0.015]
        fixed = {"interpolate": interpolate}
        costs = [left.rss({"profile_tick": {"T": t, **fixed}}) for t in trials]
        yield {"T": trials[int(np.argmin(costs))]}

    def _grid_shows(self, left: ResidualView, tick_s: float) -> float:
        """How strong, in standard deviations, what lies between chords and curve is.

        A chord over T is a T²/12 from its arc in the mean.
        """
        sags = [
            np.asarray(left.data[row].labels["acceleration"], dtype=float) * tick_s**2 / 12
            / left.sigmas[row]
            for row in self._positions
        ]  # fmt: skip
        return math.sqrt(sum(float(sag @ sag) for sag in sags))

    def _delay(self, left: ResidualView) -> tuple[float, float]:
        """By how much the data are late against the model (s), and its standard deviation."""
        lateness = strength = 0.0
        for row, (_, reading) in self._positions.items():
            if len(reading.time_s) < _FEWEST_FOR_SPEED:
                continue
            speed = np.gradient(left.predictions[row], reading.time_s) / left.sigmas[row]
            # The residual has lost its mean to the offset.
            speed -= speed.mean()
            lateness -= float(speed @ left.residuals[row])
            strength += float(speed @ speed)
        return lateness / max(strength, 1e-300), 1 / math.sqrt(max(strength, 1e-300))

    # -- steps -------------------------------------------------------------------

    def lost_steps(self, left: ResidualView) -> Iterator[Values]:
        """Steps of whole pitches that stay, in one run or in the same move of all."""
        found: list[dict[str, float]] = []
        begun, over = 0.0, 1.0
        pitch_m = self._motor.experiment.machine.axis.pitch_m
        for row, (run, reading) in self._positions.items():
            step = _step(left.residuals[row], self._metres(left, row), reading.time_s)
            moves = [m for m in self._motor.schedule(run).moves if reading.sensor.axis in m.axes]
            if step is None or not moves:
                continue
            before_s, after_s, height_m = step
            pitches = round(-height_m / pitch_m)
            if not pitches or abs(-height_m / pitch_m - pitches) > _WHOLE * max(1, abs(pitches)):
                continue
            index, share = _place(moves, (before_s + after_s) / 2)
            found.append({"n": float(pitches), "move": index + 1.0, "at": share, RUN: float(run)})
            begun = max(begun, _share(moves[index], before_s))
            over = min(over, _share(moves[index], after_s))
        yield from found
        alike = {(f["n"], f["move"]) for f in found}
        if len(found) > 1 and len(found) == len(self._positions) and len(alike) == 1:
            # Each run tells between which samples it was; what all say is the closest.
            yield {**found[0], "at": (begun + over) / 2, RUN: -1.0}

    # -- readings ------------------------------------------------------------------

    def _metres(self, left: ResidualView, row: int) -> Floats:
        metres: Floats = left.residuals[row] * left.sigmas[row]
        return metres * self._positions[row][1].sensor.unit_si

    def _places_m(self, left: ResidualView) -> dict[int, Floats]:
        """Where the target was at each sample, whatever the transducer made of it."""
        places = self._motor.targets(left.settings)
        return {
            row: places[row] * reading.sensor.unit_si
            for row, (_, reading) in self._positions.items()
        }


def _sinusoid(phase: Floats, values: Floats) -> tuple[float, float]:
    """The sizes of sine and cosine in `values` that fit best, a constant left free."""
    shapes = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))])
    sine, cosine, _ = np.linalg.lstsq(shapes, values, rcond=None)[0]
    return float(sine), float(cosine)


def _peaks(power: Floats) -> NDArray[np.intp]:
    """Local maxima, the highest first."""
    inner = power[1:-1]
    peaks = 1 + np.flatnonzero((inner >= power[:-2]) & (inner > power[2:]))
    return peaks[np.argsort(power[peaks])[::-1]]


def _round_numbers(tick_s: float) -> set[float]:
    """Ticks near `tick_s` that a person would set."""
    grids = (1e-4, 2.5e-4, 5e-4, 1e-3)
    near = {round(tick_s / grid) * grid for grid in grids}
    return {t for t in near if abs(t - tick_s) < 0.01 * tick_s}


def _step(z: Floats, metres: Floats, time_s: Floats) -> tuple[float, float, float] | None:
    """The times before and after the step that divides the samples best, and its height (m)."""
    if len(z) < _FEWEST_FOR_A_STEP:
        return None
    at, contrast = cusum_step(z)
    if abs(contrast) < _CONTRAST:
        return None
    height = float(metres[at + 1 :].mean() - metres[: at + 1].mean())
    return float(time_s[at]), float(time_s[at + 1]), height


def _place(moves: Sequence[PlannedMove], time_s: float) -> tuple[int, float]:
    """Which of the moves (from 0), and at which share of it."""
    begun = [i for i, move in enumerate(moves) if move.start_s <= time_s]
    index = begun[-1] if begun else 0
    return index, _share(moves[index], time_s)


def _share(move: PlannedMove, time_s: float) -> float:
    """Of the move's time, what is over at `time_s`."""
    return min(max((time_s - move.start_s) / move.profile.duration_s, 0.0), 1.0)
