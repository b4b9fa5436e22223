"""Rules, what they find, and their subject: a program, the settings, its derived properties.

Each derived property is computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from mopro.errors import Diagnostic, Severity
from mopro.motion import PlannedMove, Survey, survey
from mopro.program import ir
from mopro.source import Span

if TYPE_CHECKING:
    from mopro.language import ast
    from mopro.lint.stall_margins import StallMargins
    from mopro.machine import Machine


# -- settings ---------------------------------------------------------------------------------
# Settings of the linter.


# Share of the pull-out force below which a margin is reported.
LOW_MARGIN = 0.20


@dataclass(frozen=True)
class Settings:
    """The machine and payload of the program, and the rules to run.

    `select` are the rules to run, or None for the default ones; those in `ignore` are left
    out. `start_m` is the start of an axis from the middle of its travel, if known; `travel_m`
    the length of its travel where an instrument's range, for example, is shorter than the
    platen. A field's `key` is its name in a file, if different.
    """

    machine: str = "chow1992"
    payload_kg: float = field(default=0.0, metadata={"key": "payload"})
    grammar: str = "attested"
    select: frozenset[str] | None = None
    ignore: frozenset[str] = frozenset()
    low_margin: float = field(default=LOW_MARGIN, metadata={"key": "low-margin"})
    start_m: Mapping[int, float] = field(default_factory=dict, metadata={"key": "start"})
    travel_m: Mapping[int, float] = field(default_factory=dict, metadata={"key": "travel"})


# -- the subject ------------------------------------------------------------------------------
# Subject of the rules: a program and its derived properties, each computed once.

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
    def op_at(self) -> dict[Span, ir.Op]:
        """The operation of each statement, by its place."""
        return {op.span: op for op in self.program.ops}

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
        return microsteps_per_uu * self._microstep_m

    @cached_property
    def _microstep_m(self) -> Fraction:
        return Fraction(self.machine.microstep_m).limit_denominator(10**9)

    def length(self, microsteps: float, microsteps_per_uu: Fraction) -> str:
        """A length in the program's user unit."""
        return f"{microsteps / float(microsteps_per_uu):.5g} {self.unit(microsteps_per_uu)}"


# -- travel -----------------------------------------------------------------------------------
# Travel of each axis, and the extent of a program's moves.


class Travel(NamedTuple):
    """Ends of the travel of one axis, in microsteps from its start."""

    low_u: float
    high_u: float

    @property
    def length_u(self) -> float:
        return self.high_u - self.low_u


def travel_of(subject: Subject, axis: int) -> Travel:
    """The machine's travel of `axis`, or the configured one, relative to the configured start."""
    settings, microstep_m = subject.settings, subject.machine.microstep_m
    low_u, high_u = subject.machine.travel_u()[axis]
    if axis in settings.travel_m:
        high_u = settings.travel_m[axis] / 2 / microstep_m
        low_u = -high_u
    start_u = settings.start_m.get(axis, 0.0) / microstep_m
    return Travel(low_u - start_u, high_u - start_u)


def extent_u(moves: tuple[PlannedMove, ...], axis: int) -> tuple[int, int]:
    """Lowest and highest position of `axis` in `moves`, in microsteps."""
    ends = [
        end
        for move in moves
        for stroke in move.strokes
        if stroke.axis == axis
        for end in (stroke.start_u, stroke.end_u)
    ]
    return min(ends, default=0), max(ends, default=0)


# -- two subjects compared --------------------------------------------------------------------
# Checks of a fixed program against the one before, one for each kind of fix.


def same_program(before: Subject, after: Subject) -> bool:
    """True if both have the same operations."""
    return before.program == after.program


def same_but_labels(before: Subject, after: Subject) -> bool:
    """True if they differ only in labels that no jump goes to."""
    return _without_idle_labels(before) == _without_idle_labels(after)


def _without_idle_labels(subject: Subject) -> list[ir.Op]:
    used = {op.name for op in subject.program.ops if isinstance(op, ir.Jump)}
    ops = subject.program.ops
    return [op for op in ops if not isinstance(op, ir.Label) or op.name in used]


def same_but_waits(before: Subject, after: Subject) -> bool:
    """True if they differ only in waits for an axis."""
    return _without_waits(before) == _without_waits(after)


def same_motion(before: Subject, after: Subject) -> bool:
    """True if every axis has the same moves at the same times."""
    return _moves(before) == _moves(after)


def same_motion_but_waits(before: Subject, after: Subject) -> bool:
    return same_but_waits(before, after) and same_motion(before, after)


def _without_waits(subject: Subject) -> list[ir.Op]:
    return [op for op in subject.program.ops if not isinstance(op, ir.WaitAxis)]


def _moves(subject: Subject) -> list[tuple[object, ...]]:
    return [_place_and_time(move) for move in subject.survey.schedule.moves]


def _place_and_time(move: PlannedMove) -> tuple[object, ...]:
    return move.strokes, move.profile, move.start_s


# -- rules and findings -----------------------------------------------------------------------
# Definition of a rule: the source of its findings, explanation and docs page.


class Stage(StrEnum):
    """Stage of a check; a rule runs only if the earlier stages accept the program."""

    LANGUAGE = "language"
    TEXT = "text"
    MOTION = "motion"
    PHYSICS = "physics"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding; `fix` is the replacement text of its span."""

    rule: str
    message: str
    span: Span
    severity: Severity
    hint: str | None = None
    fix: str | None = None

    @classmethod
    def of(cls, diagnostic: Diagnostic, fix: str | None = None) -> Finding:
        d = diagnostic
        return cls(d.rule, d.message, d.span, d.severity, d.hint, fix)

    @property
    def diagnostic(self) -> Diagnostic:
        return Diagnostic(self.rule, self.message, self.span, self.severity, self.hint)


Check = Callable[["Rule", Subject], Iterable[Finding]]
FixCheck = Callable[[Subject, Subject], bool]


@dataclass(frozen=True)
class Rule:
    """A kind of finding about a program.

    `bad` and `good` are whole programs with and without the finding. `check` yields the
    findings; those of a rule without one come from the compiler or the schedule. `fix` makes
    the replacement text from the program and the finding. `example` are the settings of the
    examples. `fix_check` compares the program before and after a fix, which is applied only if
    it returns True. A rule that is not `default` runs only if selected by name.
    """

    name: str
    stage: Stage
    severity: Severity
    what: str
    why: str
    bad: str
    good: str
    check: Check | None = None
    fix: Callable[[Subject | None, Diagnostic], str | None] | None = None
    fix_check: FixCheck | None = None
    default: bool = True
    example: Settings = field(default_factory=Settings)

    def at(
        self, span: Span, message: str, hint: str | None = None, fix: str | None = None
    ) -> Finding:
        return Finding(self.name, message, span, self.severity, hint, fix)
