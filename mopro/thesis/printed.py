"""Tables 3.1 to 3.3 and 4.5 as printed in the source, and the formulas of 4.1 to 4.4.

Formulas are as printed, including their errors; the corrected ones are in motion/profile.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class ThermalTest:
    """Settings (in/s, in) and results (K) of one row of Tables 3.1 and 3.2.

    `elongations` are Table 3.3's x1, x2, y1, y2 in thousandths of an inch.
    """

    velocity: float
    x: float
    y: float
    actual_K: float
    theory_K: float
    elongations: tuple[float, float, float, float]


THERMAL = (
    ThermalTest(0, 0, 0, 25.4884, 76.5517, (1.766, 2.284, 1.766, 2.284)),
    ThermalTest(3.5, 0, 8, 21.3867, 66.9469, (1.482, 1.916, 1.694, 2.190)),
    ThermalTest(3.5, 0, 16, 16.4062, 47.3386, (1.137, 1.470, 2.599, 3.360)),
    ThermalTest(15, 0, 16, 22.6563, 43.5173, (1.570, 2.030, 3.589, 4.640)),
    ThermalTest(15, 8, 8, 35.2539, 58.1984, (4.886, 6.317, 4.886, 6.317)),
    ThermalTest(24, 0, 16, 26.0742, 41.7483, (1.807, 2.336, 4.130, 5.340)),
    ThermalTest(24, 8, 8, 38.7695, 48.5993, (5.373, 6.947, 5.373, 6.947)),
    ThermalTest(24, 0, 8, 30.9570, 59.0410, (2.145, 2.774, 2.452, 3.170)),
)


@dataclass(frozen=True)
class MoveTest:
    """One row of Table 4.5: inches, seconds, pounds."""

    distance: float
    velocity: float
    acceleration: float
    profile: str
    load_lb: float


EXPERIMENTS = (
    MoveTest(8, 15, 50, "trapezoid", 0),
    MoveTest(8, 15, 10, "triangle", 0),
    MoveTest(8, 15, 50, "parabola", 0),
    MoveTest(8, 15, 10, "parabola", 0),
    MoveTest(8, 15, 200, "smooth", 0),
    MoveTest(15, 40, 250, "trapezoid", 0),
    MoveTest(15, 40, 100, "triangle", 0),
    MoveTest(15, 40, 100, "parabola", 0),
    MoveTest(15, 40, 250, "parabola", 0),
    MoveTest(15, 40, 600, "smooth", 0),
    MoveTest(8, 15, 50, "trapezoid", 5),
    MoveTest(8, 15, 10, "triangle", 5),
    MoveTest(8, 15, 200, "smooth", 5),
    MoveTest(8, 15, 50, "parabola", 5),
)

Formula = Callable[[float, float, float, float], float]


@dataclass(frozen=True)
class Entry:
    """One printed formula of (s, V, a, t); `erratum` is its number in the list of errors.

    `quantity` is duration, displacement, velocity or acceleration, `phase` 1 to 3.
    """

    phase: int
    quantity: str
    formula: Formula
    erratum: int | None = None


def _shifted(s: float, v: float, a: float, t: float) -> float:
    return t - s / v + 8 * v / (3 * a)


def _smooth_ramp(v: float, a: float, t: float) -> float:
    return -(a**2) / (12 * v) * t**3 + a * t**2 / 2


PROFILE_TABLES: dict[str, tuple[str, tuple[Entry, ...]]] = {
    "4.1": (
        "trapezoid",
        (
            Entry(1, "duration", lambda s, v, a, t: v / a),
            Entry(2, "duration", lambda s, v, a, t: s / v - v / a),
            Entry(3, "duration", lambda s, v, a, t: v / a),
            Entry(1, "displacement", lambda s, v, a, t: a * t**2 / 2),
            Entry(2, "displacement", lambda s, v, a, t: -(v**2) / (2 * a) + v * t),
            Entry(
                3,
                "displacement",
                lambda s, v, a, t: (
                    a * s**2 / (2 * v**2) - v**2 / (2 * a) + v * t + a * s * t / v - a * t**2 / 2
                ),
                1,
            ),
            Entry(1, "velocity", lambda s, v, a, t: a * t),
            Entry(2, "velocity", lambda s, v, a, t: v),
            Entry(3, "velocity", lambda s, v, a, t: v + a * s / v - a * t),
            Entry(1, "acceleration", lambda s, v, a, t: a),
            Entry(2, "acceleration", lambda s, v, a, t: 0.0),
            Entry(3, "acceleration", lambda s, v, a, t: -a),
        ),
    ),
    "4.2": (
        "triangle",
        (
            Entry(1, "duration", lambda s, v, a, t: math.sqrt(s / a)),
            Entry(3, "duration", lambda s, v, a, t: math.sqrt(s / a)),
            Entry(1, "displacement", lambda s, v, a, t: a * t**2 / 2),
            Entry(
                3,
                "displacement",
                lambda s, v, a, t: (
                    s
                    - math.sqrt(s / a) * math.sqrt(s * a)
                    + math.sqrt(s * a) * t
                    + a * math.sqrt(s / a) * t
                    - a * t**2 / 2
                ),
                2,
            ),
            Entry(1, "velocity", lambda s, v, a, t: a * t),
            Entry(
                3, "velocity", lambda s, v, a, t: math.sqrt(s * a) + a * math.sqrt(s / a) - a * t
            ),
            Entry(1, "acceleration", lambda s, v, a, t: a),
            Entry(3, "acceleration", lambda s, v, a, t: -a),
        ),
    ),
    "4.3": (
        "smooth",
        (
            Entry(1, "duration", lambda s, v, a, t: 2 * v / a),
            Entry(2, "duration", lambda s, v, a, t: s / v - 8 * v / (3 * a)),
            Entry(3, "duration", lambda s, v, a, t: 2 * v / a),
            Entry(1, "displacement", lambda s, v, a, t: _smooth_ramp(v, a, t)),
            Entry(2, "displacement", lambda s, v, a, t: 2 * v**2 / (3 * a) + v * t, 3),
            Entry(
                3,
                "displacement",
                lambda s, v, a, t: _smooth_ramp(v, a, _shifted(s, v, a, t)),
                3,
            ),
            Entry(1, "velocity", lambda s, v, a, t: -(a**2) / (4 * v) * t**2 + a * t),
            Entry(2, "velocity", lambda s, v, a, t: v),
            Entry(
                3,
                "velocity",
                lambda s, v, a, t: (
                    -(a**2) / (4 * v) * _shifted(s, v, a, t) ** 2 + a * _shifted(s, v, a, t)
                ),
            ),
            Entry(1, "acceleration", lambda s, v, a, t: -(a**2) / (2 * v) * t + a),
            Entry(2, "acceleration", lambda s, v, a, t: 0.0),
            Entry(
                3,
                "acceleration",
                lambda s, v, a, t: -(a**2) / (2 * v) * _shifted(s, v, a, t) + a,
            ),
        ),
    ),
    "4.4": (
        "parabola",
        tuple(
            entry
            for phase in (1, 3)
            for entry in (
                Entry(phase, "duration", lambda s, v, a, t: math.sqrt(6 * s / a) / 2),
                Entry(
                    phase,
                    "displacement",
                    lambda s, v, a, t: (
                        math.sqrt(6) * a**1.5 / (18 * math.sqrt(s)) * t**3 + a * t**2
                    ),
                    5,
                ),
                Entry(
                    phase,
                    "velocity",
                    lambda s, v, a, t: math.sqrt(6) * a**1.5 / (6 * math.sqrt(s)) * t**2 + a * t,
                    5,
                ),
                Entry(
                    phase,
                    "acceleration",
                    lambda s, v, a, t: math.sqrt(6) * a**1.5 / (3 * math.sqrt(s)) * t + a,
                    5,
                ),
            )
        ),
    ),
}
