"""Trial of a machine: a short move, and an hour at rest, to see that a run can be done."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from mopro.effects import catalogue_of
from mopro.effects.resolve import stated_effects
from mopro.errors import Diagnostic, ModelError, RunError
from mopro.machine import Machine
from mopro.plant.command_table import plan_with_effects
from mopro.plant.simulation import simulate
from mopro.program import AXES, Program, ir
from mopro.source import Source, Span

# A move of one pitch, which the machine may or may not follow, and what it may bring about.
_MOVE_S = 0.02
_RATE_HZ = 1000.0
_WARM_S = 3600.0
_PLACE = Span(1, 1, 2)


def try_out(machine: Machine) -> None:
    """Emulate a move of one pitch and an hour of heating; ModelError if a value is not finite.

    With all effects that it states, whatever runs they belong to.
    """
    active = stated_effects(machine, catalogue_of(machine))
    schedule = plan_with_effects(_one_pitch(machine), machine, active)
    warm = replace(schedule, duration_s=_WARM_S)
    simulation = simulate(warm, machine, active, compiled=False)
    try:
        simulation.advance(np.arange(0.0, 2 * _MOVE_S, 1 / _RATE_HZ), 2 * _MOVE_S)
        simulation.settle()
    except RunError as error:
        found = error.diagnostics[0]
        raise _unstable(machine, f"a trial move of one pitch fails: {found.message}") from error
    if not np.isfinite(simulation.temperature_C(np.linspace(0.0, _WARM_S, 61))).all():
        raise _unstable(machine, "the forcer's temperature is not finite within an hour")


def _unstable(machine: Machine, message: str) -> ModelError:
    names = ", ".join(effect.name for effect in machine.effects)
    hint = f"check the values of {names}" if names else None
    source = machine.source or Source(machine.name, "")
    return ModelError(source, [Diagnostic("unstable", message, _PLACE, hint=hint)])


def _one_pitch(machine: Machine) -> Program:
    """Both axes by one pitch and back to rest in 20 ms."""
    pitch_u = Fraction(machine.axis.pitch_m / machine.microstep_m)
    ops: list[ir.Op] = [
        ir.SetUnits(_PLACE, AXES, 1, 1),
        ir.SetVelocity(_PLACE, AXES, 4 * pitch_u / Fraction(_MOVE_S)),
        ir.SetAcceleration(_PLACE, AXES, 4 * pitch_u / Fraction(_MOVE_S) ** 2),
        ir.Move(_PLACE, AXES, pitch_u),
        ir.WaitAxis(_PLACE, AXES),
    ]
    return Program(tuple(ops), Source("a trial move", ""))
