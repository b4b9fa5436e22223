"""What can be hidden: each effect's parameters for a strength between 0 (absent) and 1.

Strength 1 is the far end of the plausible range, `least` the near end. What is not a size
(phases, wavelengths, signs, where it acts) is drawn once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mopro.benchmark.reference.nominal import LVDT_HALF_M, STEEL_1_K, Nominal

Generator = np.random.Generator
Parameters = dict[str, float]
Drawn = Callable[[float], Parameters]
Draw = Callable[[Generator, Nominal], Drawn]


@dataclass(frozen=True)
class Entry:
    """One effect: `draw` gives its parameters, on a machine, as a function of its strength."""

    name: str
    draw: Draw
    least: float = 1e-3
    family: str = ""
    thermal: bool = False


def _sized(
    parameter: str, most: float, signed: bool = False, **others: Callable[[Generator], float]
) -> Draw:
    def draw(g: Generator, n: Nominal) -> Drawn:
        top = most * (g.choice([-1.0, 1.0]) if signed else 1.0)
        fixed = {name: float(value(g)) for name, value in others.items()}
        return lambda s: {parameter: float(top * s), **fixed}

    return draw


def _even(low: float, high: float) -> Callable[[Generator], float]:
    return lambda g: g.uniform(low, high)


def _log(low: float, high: float) -> Callable[[Generator], float]:
    return lambda g: math.exp(g.uniform(math.log(low), math.log(high)))


def _one_of(*values: float) -> Callable[[Generator], float]:
    return lambda g: g.choice(values)


_angle = _even(-math.pi, math.pi)


def _damping(g: Generator, n: Nominal) -> Drawn:
    end = g.choice([0.1, 0.002])
    return lambda s: {"zeta": float(n.damping_ratio + s * (end - n.damping_ratio))}


def _warmth(g: Generator, n: Nominal) -> Drawn:
    measured_at = g.choice([n.air_C, n.air_C, 20.0, 30.0])
    return lambda s: {"alpha": 1.2e-3 * s, "T0": float(measured_at)}


def _detent(g: Generator, n: Nominal) -> Drawn:
    phi = _angle(g)
    return lambda s: {"Fd": 0.1 * n.force_N * s, "phi": phi}


def _offsets(g: Generator, n: Nominal) -> Drawn:
    angle = _angle(g)
    a, b = 0.05 * math.cos(angle), 0.05 * math.sin(angle)
    return lambda s: {"o_a": s * a, "o_b": s * b}


def _hold(g: Generator, n: Nominal) -> Drawn:
    after_s = _log(0.05, 0.5)(g)
    return lambda s: {"h": 1 - 0.7 * s, "t_h": after_s}


def _lost(g: Generator, n: Nominal) -> Drawn:
    sign, move, at = int(g.choice([-1, 1])), int(g.integers(1, 3)), float(g.uniform(0.2, 0.8))
    return lambda s: {"n": float(sign * max(1, round(50 * s))), "move": float(move), "at": at}


def _hum(g: Generator, n: Nominal) -> Drawn:
    """With a second or a third harmonic, both, or none."""
    f, shares = float(g.choice([50.0, 60.0])), g.choice([0.0, 0.3], 2)
    phi, phi2, phi3 = _angle(g), _angle(g), _angle(g)

    def sized(s: float) -> Parameters:
        second, third = (5.08e-4 * s * shares).tolist()
        return {
            "A": 5.08e-4 * s, "f": f, "phi": phi,
            "A2": second, "phi2": phi2, "A3": third, "phi3": phi3,
        }  # fmt: skip

    return sized


def _conduction(g: Generator, n: Nominal) -> Drawn:
    growing = g.choice([0.0, 40.0])
    return lambda s: {"G": 40.0 * s, "g": float(growing * s), "T_p": n.air_C}


def _core(g: Generator, n: Nominal) -> Drawn:
    share = g.choice([0.0, 1.0])
    return lambda s: {"kh": float(0.2 * s * share), "ke": float(2e-4 * s * (1 - share))}


def _convection(g: Generator, n: Nominal) -> Drawn:
    end = g.choice([-0.5, 3.0])
    return lambda s: {"e": float(end * s)}


def _periodic(g: Generator, n: Nominal) -> Drawn:
    wavelength, phi = _log(3e-4, 0.05)(g), float(_angle(g))
    return lambda s: {"A": 1e-4 * s, "lambda": wavelength, "phi": phi}


def _copper(g: Generator, n: Nominal) -> Drawn:
    return lambda s: {"alpha": 0.00393, "T0": n.air_C}


ENTRIES = {
    e.name: e
    for e in (
        Entry("payload_mass", _sized("dm", 3.0), family="lag"),
        Entry("viscous_drag", _sized("b", 15.0), 0.5 / 15, "delay"),
        Entry("quadratic_drag", _sized("c", 8.0), 0.5 / 8, "square"),
        Entry(
            "coulomb_friction", _sized("Fc", 10.0, delta=_even(2e-6, 1e-5)), 0.05, "friction"
        ),
        Entry("umbilical_spring", _sized("k_h", 50.0, x_h=_even(-0.2, 0.2)), 0.1, "scale"),
        Entry("constant_force", _sized("F_b", 5.0, signed=True), 0.02, "constant"),
        Entry("electrical_damping", _damping, family="ringing"),
        Entry("force_constant", _sized("e", 0.2, signed=True), family="lag"),
        Entry("force_constant_temperature", _warmth, 0.25, "lag"),
        Entry("detent_force", _detent, 0.2, "fourth"),
        Entry("phase_gain_imbalance", _sized("eps", 0.1, signed=True), 0.1, "second"),
        Entry("quadrature_error", _sized("phi", 0.0873, signed=True), 0.1, "second"),
        Entry("phase_current_offset", _offsets, 0.1, "first"),
        Entry("current_third_harmonic", _sized("s", 0.05, signed=True), 0.2, "fourth"),
        Entry("current_loop_lag", _sized("tau", 5e-4), 0.04, "delay"),
        Entry("voltage_saturation", lambda g, n: lambda s: {"Vb": 40.0 / s}, 40 / 150, "square"),
        Entry("hold_current_reduction", _hold, 0.25 / 0.7, "hold"),
        Entry("acceleration_scale", _sized("e", 0.5, signed=True), family="acceleration"),
        Entry("velocity_scale", _sized("e", 0.02, signed=True), family="clock"),
        Entry("profile_tick", _sized("T", 0.01, interpolate=_one_of(1.0)), 0.05, "delay"),
        Entry("controller_clock", _sized("e", 5e-3, signed=True), 0.002, "clock"),
        Entry("start_delay", _sized("d", 0.02, every_move=_one_of(0.0, 0.0, 1.0)), family="delay"),
        Entry("lost_steps", _lost, 0.02, "steps"),
        Entry("pitch_scale", _sized("e", 5e-4, signed=True), family="scale"),
        Entry(
            "platen_expansion", _sized("dT", 40.0, share=_one_of(0.0), alpha=_one_of(STEEL_1_K)),
            family="scale",
        ),
        Entry("backlash", _sized("B", 1e-4), 0.01, "friction"),
        Entry("periodic_error", _periodic, 0.01, "periodic"),
        Entry("cross_axis_coupling", _sized("gamma", 1e-3, signed=True), 0.05, "cross"),
        Entry("sensor_gain", _sized("g", 0.01, signed=True), family="scale"),
        Entry("sensor_offset", _sized("o", 1e-3, signed=True), family="constant"),
        Entry(
            "sensor_nonlinearity",
            _sized(
                "c3", 0.01, signed=True, c5=_one_of(0.0), mid=_even(-0.05, 0.05),
                half=_one_of(LVDT_HALF_M),
            ), 0.1, "bend",
        ),
        Entry("sensor_bandwidth", lambda g, n: lambda s: {"f_c": 50.0 / s}, 0.05, "delay"),
        Entry("trigger_delay", _sized("t_d", 0.01), family="delay"),
        Entry("sample_clock", _sized("e", 5e-3, signed=True), 0.002, "clock"),
        Entry("hum", _hum, 0.05, "hum"),
        Entry("platen_conduction", _conduction, 0.025, "loss", True),
        Entry("speed_dependent_heat", _core, family="core", thermal=True),
        Entry("convection_scale", _convection, family="loss", thermal=True),
        Entry("resistance_tempco", _copper, 0.999, "copper", True),
        Entry("radiation", _sized("eps", 0.95), 0.02 / 0.95, "loss", True),
        Entry("ambient_drift", _sized("r", 5.6e-4, signed=True), family="drift", thermal=True),
        Entry("thermocouple_lag", _sized("tau", 60.0), 2 / 60, "early", True),
    )
}  # fmt: skip
POSITION = tuple(e.name for e in ENTRIES.values() if not e.thermal)
THERMAL = tuple(e.name for e in ENTRIES.values() if e.thermal)
