"""Runs on the virtual controller: the emulator's table, stops, and what goes wrong."""

import numpy as np
import pytest

import mopro
from helpers.bench_of_link import DIALECTS, SHORT, Impatient, bench, without
from mopro.controller.faults import Fault, PlantFault
from mopro.errors import MotionError, SourceError
from mopro.machine import load_machine
from mopro.program.compile import compile_file
from mopro.program.statements import canonical, resume

MICROSTEP_M = load_machine("chow1992").microstep_m
PROGRAM = mopro.compile(SHORT, "short.CMD")


def last_u(recording, axis):
    return round(float(recording[f"command_{axis}_m"][-1]) / MICROSTEP_M)


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize(
    ("name", "for_s"),
    [
        ("LVDT1", None),
        ("LVDT2", None),
        ("LVDT3", None),
        ("LVDT4", None),
        ("TEMP1", 4 * 1.075),
        ("TEMP2", 4 * (8 / 15 + 0.075)),
    ],
)
def test_the_controller_gives_the_emulators_table(programs_folder, dialect, name, for_s):
    program = compile_file(programs_folder / f"{name}.CMD")
    there = bench(dialect).run(program, for_s)
    here = mopro.emulate(program, for_s=for_s)
    assert there.run.moves == here.run.moves
    assert there.run.trouble is None
    assert there.run.duration_s == here.run.duration_s
    for axis in (1, 2):
        assert last_u(there, axis) == last_u(here, axis)


def test_a_run_cut_in_mid_move_has_the_same_table_and_then_brakes(programs_folder):
    program = compile_file(programs_folder / "TEMP1.CMD")
    there, here = bench().run(program, 2.7), mopro.emulate(program, for_s=2.7)
    assert there.run.moves == here.run.moves
    assert not there.run.moves[-1].complete
    braking_u = 15.0**2 / (2 * 200) * 12500
    assert last_u(there, 2) - last_u(here, 2) == pytest.approx(braking_u, abs=1)


def test_the_recording_says_whose_clock_it_has_and_shows_what_was_seen():
    recording = bench().run(PROGRAM)
    assert recording.header.clock == "host"
    assert set(recording["line"]) <= set(range(1, 9))
    assert (np.diff(recording["time_s"]) > 0).all()
    assert recording["position_1_m"][-1] == pytest.approx(recording["command_1_m"][-1], abs=1e-9)


FAST = mopro.compile(SHORT.replace("VEL1 8.0", "VEL1 40.0").replace("2.0", "9.0"), "fast.CMD")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_command_and_position_are_of_one_moment(dialect):
    """At 1 m/s two answers one after the other would be 50 mm apart."""
    there, here = bench(dialect).run(FAST), mopro.emulate(FAST)
    lag_m = np.abs(there["command_1_m"] - there["position_1_m"])
    assert lag_m.max() < 2 * here.run.moves[0].max_lag * 0.0254
    told_m = np.interp(there["time_s"], here["time_s"], here["command_1_m"])
    moving = np.abs(np.diff(there["command_1_m"])) > 1e-3
    assert moving.sum() >= 2
    assert np.abs(there["command_1_m"] - told_m).max() < 1e-3


@pytest.mark.parametrize("dialect", DIALECTS)
def test_what_two_answers_cannot_tell_is_left_out(dialect):
    """Without a statement for both positions the command is known while it stands still."""
    recording = bench(without(dialect, "sample")).run(FAST)
    lag_m = np.abs(recording["command_1_m"] - recording["position_1_m"])
    assert np.isfinite(recording["position_1_m"]).all()
    assert np.isnan(lag_m).any()
    assert np.nanmax(lag_m) < 1e-5
    assert last_u(recording, 1) == round((9.0 - 1.0) * 12500)


def test_columns_that_nobody_can_see_are_left_out():
    seen = list(bench().run(PROGRAM).columns)
    assert seen == ["time_s", "command_1_m", "position_1_m", "command_2_m", "position_2_m", "line"]
    recording = bench(without("checked", "sample", "measured")).run(PROGRAM)
    assert list(recording.columns) == ["time_s", "command_1_m", "command_2_m", "line"]
    assert recording.axes == [1, 2]
    recording.plot()


def test_the_header_states_the_rate_of_the_samples():
    recording = bench().run(PROGRAM)
    assert recording.header.rate_hz == pytest.approx(1 / np.diff(recording["time_s"]).mean())
    assert recording.header.rate_hz < 15


def test_settling_is_polled_where_positions_are_measured():
    def lasts_s(dialect):
        recording = bench(dialect).run(PROGRAM, settle_s=0.5)
        assert recording.run.duration_s == mopro.emulate(PROGRAM).run.duration_s
        return recording["time_s"][-1] - recording.run.duration_s

    assert 0.4 < lasts_s("checked") < 1.0
    assert lasts_s(without("checked", "sample", "measured")) < 0.4


def test_a_link_that_fails_while_the_axes_settle_takes_nothing_from_the_run():
    joined = bench("checked", Fault("disconnect", at_s=2.2, for_s=1e6), breaks=True)
    run = joined.run(PROGRAM, settle_s=60.0).run
    assert (run.trouble, run.complete) == (None, True)
    assert joined.session.port.now_s() < 10.0


