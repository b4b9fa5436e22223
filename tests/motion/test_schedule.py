"""Programs to timed commands: waits, loops, coordinated moves, exact targets, refusals."""

import math
from fractions import Fraction

import pytest

import mopro
from mopro.errors import MotionError
from mopro.motion import plan

SETUP = "UU012500/1\nVEL0 40.0\nACC0 0.25\n"
IN = 12500  # microsteps


def schedule(body, for_s=None, setup=SETUP, **options):
    return plan(mopro.compile(setup + body, **options), for_s)


def findings(body, for_s=None, setup=SETUP, **options):
    with pytest.raises(MotionError) as caught:
        schedule(body, for_s, setup, **options)
    return [(d.span.line, d.rule) for d in caught.value.diagnostics]


def test_moves_waits_and_dwells_take_the_time_that_arithmetic_says():
    run = schedule("MRI1 15.0\nWX1\nWT2000\nMRI1 -15.0\nWX1\n")
    move_s = 15 / 40 + 40 / 250
    assert [m.start_s for m in run.moves] == pytest.approx([0.0, move_s + 2], rel=1e-15)
    assert run.duration_s == pytest.approx(2 * move_s + 2, rel=1e-15)
    assert run.complete
    assert run.final_u(1) == 0


def test_a_run_ends_when_its_last_motion_does():
    run = schedule("MRI1 15.0\nMRI2 1.0\n")
    assert run.duration_s == pytest.approx(15 / 40 + 40 / 250)


def test_axis_zero_moves_every_axis_by_its_own_registers():
    run = schedule("VEL2 20.0\nMRI0 15.0\nWX0\n")
    assert [m.axes for m in run.moves] == [(1,), (2,)]
    assert run.moves[0].profile.duration_s < run.moves[1].profile.duration_s


def test_the_longer_way_is_the_major_axis():
    run = schedule("VEL1 10.0\nMR1 4.0\nMR2 -8.0\nGO\nWX0\n")
    (move,) = run.moves
    assert move.axes == (2, 1)
    assert move.profile.peak_velocity == 40 * IN
    for t in (0.05, 0.1, 0.2):
        assert run.tracks[1].state(t).position == pytest.approx(
            -run.tracks[2].state(t).position / 2, rel=1e-12
        )
    assert (run.final_u(1), run.final_u(2)) == (4 * IN, -8 * IN)


def test_of_equal_ways_the_lower_axis_governs():
    run = schedule("VEL1 10.0\nMR2 8.0\nMR1 -8.0\nGO\nWX0\n")
    assert run.moves[0].axes == (1, 2)
    assert run.moves[0].in_uu(run.moves[0].profile.peak_velocity) == 10.0


def test_a_target_is_used_once_and_the_last_one_counts():
    run = schedule("MR1 8.0\nMR1 2.0\nGO\nWX1\nMR2 1.0\nGO\nWX2\n")
    assert [m.axes for m in run.moves] == [(1,), (2,)]
    assert run.final_u(1) == 2 * IN


@pytest.mark.parametrize("units", ["12500/3", "62500/127", "10/7", "99999/1"])
def test_ten_thousand_loops_end_where_arithmetic_says(units):
    """A step that is no whole number of microsteps does not drift: each target is rounded once."""
    rounds = 10_000
    body, setup = ":B1\nMRI1 0.7\nWX1\nWT5\nJUMP B1\n", f"UU0{units}\nVEL0 40.0\nACC0 0.25\n"
    longest = schedule(body, 1.0, setup).moves[0].profile.duration_s * 1.5 + 0.006
    last = schedule(body, rounds * longest, setup).moves[rounds - 1]
    run = schedule(body, last.end_s + 0.001, setup)
    assert len(run.moves) == rounds
    assert run.final_u(1) == round(rounds * Fraction(units) * Fraction(7, 10))


def test_positions_stay_exact_when_units_change_on_the_way():
    run = schedule("MRI1 0.1\nWX1\nUU03/1\nMRI1 0.5\nWX1\n", setup="UU01/3\nVEL0 9.0\nACC0 9.0\n")
    assert run.final_u(1) == round(Fraction(1, 30) + Fraction(3, 2))


def test_a_move_too_small_for_a_microstep_takes_no_time():
    run = schedule("MRI1 0.00001\nWX1\n")
    assert run.duration_s == 0
    assert run.moves[0].strokes[0].length_u == 0


def test_activity_names_the_line_that_moves_and_else_the_one_that_waits():
    run = schedule("MRI1 15.0\nWX1\nWT2000\nMRI1 1.0\nMRI2 15.0\nWT3000\n")
    assert [line for _, line in run.activity] == [4, 6, 8, 9]
    both = schedule("MRI1 15.0\nMRI2 1.0\nWX0\n")
    assert [line for _, line in both.activity] == [5, 4]


