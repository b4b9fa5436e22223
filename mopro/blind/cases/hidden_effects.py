"""Effects that can be hidden, each with its parameters as a function of one strength.

Strength 0 is no effect, 1 the far end of the plausible range, `least` the near end. All other
numbers (phases, wavelengths, signs, positions) are drawn once. Parameters are in SI.

The variables that an effect's response depends on, by physics, are the right words for a residual
that remains without it: one of `v`, `sgn v`, `x`, `x mod` (periodic in position), `a`, `t`, `T`
(temperature), `command` and `sensor` (the reading itself). Several are right where one motion makes
them proportional: a late reading is off by v times the delay, and a clock that is fast by v times
the time that has passed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mopro.blind.reference.motor import LVDT_HALF_M, STEEL_1_K, Generator, Nominal

Parameters = dict[str, float]
Drawn = Callable[[float], Parameters]
Draw = Callable[[Generator, Nominal], Drawn]
# A range of more than a decade is of a size, of which no decade is likelier than another.
_DECADE = 10.0


@dataclass(frozen=True)
class HiddenEffect:
    """One effect: `draw` gives its parameters as a function of strength, for a machine.

    Its response depends on `variables`. Effects of one `family` look alike and are not hidden
    together. One that is not `standard` is in none of the grids smoke, small and full, whose cases
    stay the same. `assumed` are constants that a diagnosis assumes, with what is plausible of them.
    """

    name: str
    draw: Draw
    variables: tuple[str, ...] = ()
    least: float = 1e-3
    family: str = ""
    thermal: bool = False
    standard: bool = True
    assumed: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def with_constants(self, g: Generator, drawn: Drawn) -> Drawn:
        """`drawn`, with the effect's constants anywhere in their plausible ranges."""
        values = {name: _within(g, *ends) for name, ends in self.assumed.items()}
        return lambda s: {**drawn(s), **values}


def _within(g: Generator, low: float, high: float) -> float:
    if low > 0 and high > _DECADE * low:
        return _log_uniform(g, low, high)
    return float(g.uniform(low, high))


def sized(
    parameter: str,
    most: float,
    signed: bool = False,
    **others: tuple[float, float] | Callable[[Generator], float],
) -> Draw:
    """Draws with one parameter up to `most`, either sign if `signed`, and `others`.

    These are drawn once, evenly from a range or as a function of the generator.
    """

    def draw(g: Generator, n: Nominal) -> Drawn:
        top = most * (g.choice([-1.0, 1.0]) if signed else 1.0)
        fixed = {
            name: float(g.uniform(*own) if isinstance(own, tuple) else own(g))
            for name, own in others.items()
        }
        return lambda s: {parameter: float(top * s), **fixed}

    return draw


def _log_uniform(g: Generator, low: float, high: float) -> float:
    return math.exp(g.uniform(math.log(low), math.log(high)))


def _one_of(*values: float) -> Callable[[Generator], float]:
    return lambda g: g.choice(values)


def _angle(g: Generator) -> float:
    return g.uniform(-math.pi, math.pi)


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
    after_s = _log_uniform(g, 0.05, 0.5)
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
    wavelength, phi = _log_uniform(g, 3e-4, 0.05), float(_angle(g))
    return lambda s: {"A": 1e-4 * s, "lambda": wavelength, "phi": phi}


def _stribeck(g: Generator, n: Nominal) -> Drawn:
    over, speed, delta = g.uniform(1.3, 1.5), g.uniform(0.02, 0.1), g.uniform(2e-6, 1e-5)
    return lambda s: {
        "Fc": 10.0 * s, "delta": float(delta), "Fs": float(10.0 * s * over), "vs": float(speed),
    }  # fmt: skip


def _copper(g: Generator, n: Nominal) -> Drawn:
    return lambda s: {"alpha": 0.00393, "T0": n.air_C}


