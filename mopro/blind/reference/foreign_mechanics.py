"""Foreign mechanics as numbers of the equation of motion, and lost microsteps of the command."""

from __future__ import annotations

import math

import numpy as np

from mopro.blind.reference import motion as m
from mopro.blind.reference.foreign import Foreign
from mopro.blind.reference.motion import Floats


def mechanics(foreign: Foreign | None, mass_kg: float) -> dict[str, float]:
    """The numbers of the equation of motion (`motion.NAMES`) that `foreign` changes.

    lugre, place_friction, fading_friction: `N`, `presliding` (m), and of each its own;
    hysteretic_spring: `N`, `reach` (m); structural_mode: `share` of the mass, `f` (Hz), `zeta`;
    direction_gain: `e`. Other kinds change none.
    """
    if foreign is None or foreign.name not in _KINDS:
        return {}
    return {"states": float(m.STATES), **_KINDS[foreign.name](dict(foreign.numbers), mass_kg)}


def _friction(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    bristle = n["N"] / n["presliding"]
    static = n.get("static", 1.0)
    return {
        "grip": n["N"],
        "grip_static": (static - 1.0) * n["N"],
        "grip_speed": n.get("vs", 1.0),
        "bristle": bristle,
        "bristle_damping": n.get("inner", 0.0) * 2 * math.sqrt(bristle * mass_kg),
        "rough": n.get("depth", 0.0),
        "rough_wave": 2 * math.pi / n.get("length", 1.0),
        "rough_phase": n.get("phi", 0.0),
        "fade": n.get("fade", 0.0),
        "fade_s": n.get("tau", 1.0),
    }


def _spring(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    return {"loop": n["N"], "loop_reach": n["reach"]}


def _mode(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    """A part of the forcer's mass on a spring; the whole mass stays the same."""
    own = n["share"] * mass_kg
    w = 2 * math.pi * n["f"]
    return {
        "mass": mass_kg - own,
        "mode_mass": own,
        "mode_stiffness": own * w * w,
        "mode_damping": 2 * n["zeta"] * w * own,
    }


def _direction(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    return {"lopsided": n["e"]}


_KINDS = {
    "lugre": _friction,
    "place_friction": _friction,
    "fading_friction": _friction,
    "hysteretic_spring": _spring,
    "structural_mode": _mode,
    "direction_gain": _direction,
}


def with_lost_microsteps(command: Floats, foreign: Foreign | None, microstep_m: float) -> Floats:
    """The command without a microstep now and then while it moves, always behind."""
    if foreign is None or foreign.name != "missing_microsteps":
        return command
    found: list[Floats] = []
    behind_m = 0.0
    times = _moments(foreign, float(command[-1, m.T0]))
    for row in command:
        moving = row[m.V0 : m.J0 + 1].any()
        rest = row.copy()
        rest[m.X0] -= behind_m
        for at_s in times[(times > row[m.T0]) & (times < row[m.T1])] if moving else ():
            first, rest = _cut(rest, float(at_s))
            step = math.copysign(microstep_m, rest[m.V0] or rest[m.A0])
            rest[m.X0] -= step
            behind_m += step
            found.append(first)
        found.append(rest)
    return np.array(found)


def _moments(foreign: Foreign, until_s: float) -> Floats:
    """Times (s) of about `rate` per second, at uneven distances."""
    k = np.arange(1, math.ceil(until_s * foreign.numbers["rate"]) + 1)
    uneven = 0.35 * np.sin(12.9898 * k + foreign.numbers["phi"])
    return np.asarray((k - 0.5 + uneven) / foreign.numbers["rate"])


def _cut(row: Floats, at_s: float) -> tuple[Floats, Floats]:
    """The row until `at_s`, and from there on."""
    before, after = row.copy(), row.copy()
    tau = at_s - row[m.T0]
    x, v, a, j = row[m.X0 : m.J0 + 1]
    before[m.T1] = after[m.T0] = at_s
    after[m.X0] = x + tau * (v + tau * (a / 2 + tau * j / 6))
    after[m.V0], after[m.A0] = v + tau * (a + tau * j / 2), a + tau * j
    after[m.SLIP] = 0.0
    return before, after
