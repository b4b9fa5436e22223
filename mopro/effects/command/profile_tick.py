"""A controller that updates its command now and then."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mopro.diagnosis.model import Candidate, FindStarts, ResidualView, Role
from mopro.diagnosis.model import Parameter as Fitted
from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.effects.search import Values, delay_s

# Delays this many standard deviations clear of zero may be a tick.
_CLEARLY = 5.0
# Where its grid shows by as many, only ticks that are close have its phase throughout.
_GRID_SHOWS = 2.0
_TICKS_TRIED = 21
_SHORTEST_S, _LONGEST_S = 1e-4, 0.015
_TICK = Fitted(
    "T", "s", _SHORTEST_S, _LONGEST_S, role=Role.SHAPE, plausible=(2.5e-4, 0.0125), difference=1e-6
)


class ProfileTick(Effect):
    """The controller works the profile out only every T seconds.

    With `interpolate` = 1 the drive goes evenly, during each tick, to where the profile
    was at the tick's beginning: x_c'(nT + τ) = x_c((n-1)T) + (x_c(nT) - x_c((n-1)T)) τ/T,
    which is late by T. With 0 it holds: x_c'(t) = x_c(T floor(t/T)), late by T/2 in the
    mean and in steps of v T. Source: assumed.
    """

    name = "profile_tick"
    domain = Domain.COMMAND
    families = ("delay",)
    parameters = (
        Parameter("T", "s", "time", 2e-3, (5e-4, 1e-2), 0.0, 0.1, "update interval"),
        Parameter(
            "interpolate", "1", "ratio", 1.0, (0, 1), 0.0, 1.0,
            "1: even motion between updates, 0: hold", null=1.0, whole=True,
        ),
    )  # fmt: skip

    def tick_s(self, *p: float) -> tuple[float, bool]:
        return p[0], bool(p[1])

    def forms(self, view: View) -> Iterator[Candidate]:
        """Even motion is late by a tick, steps are by half a tick."""
        for form, interpolate, ticks in (("interpolated", 1.0, 1.0), ("held", 0.0, 2.0)):
            fixed = {"interpolate": interpolate}
            yield self.form(
                _TICK, form=form, fixed=fixed, find_starts=self._search(view, ticks, fixed)
            )

    def _search(self, view: View, ticks: float, fixed: Values) -> FindStarts:
        """Looks for the tick that the delay, so many of which are one, speaks of.

        Where its grid shows, that is the best one around.
        """

        def seek(left: ResidualView) -> Iterator[Values]:
            late_s, error_s = delay_s(view, left)
            tick_s = ticks * late_s
            if not (late_s > _CLEARLY * error_s and _SHORTEST_S < tick_s < _LONGEST_S):
                return
            if _grid_shows(view, left, tick_s) < _GRID_SHOWS:
                yield {"T": tick_s}
                return
            trials = _around(view, tick_s, ticks * 2 * error_s)
            costs = [left.rss({self.name: {"T": t, **fixed}}) for t in trials]
            yield {"T": trials[int(np.argmin(costs))]}

        return seek


def _around(view: View, tick_s: float, error_s: float) -> list[float]:
    """Ticks to either side, as far as two standard deviations and as a grid's phase is lost."""
    last_s = max(float(reading.time_s[-1]) for _, reading in view.positions().values())
    reach_s = max(error_s, tick_s**2 / last_s)
    around = np.linspace(tick_s - reach_s, tick_s + reach_s, _TICKS_TRIED)
    trials = (float(t) for t in (*around, *_round_numbers(tick_s)))
    return [t for t in trials if _SHORTEST_S < t < _LONGEST_S]


def _round_numbers(tick_s: float) -> set[float]:
    """Ticks near `tick_s` that a person would set."""
    grids = (1e-4, 2.5e-4, 5e-4, 1e-3)
    near = {round(tick_s / grid) * grid for grid in grids}
    return {t for t in near if abs(t - tick_s) < 0.01 * tick_s}


def _grid_shows(view: View, left: ResidualView, tick_s: float) -> float:
    """How strong, in standard deviations, what lies between chords and curve is.

    A chord over T is a T²/12 from its arc in the mean.
    """
    sags = [
        np.asarray(left.data[row].labels["acceleration"], dtype=float) * tick_s**2 / 12
        / left.sigmas[row]
        for row in view.positions()
    ]  # fmt: skip
    return math.sqrt(sum(float(sag @ sag) for sag in sags))
