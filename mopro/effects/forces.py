"""Effects in the equation of motion: forces on the forcer, and its constants."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.effect import WIDER, Domain, Effect, Floats, Parameter, Toleranced, View, phase
from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.machine import Machine
from mopro.machine.constants import PlantConstants

PRESLIDING_M = 5e-6
PRESLIDING = Parameter(
    "delta", "m", "length", PRESLIDING_M, (2e-6, 1e-5), 1e-7, 1e-3, "presliding", null=PRESLIDING_M
)
PRESLIDING_FITTED = Fitted(
    "delta", "m", 5e-7, 5e-5, (PRESLIDING_M,), Role.CONSTANT, plausible=PRESLIDING.plausible
)


class DahlFriction(Effect):
    """Base of laws of dry friction whose first two parameters are a force and `delta` (m).

    Their state z, from -1 to 1, is the share of the friction that has built up:
    dz/dx = (1 - z sgn ẋ) / delta. z depends on the path alone, z = s - (s - z0) exp(-|Δx|/delta)
    with s the direction, and is taken so at every stage of the integrator. Source:
    P. R. Dahl's model.
    """

    kernel_group = "forces"

    @staticmethod
    def slide(z: float, dx: float, force_N: float, delta: float, *others: float) -> float:
        if dx >= 0.0:
            return 1.0 - (1.0 - z) * math.exp(-dx / delta)
        return (1.0 + z) * math.exp(dx / delta) - 1.0


class PlatenEdge(Effect):
    """The mechanical stop of the forcer beyond its limit switch.

    F = -K (x - edge) - C ẋ outside of [low, high] (m), a stiff and well damped contact.
    Source: assumed. Not in the catalogue: every machine has it, few runs reach it.
    """

    name = "platen_edge"
    domain = Domain.DYNAMICS
    parameters = tuple(
        Parameter(n, "m", "length", 0.0, (-1, 1), -math.inf, math.inf, f"{n} edge")
        for n in ("low", "high")
    )

    @staticmethod
    def force(x: float, v: float, low: float, high: float) -> float:
        if low <= x <= high:
            return 0.0
        edge = high if x > high else low
        return -2.0e6 * (x - edge) - 2.0e3 * v


# One object for all runs, as kernels are cached by their effects.
PLATEN_EDGE = PlatenEdge()


# Masses that are tried are so many times apart.
_HEAVIER = 1.12


class PayloadMass(Effect):
    """The forcer carries another mass than stated; less where it is stated to carry some.

    m' = m + dm, in kg. Source: chapter 4.3.2, moves with 5 lb.
    """

    name = "payload_mass"
    domain = Domain.DYNAMICS
    parameters = (Parameter("dm", "kg", "mass", 1.0, (0.0, 3.0), -50.0, 50.0, "added mass"),)

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, mass_kg=plant.mass_kg + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        mass_kg, own = view.machine.axis.moving_mass_kg, self.fitted("dm", 0.02)
        carried_kg = max((run.payload_kg for run in view.runs), default=0.0)
        _, most_kg = self.parameter("dm").plausible
        lighter = (-kg for kg in self._tried(mass_kg, carried_kg) if carried_kg)
        yield self.form(
            replace(
                own,
                low=-carried_kg,
                plausible=(-carried_kg, most_kg),
                starts=(*own.starts, *self._tried(mass_kg, most_kg), *lighter),
            )
        )

    @staticmethod
    def _tried(mass_kg: float, most_kg: float) -> Iterator[float]:
        """Masses to try beside the moving one, to the largest.

        A ring's frequency goes with both masses and forces: a signature taken too far off is out
        of phase with what it is to show.
        """
        total_kg = _HEAVIER * mass_kg
        while total_kg < mass_kg + most_kg:
            yield total_kg - mass_kg
            total_kg *= _HEAVIER
        yield most_kg


class ViscousDrag(Effect):
    """Drag in proportion to the speed, of the air film or the umbilical.

    F = -b ẋ, b in N s/m. Source: chapter 2.1, "nearly frictionless"; figures assumed.
    """

    name = "viscous_drag"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    families = ("delay",)
    parameters = (Parameter("b", "N s/m", "drag", 5.0, (0.5, 15.0), 0.0, 500.0, "drag"),)

    @staticmethod
    def force(x: float, v: float, b: float) -> float:
        return -b * v

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("b", 3.0))


class QuadraticDrag(Effect):
    """Drag in proportion to the square of the speed.

    F = -c ẋ |ẋ|, c in N s²/m². Source: assumed.
    """

    name = "quadratic_drag"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    parameters = (Parameter("c", "N s2/m2", "quadratic drag", 3.0, (0.5, 8.0), 0.0, 500.0, "drag"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return -c * v * abs(v)

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("c", 1.5))


# Forces (N) that it is probed at: a dry friction is far from proportional to its force.
PROBED_N = (1.0, 3.0, 9.0)


class CoulombFriction(DahlFriction):
    """Dry friction with presliding after Dahl.

    F = -Fc z, dz/dx = (1 - z sgn ẋ) / delta; Fc in N, delta in m. z depends on the path
    alone, z = s - (s - z0) exp(-|Δx|/delta) with s the direction, and is taken so at
    every stage of the integrator. Source: P. R. Dahl's model; figures assumed.
    """

    name = "coulomb_friction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("Fc", "N", "force", 3.0, (0.5, 10.0), 0.0, 100.0, "sliding friction"),
        PRESLIDING,
    )

    @staticmethod
    def force(x: float, v: float, z: float, fc: float, delta: float) -> float:
        return -fc * z

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("Fc", *PROBED_N), PRESLIDING_FITTED)


_SPEED_M_S = 0.05


class StribeckFriction(DahlFriction):
    """Dry friction that falls with the speed, from a static to a sliding value.

    F = -(Fc + (Fs - Fc) exp(-(ẋ/vs)²)) z with presliding after Dahl as in coulomb_friction;
    Fc and Fs in N, vs in m/s, delta in m. At Fs = Fc it is coulomb_friction. Source:
    R. Stribeck's curve in the form of B. Armstrong-Hélouvry; figures assumed.
    """

    name = "stribeck_friction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("Fc", "N", "force", 3.0, (0.5, 10.0), 0.0, 100.0, "sliding friction"),
        PRESLIDING,
        Parameter("Fs", "N", "force", 6.0, (0.5, 15.0), 0.0, 100.0, "static friction"),
        Parameter(
            "vs", "m/s", "velocity", _SPEED_M_S, (0.005, 0.3), 1e-4, 10.0,
            "speed at which it falls", null=_SPEED_M_S,
        ),
    )  # fmt: skip

    @staticmethod
    def force(x: float, v: float, z: float, fc: float, delta: float, fs: float, vs: float) -> float:
        return -(fc + (fs - fc) * math.exp(-(v / vs) * (v / vs))) * z

    def forms(self, view: View) -> Iterator[Candidate]:
        """All three at once: with fewer free it is hardly more than a Coulomb friction."""
        speed = Fitted(
            "vs",
            "m/s",
            2e-3,
            0.6,
            (0.02, 0.1),
            Role.SHAPE,
            plausible=self.parameter("vs").plausible,
        )
        forces = self.fitted("Fc", 1.0, 3.0), self.fitted("Fs", 2.0, 6.0)
        yield self.form(*forces, speed, PRESLIDING_FITTED, special=CoulombFriction.name)


class LoadDependentFriction(DahlFriction):
    """Dry friction in proportion to the motor's force, as of a guide that it is pressed against.

    F = -mu |F_motor| z with presliding after Dahl as in coulomb_friction; mu is a ratio,
    delta in m. While it accelerates at a, the motor gives m a / (1 - mu); while it brakes,
    m a / (1 + mu). Source: assumed.
    """

    name = "load_dependent_friction"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("mu", "1", "ratio", 0.1, (0.01, 0.3), 0.0, 0.9, "friction over motor force"),
        PRESLIDING,
    )

    @staticmethod
    def reaction(x: float, v: float, z: float, motor_N: float, mu: float, delta: float) -> float:
        return -mu * abs(motor_N) * z

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("mu", 0.03, 0.15), PRESLIDING_FITTED)


_FREE_END = Fitted("x_h", "m", -0.9, 0.9, (0.0,), Role.SHAPE, plausible=(-0.6, 0.6))


class UmbilicalSpring(Effect):
    """The umbilical pulls the forcer towards its rest position like a spring.

    F = -k_h (x - x_h), k_h in N/m, x_h in m from the start. Source: chapter 2.2 names
    the umbilical; figures assumed.
    """

    name = "umbilical_spring"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    families = ("scale",)
    parameters = (
        Parameter("k_h", "N/m", "stiffness", 20.0, (5.0, 50.0), 0.0, 1000.0, "stiffness"),
        Parameter("x_h", "m", "length", 0.0, (-0.5, 0.5), -2.0, 2.0, "where it hangs freely"),
    )

    @staticmethod
    def force(x: float, v: float, k_h: float, x_h: float) -> float:
        return -k_h * (x - x_h)

    def forms(self, view: View) -> Iterator[Candidate]:
        stiffness = self.fitted("k_h", 10.0)
        spring = self.form(stiffness, fixed={"x_h": 0.0})
        yield spring
        yield replace(
            spring, parameters=(stiffness, _FREE_END), fixed={}, form="free end fitted", extends=""
        )


class ConstantForce(Effect):
    """A constant force, such as a tilted platen's.

    F = F_b, in N. Source: assumed.
    """

    name = "constant_force"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    parameters = (Parameter("F_b", "N", "force", 1.0, (-5.0, 5.0), -100.0, 100.0, "force"),)

    @staticmethod
    def force(x: float, v: float, f_b: float) -> float:
        return f_b

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("F_b", 1.0))

    def static_deflection_m(self, machine: Machine) -> float:
        """F/K."""
        most_N = max(map(abs, self.parameter("F_b").plausible))
        return most_N / machine.axis.stiffness_N_m


class ElectricalDamping(Effect):
    """The drive damps the relative speed by another ratio than the machine states.

    c_s = 2 zeta √(K m) with the bare mass; zeta is a ratio. Source: assumed.
    """

    name = "electrical_damping"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("zeta", "1", "ratio", 0.01, (0.002, 0.1), 0.0, 2.0, "damping ratio", null=0.03),
    )

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, damping_N_s_m=p[0] * plant.critical_N_s_m)

    def forms(self, view: View) -> Iterator[Candidate]:
        """Tried at half and twice what the machine has; a machine with much may have more."""
        ratio = view.machine.axis.damping_ratio
        own = self.fitted("zeta", *((ratio / 2, 2 * ratio) if ratio else (0.01, 0.05)))
        low, high = own.plausible or (own.low, own.high)
        zeta = replace(
            own, low=0.0, high=max(own.high, 2 * WIDER * ratio), null=ratio,
            plausible=(low, max(high, 2 * ratio)),
        )  # fmt: skip
        yield self.form(zeta)

    def toleranced(self, machine: Machine) -> Toleranced:
        ratio = machine.axis.damping_ratio
        # The plant has c_s, which the file's ratio makes with its force: c_s ~ zeta √F0.
        return Toleranced("axis.damping_ratio", ratio, ratio, ("axis.pull_out_force",))


class ForceConstant(Effect):
    """The motor is stronger or weaker than the machine states.

    F0' = F0 (1 + e); e is a ratio. c_s stays: it is a constant of the drive. Source: F0
    itself is assumed.
    """

    name = "force_constant"
    domain = Domain.DYNAMICS
    parameters = (Parameter("e", "1", "ratio", 0.1, (-0.2, 0.2), -0.95, 5.0, "relative excess"),)

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, pull_out_force_N=plant.pull_out_force_N * (1 + p[0]))

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 0.003, -0.05, 0.09, -0.11, -0.17, 0.17))

    def toleranced(self, machine: Machine) -> Toleranced:
        return Toleranced("axis.pull_out_force", 0.0, 1.0)


class ForceConstantTemperature(Effect):
    """Magnets weaken as the forcer warms.

    F0' = F0 (1 - alpha (T - T0)); alpha in 1/K, T the forcer's temperature and T0 in °C.
    Source: magnet material data, 0.03 to 0.12 %/K.
    """

    name = "force_constant_temperature"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("alpha", "1/K", "expansion", 1e-3, (3e-4, 1.2e-3), 0.0, 8e-3, "loss per kelvin"),
        Parameter(
            "T0", "C", "temperature", 24.87, (15.0, 30.0), -50.0, 200.0,
            "where the machine's F0 holds", null=24.87,
        ),
    )  # fmt: skip

    def force_factor(self, temperature_C: Floats, *p: float) -> Floats:
        factor: Floats = 1 - p[0] * (temperature_C - p[1])
        return factor

    def forms(self, view: View) -> Iterator[Candidate]:
        """Magnets weaken from where F0 was measured on, which is assumed, not known."""
        fixed = {"T0": view.machine.heat.ambient_C}
        yield self.form(self.fitted("alpha", 5e-4), fixed=fixed)


# Largest plausible detent force, as a share of the pull-out force.
_PLAUSIBLE_SHARE = 0.1


class DetentForce(Effect):
    """The teeth hold the forcer without current, four times a pitch.

    F = -Fd sin(4 k x + phi), k = 2π/pitch; Fd in N, phi in rad. Source: the four-step
    cycle of chapter 2.1; figures assumed.
    """

    name = "detent_force"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    parameters = (
        Parameter("Fd", "N", "force", 5.0, (2.2, 11.0), 0.0, 100.0, "amplitude"),
        Parameter(
            "phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase", role=Role.PHASE
        ),
        Parameter(
            "pitch", "m", "length", 1.016e-3, (1.016e-3, 1.016e-3), 1e-5, 0.1,
            "the teeth's pitch", null=1.016e-3,
        ),
    )  # fmt: skip

    @staticmethod
    def force(x: float, v: float, fd: float, phi: float, pitch: float) -> float:
        return -fd * math.sin(8.0 * math.pi * x / pitch + phi)

    def forms(self, view: View) -> Iterator[Candidate]:
        """Shares of the pull-out force, small ones and large ones, as a ring bends under it.

        Where the teeth pass at their own frequency the answer is no mirror image half a turn on.
        """
        most = _PLAUSIBLE_SHARE * view.machine.axis.pull_out_force_N
        own = self.fitted("Fd", most / 4, 0.75 * most)
        highest = min(WIDER * most, self.parameter("Fd").high)
        force = replace(own, high=highest, plausible=(0.0, most))
        pitch = {"pitch": view.machine.axis.pitch_m}
        yield self.form(force, phase("phi", 0.0, math.pi), fixed=pitch)
