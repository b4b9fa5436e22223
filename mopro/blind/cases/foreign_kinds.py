"""The kinds of the grid `foreign`: numbers as a function of strength, right variables and names.

Strength 0 is none of it, 1 the most that is drawn. Kinds without `sized` have one size only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mopro.blind.cases.hidden_effects import Draw, sized

_DRY = ("coulomb_friction", "stribeck_friction", "load_dependent_friction")
_MOST_RATE = 2.0  # microsteps lost per second, at most


@dataclass(frozen=True)
class ForeignKind:
    """One kind: `draw` gives its numbers as a function of strength.

    `variables` are those that its residual may rightly be said to depend on. Names in `same`
    describe it as well as can be; those in `akin` describe a part of it, and are right beside an
    unexplained rest. `coloured` is noise of the stated size, which is no finding.
    """

    name: str
    draw: Draw
    variables: tuple[str, ...]
    same: tuple[str, ...] = ()
    akin: tuple[str, ...] = ()
    sized: bool = True
    coloured: bool = False


_PRESLIDING = (3e-6, 1e-5)
_ANGLE = (-math.pi, math.pi)

FOREIGN_KINDS = {
    k.name: k
    for k in (
        ForeignKind(
            "lugre",
            sized("N", 12.0, presliding=(5e-6, 3e-5), static=(1.2, 1.6), vs=(0.01, 0.1),
                    inner=(0.1, 0.7)),
            ("sgn v", "v"), same=("stribeck_friction", "coulomb_friction"), akin=_DRY,
        ),
        ForeignKind(
            "hysteretic_spring", sized("N", 12.0, reach=(0.01, 0.06)), ("x", "sgn v"),
            akin=("umbilical_spring", *_DRY),
        ),
        ForeignKind(
            "structural_mode", sized("share", 0.5, f=(12.0, 40.0), zeta=(0.01, 0.05)),
            ("a", "t", "command"), akin=("electrical_damping", "payload_mass", "force_constant"),
        ),
        ForeignKind(
            "place_friction",
            sized("N", 10.0, presliding=_PRESLIDING, depth=(0.7, 0.95), length=(0.03, 0.15),
                    phi=_ANGLE),
            ("x", "x mod", "sgn v"), akin=_DRY,
        ),
        ForeignKind(
            "fading_friction",
            sized("N", 10.0, presliding=_PRESLIDING, fade=(0.7, 0.95), tau=(0.5, 2.0)),
            ("t", "T", "sgn v"), akin=_DRY,
        ),
        ForeignKind(
            "direction_gain", sized("e", 0.3, True), ("sgn v", "a", "command"),
            akin=("force_constant", "payload_mass"),
        ),
        ForeignKind(
            "missing_microsteps", sized("rate", _MOST_RATE, phi=_ANGLE), ("t", "command", "x"),
            akin=("lost_steps", "pitch_scale", "sensor_gain", "platen_expansion"),
        ),
        ForeignKind("jittered_clock", sized("share", 0.45), ("v", "t")),
        ForeignKind(
            "stepping_clock", sized("step", 5e-3, every=(0.4, 1.2)), ("t", "v"),
            akin=("sample_clock", "controller_clock", "trigger_delay", "velocity_scale"),
        ),
        ForeignKind("wandering_gain", sized("rms", 1e-2, tau=(0.3, 2.0)), ("sensor", "x", "t")),
        ForeignKind(
            "thermal_bow", sized("bow", 1e-3, True, half=(0.2, 0.3)),
            ("T", "t", "x", "sensor"), akin=("sensor_nonlinearity", "platen_expansion"),
        ),
        ForeignKind(
            "dropouts", sized("rate", 1.0, lasts=(0.002, 0.01)), ("t", "sensor"), sized=False
        ),
        ForeignKind("outliers", sized("count", 8.0), ("t", "sensor"), sized=False),
        ForeignKind(
            "sticking_sensor", sized("rate", 1.0, lasts=(0.02, 0.06)), ("sensor", "t", "v"),
            sized=False,
        ),
        ForeignKind("ar1_noise", sized("none", 0.0, phi=(0.5, 0.95)), (), coloured=True),
        ForeignKind("flicker_noise", sized("none", 0.0), (), coloured=True),
    )
}  # fmt: skip
