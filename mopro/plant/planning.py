"""The command of a run, with the effects that change what is commanded."""

from __future__ import annotations

from collections.abc import Sequence

from mopro.effects import Active
from mopro.machine import Machine
from mopro.motion import Schedule, plan
from mopro.program import Program


def plan_with_effects(
    program: Program, machine: Machine, active: Sequence[Active], for_s: float | None = None
) -> Schedule:
    """The schedule of `program` on `machine`; raises MotionError, as `plan` does."""
    for a in active:
        program = a.effect.program(program, *a.values)
    return change_schedule(plan(program, for_s, machine.travel_u()), active)


def change_schedule(schedule: Schedule, active: Sequence[Active]) -> Schedule:
    """`schedule` as effects of the command change it."""
    for a in active:
        schedule = a.effect.schedule(schedule, *a.values)
    return schedule
