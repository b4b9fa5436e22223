"""Candidates: the words in which an effect, or a free-form term, states how it is fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from mopro.engine.assumed import TOLERANCE
from mopro.engine.series import Floats, Series, Settings

# What settings may add to an effect's own parameters: the number (from 0) of the run in which alone
# it is on, -1 for all.
RUN = "run"


class Role(StrEnum):
    """Role of a parameter in the response of its effect.

    AMPLITUDE: the effect is off at `null`, and the response is nearly proportional to the
    distance from there. SHAPE: a period or a corner frequency, which decides the form of what
    the amplitudes multiply. PHASE: an angle in radians; the response at any angle is a
    combination of those at 0 and at π/2. SEARCHED: found by the candidate's own search and
    constant in least squares (a count, the moment of a step). CONSTANT: a number that the
    effect takes from elsewhere (a reference temperature), expected in its plausible range as
    likely at one value as at another; what the data do not tell about it costs no evidence.
    """

    AMPLITUDE = "amplitude"
    SHAPE = "shape"
    PHASE = "phase"
    SEARCHED = "searched"
    CONSTANT = "constant"


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in `unit`, fitted within [`low`, `high`].

    `starts`: values to simulate the signature at. `plausible`: the range in which a value is
    expected, the whole range unless given; a value clearly outside is evidence against the
    effect. `tolerated`: values that merely correct a number that the model itself states with
    this tolerance, which is a calibration and no finding. `inverse`: the fit's coordinate is
    one over the value (a corner frequency, a period). `difference`: step of finite differences
    as a share of the range, small against the curvature of the response and large against the
    rounding of a simulation. `run`: the only run whose readings the number changes, by name.
    `cyclic`: the ends of the range are the same, as for an angle.
    """

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...] = ()
    role: Role = Role.AMPLITUDE
    null: float = 0.0
    plausible: tuple[float, float] | None = None
    inverse: bool = False
    difference: float = 1e-3
    tolerated: tuple[float, float] | None = None
    run: str | None = None
    cyclic: bool = False

    def scaled(self, value: float) -> float:
        """`value` as a share of the range, 0 to 1."""
        low, high = self._coordinate(self.low), self._coordinate(self.high)
        return (self._coordinate(value) - low) / (high - low)

    def value(self, scaled: float) -> float:
        """Inverse of `scaled`."""
        low, high = self._coordinate(self.low), self._coordinate(self.high)
        return self._coordinate(low + scaled * (high - low))

    def slope(self, scaled: float) -> float:
        """Derivative of `value`, in `unit` per range; exact also in a range of few digits."""
        low, high = self._coordinate(self.low), self._coordinate(self.high)
        return (low - high) * self.value(scaled) ** 2 if self.inverse else high - low

    def multiplied(self, value: float, factor: float) -> float:
        """The value whose distance from the null is `factor` times that of `value`."""
        null = self._coordinate(self.null)
        coordinate = null + factor * (self._coordinate(value) - null)
        if self.inverse and coordinate <= 0:
            return max(self.low, self.high)
        return self._coordinate(coordinate)

    def factor(self, value: float, of: float) -> float:
        """Distance of `value` from the null divided by that of `of`; inverse of `multiplied`."""
        null = self._coordinate(self.null)
        return (self._coordinate(value) - null) / (self._coordinate(of) - null)

    def to_null(self, value: float) -> float:
        """Change of `value` that turns the effect off, to first order in the fit's coordinate."""
        return value - value**2 / self.null if self.inverse else self.null - value

    def _coordinate(self, value: float) -> float:
        return 1 / value if self.inverse else value

    def beyond(self, value: float) -> float:
        """Distance of `value` from the plausible range, in `unit`; 0 inside.

        The range is widened by `TOLERANCE` of it at each end, as its ends are round numbers.
        """
        low, high = self.plausible or (self.low, self.high)
        margin = TOLERANCE * (high - low)
        return max(low - margin - value, value - margin - high, 0.0)

    @property
    def expected(self) -> float:
        """Width of the range in which a value is expected, in `unit`."""
        low, high = self.plausible or (self.low, self.high)
        return high - low

    def tolerates(self, value: float, error: float) -> bool:
        """True if `value`, known to ± `error`, is within the model's tolerance."""
        if self.tolerated is None or not math.isfinite(error):
            return False
        low, high = self.tolerated
        return low - error <= value <= high + error

    def within(self, value: float) -> float:
        """`value` clipped to the range; an angle is turned into ±π first.

        In place of what is no finite number, the value in the range that is nearest to the null.
        """
        if not math.isfinite(value):
            value = self.null
        if self.role is Role.PHASE:
            value = math.remainder(value, 2 * math.pi)
        return float(min(max(value, self.low), self.high))


