"""The drive's phase currents, in units of the set current I.

The nominal setpoints are i_a = cos θ, i_b = sin θ with θ = k x_c.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from mopro.effects.effect import Domain, Effect, Floats, Parameter, View, ViewedReading
from mopro.effects.starts import Values
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.machine import Machine


class PhaseGainImbalance(Effect):
    """The two phases' gains differ.

    i_a' = i_a (1 + eps/2), i_b' = i_b (1 - eps/2); eps is a ratio. At low speed
    Δx = -eps/(2k) sin 2θ. Source: assumed.
    """

    name = "phase_gain_imbalance"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (
        Parameter("eps", "1", "ratio", 0.04, (-0.1, 0.1), -1.0, 1.0, "relative difference"),
    )

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, eps: float) -> tuple[float, float]:
        return ia * (1.0 + eps / 2.0), ib * (1.0 - eps / 2.0)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("eps", 0.03))


class QuadratureError(Effect):
    """The phases are not a quarter turn apart.

    i_b' = sin(θ + phi), phi in rad. At low speed Δx = phi/(2k) (1 + cos 2θ) for small
    phi. Source: assumed.
    """

    name = "quadrature_error"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (Parameter("phi", "rad", "angle", 0.035, (-0.0873, 0.0873), -1.0, 1.0, "angle"),)

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, phi: float) -> tuple[float, float]:
        # As sin(θ + phi) - sin θ: only what does not change in a run is a sine of another angle.
        half = math.sin(0.5 * phi)
        more = math.cos(theta) * math.sin(phi) - 2.0 * half * half * math.sin(theta)
        return ia, ib + more

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("phi", 0.02))


class PhaseCurrentOffset(Effect):
    """The phase currents have an offset.

    i_a' = i_a + o_a, i_b' = i_b + o_b, in units of I. At low speed
    Δx = (o_b cos θ - o_a sin θ)/k. Source: assumed.
    """

    name = "phase_current_offset"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (
        Parameter("o_a", "1", "ratio", 0.02, (-0.05, 0.05), -1.0, 1.0, "of phase a over I"),
        Parameter("o_b", "1", "ratio", 0.0, (-0.05, 0.05), -1.0, 1.0, "of phase b over I"),
    )

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, oa: float, ob: float) -> tuple[float, float]:
        return ia + oa, ib + ob

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("o_a", 0.01), self.fitted("o_b", 0.01))


class CurrentThirdHarmonic(Effect):
    """The phase currents have a third harmonic.

    i_b' = i_b + s sin 3θ, and i_a' = i_a - s cos 3θ, the same shape a quarter turn
    earlier; s is a ratio. At low speed Δx = s/k sin 4θ. Source: assumed.
    """

    name = "current_third_harmonic"
    domain = Domain.DYNAMICS
    kernel_group = "setpoints"
    parameters = (Parameter("s", "1", "ratio", 0.02, (-0.05, 0.05), -1.0, 1.0, "over I"),)

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, s: float) -> tuple[float, float]:
        # Of the angle's own sine and cosine, which compiled code has at hand.
        cosine, sine = math.cos(theta), math.sin(theta)
        cosine_3 = cosine * (4.0 * cosine * cosine - 3.0)
        return ia - s * cosine_3, ib + s * sine * (3.0 - 4.0 * sine * sine)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("s", 0.01))


# A shorter lag is a mere delay.
_SHORTEST_S = 1e-5


class CurrentLoopLag(Effect):
    """Each phase current follows its setpoint with a first-order lag.

    tau di/dt = i_set - i, tau in s. At a steady speed ω = k ẋ: amplitude
    1/√(1 + ω² tau²) and angle atan(ω tau), so Δx = -atan(ω tau)/k. Source: assumed.
    """

    name = "current_loop_lag"
    domain = Domain.DYNAMICS
    families = ("delay",)
    parameters = (Parameter("tau", "s", "time", 1e-4, (2e-5, 5e-4), 0.0, 0.01, "time constant"),)
    current_loop = "lag"

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(replace(self.fitted("tau", 5e-5, 3e-4), low=_SHORTEST_S))


_SUPPLY = Fitted(
    "Vb", "V", 25.0, 225.0, (40.0, 50.0, 90.0), Role.SHAPE, plausible=(40.0, 150.0), inverse=True
)


class VoltageSaturation(Effect):
    """The supply voltage limits the phase currents: the full electrical model of each phase.

    v_a = R i_a + L di_a/dt - Kf ẋ sin kx, v_b = R i_b + L di_b/dt + Kf ẋ cos kx, with
    Kf = F0/I and |v| <= Vb (V). The current loop asks for what keeps the current on its
    setpoint, and brings it back within 50 µs, as long as Vb suffices. Source: R is eq.
    3.45; L and supply are assumed.
    """

    name = "voltage_saturation"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("Vb", "V", "voltage", 75.0, (40.0, 150.0), 1.0, 1e6, "supply", null=1e6),
    )
    current_loop = "voltage"

    def stated_by(self, machine: Machine) -> tuple[float, ...] | None:
        """A drive of the full electrical model has it at its supply."""
        return (machine.drive.supply_V,) if machine.drive.model == "full" else None

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(_SUPPLY)


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
