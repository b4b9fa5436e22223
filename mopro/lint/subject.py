"""Subject of the rules: a program and its derived properties, each computed once."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

from mopro.lint.settings import Settings
from mopro.program import ir

if TYPE_CHECKING:
    from mopro.language import ast
    from mopro.lint.stall_margins import StallMargins
    from mopro.machine import Machine
    from mopro.motion import PlannedMove, Survey


# Statements above which a loop is surveyed for two rounds, the fewest that show a drift.
_TWO_ROUNDS_FROM = 20_000


@dataclass(frozen=True)
class Subject:
    """A program that compiles, and the settings of the linter."""

    tree: ast.Tree
    program: ir.Program
    settings: Settings

    @cached_property
    def survey(self) -> Survey:
        from mopro.motion import survey

        rounds = 2 if len(self.program.ops) > _TWO_ROUNDS_FROM else 3
        return survey(self.program, rounds, self._switches_u)

    @property
    def _switches_u(self) -> dict[int, tuple[float, float]]:
        """Limit switches (low, high) of each axis in microsteps; empty without a seek."""
        if not self.program.seeks_switch:
            return {}
        return self.machine.travel_u()

    @cached_property
    def machine(self) -> Machine:
        from mopro.machine import load_machine

        return load_machine(self.settings.machine)

    @cached_property
    def stall_margins(self) -> StallMargins:
        """Margin of each move against a stall."""
        from mopro.lint.stall_margins import LadenMachine, stall_margins_of

        laden = LadenMachine(self.machine, self.settings.payload_kg)
        return stall_margins_of(laden, self.distinct_moves, self.settings.low_margin)

    @property
    def distinct_moves(self) -> tuple[PlannedMove, ...]:
        """All moves; those of a loop only up to its second round, as later rounds repeat them."""
        moves, laps = self.survey.schedule.moves, self.survey.laps
        return moves[: laps[1].moves] if len(laps) > 1 else moves

    @cached_property
    def reached(self) -> frozenset[int]:
        """Indices of the operations that a run can reach."""
        met = {id(op) for op in self.program.reachable()}
        return frozenset(i for i, op in enumerate(self.program.ops) if id(op) in met)

    def unit(self, microsteps_per_uu: Fraction) -> str:
        """The name of a program's user unit."""
        from mopro.units import length_unit_name

        return length_unit_name(self.metres_per_uu(microsteps_per_uu))

    def metres_per_uu(self, microsteps_per_uu: Fraction) -> Fraction:
        return microsteps_per_uu * Fraction(self.machine.microstep_m).limit_denominator(10**9)

    def length(self, microsteps: float, microsteps_per_uu: Fraction) -> str:
        """A length in the program's user unit."""
        return f"{microsteps / float(microsteps_per_uu):.5g} {self.unit(microsteps_per_uu)}"
