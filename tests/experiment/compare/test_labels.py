"""Which line, phase, way and move each sample belongs to."""

import numpy as np
import pytest

import mopro
from mopro.emulator import Emulator
from mopro.experiment.sawyer.labels import labels
from mopro.experiment.sawyer.logged import schedule_of
from mopro.experiment.sawyer.trials import LoggedCommand
from mopro.machine import load_machine
from mopro.motion import plan

MACHINE = load_machine("chow1992")
INCH = 0.0254
# 4 in at 8 in/s and 100 in/s²: 80 ms of ramp, 420 ms of cruise.
TEXT = "UU012500/1\nVEL1 8.0\nACC1 0.1\nWT100\nMRI1 4.0\nWX1\nWT1000\nMRI1 -4.0\nWX1\n"


def of(schedule, time_s, axis=1):
    return labels(schedule, axis, np.asarray(time_s, dtype=float), MACHINE.microstep_m)


def test_phases_of_a_trapezoid_and_what_follows():
    times = [0.05, 0.1, 0.15, 0.3, 0.65, 0.685, 0.9, 1.1, 1.75]
    found = of(plan(mopro.compile(TEXT)), times)
    assert found.phase.tolist() == [
        "dwell", "accelerate", "accelerate", "cruise", "decelerate", "settle", "settle",
        "dwell", "accelerate",
    ]  # fmt: skip
    assert found.line.tolist() == [4, 5, 5, 5, 5, 5, 5, 7, 8]
    assert found.direction.tolist() == [0, 1, 1, 1, 1, 1, 1, 1, -1]
    assert found.move.tolist() == [0] * 8 + [1]


def test_the_command_is_the_closed_form():
    found = of(plan(mopro.compile(TEXT)), [0.05, 0.14, 0.3, 1.0])
    way = [0, 100 * 0.04**2 / 2, 0.32 + 8 * 0.12, 4]
    assert found.command_m == pytest.approx(np.array(way) * INCH, abs=1e-9)
    assert found.velocity_m_s == pytest.approx(np.array([0, 4, 8, 0]) * INCH)
    assert found.acceleration_m_s2 == pytest.approx(np.array([0, 100, 0, 0]) * INCH)


def test_a_parabola_has_no_cruise_and_a_smooth_move_has():
    text = "UU012500/1\nVEL1 {}\nACC1 0.25\nPARA1+\nMRI1 4.0\nWX1\n"
    times = np.arange(0.0, 2.0, 1e-3)
    parabola = of(plan(mopro.compile(text.format(80.0))), times)
    assert set(parabola.phase.tolist()) == {"accelerate", "decelerate", "settle", "dwell"}
    assert "cruise" in of(plan(mopro.compile(text.format(10.0))), times).phase


def test_an_axis_that_takes_no_part_dwells_all_the_time():
    found = of(plan(mopro.compile(TEXT)), [0.0, 0.3, 1.0], axis=2)
    assert set(found.phase.tolist()) == {"dwell"}
    assert not found.direction.any()
    # The line that runs is told all the same.
    assert found.line.tolist() == [4, 5, 7]


def test_each_move_of_a_loop_is_a_move_of_its_own():
    text = "UU012500/1\nVEL0 15.0\nACC0 0.2\n:B1\nMRI2 2.0\nWX2\nMRI2 -2.0\nWX2\nJUMP B1\n"
    schedule = plan(mopro.compile(text), for_s=5.0)
    found = of(schedule, np.arange(0.0, 5.0, 1e-3), axis=2)
    assert np.unique(found.move).tolist() == list(range(len(schedule.moves)))
    assert set(np.unique(found.line)) == {5, 7}
    assert ((found.direction > 0) == (found.line == 5)).all()


# -- logged commands ------------------------------------------------------------------


def logged(text, rate_hz=1000.0):
    """A schedule, and the command that a controller would have logged of it."""
    program = mopro.compile(text)
    schedule = plan(program)
    times = np.arange(round(schedule.duration_s * rate_hz) + 1) / rate_hz
    log = {axis: of(schedule, times, axis).command_m for axis in (1, 2)}
    return schedule, LoggedCommand(times, log)


@pytest.mark.parametrize("text", [TEXT, TEXT.replace("MRI1 4", "PARA1+\nMRI1 4")])
def test_a_logged_command_goes_where_the_program_went(text):
    schedule, command = logged(text)
    again = schedule_of(command, MACHINE)
    times = np.arange(0.0, schedule.duration_s, 3.7e-4)
    told, followed = of(schedule, times), of(again, times)
    assert np.abs(told.command_m - followed.command_m).max() < 0.3e-6
    assert set(followed.line.tolist()) == {0}
    assert (followed.direction == told.direction).mean() > 0.99
    assert (followed.phase == told.phase).mean() > 0.98
    assert [m.strokes[0].length_u for m in again.moves] == [50000, -50000]


def test_the_machine_follows_the_log_as_it_follows_the_program():
    schedule, command = logged(TEXT)
    emulator = Emulator(MACHINE)
    times = np.arange(0.0, schedule.duration_s, 1e-3)
    one, other = (
        emulator.begin(s).advance(times, float(times[-1]))
        for s in (schedule, schedule_of(command, MACHINE))
    )
    assert np.abs(one["position_1_m"] - other["position_1_m"]).max() < 0.5e-6
    assert other["temperature_C"] == pytest.approx(one["temperature_C"], abs=1e-3)


def test_a_reversal_without_a_rest_makes_two_moves():
    times = np.arange(2001) / 1000
    position = 0.01 * (1 - np.cos(2 * np.pi * np.clip(times - 0.5, 0, 1)))
    schedule = schedule_of(LoggedCommand(times, {1: position}), MACHINE)
    ups = [m.strokes[0].length_u > 0 for m in schedule.moves]
    assert ups == [True, False]
    assert schedule.moves[0].end_s == pytest.approx(1.0, abs=2e-3)
    assert np.abs(of(schedule, times).command_m - position).max() < 1e-7


def test_a_log_that_begins_and_ends_under_way():
    times = np.arange(501) / 1000
    schedule = schedule_of(LoggedCommand(times, {2: 0.05 + 0.1 * times}), MACHINE)
    found = of(schedule, [0.0, 0.25, 0.4999], axis=2)
    assert found.velocity_m_s == pytest.approx(0.1, rel=1e-6)
    assert found.command_m == pytest.approx([0.0, 0.025, 0.04999], abs=1e-9)


def test_a_log_at_rest_has_no_moves():
    schedule = schedule_of(LoggedCommand(np.arange(5.0), {1: np.full(5, 0.3)}), MACHINE)
    assert schedule.moves == ()
    assert schedule.tracks[1].segments == []
