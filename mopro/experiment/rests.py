"""When a drive saves current at rest, from where its axis begins to ring differently.

The ring that a move leaves slows down at that moment, so what is to be seen of it depends
on the phase of the ring: no fixed start leads there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from mopro.diagnosis import Leftover
from mopro.experiment.model import Floats, Reading
from mopro.experiment.motor import Motor

# So many standard deviations clear of white noise something shows.
_CLEARLY = 5.0
# The ring at full current and at a third of it part within a few periods; where they begin
# to is told to within these many, before and after.
_BEFORE, _AFTER = 3.0, 1.0
_STEPS_A_PERIOD = 4
# The shares of the current to try, which an axis rings with at quite another speed each.
_SHARES = (0.35, 0.6)
_KEPT = 2
# No drive saves current sooner after a move.
EARLIEST_S = 0.02


class Rests:
    """Looks at what a fit leaves of the positions at rest, in the runs of `motor`."""

    def __init__(self, motor: Motor) -> None:
        self._motor = motor
        axis = motor.experiment.machine.axis
        self._period_s = math.tau / math.sqrt(axis.stiffness_N_m / axis.moving_mass_kg)
        # The time since its axis' first move, up to the second, by the series' numbers.
        self._rested_s = {
            row: self._first_rest(run, reading) for row, (run, reading) in motor.positions().items()
        }

    def _first_rest(self, run: int, reading: Reading) -> Floats:
        """For each sample the time since the first move ended; nan from the second one on."""
        moves = [m for m in self._motor.schedule(run).moves if reading.sensor.axis in m.axes]
        ends_s = [m.end_s for m in moves[:1]] or [math.inf]
        starts_s = [m.start_s for m in moves[1:2]] or [math.inf]
        return np.where(reading.time_s < starts_s[0], reading.time_s - ends_s[0], np.nan)

    def lower_current(self, left: Leftover) -> Iterator[Mapping[str, float]]:
        """The likeliest moments (t_h) and shares (h) of hold_current_reduction."""
        begun_s = self._begun_s(left)
        if begun_s is None:
            return
        step_s = self._period_s / _STEPS_A_PERIOD
        first_s = max(begun_s - _BEFORE * self._period_s, EARLIEST_S)
        times = np.arange(first_s, begun_s + _AFTER * self._period_s + step_s, step_s)
        trials = [{"h": h, "t_h": t} for t in times.tolist() for h in _SHARES]
        trials.sort(key=lambda values: left.misfit({"hold_current_reduction": values}))
        yield from trials[:_KEPT]

    def _begun_s(self, left: Leftover) -> float | None:
        """How long after a first move the few periods begin that show the most.

        None where there is nothing, or the first moves show it: they do of all else.
        """
        rested_s = np.concatenate(list(self._rested_s.values()))
        excess = np.concatenate([left.residuals[row] ** 2 - 1 for row in self._rested_s])
        if not _shows(excess) or _shows(excess[rested_s < 0]):
            return None
        order = np.argsort(rested_s, kind="stable")[: int(np.sum(np.isfinite(rested_s)))]
        times = rested_s[order]
        so_far = np.concatenate(([0.0], np.cumsum(excess[order])))
        firsts = np.flatnonzero(times >= 0)
        lasts = np.searchsorted(times, times[firsts] + _BEFORE * self._period_s)
        within = so_far[lasts] - so_far[firsts]
        return float(times[firsts[int(np.argmax(within))]]) if len(firsts) else None


def _shows(excess: Floats) -> bool:
    """Whether squares of residuals less 1 add up to more than those of white noise."""
    return float(excess.sum()) > _CLEARLY * math.sqrt(2 * len(excess))
