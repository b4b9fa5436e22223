"""How far each axis can go, and how far a program goes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from mopro.motion import PlannedMove
from mopro.program import AXES

if TYPE_CHECKING:
    from mopro.lint.subject import Subject
    from mopro.machine import Machine


def platen_travel_m(machine: Machine) -> dict[int, float]:
    """From one limit switch to the other: the platen's length and width less the forcer."""
    side = machine.heat.forcer_side_m
    sizes = (machine.platen.length_m, machine.platen.width_m)
    return {axis: size - side for axis, size in zip(AXES, sizes, strict=True)}


class Travel(NamedTuple):
    """Where one axis may be and where it starts, in microsteps from its start."""

    low_u: float
    high_u: float

    @property
    def length_u(self) -> float:
        return self.high_u - self.low_u


def travel_of(subject: Subject, axis: int) -> Travel:
    settings, microstep_m = subject.settings, subject.machine.microstep_m
    length_m = settings.travel_m.get(axis, platen_travel_m(subject.machine)[axis])
    start_m = settings.start_m.get(axis, 0.0)
    return Travel((-length_m / 2 - start_m) / microstep_m, (length_m / 2 - start_m) / microstep_m)


def extent_u(moves: tuple[PlannedMove, ...], axis: int) -> tuple[int, int]:
    """The lowest and the highest place that `moves` take `axis` to, in microsteps."""
    ends = [
        end
        for move in moves
        for stroke in move.strokes
        if stroke.axis == axis
        for end in (stroke.start_u, stroke.end_u)
    ]
    return min(ends, default=0), max(ends, default=0)
