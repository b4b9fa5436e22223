"""Free-form heat flows into the forcer: of its temperature, of the speeds, of time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from mopro.effects.effect import Domain, Surroundings, View
from mopro.effects.free_form import FreeFormTerm, size
from mopro.engine.candidate import Candidate

# The power (W) of the largest term at a rise over the air (K), a speed (m/s), a time (s) and a
# power of the coils (W) that are common: several times that of any motor. Halved or doubled, so are
# the ranges of sizes; no fit ends at their ends.
_LARGEST_W = 100.0
_RISE_K, _SPEED_M_S, _TIME_S, _COIL_W = 10.0, 0.1, 600.0, 10.0


class _HeatFlow(FreeFormTerm):
    """Base of heat flows in proportion to one variable.

    `reference`: a common value of the variable, in SI.
    """

    domain = Domain.HEAT
    enters, unit = "heat", "W"
    reference: ClassVar[float]

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.size(_LARGEST_W / self.reference), law=self.law)


class _OfRise(_HeatFlow):
    name, of, text = "heat of T", "T", "(T - ambient)"
    parameters = (size("W/K"),)
    reference = _RISE_K

    def heat(self, here: Surroundings, *p: float) -> None:
        here.extra_W += p[0] * (here.temperature_C - here.air_C)


class _OfRiseSquared(_HeatFlow):
    name, of, text = "heat of T²", "T", "(T - ambient) * abs(T - ambient)"
    parameters = (size("W/K2"),)
    reference = _RISE_K**2

    def heat(self, here: Surroundings, *p: float) -> None:
        rise = here.temperature_C - here.air_C
        here.extra_W += p[0] * rise * abs(rise)


class _OfRiseAndSpeed(_HeatFlow):
    """Cooling by the motion."""

    name, of, text = "heat of T v", "T", "(T - ambient) * abs(v)"
    parameters = (size("J/(m K)"),)
    reference = _RISE_K * _SPEED_M_S

    def heat(self, here: Surroundings, *p: float) -> None:
        here.extra_W += p[0] * (here.temperature_C - here.air_C) * sum(here.speeds_m_s)


class _OfRiseAndPower(_HeatFlow):
    """Coils whose power changes with the temperature."""

    name, of, text = "heat of T power", "T", "(T - ambient) * power"
    parameters = (size("1/K"),)
    reference = _RISE_K * _COIL_W

    def heat(self, here: Surroundings, *p: float) -> None:
        here.extra_W += p[0] * (here.temperature_C - here.air_C) * here.coil_W


class _OfSpeed(_HeatFlow):
    name, of, text = "heat of v", "v", "abs(v)"
    parameters = (size("J/m"),)
    reference = _SPEED_M_S

    def heat(self, here: Surroundings, *p: float) -> None:
        here.extra_W += p[0] * sum(here.speeds_m_s)


class _OfSpeedSquared(_HeatFlow):
    name, of, text = "heat of v²", "v", "v**2"
    parameters = (size("J s/m2"),)
    reference = _SPEED_M_S**2

    def heat(self, here: Surroundings, *p: float) -> None:
        here.extra_W += p[0] * sum(speed**2 for speed in here.speeds_m_s)


class _OfTime(_HeatFlow):
    name, of, text = "heat of t", "t", "t"
    parameters = (size("W/s"),)
    reference = _TIME_S

    def heat(self, here: Surroundings, *p: float) -> None:
        here.extra_W += p[0] * here.time_s


class _AirOfTime(FreeFormTerm):
    """A change of the air's temperature in proportion to time."""

    name, of, text = "air of t", "t", "t"
    domain = Domain.HEAT
    enters, unit = "ambient", "K"
    parameters = (size("K/s"),)

    def heat(self, here: Surroundings, *p: float) -> None:
        here.air_C += p[0] * here.time_s

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.size(_RISE_K / _TIME_S), law=self.law)


HEAT: tuple[type[FreeFormTerm], ...] = (
    _OfRise,
    _OfRiseSquared,
    _OfRiseAndSpeed,
    _OfRiseAndPower,
    _OfSpeed,
    _OfSpeedSquared,
    _OfTime,
    _AirOfTime,
)