def test_a_loop_ends_at_the_time_asked_for_even_within_a_move():
    run = schedule(":B1\nMRI1 1.0\nWX1\nMRI1 -1.0\nWX1\nJUMP B1\n", 0.3)
    assert run.duration_s == 0.3
    assert not run.complete
    assert run.moves[-1].end_s > 0.3
    with pytest.raises(ValueError, match="needs a duration"):
        schedule(":B1\nWT1\nJUMP B1\n")


class TestLeaving:
    """Times at which a command goes past a place, against the trapezoid's closed form."""

    def test_in_the_ramp_the_cruise_and_the_brake(self):
        track = schedule("MRI1 15.0\nWX1\n").tracks[1]
        ramp_s, ramp = 40 / 250, 40**2 / 500
        assert track.leaves_s(-1, 2 * IN) == pytest.approx(math.sqrt(2 * 2 / 250), abs=2e-6)
        assert track.leaves_s(-1, 9 * IN) == pytest.approx(ramp_s + (9 - ramp) / 40, abs=2e-6)
        braking_s = 15 / 40 + ramp_s - math.sqrt(2 * 1 / 250)
        assert track.leaves_s(-1, 14 * IN) == pytest.approx(braking_s, abs=2e-6)

    def test_never_or_not_in_time(self):
        track = schedule("MRI1 15.0\nWX1\n").tracks[1]
        assert track.leaves_s(-1, 15 * IN) == math.inf
        assert track.leaves_s(-1, 9 * IN, until_s=0.2) == math.inf

    def test_on_the_way_back_through_the_lower_end(self):
        track = schedule("MRI1 2.0\nWX1\nMRI1 -4.0\nWX1\n").tracks[1]
        assert track.leaves_s(-1 * IN, 3 * IN) > 2 * math.sqrt(2 / 250)


class TestRefusals:
    def test_a_move_on_a_moving_axis_names_both_lines(self):
        with pytest.raises(MotionError) as caught:
            schedule("MRI1 15.0\nMRI1 -15.0\n")
        (finding,) = caught.value.diagnostics
        assert (finding.rule, finding.span.line) == ("move-on-moving-axis", 5)
        assert "line 4 started it" in finding.message
        assert "WX1" in (finding.hint or "")

    def test_a_dwell_that_is_long_enough_is_a_wait(self):
        assert len(schedule("MRI1 15.0\nWT536\nMRI1 -15.0\n").moves) == 2
        assert findings("MRI1 15.0\nWT534\nMRI1 -15.0\n") == [(6, "move-on-moving-axis")]

    def test_all_findings_come_at_once_and_once(self):
        body = ":B1\nGO\nMRI1 1.0\nMRI1 2.0\nWX1\nJUMP B1\n"
        assert findings(body, 60) == [(5, "go-without-target"), (7, "move-on-moving-axis")]

    @pytest.mark.parametrize(
        ("setup", "rules"),
        [
            ("VEL0 1.0\nACC0 1.0\n", {"missing-units"}),
            ("UU01/1\nACC0 1.0\n", {"missing-velocity"}),
            ("UU01/1\nVEL0 1.0\n", {"missing-acceleration"}),
            ("", {"missing-units", "missing-velocity", "missing-acceleration"}),
        ],
    )
    def test_registers_must_be_set(self, setup, rules):
        assert {rule for _, rule in findings("MRI1 1.0\nWX1\n", setup=setup)} == rules

    def test_a_minor_axis_needs_no_velocity(self):
        setup = "UU01/1\nVEL1 1.0\nACC1 1.0\n"
        run = schedule("MR1 8.0\nMR2 4.0\nGO\nWX0\n", setup=setup)
        assert run.final_u(2) == 4

    @pytest.mark.parametrize(
        "body",
        [":B1\nJUMP B1\n", ":B1\nWX1\nJUMP B1\n", ":B1\nWT0\nJUMP B1\n",
         "MRI1 1.0\n:B1\nWX1\nJUMP B1\n", ":A\n:B\nJUMP A\n"],
    )  # fmt: skip
    def test_a_loop_must_take_time(self, body):
        assert [rule for _, rule in findings(body, 60)] == ["loop-without-time"]

    def test_a_loop_of_a_million_rounds_a_second_is_stopped(self, monkeypatch):
        monkeypatch.setattr("mopro.motion.planner.MOST_STATEMENTS", 1000)
        assert findings(":B1\nWT1\nJUMP B1\n", 60) == [(6, "too-many-statements")]