HIDDEN_EFFECTS = {
    e.name: e
    for e in (
        # Forces: the lag is the force over the stiffness.
        HiddenEffect("payload_mass", sized("dm", 3.0), ("a",), family="lag"),
        HiddenEffect("viscous_drag", sized("b", 15.0), ("v",), 0.5 / 15, "delay"),
        HiddenEffect("quadratic_drag", sized("c", 8.0), ("v",), 0.5 / 8, "square"),
        HiddenEffect(
            "coulomb_friction", sized("Fc", 10.0, delta=(2e-6, 1e-5)), ("sgn v",), 0.05,
            "friction", assumed={"delta": (2e-6, 1e-5)},
        ),
        HiddenEffect(
            "umbilical_spring", sized("k_h", 50.0, x_h=(-0.2, 0.2)), ("x",), 0.1, "scale"
        ),
        HiddenEffect(
            "constant_force", sized("F_b", 5.0, True), ("command", "sensor"), 0.02, "constant"
        ),
        HiddenEffect("electrical_damping", _damping, ("a", "v", "command"), family="ringing"),
        HiddenEffect("force_constant", sized("e", 0.2, True), ("a",), family="lag"),
        HiddenEffect(
            "force_constant_temperature", _force_tempco, ("T", "a", "t"), 0.25, "lag",
            assumed={"T0": (15.0, 30.0)},
        ),
        HiddenEffect("detent_force", _detent, ("x mod",), 0.2, "fourth"),
        # Currents: their errors repeat with the pitch, or follow the field's speed.
        HiddenEffect("phase_gain_imbalance", sized("eps", 0.1, True), ("x mod",), 0.1, "second"),
        HiddenEffect("quadrature_error", sized("phi", 0.0873, True), ("x mod",), 0.1, "second"),
        HiddenEffect("phase_current_offset", _offsets, ("x mod",), 0.1, "first"),
        HiddenEffect("current_third_harmonic", sized("s", 0.05, True), ("x mod",), 0.2, "fourth"),
        HiddenEffect(
            "current_loop_lag", sized("tau", 5e-4), ("v", "command", "t"), 0.04, "delay"
        ),
        HiddenEffect(
            "voltage_saturation", lambda g, n: lambda s: {"Vb": 40.0 / s}, ("v", "command"),
            40 / 150, "square",
        ),
        HiddenEffect(
            "hold_current_reduction", _hold, ("command", "t"), 0.25 / 0.7, "hold",
            assumed={"t_h": (0.05, 5.0)},
        ),
        # The command.
        HiddenEffect(
            "acceleration_scale", sized("e", 0.5, True), ("command", "a"), family="acceleration"
        ),
        HiddenEffect("velocity_scale", sized("e", 0.02, True), ("command", "v"), family="clock"),
        HiddenEffect(
            "profile_tick", sized("T", 0.01, interpolate=_one_of(1.0)), ("command", "v", "t"),
            0.05, "delay",
        ),
        HiddenEffect(
            "controller_clock", sized("e", 5e-3, True), ("command", "v", "t"), 0.002, "clock"
        ),
        HiddenEffect(
            "start_delay", sized("d", 0.02, every_move=_one_of(0.0, 0.0, 1.0)),
            ("command", "v", "t"), family="delay",
        ),
        HiddenEffect(
            "lost_steps", _lost, ("command", "x", "t"), 0.02, "steps", assumed={"at": (0.0, 1.0)}
        ),
        # The measurement.
        HiddenEffect("pitch_scale", sized("e", 5e-4, True), ("x", "sensor"), family="scale"),
        HiddenEffect(
            "platen_expansion", sized("dT", 40.0, share=_one_of(0.0), alpha=_one_of(STEEL_1_K)),
            ("x", "sensor", "T"), family="scale", assumed={"alpha": (9.9e-6, 1.28e-5)},
        ),
        HiddenEffect("backlash", sized("B", 1e-4), ("sgn v",), 0.01, "friction"),
        HiddenEffect(
            "periodic_error", _periodic, ("x mod", "sensor"), 0.01, "periodic",
            assumed={"lambda": (1e-4, 0.1)},
        ),
        HiddenEffect(
            "cross_axis_coupling", sized("gamma", 1e-3, True), ("x", "command", "sensor"), 0.05,
            "cross",
        ),
        HiddenEffect("sensor_gain", sized("g", 0.01, True), ("sensor", "x"), family="scale"),
        HiddenEffect("sensor_offset", sized("o", 1e-3, True), ("sensor",), family="constant"),
        HiddenEffect(
            "sensor_nonlinearity",
            sized(
                "c3", 0.01, True, c5=_one_of(0.0), mid=(-0.05, 0.05), half=_one_of(LVDT_HALF_M)
            ), ("sensor", "x"), 0.1, "bend",
        ),
        HiddenEffect(
            "sensor_bandwidth", lambda g, n: lambda s: {"f_c": 50.0 / s}, ("sensor", "v", "t"),
            0.05, "delay",
        ),
        HiddenEffect(
            "trigger_delay", sized("t_d", 0.01), ("t", "v", "command", "sensor"), family="delay"
        ),
        HiddenEffect(
            "sample_clock", sized("e", 5e-3, True), ("t", "v", "sensor"), 0.002, "clock"
        ),
        HiddenEffect("hum", _hum, ("t",), 0.05, "hum"),
        # Heat.
        HiddenEffect(
            "platen_conduction", _conduction, ("T",), 0.025, "loss", True,
            assumed={"T_p": (15.0, 40.0)},
        ),
        HiddenEffect("speed_dependent_heat", _core, ("v",), family="core", thermal=True),
        HiddenEffect("convection_scale", _convection, ("T", "v"), family="loss", thermal=True),
        HiddenEffect(
            "resistance_tempco", _copper, ("T",), 0.999, "copper", True,
            assumed={"T0": (15.0, 30.0)},
        ),
        HiddenEffect("radiation", sized("eps", 0.95), ("T",), 0.02 / 0.95, "loss", True),
        HiddenEffect(
            "ambient_drift", sized("r", 5.6e-4, True), ("t", "T"), family="drift", thermal=True
        ),
        HiddenEffect(
            "thermocouple_lag", sized("tau", 60.0), ("sensor", "t", "T"), 2 / 60, "early", True
        ),
        # Frictions that are in none of the standard grids.
        HiddenEffect(
            "stribeck_friction", _stribeck, ("sgn v", "v"), 0.05, "friction", standard=False,
            assumed={"delta": (2e-6, 1e-5), "vs": (0.005, 0.3)},
        ),
        HiddenEffect(
            "load_dependent_friction", sized("mu", 0.3, delta=(2e-6, 1e-5)), ("sgn v", "a"),
            0.01 / 0.3, "friction", standard=False, assumed={"delta": (2e-6, 1e-5)},
        ),
    )
}  # fmt: skip
STANDARD = tuple(e.name for e in HIDDEN_EFFECTS.values() if e.standard)
POSITION = tuple(e.name for e in HIDDEN_EFFECTS.values() if not e.thermal and e.standard)
THERMAL = tuple(e.name for e in HIDDEN_EFFECTS.values() if e.thermal)
