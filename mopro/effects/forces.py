"""Stage D: forces on the forcer, and the constants of its equation of motion."""

from __future__ import annotations

import math
from dataclasses import replace

from mopro.effects.base import Effect, Floats, Parameter, Stage
from mopro.machine.constants import PlantConstants


class PayloadMass(Effect):
    """More mass rides on the forcer than was stated.

    m' = m + dm, in kg. Source: chapter 4.3.2, moves with 5 lb.
    """

    name = "payload_mass"
    stage = Stage.DYNAMICS
    parameters = (Parameter("dm", "kg", "mass", 1.0, (0.0, 3.0), -2.0, 50.0, "added mass"),)

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, mass_kg=plant.mass_kg + p[0])


class ViscousDrag(Effect):
    """Drag in proportion to the speed, of the air film or the umbilical.

    F = -b ẋ, b in N s/m. Source: chapter 2.1, "nearly frictionless"; figures assumed.
    """

    name = "viscous_drag"
    stage = Stage.DYNAMICS
    families = ("delay",)
    parameters = (Parameter("b", "N s/m", "drag", 5.0, (0.5, 15.0), 0.0, 500.0, "drag"),)

    @staticmethod
    def force(x: float, v: float, b: float) -> float:
        return -b * v


class QuadraticDrag(Effect):
    """Drag in proportion to the square of the speed.

    F = -c ẋ |ẋ|, c in N s²/m². Source: assumed.
    """

    name = "quadratic_drag"
    stage = Stage.DYNAMICS
    parameters = (Parameter("c", "N s2/m2", "quadratic drag", 3.0, (0.5, 8.0), 0.0, 500.0, "drag"),)

    @staticmethod
    def force(x: float, v: float, c: float) -> float:
        return -c * v * abs(v)


class CoulombFriction(Effect):
    """Dry friction with presliding after Dahl.

    F = -Fc z, dz/dx = (1 - z sgn ẋ) / delta; Fc in N, delta in m. z depends on the path
    alone, z = s - (s - z0) exp(-|Δx|/delta) with s the direction, and is taken so at
    every stage of the integrator. Source: P. R. Dahl's model; figures assumed.
    """

    name = "coulomb_friction"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("Fc", "N", "force", 3.0, (0.5, 10.0), 0.0, 100.0, "sliding friction"),
        Parameter("delta", "m", "length", 5e-6, (2e-6, 1e-5), 1e-7, 1e-3, "presliding", null=5e-6),
    )

    @staticmethod
    def slide(z: float, dx: float, fc: float, delta: float) -> float:
        if dx >= 0.0:
            return 1.0 - (1.0 - z) * math.exp(-dx / delta)
        return (1.0 + z) * math.exp(dx / delta) - 1.0

    @staticmethod
    def force(x: float, v: float, z: float, fc: float, delta: float) -> float:
        return -fc * z


class UmbilicalSpring(Effect):
    """The umbilical pulls the forcer towards where it hangs freely.

    F = -k_h (x - x_h), k_h in N/m, x_h in m from the start. Source: chapter 2.2 names
    the umbilical; figures assumed.
    """

    name = "umbilical_spring"
    stage = Stage.DYNAMICS
    families = ("scale",)
    parameters = (
        Parameter("k_h", "N/m", "stiffness", 20.0, (5.0, 50.0), 0.0, 1000.0, "stiffness"),
        Parameter("x_h", "m", "length", 0.0, (-0.5, 0.5), -2.0, 2.0, "where it hangs freely"),
    )

    @staticmethod
    def force(x: float, v: float, k_h: float, x_h: float) -> float:
        return -k_h * (x - x_h)


class ConstantForce(Effect):
    """A constant force, such as a tilted platen's.

    F = F_b, in N. Source: assumed.
    """

    name = "constant_force"
    stage = Stage.DYNAMICS
    parameters = (Parameter("F_b", "N", "force", 1.0, (-5.0, 5.0), -100.0, 100.0, "force"),)

    @staticmethod
    def force(x: float, v: float, f_b: float) -> float:
        return f_b


class DetentForce(Effect):
    """The teeth hold the forcer without current, four times a pitch.

    F = -Fd sin(4 k x + phi), k = 2π/pitch; Fd in N, phi in rad. Source: the four-step
    cycle of chapter 2.1; figures assumed.
    """

    name = "detent_force"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("Fd", "N", "force", 5.0, (2.2, 11.0), 0.0, 100.0, "amplitude"),
        Parameter("phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase"),
        Parameter(
            "pitch", "m", "length", 1.016e-3, (1.016e-3, 1.016e-3), 1e-5, 0.1,
            "the teeth's pitch", null=1.016e-3,
        ),
    )  # fmt: skip

    @staticmethod
    def force(x: float, v: float, fd: float, phi: float, pitch: float) -> float:
        return -fd * math.sin(8.0 * math.pi * x / pitch + phi)


class ElectricalDamping(Effect):
    """The drive damps the relative speed by another ratio than the machine states.

    c_s = 2 zeta √(K m) with the bare mass; zeta is a ratio. Source: assumed.
    """

    name = "electrical_damping"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("zeta", "1", "ratio", 0.01, (0.002, 0.1), 0.0, 2.0, "damping ratio", null=0.03),
    )

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, damping_N_s_m=p[0] * plant.critical_N_s_m)


class ForceConstant(Effect):
    """The motor is stronger or weaker than the machine states.

    F0' = F0 (1 + e); e is a ratio. c_s stays: it is a constant of the drive. Source: F0
    is assumed in the first place.
    """

    name = "force_constant"
    stage = Stage.DYNAMICS
    parameters = (Parameter("e", "1", "ratio", 0.1, (-0.2, 0.2), -0.95, 5.0, "relative excess"),)

    def plant(self, plant: PlantConstants, *p: float) -> PlantConstants:
        return replace(plant, pull_out_force_N=plant.pull_out_force_N * (1 + p[0]))


class ForceConstantTemperature(Effect):
    """Magnets weaken as the forcer warms.

    F0' = F0 (1 - alpha (T - T0)); alpha in 1/K, T the forcer's temperature and T0 in °C.
    Source: magnet material data, 0.03 to 0.12 %/K.
    """

    name = "force_constant_temperature"
    stage = Stage.DYNAMICS
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
