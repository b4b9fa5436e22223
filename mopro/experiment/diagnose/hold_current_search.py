"""When a drive saves current at rest, from where its axis begins to ring differently.

The ring that a move leaves slows down at that moment, so what is to be seen of it depends
on the phase of the ring: no fixed start leads there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from mopro.diagnosis import ResidualView
from mopro.experiment.diagnose.start_search import Values
from mopro.experiment.model import Floats, Reading
from mopro.experiment.predict.forward_model import Motor

# So many standard deviations clear of white noise something shows.
_CLEARLY = 5.0
# The ring at full current and at a third of it part within a few periods; where they begin
# to is told to within these many, before and after.
_BEFORE, _AFTER = 3.0, 1.0
_STEPS_A_PERIOD = 4
# Shares of the current that an axis rings with at quite another speed each, and such that the
# phase of one at least is right over the ten periods of a ring.
_SHARES = (0.35, 0.6)
_CLOSE_SHARES = tuple(np.geomspace(0.3, 0.75, 16).tolist())
# From there both are moved in steps (shares, and periods of the ring) to where they fit best.
_CLOSE = np.array([1 / 1.03, 1.0, 1.03])
_CLOSE_TIMES = np.linspace(-0.5, 0.5, 9)
_ROUNDS = 6
_KEPT = 2
# No drive saves current sooner after a move.
EARLIEST_S = 0.02


class Rests:
    """Looks at what a fit leaves of the positions at rest, in the runs of `motor`."""

    def __init__(self, motor: Motor) -> None:
        self._motor = motor
        axis = motor.experiment.machine.axis
        self._period_s = math.tau / math.sqrt(axis.stiffness_N_m / axis.moving_mass_kg)
        self._since = {
            row: self._since_moves(run, reading)
            for row, (run, reading) in motor.positions().items()
        }

    def _since_moves(self, run: int, reading: Reading) -> list[tuple[slice, float]]:
        """The samples from each move of its axis to the next, and when that move ends (s).

        None of an axis that never moves.
        """
        moves = [m for m in self._motor.schedule(run).moves if reading.sensor.axis in m.axes]
        starts = np.searchsorted(reading.time_s, [m.start_s for m in moves[1:]]).tolist()
        spans = pairwise([0, *starts, len(reading.time_s)] if moves else [])
        return [(slice(*span), move.end_s) for span, move in zip(spans, moves, strict=True)]

    def lower_current(self, left: ResidualView) -> Iterator[Values]:
        """The likeliest moments (t_h) and shares (h) of hold_current_reduction."""
        begun_s = self._begun_s(left)
        if begun_s is None:
            return
        step_s = self._period_s / _STEPS_A_PERIOD
        begun_s = max(begun_s, EARLIEST_S)
        first_s = max(begun_s - _BEFORE * self._period_s, EARLIEST_S)
        times = np.arange(first_s, begun_s + _AFTER * self._period_s + step_s, step_s)
        found_s = self._best(left, [(h, t) for t in times.tolist() for h in _SHARES])[0]["t_h"]
        likeliest = self._best(left, [(h, found_s) for h in _CLOSE_SHARES])
        rounds = _ROUNDS if _gains(left, likeliest[0]) else 0
        for _ in range(rounds):
            best = likeliest[0]
            likeliest = self._best(left, self._around(best["h"], best["t_h"]))
            if likeliest[0] == best:
                break
        yield from likeliest

    def _around(self, share: float, begun_s: float) -> Iterator[tuple[float, float]]:
        """Shares and moments near these: the one makes up for the other over a period or so."""
        times = begun_s + self._period_s * _CLOSE_TIMES
        for h in share * _CLOSE:
            yield from ((float(h), t) for t in times.tolist() if h < 1 and t >= EARLIEST_S)

    def _best(self, left: ResidualView, places: Iterable[tuple[float, float]]) -> list[Values]:
        """The likeliest few shares and moments."""
        trials: list[Values] = [{"h": h, "t_h": t_h} for h, t_h in places]
        trials.sort(key=lambda values: left.rss({"hold_current_reduction": values}))
        return trials[:_KEPT]

    def _begun_s(self, left: ResidualView) -> float | None:
        """How long after a move the few periods begin that show the most.

        Of each series that is in the first rest that shows anything: the next move begins
        otherwise. None where there is nothing, or first moves show it: they do of all else.
        """
        first_moves, rests = [np.empty(0)], [np.empty((2, 0))]
        for row, (_, reading) in self._motor.positions().items():
            excess = left.residuals[row] ** 2 - 1
            for number, (samples, end_s) in enumerate(self._since[row]):
                rested_s, own = reading.time_s[samples] - end_s, excess[samples]
                if not number:
                    first_moves.append(own[rested_s < 0])
                rests.append(np.stack([rested_s, own])[:, rested_s >= 0])
                if _shows(rests[-1][1]):
                    break
        rested_s, excess = np.concatenate(rests, axis=1)
        if not _shows(excess) or _shows(np.concatenate(first_moves)):
            return None
        order = np.argsort(rested_s, kind="stable")
        times = rested_s[order]
        so_far = np.concatenate(([0.0], np.cumsum(excess[order])))
        lasts = np.searchsorted(times, times + _BEFORE * self._period_s)
        within = so_far[lasts] - so_far[:-1]
        return float(times[int(np.argmax(within))])


def _gains(left: ResidualView, values: Values) -> bool:
    """Whether a trial is any better than none: where it is worse, no step makes it good."""
    without = sum(float(part @ part) for part in left.residuals)
    return left.rss({"hold_current_reduction": values}) < without


def _shows(excess: Floats) -> bool:
    """Whether squares of residuals less 1 add up to more than those of white noise."""
    return float(excess.sum()) > _CLEARLY * math.sqrt(2 * len(excess))