class TestAssumedStatements:
    def schedule(self, body, for_s=None, travel_u=None):
        return plan(mopro.compile(SETUP + body, grammar="extended"), for_s, travel_u)

    def test_absolute_moves_go_to_places(self):
        run = self.schedule("MAI1 3.0\nWX1\nMAI1 1.0\nWX1\nMA1 2.0\nMA2 1.0\nGO\nWX0\n")
        assert [m.strokes[0].end_u for m in run.moves] == [3 * IN, IN, 2 * IN]
        assert run.final_u(2) == IN

    def test_continuous_motion_until_a_stop(self):
        run = self.schedule("MC1 10.0\nWT1000\nST1\nWX1\n")
        ramp_s = 10 / 250
        assert run.duration_s == pytest.approx(1 + ramp_s, rel=1e-5)
        assert run.final_u(1) == pytest.approx(10 * IN, abs=1)
        state = run.tracks[1].state(0.5)
        assert (state.velocity, state.acceleration) == (10 * IN, 0)
        assert run.moves[0].strokes[0].end_u == run.final_u(1)

    def test_continuous_motion_changes_speed_and_direction(self):
        run = self.schedule("MC1 10.0\nWT1000\nMC1 -10.0\nWT1000\nST1\nWX1\n")
        assert run.tracks[1].state(0.9).velocity == 10 * IN
        assert run.tracks[1].state(1.9).velocity == -10 * IN
        for t in (1.0, 1.08, 2.0):
            before, after = run.tracks[1].state(t - 1e-9), run.tracks[1].state(t + 1e-9)
            assert after.position == pytest.approx(before.position, abs=1e-2)
            assert after.velocity == pytest.approx(before.velocity, abs=1e-2)

    def test_motion_without_end_needs_a_duration(self):
        with pytest.raises(MotionError, match="endless-motion"):
            self.schedule("MC1 10.0\nWX1\n")
        run = self.schedule("MC1 10.0\nWX1\n", for_s=2.0)
        assert run.duration_s == 2.0

    def test_a_moving_axis_takes_no_other_move(self):
        with pytest.raises(MotionError, match="still moving without end"):
            self.schedule("MC1 10.0\nMRI1 1.0\nST1\n", 1.0)

    def test_seek_passes_the_switch_by_its_braking_distance(self):
        run = self.schedule("SK1 -20.0\nWX1\n", travel_u={1: (-10.0 * IN, 10.0 * IN)})
        assert run.final_u(1) == round((-10 - 20**2 / (2 * 250)) * IN)
        with pytest.raises(MotionError, match="no-limit-switch"):
            self.schedule("SK1 -20.0\n")

    def test_seek_that_meets_the_switch_in_its_ramp(self):
        run = self.schedule("SK1 20.0\nWX1\n", travel_u={1: (-10.0, 0.5 * IN)})
        assert run.final_u(1) == IN
        assert run.moves[0].profile.shape == "triangle"
        assert run.duration_s == pytest.approx(2 * math.sqrt(1 / 250))

    def test_home_makes_the_switch_the_origin(self):
        travel = {1: (-10.0 * IN, 10.0 * IN)}
        run = self.schedule("VEL1 20.0\nHM1\nWX1\nMAI1 2.0\nWX1\n", travel_u=travel)
        assert run.moves[1].strokes[0].length_u == 2 * IN

    def test_zero_position_is_what_absolute_moves_count_from(self):
        run = self.schedule("MRI1 3.0\nWX1\nZP1\nMAI1 2.0\nWX1\nMRI1 -1.0\nWX1\nMAI1 0.0\nWX1\n")
        assert [m.strokes[0].end_u for m in run.moves] == [3 * IN, 5 * IN, 4 * IN, 3 * IN]

    def test_zero_position_concerns_its_axis_and_later_targets_only(self):
        body = "MRI0 1.0\nWX0\nMA1 2.0\nZP1\nGO\nWX0\nMAI2 3.0\nWX2\nZP0\nMA0 0.5\nGO\nWX0\n"
        run = self.schedule(body)
        ends = [{s.axis: s.end_u / IN for s in move.strokes} for move in run.moves]
        assert ends == [{1: 1}, {2: 1}, {1: 2}, {2: 3}, {1: 2.5, 2: 3.5}]

    def test_zero_position_takes_no_time_and_no_motion(self):
        run = self.schedule("ZP0\nWT100\nZP1\n")
        assert (run.duration_s, run.moves, run.final_u(1)) == (0.1, (), 0)

    @pytest.mark.parametrize("motion", ["MRI1 8.0", "MC1 1.0"])
    def test_zero_position_of_a_moving_axis_is_refused(self, motion):
        with pytest.raises(MotionError, match="put `WX1` before line 5") as caught:
            self.schedule(f"{motion}\nZP1\n", 1.0)
        assert [(d.span.line, d.rule) for d in caught.value.diagnostics] == [
            (5, "move-on-moving-axis")
        ]
