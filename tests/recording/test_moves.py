"""Outcomes of moves: the worst of their axes, rows in the program's units, and their words."""

from dataclasses import replace
from fractions import Fraction

import pytest

from mopro.motion import PlannedMove, Stroke, plan_profile
from mopro.recording import MoveOutcome, MoveReport
from mopro.recording.moves import (
    folded,
    folded_columns,
    stall_message,
)
from mopro.source import Span

MICROSTEP_M = 2.032e-6
MOVE = PlannedMove(
    Span(7, 1, 1),
    (Stroke(2, 0, 12500), Stroke(1, 0, -5000)),
    plan_profile(12500.0, 125000.0, 1.25e6),
    start_s=0.5,
    distance_uu=1.0,
    microsteps_per_uu=Fraction(12500),
)


def test_the_worst_of_the_axes_is_taken_field_by_field():
    first = MoveOutcome(1e-4, 0.8, lost_pitches=1, slipped=True)
    second = MoveOutcome(3e-4, 0.9, lost_pitches=-2, complete=False)
    assert MoveOutcome.worst([first, second]) == MoveOutcome(3e-4, 0.8, -2, True, False)


def test_what_no_axis_saw_stays_unknown():
    assert MoveOutcome.worst([MoveOutcome(), MoveOutcome()]) == MoveOutcome()
    assert MoveOutcome.worst([MoveOutcome(), MoveOutcome(1e-4, 0.5)]) == MoveOutcome(1e-4, 0.5)


def test_the_row_is_in_the_programs_units_and_names_the_major_axis_first():
    row = MoveReport.of(MOVE, MoveOutcome(0.0254e-3, 0.5, 3, True), MICROSTEP_M)
    assert (row.line, row.axes, row.unit, row.distance) == (7, [2, 1], "in", 1.0)
    assert (row.set_velocity, row.acceleration) == pytest.approx((10.0, 100.0))
    assert row.max_lag == pytest.approx(1e-3)
    assert stall_message([row]) == "axis 2+1 stalled here: it lost +3 pitches"


def test_a_row_of_what_nobody_saw_says_so():
    (row,) = folded(passes(MoveOutcome(complete=False)))
    assert row.cells[-3:] == ["-", "-", "0"]
    assert row.cells[2].endswith(" cut")


def passes(*outcomes):
    return [MoveReport.of(MOVE, outcome, MICROSTEP_M) for outcome in outcomes]


def test_passes_that_went_alike_are_one_row_with_the_worst_of_them():
    (row,) = folded(passes(MoveOutcome(1e-4, 0.8), MoveOutcome(3e-4, 0.5), MoveOutcome(2e-4, 0.9)))
    assert row.count == 3
    assert (row.worst.max_lag, row.worst.stall_margin) == pytest.approx((3e-4 / 0.0254, 0.5))
    cells = dict(zip(folded_columns("in"), row.cells, strict=True))
    assert (cells["line"], cells["stall\nmargin"], cells["distance\n(in)"]) == ("7 × 3", "50%", "1")


def test_a_stall_and_a_move_cut_short_have_rows_of_their_own():
    slips = [MoveOutcome(1e-3, 0.0, 1, True), MoveOutcome(1e-3, 0.0, 2, True)]
    rows = folded(passes(MoveOutcome(), *slips, MoveOutcome(), MoveOutcome(complete=False)))
    assert [row.cells[0] for row in rows] == ["7 × 2", "7 × 2", "7"]
    assert [row.cells[-1] for row in rows] == ["0", "+3", "0"]
    assert rows[2].cells[2].endswith(" cut")


def test_a_velocity_that_is_not_reached_is_told_beside_the_one_that_is_set():
    short = replace(passes(MoveOutcome())[0], peak_velocity=7.5)
    assert folded([short])[0].cells[4] == "7.5 of 10"
    assert folded(passes(MoveOutcome()))[0].cells[4] == "10"
