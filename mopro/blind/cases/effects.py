"""Effects that can be hidden, each with its parameters as a function of one strength.

Strength 0 is no effect, 1 the far end of the plausible range, `least` the near end. All other
numbers (phases, wavelengths, signs, positions) are drawn once. Parameters are in SI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mopro.blind.reference.motor import LVDT_HALF_M, STEEL_1_K, Nominal

Generator = np.random.Generator
Parameters = dict[str, float]
Drawn = Callable[[float], Parameters]
Draw = Callable[[Generator, Nominal], Drawn]


@dataclass(frozen=True)
class HiddenEffect:
    """One effect: `draw` gives its parameters as a function of strength, for a machine.

    Effects of one `family` look alike and are not hidden together. One that is not `standard`
    is in none of the grids smoke, small and full, whose cases stay the same.
    """

    name: str
    draw: Draw
    least: float = 1e-3
    family: str = ""
    thermal: bool = False
    standard: bool = True


def _sized(
    parameter: str, most: float, signed: bool = False, **others: Callable[[Generator], float]
) -> Draw:
    """Draws with one parameter up to `most`, either sign if `signed`, and fixed `others`."""

    def draw(g: Generator, n: Nominal) -> Drawn:
        top = most * (g.choice([-1.0, 1.0]) if signed else 1.0)
        fixed = {name: float(value(g)) for name, value in others.items()}
        return lambda s: {parameter: float(top * s), **fixed}

    return draw


def _uniform(low: float, high: float) -> Callable[[Generator], float]:
    return lambda g: g.uniform(low, high)


def _log_uniform(low: float, high: float) -> Callable[[Generator], float]:
    return lambda g: math.exp(g.uniform(math.log(low), math.log(high)))


def _one_of(*values: float) -> Callable[[Generator], float]:
    return lambda g: g.choice(values)


_angle = _uniform(-math.pi, math.pi)


def _damping(g: Generator, n: Nominal) -> Drawn:
    end = g.choice([0.1, 0.002])
    return lambda s: {"zeta": float(n.damping_ratio + s * (end - n.damping_ratio))}


def _force_tempco(g: Generator, n: Nominal) -> Drawn:
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
    after_s = _log_uniform(0.05, 0.5)(g)
    return lambda s: {"h": 1 - 0.7 * s, "t_h": after_s}


def _lost(g: Generator, n: Nominal) -> Drawn:
    sign, move, at = int(g.choice([-1, 1])), int(g.integers(1, 3)), float(g.uniform(0.2, 0.8))
    return lambda s: {"n": float(sign * max(1, round(50 * s))), "move": float(move), "at": at}


def _hum(g: Generator, n: Nominal) -> Drawn:
    """Mains hum with a second or a third harmonic, both, or none."""
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
    wavelength, phi = _log_uniform(3e-4, 0.05)(g), float(_angle(g))
    return lambda s: {"A": 1e-4 * s, "lambda": wavelength, "phi": phi}


def _stribeck(g: Generator, n: Nominal) -> Drawn:
    over, speed, delta = g.uniform(1.3, 1.5), _uniform(0.02, 0.1)(g), _uniform(2e-6, 1e-5)(g)
    return lambda s: {
        "Fc": 10.0 * s, "delta": float(delta), "Fs": float(10.0 * s * over), "vs": float(speed),
    }  # fmt: skip


def _copper(g: Generator, n: Nominal) -> Drawn:
    return lambda s: {"alpha": 0.00393, "T0": n.air_C}


HIDDEN_EFFECTS = {
    e.name: e
    for e in (
        HiddenEffect("payload_mass", _sized("dm", 3.0), family="lag"),
        HiddenEffect("viscous_drag", _sized("b", 15.0), 0.5 / 15, "delay"),
        HiddenEffect("quadratic_drag", _sized("c", 8.0), 0.5 / 8, "square"),
        HiddenEffect(
            "coulomb_friction", _sized("Fc", 10.0, delta=_uniform(2e-6, 1e-5)), 0.05, "friction"
        ),
        HiddenEffect(
            "umbilical_spring", _sized("k_h", 50.0, x_h=_uniform(-0.2, 0.2)), 0.1, "scale"
        ),
        HiddenEffect("constant_force", _sized("F_b", 5.0, signed=True), 0.02, "constant"),
        HiddenEffect("electrical_damping", _damping, family="ringing"),
        HiddenEffect("force_constant", _sized("e", 0.2, signed=True), family="lag"),
        HiddenEffect("force_constant_temperature", _force_tempco, 0.25, "lag"),
        HiddenEffect("detent_force", _detent, 0.2, "fourth"),
        HiddenEffect("phase_gain_imbalance", _sized("eps", 0.1, signed=True), 0.1, "second"),
        HiddenEffect("quadrature_error", _sized("phi", 0.0873, signed=True), 0.1, "second"),
        HiddenEffect("phase_current_offset", _offsets, 0.1, "first"),
        HiddenEffect("current_third_harmonic", _sized("s", 0.05, signed=True), 0.2, "fourth"),
        HiddenEffect("current_loop_lag", _sized("tau", 5e-4), 0.04, "delay"),
        HiddenEffect(
            "voltage_saturation", lambda g, n: lambda s: {"Vb": 40.0 / s}, 40 / 150, "square"
        ),
        HiddenEffect("hold_current_reduction", _hold, 0.25 / 0.7, "hold"),
        HiddenEffect("acceleration_scale", _sized("e", 0.5, signed=True), family="acceleration"),
        HiddenEffect("velocity_scale", _sized("e", 0.02, signed=True), family="clock"),
        HiddenEffect("profile_tick", _sized("T", 0.01, interpolate=_one_of(1.0)), 0.05, "delay"),
        HiddenEffect("controller_clock", _sized("e", 5e-3, signed=True), 0.002, "clock"),
        HiddenEffect(
            "start_delay", _sized("d", 0.02, every_move=_one_of(0.0, 0.0, 1.0)), family="delay"
        ),
        HiddenEffect("lost_steps", _lost, 0.02, "steps"),
        HiddenEffect("pitch_scale", _sized("e", 5e-4, signed=True), family="scale"),
        HiddenEffect(
            "platen_expansion", _sized("dT", 40.0, share=_one_of(0.0), alpha=_one_of(STEEL_1_K)),
            family="scale",
        ),
        HiddenEffect("backlash", _sized("B", 1e-4), 0.01, "friction"),
        HiddenEffect("periodic_error", _periodic, 0.01, "periodic"),
        HiddenEffect("cross_axis_coupling", _sized("gamma", 1e-3, signed=True), 0.05, "cross"),
        HiddenEffect("sensor_gain", _sized("g", 0.01, signed=True), family="scale"),
        HiddenEffect("sensor_offset", _sized("o", 1e-3, signed=True), family="constant"),
        HiddenEffect(
            "sensor_nonlinearity",
            _sized(
                "c3", 0.01, signed=True, c5=_one_of(0.0), mid=_uniform(-0.05, 0.05),
                half=_one_of(LVDT_HALF_M),
            ), 0.1, "bend",
        ),
        HiddenEffect("sensor_bandwidth", lambda g, n: lambda s: {"f_c": 50.0 / s}, 0.05, "delay"),
        HiddenEffect("trigger_delay", _sized("t_d", 0.01), family="delay"),
        HiddenEffect("sample_clock", _sized("e", 5e-3, signed=True), 0.002, "clock"),
        HiddenEffect("hum", _hum, 0.05, "hum"),
        HiddenEffect("platen_conduction", _conduction, 0.025, "loss", True),
        HiddenEffect("speed_dependent_heat", _core, family="core", thermal=True),
        HiddenEffect("convection_scale", _convection, family="loss", thermal=True),
        HiddenEffect("resistance_tempco", _copper, 0.999, "copper", True),
        HiddenEffect("radiation", _sized("eps", 0.95), 0.02 / 0.95, "loss", True),
        HiddenEffect(
            "ambient_drift", _sized("r", 5.6e-4, signed=True), family="drift", thermal=True
        ),
        HiddenEffect("thermocouple_lag", _sized("tau", 60.0), 2 / 60, "early", True),
        HiddenEffect("stribeck_friction", _stribeck, 0.05, "friction", standard=False),
        HiddenEffect(
            "load_dependent_friction", _sized("mu", 0.3, delta=_uniform(2e-6, 1e-5)), 0.01 / 0.3,
            "friction", standard=False,
        ),
    )
}  # fmt: skip
STANDARD = tuple(e.name for e in HIDDEN_EFFECTS.values() if e.standard)
POSITION = tuple(e.name for e in HIDDEN_EFFECTS.values() if not e.thermal and e.standard)
THERMAL = tuple(e.name for e in HIDDEN_EFFECTS.values() if e.thermal)
