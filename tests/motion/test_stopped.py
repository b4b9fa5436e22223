"""A schedule given up before its time: braked, held or cut, against closed forms."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mopro
from mopro.motion import Stopping, plan

# 2 in/s and 100 in/s² in microsteps; the ramps take 20 ms, the cruise lasts till 1 s.
SPEED, RATE = 2 * 12500.0, 100 * 12500.0
SETUP = "UU012500/1\nVEL0 2\nACC0 0.1\n"
ONE = plan(mopro.compile(SETUP + "MRI1 2\nWX1\nWT100\nMRI1 -1\nWX1\n"))
BOTH = plan(mopro.compile(SETUP + "MR1 2\nMR2 -0.5\nGO\nWX1\n"))


def at(schedule, axis, time_s):
    return schedule.tracks[axis].state(time_s)


def test_a_braked_axis_comes_to_rest_within_v_squared_over_2_a():
    stopped = ONE.stopped(0.5, Stopping.BRAKE)
    reached = SPEED * 0.5 - SPEED**2 / RATE / 2
    assert at(stopped, 1, 0.5).position == pytest.approx(reached)
    assert stopped.final_u(1) == round(reached + SPEED**2 / (2 * RATE))
    assert stopped.duration_s == pytest.approx(0.5 + SPEED / RATE, rel=1e-3)
    assert at(stopped, 1, stopped.duration_s).velocity == 0
    halfway_s = (0.5 + stopped.duration_s) / 2
    assert at(stopped, 1, halfway_s).velocity == pytest.approx(SPEED / 2)


def test_an_axis_that_speeds_up_brakes_from_the_speed_it_has():
    stopped = ONE.stopped(0.01, Stopping.BRAKE)
    assert stopped.final_u(1) == round(2 * RATE * 0.01**2 / 2)
    assert stopped.duration_s == pytest.approx(0.02, rel=1e-2)


def test_a_held_axis_stands_on_the_nearest_microstep_at_once():
    time_s = 0.4000123
    stopped = ONE.stopped(time_s, Stopping.HOLD)
    reached = at(ONE, 1, time_s).position
    assert reached != round(reached)
    assert stopped.duration_s == time_s
    assert at(stopped, 1, time_s + 1.0).position == round(reached)


def test_a_cut_axis_stands_exactly_where_it_was():
    time_s = 0.4000123
    stopped = ONE.stopped(time_s, Stopping.CUT)
    assert stopped.duration_s == time_s
    assert at(stopped, 1, time_s + 1.0) == (at(ONE, 1, time_s).position, 0.0, 0.0)


def test_axes_that_move_together_brake_along_their_path():
    stopped = BOTH.stopped(0.5, Stopping.BRAKE)
    ends_s = [stopped.tracks[axis].segments[-1].end_s for axis in (1, 2)]
    assert ends_s[0] == pytest.approx(ends_s[1], abs=2 / (SPEED / 4))
    assert stopped.final_u(2) == pytest.approx(-stopped.final_u(1) / 4, abs=1)


def test_what_had_not_begun_is_left_out():
    pause_s = (ONE.moves[0].end_s + ONE.moves[1].start_s) / 2
    for stopping in Stopping:
        stopped = ONE.stopped(pause_s, stopping)
        assert stopped.moves == ONE.moves[:1]
        assert stopped.duration_s == pause_s
        assert not stopped.complete
        assert [line for _, line in stopped.activity] == [4, 6]
        assert stopped.final_u(1) == 25000


def test_a_motion_without_end_brakes_at_its_set_acceleration():
    program = mopro.compile(SETUP + "MC1 2\nWT500\n", grammar="extended")
    stopped = plan(program, 2.0).stopped(1.0, Stopping.BRAKE)
    assert stopped.duration_s == pytest.approx(1.0 + SPEED / RATE, rel=1e-3)


@given(st.floats(1e-6, 2.0), st.sampled_from(Stopping), st.sampled_from([ONE, BOTH]))
def test_a_stop_changes_nothing_before_it_and_ends_at_rest(time_s, stopping, schedule):
    before = {axis: list(track.segments) for axis, track in schedule.tracks.items()}
    stopped = schedule.stopped(time_s, stopping)
    for axis in (1, 2):
        assert schedule.tracks[axis].segments == before[axis]
        for share in (0.0, 0.3, 0.99):
            earlier_s = share * time_s
            assert at(stopped, axis, earlier_s)[:2] == at(schedule, axis, earlier_s)[:2]
        last = at(stopped, axis, math.nextafter(stopped.duration_s, math.inf))
        assert last.velocity == 0
        assert stopping is Stopping.CUT or last.position == round(last.position)
