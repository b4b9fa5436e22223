"""Free-form forces: of the speed, the direction, the place, the place modulo a period, and a."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from mopro.effects.effect import Domain, Floats, Parameter, View, phase
from mopro.effects.forces import (
    PRESLIDING,
    PRESLIDING_FITTED,
    PROBED_N,
    DahlFriction,
)
from mopro.effects.free_form import FreeFormTerm, size
from mopro.effects.starts import FEWEST_PERIODS, Values, force_N, strongest_lines
from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.machine.constants import PlantConstants

# Shortest period (m) of a force that repeats with the place, as the catalogue's cyclic error has.
_FINEST_PERIOD_M = 1e-4
# Starts of a force of a period: the strongest lines over the place of the force that the residual
# calls for. Each costs two simulations.
_PERIODS_TRIED = 2
# Largest share of its force by which a motor differs from itself in the other direction.
_LARGEST_SHARE = 0.5


class Force(FreeFormTerm):
    """Base of forces on the forcer; unless overridden, c times a function of place and speed.

    That is fitted up to the pull-out force.
    """

    domain = Domain.DYNAMICS
    enters = "force"
    unit = "N"
    kernel_group: ClassVar[str | None] = "unlisted"
    # True if it grows with the speed: along the motion, the damping must exceed it.
    of_speed: ClassVar[bool] = False

    def forms(self, view: View) -> Iterator[Candidate]:
        assert self.force is not None, "a force of the motion states it"
        moved, axis = list(motions(view)), view.machine.axis
        reach = max((float(np.max(np.abs(self.force(x, v, 1.0)))) for x, v in moved), default=0.0)
        if not reach:
            return
        size = self.size(axis.pull_out_force_N / reach)
        if self.of_speed:
            fastest = max(float(np.abs(v).max()) for _, v in moved)
            along = min(size.high, axis.drive_damping_N_s_m * fastest / reach)
            size = _against_motion(replace(size, high=along))
        yield self.form(size, law=self.law)


def _against_motion(size: Fitted) -> Fitted:
    """The size with its starts negated: a force along the motion makes the motor ring."""
    return replace(size, starts=tuple(-start for start in size.starts))


def motions(view: View) -> Iterator[tuple[Floats, Floats]]:
    """Place (m) and speed (m/s) that the model predicts at each position sensor."""
    places = view.targets({})
    for row, (_, reading) in view.positions().items():
        if len(reading.time_s) > 1:
            x = places[row] * reading.sensor.unit_si
            yield x, np.gradient(x, reading.time_s)


class _OfSpeed(Force):
    name, of, text = "force of v", "v", "v"
    parameters = (size("N s/m"),)
    of_speed = True

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return c * v


class _OfSpeedSquared(Force):
    name, of, text = "force of v|v|", "v", "v * abs(v)"
    parameters = (size("N s2/m2"),)
    of_speed = True

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return c * v * abs(v)


class _OfDirection(Force):
    """A force of the direction, which builds up over the presliding of Dahl's model."""

    name, of, text = "force of sgn v", "sgn v", "sign(v)"
    parameters = (size("N"), PRESLIDING)
    slide = staticmethod(DahlFriction.slide)

    @staticmethod
    def force(x: float, v: float, z: float, c: float, delta: float) -> float:
        return c * z

    def forms(self, view: View) -> Iterator[Candidate]:
        # As Coulomb's friction is, to be told for the same where that is listed.
        size = replace(self.size(view.machine.axis.pull_out_force_N), starts=PROBED_N)
        yield self.form(_against_motion(size), PRESLIDING_FITTED, law=self.law)


class _FallingOfDirection(Force):
    """A dry friction (N) that falls with the speed from its static to its sliding value.

    (c + s exp(-|v|/vs)) z, with z of Dahl's model in place of sgn v. The presliding is fitted with
    it: without, it is hardly more than one that does not fall.
    """

    name, of = "falling force of sgn v", "sgn v"
    slide = staticmethod(DahlFriction.slide)
    parameters = (
        size("N"), PRESLIDING, size("N", "s"),
        Parameter("vs", "m/s", "velocity", 0.05, (0.005, 0.3), 1e-4, 10.0, "speed", null=0.05),
    )  # fmt: skip

    @staticmethod
    def force(x: float, v: float, z: float, c: float, delta: float, s: float, vs: float) -> float:
        return (c + s * math.exp(-abs(v) / vs)) * z

    def written(self, values: Mapping[str, float]) -> str:
        c, s, vs = (values[name] for name in ("c", "s", "vs"))
        return f"({c:.4g} + {s:.4g} * exp(-abs(v) / {vs:.4g})) * sign(v)"

    def forms(self, view: View) -> Iterator[Candidate]:
        fastest = max((float(np.abs(v).max()) for _, v in motions(view)), default=0.0)
        if not fastest:
            return
        ends = LEAST_SHARE**2 * fastest, fastest
        speed = Fitted("vs", "m/s", *ends, (LEAST_SHARE * fastest,), Role.SHAPE)
        largest = _against_motion(self.size(view.machine.axis.pull_out_force_N))
        yield self.form(largest, replace(largest, name="s"), speed, PRESLIDING_FITTED, law=self.law)


