"""Motion of one axis under a program with hidden effects.

Hidden effects change the controller, the numbers of the equation of motion and the rows of
the command.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from scipy.optimize import brentq

from mopro.blind.reference import equation as m
from mopro.blind.reference.listing import Controller, Stroke, Timeline
from mopro.blind.reference.motor import LOOP_S, THESIS, Floats, Hidden, Nominal, of
from mopro.blind.reference.uncatalogued import Foreign, cut, mechanics

Temperature = Callable[[Floats], Floats]


def controller(hidden: Hidden) -> Controller:
    """The controller as the hidden effects change it."""
    late = hidden.get("start_delay", {})
    each = late.get("every_move", 0.0)
    return Controller(
        speed=1 + of(hidden, "velocity_scale", "e"),
        acceleration=1 + of(hidden, "acceleration_scale", "e"),
        clock=1 + of(hidden, "controller_clock", "e"),
        delay_s=0.0 if each else late.get("d", 0.0),
        each_delay_s=late.get("d", 0.0) if each else 0.0,
    )


def numbers(
    hidden: Hidden, payload_kg: float = 0.0, n: Nominal = THESIS, foreign: Foreign | None = None
) -> Floats:
    """The numbers of the equation of motion in the order of `equation.NAMES`, SI."""
    stiffness = n.wave_1_m * n.force_N
    zeta = of(hidden, "electrical_damping", "zeta", n.damping_ratio)
    values = dict.fromkeys(m.NAMES, 0.0) | {
        "wave": n.wave_1_m,
        "force": n.force_N * (1 + of(hidden, "force_constant", "e")),
        "mass": n.mass_kg + payload_kg + of(hidden, "payload_mass", "dm"),
        "damping": 2 * zeta * math.sqrt(stiffness * n.mass_kg),
        "viscous": of(hidden, "viscous_drag", "b"),
        "quadratic": of(hidden, "quadratic_drag", "c"),
        **_friction(hidden),
        "spring": of(hidden, "umbilical_spring", "k_h"),
        "spring_at": of(hidden, "umbilical_spring", "x_h"),
        "constant": of(hidden, "constant_force", "F_b"),
        "detent": of(hidden, "detent_force", "Fd"),
        "detent_phase": of(hidden, "detent_force", "phi"),
        "gain": of(hidden, "phase_gain_imbalance", "eps"),
        "quadrature": of(hidden, "quadrature_error", "phi"),
        "offset_a": of(hidden, "phase_current_offset", "o_a"),
        "offset_b": of(hidden, "phase_current_offset", "o_b"),
        "third": of(hidden, "current_third_harmonic", "s"),
        "lag_s": of(hidden, "current_loop_lag", "tau"),
        "supply": of(hidden, "voltage_saturation", "Vb"),
        "ohm": n.coil_ohm,
        "henry": n.coil_H,
        "current": n.current_A,
        "emf": n.force_N / n.current_A,
        "loop_s": LOOP_S,
        "states": m.PLAIN_STATES,
    }
    values |= mechanics(foreign, values["mass"])
    return np.array([values[name] for name in m.NAMES])


def _friction(hidden: Hidden) -> dict[str, float]:
    """The numbers of the laws of dry friction, which share one presliding."""
    falling = hidden.get("stribeck_friction", {})
    laws = ("coulomb_friction", "stribeck_friction", "load_dependent_friction")
    presliding = [hidden[law]["delta"] for law in laws if law in hidden]
    return {
        "friction": of(hidden, "coulomb_friction", "Fc") + falling.get("Fc", 0.0),
        "breakaway": falling.get("Fs", 0.0) - falling.get("Fc", 0.0),
        "breakaway_speed": falling.get("vs", 1.0),
        "pressed": of(hidden, "load_dependent_friction", "mu"),
        "presliding": presliding[0] if presliding else 1.0,
    }


def rows(
    timeline: Timeline,
    axis: int,
    hidden: Hidden,
    temperature: Temperature | None = None,
    pitch_m: float = THESIS.pitch_m,
) -> Floats:
    """The command of one axis, shape (rows, equation.COLUMNS), ordered in time without gaps."""
    strokes = [s for s in timeline.strokes if s.axis == axis]
    until_s = timeline.duration_s + 1.0
    command = _command(strokes, until_s)
    if "profile_tick" in hidden:
        command = _ticked(command, hidden["profile_tick"]["T"])
    if "hold_current_reduction" in hidden:
        command = _held(command, **hidden["hold_current_reduction"])
    if "lost_steps" in hidden:
        command = _slipped(command, strokes, hidden["lost_steps"], pitch_m)
    if "force_constant_temperature" in hidden and temperature is not None:
        alpha, t0 = (hidden["force_constant_temperature"][key] for key in ("alpha", "T0"))
        command[:, m.F_FROM] = 1 - alpha * (temperature(command[:, m.T0]) - t0)
        command[:, m.F_TO] = 1 - alpha * (temperature(command[:, m.T1]) - t0)
    return command


def equilibrium(row: Floats, p: Floats) -> Floats:
    """The state at rest under the hidden loads, with the friction's z = 0; shape (STATES,)."""

    def pull(x: float) -> float:
        strength = p[m.FORCE] * row[m.F_FROM]
        electric = ib * math.cos(p[m.WAVE] * x) - ia * math.sin(p[m.WAVE] * x)
        return float(strength * electric + m.loads(x, 0.0, 0.0, p))

    ia, ib, _, _ = m.setpoints(p[m.WAVE] * row[m.X0], row[m.SHARE], p)
    near = 2 * math.pi / p[m.WAVE] / 5
    x = brentq(pull, row[m.X0] - near, row[m.X0] + near, xtol=1e-16)
    return np.array([x, 0.0, 0.0, ia, ib])


