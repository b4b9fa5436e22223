"""A drive that reduces its current at rest, and the search for the time at which it does so.

At that time the oscillation after a move becomes slower. The residual depends on the phase of
the oscillation then, so a fit from a fixed start does not converge.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise, product

import numpy as np

from mopro.effects.base import Domain, Effect, Floats, Parameter, View, ViewedReading
from mopro.effects.search import Values
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted

# Excess of squared residuals over white noise, in its standard deviations, that is evidence.
_EXCESS_SIGMAS = 5.0
# In periods of the oscillation, before and after the time found: full and reduced current
# differ visibly within a few periods, so the time is known to within these.
_BEFORE, _AFTER = 3.0, 1.0
_STEPS_A_PERIOD = 4
# Shares of the current whose natural frequencies differ enough that the phase of at least one
# is right over the ten periods that an oscillation lasts.
_SHARES = (0.35, 0.6)
_CLOSE_SHARES = tuple(np.geomspace(0.3, 0.75, 16).tolist())
# Steps of the refinement: a factor on the share, and a time in periods; half a period each way.
_CLOSE, _CLOSE_TIME = 1.03, 1 / 8
_NEAR = tuple(product((-1, 0, 1), range(-4, 5)))
_ROUNDS = 6
_MOST_STARTS = 2
# No drive reduces its current sooner after a move (s).
EARLIEST_S = 0.02

_SHARE = Fitted("h", "1", 0.1, 1.0, (0.5,), null=1.0, plausible=(0.3, 1.0))
# A thousandth of the range is half a period of the oscillation.
_AFTER_REST = Fitted(
    "t_h", "s", EARLIEST_S, 6.0, (0.05, 0.2, 0.7, 2.0), Role.SHAPE, difference=1e-5
)


class HoldCurrentReduction(Effect):
    """The drive lowers the current of an axis that has rested for a while.

    I' = h I from t_h (s) after the command has come to rest until it moves again; h is a
    ratio. The coils heat by h² then. Source: common practice; figures assumed.
    """

    name = "hold_current_reduction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("h", "1", "ratio", 0.5, (0.3, 0.75), 0.0, 1.0, "share of current", null=1.0),
        Parameter("t_h", "s", "time", 0.5, (0.05, 5.0), 0.0, 3600.0, "time at rest", null=0.5),
    )

    def hold(self, *p: float) -> tuple[float, float]:
        return p[1], p[0]

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(
            _SHARE, _AFTER_REST, find_starts=HoldCurrentStartFinder(view, self.name).lower_current
        )


class HoldCurrentStartFinder:
    """Finds starting values in the position residuals at rest of the runs of `view`.

    `name` is the name of the effect in the settings that are tried.
    """

    def __init__(self, view: View, name: str) -> None:
        self._view = view
        self._name = name
        axis = view.machine.axis
        self._period_s = math.tau / math.sqrt(axis.stiffness_N_m / axis.moving_mass_kg)
        self._since = {
            row: self._since_moves(run, reading) for row, (run, reading) in view.positions().items()
        }

    def _since_moves(self, run: int, reading: ViewedReading) -> list[tuple[slice, float]]:
        """Samples from each move of the axis to the next, with the end of that move (s).

        Empty for an axis that never moves.
        """
        moves = [m for m in self._view.schedule(run).moves if reading.sensor.axis in m.axes]
        starts = np.searchsorted(reading.time_s, [m.start_s for m in moves[1:]]).tolist()
        spans = pairwise([0, *starts, len(reading.time_s)] if moves else [])
        return [(slice(*span), move.end_s) for span, move in zip(spans, moves, strict=True)]

    def lower_current(self, fit: ResidualView) -> Iterator[Values]:
        """Likely values of t_h (s) and h, best first."""
        begun_s = self._begun_s(fit)
        if begun_s is None:
            return
        step_s = self._period_s / _STEPS_A_PERIOD
        begun_s = max(begun_s, EARLIEST_S)
        first_s = max(begun_s - _BEFORE * self._period_s, EARLIEST_S)
        times = np.arange(first_s, begun_s + _AFTER * self._period_s + step_s, step_s)
        best_s = self._best(fit, [(h, t) for t in times.tolist() for h in _SHARES])[0]["t_h"]
        likeliest = self._best(fit, [(h, best_s) for h in _CLOSE_SHARES])
        first = likeliest[0]
        yield from self._refined(fit, first) if self._gains(fit, first) else likeliest

    def _refined(self, fit: ResidualView, first: Values) -> list[Values]:
        """The best values of a lattice about `first`, followed to where it is lowest.

        A share compensates for a time over about a period.
        """
        costs = {(0, 0): fit.rss({self._name: first})}

        def values(place: tuple[int, int]) -> Values:
            share, time = place
            begun_s = first["t_h"] + time * _CLOSE_TIME * self._period_s
            return {"h": first["h"] * _CLOSE**share, "t_h": begun_s}

        def cost(place: tuple[int, int]) -> float:
            if place not in costs:
                own = values(place)
                allowed = own["h"] < 1 and own["t_h"] >= EARLIEST_S
                costs[place] = fit.rss({self._name: own}) if allowed else math.inf
            return costs[place]

        ranked = [(0, 0)]
        for _ in range(_ROUNDS):
            share, time = centre = ranked[0]
            ranked = sorted(((share + h, time + t) for h, t in _NEAR), key=cost)
            if ranked[0] == centre:
                break
        return [values(place) for place in ranked[:_MOST_STARTS] if cost(place) < math.inf]

    def _best(self, fit: ResidualView, places: Iterable[tuple[float, float]]) -> list[Values]:
        """The values with the least sum of squares, at most _MOST_STARTS of them."""
        trials: list[Values] = [{"h": h, "t_h": t_h} for h, t_h in places]
        trials.sort(key=lambda values: fit.rss({self._name: values}))
        return trials[:_MOST_STARTS]

    def _gains(self, fit: ResidualView, values: Values) -> bool:
        """True if `values` fit better than no effect; refinement does not help otherwise."""
        without = sum(float(part @ part) for part in fit.residuals)
        return fit.rss({self._name: values}) < without

    def _begun_s(self, fit: ResidualView) -> float | None:
        """Time after a move (s) at which the periods of largest excess residual begin.

        Each series contributes its rests up to the first one with an excess, as the effect also
        changes the start of the next move. None without an excess, over all rests or over
        those periods. An excess is that over what neighbouring samples differ by, as the stated
        noise may be wrong, and over what the first move shows: noise with a memory, or another
        effect.
        """
        from mopro.engine.residuals import difference_variance  # loads scipy

        rests = [np.empty((2, 0))]
        for row, (_, reading) in self._view.positions().items():
            square = fit.residuals[row] ** 2
            noise = difference_variance(fit.residuals[row]) or 1.0
            for number, (samples, end_s) in enumerate(self._since[row]):
                rested_s, own = reading.time_s[samples] - end_s, square[samples]
                if not number and (rested_s < 0).any():
                    noise = max(noise, float(own[rested_s < 0].mean()))
                rests.append(np.stack([rested_s, own / noise - 1])[:, rested_s >= 0])
                if _is_excessive(rests[-1][1]):
                    break
        rested_s, excess = np.concatenate(rests, axis=1)
        if not len(excess):
            return None
        order = np.argsort(rested_s, kind="stable")
        times, excess = rested_s[order], excess[order]
        so_far = np.concatenate(([0.0], np.cumsum(excess)))
        lasts = np.searchsorted(times, times + _BEFORE * self._period_s)
        within = so_far[lasts] - so_far[:-1]
        first = int(np.argmax(within))
        # A faint one drowns in the noise of all rests, and not in that of a few periods.
        shown = _is_excessive(excess) or _is_excessive(excess[first : lasts[first]])
        return float(times[first]) if shown else None


def _is_excessive(excess: Floats) -> bool:
    """True if the sum of z² - 1 exceeds that of white noise by _EXCESS_SIGMAS."""
    return float(excess.sum()) > _EXCESS_SIGMAS * math.sqrt(2 * len(excess))
