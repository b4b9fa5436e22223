"""The registers of one axis: its settings, its target and its motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

from mopro.motion.track import Track
from mopro.program import ir
from mopro.source import Span

# A motion this close to its end has ended: far below one sample, far above rounding.
_TIME_TOLERANCE_S = 1e-9


@dataclass
class AxisRegisters:
    """Positions are exact rationals in microsteps from the start, so nothing drifts.

    `endless_from_u` is where a motion without end began, while one is under way.
    """

    number: int
    microsteps_per_uu: Fraction | None = None
    velocity_uu_s: Fraction | None = None
    acceleration_uu_s2: Fraction | None = None
    parabolic: bool = False
    position_u: Fraction = Fraction(0)
    origin_u: Fraction = Fraction(0)
    target_u: Fraction | None = None
    track: Track = field(default_factory=Track)
    started_s: float = 0.0
    started_by: Span = field(default_factory=lambda: Span(1, 1, 1))
    busy_until_s: float = -math.inf
    endless_from_u: int | None = None

    @property
    def endless(self) -> bool:
        return self.endless_from_u is not None

    def moving(self, t: float) -> bool:
        return self.busy_until_s > t + _TIME_TOLERANCE_S

    def occupy(self, span: Span, start_s: float, end_s: float) -> None:
        self.started_by, self.started_s, self.busy_until_s = span, start_s, end_s

    def destination_u(self, op: ir.Move | ir.SetTarget) -> Fraction:
        """The position, in microsteps from the start, to which `op` sends the axis."""
        base_u = self.origin_u if op.absolute else self.position_u
        return base_u + op.distance_uu * self.units

    def missing(self, governs: bool) -> list[tuple[str, str, str]]:
        """Settings that a motion needs and that are not set: rule, name, example.

        An axis that follows another's profile (`governs` false) needs user units only.
        """
        missing = []
        if self.microsteps_per_uu is None:
            missing.append(("missing-units", "user units", f"UU{self.number}12500/1"))
        if governs and self.velocity_uu_s is None:
            missing.append(("missing-velocity", "velocity", f"VEL{self.number} 40.0"))
        if governs and self.acceleration_uu_s2 is None:
            missing.append(("missing-acceleration", "acceleration", f"ACC{self.number} 0.25"))
        return missing

    @property
    def units(self) -> Fraction:
        return _set(self.microsteps_per_uu)

    def velocity_u_s(self) -> float:
        return float(_set(self.velocity_uu_s) * self.units)

    def acceleration_u_s2(self) -> float:
        return float(_set(self.acceleration_uu_s2) * self.units)


def _set(register: Fraction | None) -> Fraction:
    assert register is not None, "`missing` is asked before each motion"
    return register