def axis_response(
    times_s: Floats, command: Floats, p: Floats, tolerance: Floats = m.TOLERANCE
) -> Floats:
    """Position, speed, acceleration, command (SI) at ascending times; shape (len(times_s), 4)."""
    out = np.empty((len(times_s), 4))
    m.response(times_s, command, p, equilibrium(command[0], p), tolerance, out)
    return out


def _row(t0: float, t1: float, x: float, v: float = 0.0, a: float = 0.0, j: float = 0.0) -> Floats:
    return np.array([t0, t1, x, v, a, j, 1.0, 1.0, 1.0, 0.0])


def _command(strokes: list[Stroke], until_s: float) -> Floats:
    found: list[Floats] = []
    now_s = x = 0.0
    for stroke in strokes:
        if stroke.start_s > now_s:
            found.append(_row(now_s, stroke.start_s, x))
        at_s = stroke.start_s
        for lasts, v, a, j in stroke.segments:
            found.append(_row(at_s, at_s + lasts, x, v, a, j))
            x += lasts * (v + lasts * (a / 2 + lasts * j / 6))
            at_s += lasts
        x, now_s = stroke.start_m + stroke.displacement_m, at_s
    found.append(_row(now_s, max(until_s, now_s + 1.0), x))
    return np.array(found)


def position_m(command: Floats, time_s: Floats) -> Floats:
    """The commanded position (m) at each time."""
    at = np.clip(np.searchsorted(command[:, m.T0], time_s, side="right") - 1, 0, None)
    t0, x, v, a, j = (command[at, c] for c in (m.T0, m.X0, m.V0, m.A0, m.J0))
    tau = np.maximum(time_s - t0, 0.0)
    position: Floats = x + tau * (v + tau * (a / 2 + tau * j / 6))
    return position


def _ticked(command: Floats, tick_s: float) -> Floats:
    """The command updated once per tick: constant speed to the profile's position a tick before."""
    ticks = np.arange(math.ceil(command[-1, m.T1] / tick_s) + 2)
    here = position_m(command, ticks * tick_s)
    before = position_m(command, np.maximum(ticks - 1, 0) * tick_s)
    found: list[Floats] = []
    for i in ticks[:-1]:
        speed = (here[i] - before[i]) / tick_s
        if found and speed == 0.0 and found[-1][m.V0] == 0.0:
            found[-1][m.T1] = (i + 1) * tick_s
        else:
            found.append(_row(i * tick_s, (i + 1) * tick_s, before[i], speed))
    return np.array(found)


def _held(command: Floats, h: float, t_h: float) -> Floats:
    """The command with the current reduced to the share `h` after `t_h` seconds of rest."""
    found: list[Floats] = []
    for row in command:
        rests = not row[m.V0 : m.J0 + 1].any()
        if not rests or row[m.T1] - row[m.T0] <= t_h:
            found.append(row)
            continue
        full, held = row.copy(), row.copy()
        full[m.T1] = held[m.T0] = row[m.T0] + t_h
        held[m.SHARE] = h
        found += [full, held]
    return np.array(found)


def _slipped(
    command: Floats, strokes: list[Stroke], lost: Mapping[str, float], pitch_m: float
) -> Floats:
    """The command with whole pitches lost within one stroke."""
    index = int(lost["move"]) - 1
    if index >= len(strokes):
        return command
    when_s = strokes[index].start_s + lost["at"] * strokes[index].duration_s
    at = int(np.searchsorted(command[:, m.T0], when_s, side="right")) - 1
    before, after = cut(command[at], when_s)
    after[m.SLIP] = lost["n"] * pitch_m
    return np.concatenate([command[:at], [before, after], command[at + 1 :]])


def has_stalled(response: Floats, hidden: Hidden, pitch_m: float = THESIS.pitch_m) -> bool:
    """True if the axis stalled; steps of the hidden effect `lost_steps` do not count."""
    lag = response[:, 3] - response[:, 0]
    steps = abs(of(hidden, "lost_steps", "n")) * pitch_m
    return bool(np.abs(lag).max() > pitch_m * 0.3 + steps)