class _OfSpeedInPresliding(Force):
    """A damping while a dry friction builds up, which ends when it slides.

    c (v - |v| z), with z of Dahl's model: c times the presliding times dz/dt.
    """

    name, of, alone = "force of v in presliding", "v", False
    slide = staticmethod(DahlFriction.slide)
    parameters = (size("N s/m"), PRESLIDING)

    @staticmethod
    def force(x: float, v: float, z: float, c: float, delta: float) -> float:
        return c * (v - abs(v) * z)

    def written(self, values: Mapping[str, float]) -> str:
        return f"{values['c']:.4g} * (v - abs(v) * presliding(x, {values['delta']:.3g}))"

    def forms(self, view: View) -> Iterator[Candidate]:
        axis = view.machine.axis
        critical = 2.0 * math.sqrt(axis.stiffness_N_m * axis.moving_mass_kg)
        yield self.form(_against_motion(self.size(critical)), PRESLIDING_FITTED, law=self.law)


class _MotorOfDirection(Force):
    """A motor that is stronger in one direction: a force in proportion to its own."""

    name, of, text = "motor's force of sgn v", "sgn v", "force * sign(v)"
    parameters = (size("1"), PRESLIDING)
    slide = staticmethod(DahlFriction.slide)

    @staticmethod
    def reaction(x: float, v: float, z: float, motor_N: float, c: float, delta: float) -> float:
        return c * motor_N * z

    def forms(self, view: View) -> Iterator[Candidate]:
        share = _against_motion(self.size(_LARGEST_SHARE))
        yield self.form(share, PRESLIDING_FITTED, law=self.law)


class _FrictionUnderLoad(_MotorOfDirection):
    """A dry friction that the motor's force presses on."""

    name, text = "load's force of sgn v", "abs(force) * sign(v)"

    @staticmethod
    def reaction(x: float, v: float, z: float, motor_N: float, c: float, delta: float) -> float:
        return c * abs(motor_N) * z


class _Steady(Force):
    """A force of one size (N) at every place and speed: the constant of a function of x."""

    name, of = "steady force", "x"
    parameters = (size("N"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return c

    def written(self, values: Mapping[str, float]) -> str:
        return f"{values['c']:.4g}"


class _OfPlace(Force):
    name, of, text = "force of x", "x", "x"
    parameters = (size("N/m"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return c * x


class _OfPlaceSquared(Force):
    name, of, text = "force of x²", "x", "x**2"
    parameters = (size("N/m2"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return c * x * x


class _OfPlaceCubed(Force):
    name, of, text = "force of x³", "x", "x**3"
    parameters = (size("N/m3"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return c * x * x * x


class _OfAcceleration(Force):
    """A force of the acceleration, which is a mass."""

    name, of, text = "force of a", "a", "a"
    parameters = (size("kg"),)
    kernel_group = None

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, mass_kg=plant.mass_kg - p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        # A mass of nearly nothing rings faster than the steps of integration.
        half = view.machine.axis.moving_mass_kg / 2
        yield self.form(self.size(half), law=self.law)


class _OfPlaceModuloPeriod(Force):
    """A force that repeats with the place: c sin(2πx/p + phi)."""

    name, of, text = "force of x mod", "x mod", "sin(2 * pi * x / p + phi)"
    parameters = (
        size("N"),
        Parameter("p", "m", "length", 1e-3, (1e-4, 0.1), 1e-6, 10.0, "period", null=1e-3),
        Parameter("phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase"),
    )

    @staticmethod
    def force(x: float, v: float, c: float, p: float, phi: float) -> float:
        return c * math.sin(2.0 * math.pi * x / p + phi)

    def written(self, values: Mapping[str, float]) -> str:
        return f"{values['c']:.4g} * sin(2 * pi * x / {values['p']:.5g} + {values['phi']:.3g})"

    def forms(self, view: View) -> Iterator[Candidate]:
        reach = max((float(np.ptp(x)) for x, _ in motions(view)), default=0.0)
        if reach < FEWEST_PERIODS * _FINEST_PERIOD_M:
            return
        largest = view.machine.axis.pull_out_force_N
        period = Fitted(
            "p", "m", _FINEST_PERIOD_M, reach / FEWEST_PERIODS, role=Role.SHAPE, inverse=True,
            difference=1e-6,
        )  # fmt: skip
        yield self.form(
            replace(self.size(largest), low=0.0), period, phase("phi"), flexible=True,
            find_starts=lambda fit: _lines(view, fit), law=self.law,
        )  # fmt: skip


def _lines(view: View, fit: ResidualView) -> Iterator[Values]:
    """Starts from the strongest lines, over the place, of the force that the residual calls for.

    The strongest lines of the residual itself are those that meet the motor's resonance.
    """
    lines = strongest_lines(view, fit, _FINEST_PERIOD_M, _PERIODS_TRIED, of=force_N)
    for sine, cosine, period in lines:
        yield {"c": math.hypot(sine, cosine), "p": period, "phi": math.atan2(cosine, sine)}


FORCES: tuple[type[FreeFormTerm], ...] = (
    _OfSpeed,
    _OfSpeedSquared,
    _OfDirection,
    _FallingOfDirection,
    _OfSpeedInPresliding,
    _MotorOfDirection,
    _FrictionUnderLoad,
    _Steady,
    _OfPlace,
    _OfPlaceSquared,
    _OfPlaceCubed,
    _OfPlaceModuloPeriod,
    _OfAcceleration,
)
