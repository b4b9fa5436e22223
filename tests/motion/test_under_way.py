"""Registers that are set while an axis moves are for the next motion."""

import pytest

import mopro
from mopro.motion import plan

BEGUN = "UU012500/1\nVEL0 5.0\nACC0 0.25\n"
CHANGES = [
    "VEL0 1.0",
    "ACC0 0.01",
    "UU0100/1",
    "PARA0+",
    "VEL1 40.0\nACC1 1.0",
    "UU02500/1\nVEL0 9",
]


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("after_ms", ["", "WT1\n", "WT100\n"])
@pytest.mark.parametrize("move", ["MRI1 2.0", "MR1 2.0\nMR2 -1.0\nGO", "MRI0 2.0"])
def test_a_move_under_way_keeps_the_plan_that_it_began_with(change, after_ms, move):
    changed = plan(mopro.compile(f"{BEGUN}{move}\n{after_ms}{change}\nWX0\n"))
    plain = plan(mopro.compile(f"{BEGUN}{move}\nWX0\n"))
    assert [m.profile for m in changed.moves] == [m.profile for m in plain.moves]
    assert changed.duration_s == plain.duration_s


@pytest.mark.parametrize("change", CHANGES)
def test_the_next_move_has_what_was_set_under_way(change):
    before = f"{BEGUN}MRI1 2.0\n{change}\nWX1\nMRI1 1.0\nWX1\n"
    after = f"{BEGUN}MRI1 2.0\nWX1\n{change}\nMRI1 1.0\nWX1\n"
    one, other = (plan(mopro.compile(text)).moves[1].profile for text in (before, after))
    assert one == other
    assert one != plan(mopro.compile(f"{BEGUN}MRI1 1.0\nWX1\n")).moves[0].profile


def test_a_target_is_of_the_user_unit_of_its_line_and_moved_with_the_registers_at_go():
    text = f"{BEGUN}MR1 1.0\nUU0100/1\nVEL1 10.0\nGO\nWX1\n"
    (move,) = plan(mopro.compile(text)).moves
    assert move.strokes[0].length_u == 12_500
    assert move.profile.velocity == 1_000


def test_a_motion_without_end_keeps_its_velocity_and_slows_down_at_the_acceleration_set_last():
    text = f"{BEGUN}MC1 3.0\nWT500\nVEL1 1.0\nACC1 0.1\nWT500\nST1\nWX1\n"
    schedule = plan(mopro.compile(text, grammar="extended"))
    assert schedule.duration_s == pytest.approx(1.0 + 3.0 / 100.0, rel=1e-3)
