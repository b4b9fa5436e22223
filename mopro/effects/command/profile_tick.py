"""A controller that updates its command at intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.effects.search import Values, delay_s
from mopro.engine.candidate import Candidate, FindStarts, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted

# Least delay that may be a tick, in its standard errors.
_DELAY_SIGMAS = 5.0
# Size of the grid's sags in σ from which the tick is refined: only close values then keep
# the phase of the grid over the whole run.
_GRID_SIGMAS = 2.0
# Most ticks that are tried, and the least step of their number in a run: at its end the grid is off
# by a tenth of a tick at the most, from where a fit finds the rest. Halved, twice as many are
# simulated; doubled, a fifth of a tick is left.
_TICKS_TRIED = 21
_STEP = 0.2
# Four fifths of the shortest plausible tick, and more than the longest: what is farther outside is
# clearly implausible, and neither an answer nor an alternative.
_SHORTEST_S, _LONGEST_S = 2e-4, 0.015
_TICK = Fitted(
    "T", "s", _SHORTEST_S, _LONGEST_S, role=Role.SHAPE, plausible=(2.5e-4, 0.0125), difference=1e-6
)


class ProfileTick(Effect):
    """The controller computes the profile only every T seconds.

    With `interpolate` = 1 the drive moves at constant speed, during each tick, to the
    position of the profile at the tick's beginning:
    x_c'(nT + τ) = x_c((n-1)T) + (x_c(nT) - x_c((n-1)T)) τ/T, which is late by T. With 0 it
    holds: x_c'(t) = x_c(T floor(t/T)), late by T/2 on average, in steps of v T.
    Source: assumed.
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
        """Interpolated motion is late by one tick, held motion by half a tick."""
        for form, interpolate, ticks in (("interpolated", 1.0, 1.0), ("held", 0.0, 2.0)):
            fixed = {"interpolate": interpolate}
            yield self.form(
                _TICK, form=form, fixed=fixed, find_starts=self._search(view, ticks, fixed)
            )

    def _search(self, view: View, ticks: float, fixed: Values) -> FindStarts:
        """Search for the tick as `ticks` times the delay of the data.

        Where the grid of the tick is visible, the best value near it is taken.
        """

        def find_tick(fit: ResidualView) -> Iterator[Values]:
            late_s, error_s = delay_s(view, fit)
            tick_s = ticks * late_s
            if not (late_s > _DELAY_SIGMAS * error_s and _SHORTEST_S < tick_s < _LONGEST_S):
                return
            if _grid_sigmas(view, fit, tick_s) < _GRID_SIGMAS:
                yield {"T": tick_s}
                return
            # Beside any effects a tick changes what it changes alone, to within what they do to it.
            left = np.concatenate(fit.residuals)
            trials = _around(view, tick_s, ticks * 2 * error_s)
            changed = (left + fit.alone({self.name: {"T": t, **fixed}}) for t in trials)
            yield {"T": trials[int(np.argmin([float(own @ own) for own in changed]))]}

        return find_tick


def _around(view: View, tick_s: float, error_s: float) -> list[float]:
    """Ticks within `error_s`, or within the change that shifts the grid by one tick at the end.

    Their numbers in the longest run are multiples of one step, so that ticks which were tried
    before are tried again: a fifth, or that doubled until there are few enough.
    """
    last_s = max(float(reading.time_s[-1]) for _, reading in view.positions().values())
    number = last_s / tick_s
    reach = number * max(error_s / tick_s, 1 / number)
    step = _STEP * 2 ** max(math.ceil(math.log2(2 * reach / (_TICKS_TRIED * _STEP))), 0)
    first, last = math.ceil((number - reach) / step), math.floor((number + reach) / step)
    shared = (last_s / (step * n) for n in range(max(first, 1), last + 1))
    trials = (*shared, *_round_numbers(tick_s))
    return [t for t in trials if _SHORTEST_S < t < _LONGEST_S]


def _round_numbers(tick_s: float) -> set[float]:
    """Round numbers within 1 % of `tick_s`."""
    grids = (1e-4, 2.5e-4, 5e-4, 1e-3)
    near = {round(tick_s / grid) * grid for grid in grids}
    return {t for t in near if abs(t - tick_s) < 0.01 * tick_s}


def _grid_sigmas(view: View, fit: ResidualView, tick_s: float) -> float:
    """Norm, in σ, of the sags between the interpolated command and the profile.

    The mean sag of a chord over T is a T²/12.
    """
    sags = [
        np.asarray(fit.data[row].labels["acceleration"], dtype=float) * tick_s**2 / 12
        / fit.sigmas[row]
        for row in view.positions()
    ]  # fmt: skip
    return math.sqrt(sum(float(sag @ sag) for sag in sags))
