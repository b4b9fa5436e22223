"""A program executed as far as anything new can come of it, and what was noticed on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from mopro.errors import Diagnostic
from mopro.motion.planner import Planner, TravelU
from mopro.motion.schedule import Schedule
from mopro.program import ir
from mopro.source import Span


class Lap(NamedTuple):
    """The run each time it comes to one jump of its loop: when, where, after how many moves."""

    time_s: float
    position_u: tuple[Fraction, ...]
    moves: int


@dataclass(frozen=True)
class Survey:
    """A run of a program's beginning and of some rounds of its loop.

    `findings` are why parts of it would be refused. `laps` are the states at one jump of
    the loop, one more than rounds. `served` are the spans of the waits that had a motion
    to wait for and of the targets that a GO went to; `distances_u` the relative distances asked
    for, by span and axis, before they are rounded; `left_moving` the time (s) for which
    each axis moves on after the last statement.
    """

    schedule: Schedule
    findings: tuple[Diagnostic, ...]
    laps: tuple[Lap, ...]
    served: frozenset[Span]
    distances_u: Mapping[tuple[Span, int], Fraction]
    left_moving: Mapping[int, float]


def survey(program: ir.Program, rounds: int = 3, travel_u: TravelU | None = None) -> Survey:
    """Execute `program` once through, and `rounds` times round its loop if it has one.

    The registers that steer a round are the same from the second one on, and so are its
    moves but for where they start. `travel_u` is as for `plan`. Nothing is raised.
    """
    surveyor = _Surveyor(program, travel_u or {}, rounds)
    surveyor.run()
    return surveyor.survey()


class _Surveyor(Planner):
    """A planner that counts rounds and watches what becomes of waits and targets."""

    def __init__(self, program: ir.Program, travel_u: TravelU, rounds: int) -> None:
        super().__init__(program, math.inf, travel_u)
        self._rounds = rounds
        self._cut_short = False
        self._laps: dict[Span, list[Lap]] = {}
        self._served: set[Span] = set()
        self._distances_u: dict[tuple[Span, int], Fraction] = {}
        self._left_moving: dict[int, float] = {}
        self._unawaited: set[int] = set()
        self._target_set_by: dict[int, Span] = {}

    def survey(self) -> Survey:
        laps: list[Lap] = max(self._laps.values(), key=len, default=[])
        return Survey(
            schedule=self.schedule(),
            findings=tuple(self.found.values()),
            laps=tuple(laps),
            served=frozenset(self._served),
            distances_u=self._distances_u,
            left_moving=self._left_moving,
        )

    def execute(self, op: ir.Op) -> None:
        match op:
            case ir.WaitAxis():
                self._await(op)
            case ir.Go():
                self._serve_targets()
            case ir.Move() | ir.SetTarget():
                self._note_ways(op)
        super().execute(op)
        if isinstance(op, ir.SetTarget):
            self._target_set_by.update(dict.fromkeys(op.axes, op.span))
        for number, axis in self.axes.items():
            if axis.started_by is op.span:
                self._unawaited.add(number)

    def jump(self, op: ir.Jump) -> None:
        laps = self._laps.setdefault(op.span, [])
        position_u = tuple(axis.position_u for axis in self.axes.values())
        laps.append(Lap(self.now_s, position_u, len(self.moves)))
        if len(laps) > self._rounds:
            self._cut_short = True
            self.end()
        else:
            super().jump(op)

    def finish_motions(self, span: Span) -> None:
        if self._cut_short:
            return
        self._left_moving = {
            number: axis.busy_until_s - self.now_s
            for number, axis in self.axes.items()
            if axis.moving(self.now_s)
        }
        super().finish_motions(span)

    def _await(self, op: ir.WaitAxis) -> None:
        if self._unawaited & set(op.axes):
            self._served.add(op.span)
        self._unawaited -= set(op.axes)

    def _serve_targets(self) -> None:
        for number, axis in self.axes.items():
            if axis.target_u is not None:
                self._served.add(self._target_set_by[number])

    def _note_ways(self, op: ir.Move | ir.SetTarget) -> None:
        for axis in self.of(op):
            if axis.microsteps_per_uu is not None and not op.absolute:
                self._distances_u[op.span, axis.number] = op.distance_uu * axis.microsteps_per_uu