def test_motion_that_must_be_refused_is_refused_before_anything_is_sent():
    joined = bench()
    heard = joined.station.hear
    joined.station.hear = lambda data, now_s: pytest.fail("something was sent")
    with pytest.raises(MotionError, match="still moving"):
        joined.run(mopro.compile(SHORT.replace("WX1\nWT50\n", "WT50\n")))
    joined.station.hear = heard


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("after_s", [0.05, 0.2, 0.31])
def test_ctrl_c_stops_the_machine_and_says_where(dialect, after_s):
    joined = bench(dialect)
    program = mopro.compile(SHORT.replace("2.0", "12.0"), "short.CMD")
    joined.session.port = Impatient(joined.session.port, 1.2 + after_s)
    run = joined.run(program).run
    assert "interrupted" in run.trouble
    assert "both axes rest" in run.trouble
    assert "line 4 `MRI1 12.0`" in run.trouble
    assert not run.complete
    assert not run.moves[-1].complete
    still_at(joined)


def still_at(joined):
    """Fail if the motor is told to move, or moves, after now."""
    now_s = joined.session.port.now_s()
    device = joined.station.device
    before = [device.do(name, {}, now_s) for name in ("position", "measured")]
    assert [device.do(name, {}, now_s + 5.0) for name in ("position", "measured")] == before


def test_a_stop_brakes_at_the_set_acceleration():
    joined = bench("plain")
    device = joined.station.device
    joined.station.store.write("MAIN", SHORT.replace("2.0", "12.0").splitlines())
    device.do("run", {"name": "MAIN"}, 100.0)
    device.do("stop", {}, 100.5)
    assert device.do("motion", {}, 100.5)[0]["moving_1"] == 1
    at_u = device.do("position", {}, 100.5)[0]["position_1"]
    rest_u = device.do("position", {}, 102.0)[0]["position_1"]
    assert rest_u - at_u == pytest.approx(8.0**2 / (2 * 250) * 12500, abs=1)
    assert device.do("status", {}, 102.0)[0]["state"] == "stopped"
    assert device.do("motion", {}, 102.0)[0] == {"moving_1": 0, "moving_2": 0}
    measured = device.do("measured", {}, 103.0)[0]["position_1"]
    assert measured == rest_u


def test_a_lost_link_is_told_and_the_stop_is_not_claimed():
    joined = bench("checked", Fault("disconnect", at_s=1.5, for_s=1e6), breaks=True)
    run = joined.run(mopro.compile(SHORT.replace("2.0", "12.0"))).run
    assert "link is lost" in run.trouble
    assert "NOT CONFIRMED" in run.trouble


def test_an_expired_deadline_stops_the_machine():
    joined = bench("checked")
    run = joined.run(mopro.compile(SHORT.replace("WT50", "WT50000")), deadline_s=2.0).run
    assert "time allowed is over" in run.trouble
    assert "both axes rest" in run.trouble
    still_at(joined)


@pytest.mark.parametrize(
    ("befalls", "says"),
    [
        (PlantFault("limit", 0.1), "a limit switch opened"),
        (PlantFault("overheated", 0.1), "overheated"),
    ],
)
def test_what_befalls_the_machine_ends_the_run(befalls, says):
    joined = bench("checked", plant=[befalls])
    run = joined.run(PROGRAM).run
    assert says in run.trouble
    assert len(run.moves) == 1
    still_at(joined)


def test_lost_steps_are_in_the_table_and_in_the_measured_position():
    recording = bench("checked", plant=[PlantFault("lost_steps", 0.36, 1, 2)]).run(PROGRAM)
    assert recording.run.stalled
    assert sum(move.lost_pitches for move in recording.run.moves) == 2
    told = {"time_s": None, "line": 7, "axis": 1, "lost_pitches": 2}
    assert recording.header.stalls == recording.run.as_json()["stalls"] == [told]
    lost_m = recording["command_1_m"][-1] - recording["position_1_m"][-1]
    assert lost_m == pytest.approx(2 * load_machine("chow1992").axis.pitch_m, abs=MICROSTEP_M)


def test_a_reset_in_mid_move_is_recognised():
    run = bench("checked", Fault("reset", at_s=1.5, for_s=0.2)).run(
        mopro.compile(SHORT.replace("2.0", "12.0"))
    )
    assert "reset" in run.run.trouble or "greeting" in run.run.trouble


def test_a_limit_switch_is_honoured():
    program = mopro.compile(SHORT.replace("MRI1 2.0", "MRI1 30.0").replace("MRI1 -1", "MRI1 1"))
    joined = bench()
    run = joined.run(program).run
    assert "a limit switch opened" in run.trouble
    reach_u = load_machine("chow1992").travel_u()[1][1]
    overrun_u = 8.0**2 / (2 * 250) * 12500
    at_u = joined.station.device.do("position", {}, 1e3)[0]["position_1"]
    assert reach_u < at_u < reach_u + overrun_u + 8 * 12500 / 2000 + 2


def test_beginning_at_a_line_keeps_what_was_set_before_it():
    resumed = resume(PROGRAM, 6)
    assert resumed.settings == ("UU112500/1", "UU212500/1", "VEL1 8.0", "ACC1 0.25")
    recording = bench().run(resumed.program)
    assert [move.line for move in recording.run.moves] == [7]
    assert recording.run.moves[0].distance == -1.0


def test_a_loop_may_go_back_before_the_line_it_began_at(programs_folder):
    program = compile_file(programs_folder / "TEMP1.CMD")
    resumed = resume(program, 19)
    run = mopro.emulate(resumed.program, for_s=2.5).run
    assert [move.line for move in run.moves] == [19, 16, 19]
    assert mopro.compile(canonical(resumed.program)).loops_forever


def test_a_line_that_no_run_meets_is_refused():
    with pytest.raises(SourceError, match="ever run"):
        resume(PROGRAM, 99)