@dataclass(frozen=True)
class ResidualView:
    """Data and residual of a fit, as shown to a candidate's own search for starts.

    `residuals`: one array a series, in standard deviations of the noise. `sigmas`: those
    standard deviations, in the units of the series. `predictions`: the model's values with
    all that is fitted, in their units. `tangents`: what the fitted numbers make up for, an
    orthonormal basis over all series of which each has its rows (samples x numbers).
    `settings`: those of the effects, without laws.
    `rss(settings)`: sum of squares of the whole whitened residual with `settings` added, whose
    change is told by the coarse model.
    `alone(settings)`: change of that residual (samples of all series) if `settings` are added to
    the model without effects, which is simulated once whatever was fitted.
    """

    data: Sequence[Series]
    residuals: Sequence[Floats]
    sigmas: Sequence[float]
    predictions: Sequence[Floats]
    tangents: Sequence[Floats]
    settings: Settings
    rss: Callable[[Settings], float]
    alone: Callable[[Settings], Floats]


FindStarts = Callable[[ResidualView], Iterable[Mapping[str, float]]]


@dataclass(frozen=True)
class Law:
    """A free-form term: where it `enters` the model, the variable that it is a function `of`.

    `enters`: force, friction, heat, ambient, input, measurement or command. `of`: v, sgn v, x,
    x mod, a, t, T, command or sensor. `unit`: of the term's values. `formula`: its text at given
    values of the parameters. `of_data`: values of the term at every sample of a series, from what
    the model predicts there, for a term that is added to the predictions; None where `simulate`
    knows the term as it knows an effect. `alone`: a draft of it shows the form that a function of
    that variable has; False where what was before counts as well, or another variable changes the
    size. `run`: the only run that has the term.
    """

    enters: str
    of: str
    unit: str
    formula: Callable[[Mapping[str, float]], str]
    of_data: Callable[[Series, Floats, Mapping[str, float]], Floats] | None = None
    alone: bool = True
    run: str | None = None


@dataclass(frozen=True)
class Candidate:
    """An effect that the model may lack.

    `form`: an effect that is written in several ways has one candidate for each, with the same
    name, and the evidence picks one. `fixed`: parameters of the effect that this form does not
    fit, with their values. `extends`: the form with fewer free parameters that this one
    extends ("" for the one without a name); it is tried only beside that one, unless it
    `can_enter_first`. `flexible`: can mimic much that is in no catalogue (a free period).
    `special`: the name of an effect that this one is at some of its values, with parameters of the
    same names; its forms are tried in place of this one. `find_starts`: finds values of all
    parameters in a residual, where a few fixed starts cannot. `law`: set for a free-form term that
    is in no catalogue. `run`: the name of the only run in which it is on. `of_run_time`: a wave
    in the time since a run began, which another run must show to tell it from what that one does.
    """

    name: str
    parameters: tuple[Parameter, ...]
    form: str = ""
    fixed: Mapping[str, float] = field(default_factory=dict)
    extends: str | None = None
    can_enter_first: bool = False
    flexible: bool = False
    special: str = ""
    find_starts: FindStarts | None = None
    law: Law | None = None
    run: str | None = None
    of_run_time: bool = False

    @property
    def key(self) -> tuple[str, str]:
        return self.name, self.form

    def nests(self, other: Candidate) -> bool:
        """True if `other` is this effect with some of its free parameters fixed."""
        own, others = ({p.name for p in c.parameters} for c in (self, other))
        still_fixed = {name: value for name, value in other.fixed.items() if name not in own}
        return self.name == other.name and others < own and still_fixed == dict(self.fixed)

    @property
    def calibrates(self) -> bool:
        """True if it may merely correct a number of the model within its tolerance."""
        return any(parameter.tolerated for parameter in self.parameters)

    def in_run(self, run: str, number: int) -> Candidate:
        """This effect where it is on in one run alone, the one of that name and number (from 0).

        There it is a finding also where it is a calibration in all runs.
        """
        form = f"{self.form}, in {run}".removeprefix(", ")
        extends = None if self.extends is None else f"{self.extends}, in {run}".removeprefix(", ")
        own = (replace(p, tolerated=None) for p in self.parameters if p.run in (None, run))
        fixed = {**self.fixed, RUN: float(number)}
        return replace(
            self, parameters=tuple(own), form=form, fixed=fixed, extends=extends, run=run,
            of_run_time=False,
        )  # fmt: skip

    def settings(self, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
        return {self.name: {**self.fixed, **values}}
