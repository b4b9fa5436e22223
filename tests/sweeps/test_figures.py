"""The figures of a run are those of the run itself, as the emulator records it."""

import math
from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.paths import PROGRAMS
from mopro.machine import load_machine
from mopro.plant import SETTLED_M
from mopro.sweeps.figures import figures_of
from mopro.sweeps.targets import Variant

MACHINE = load_machine("chow1992")
LVDT3 = mopro.compile_file(PROGRAMS / "LVDT3.CMD")
MOVE = "UU012500/1\nVEL1 {v}\nACC1 {a}\nMRI1 {d}\nWX1\nWT300\n"
STIFF = replace(MACHINE.axis, pull_out_force_N=1e8)
HEAT = {"platen_conduction": {"G": 5.0}}


def figures(program, machine=MACHINE, payload_kg=0.0, for_s=None, compiled=None):
    return figures_of(Variant(program, machine, payload_kg), for_s, compiled)


def settled_after_s(recording, move):
    """Time from the end of `move` from which the samples of axis 1 stay close to the command."""
    time_s = recording["time_s"]
    lag = np.abs(recording["command_1_m"] - recording["position_1_m"])
    later = time_s > move.start_s + move.duration_s
    away = time_s[later & (lag > SETTLED_M)]
    return away[-1] - move.start_s - move.duration_s


@pytest.mark.parametrize(
    ("program", "payload_kg", "effects"),
    [
        (LVDT3, 0.0, {}),
        (LVDT3, 2.0, {"viscous_drag": {"b": 5.0}}),
        (mopro.compile(MOVE.format(v=30, a=3, d=5)), 0.0, {}),
        (mopro.compile(MOVE.format(v=40, a=0.5, d=60)), 0.0, {}),
    ],
    ids=["LVDT3", "with drag", "stalls", "leaves the platen"],
)
def test_a_row_is_what_a_run_tells(program, payload_kg, effects):
    machine = MACHINE.with_effects(effects)
    run = mopro.emulate(program, machine, payload_kg=payload_kg, settle_s=0.5).run
    found = figures(program, machine, payload_kg)
    inch_m = 0.0254
    assert found.time_s == run.duration_s
    assert found.force_margin == min(move.stall_margin for move in run.moves)
    assert found.largest_lag_m == pytest.approx(inch_m * max(move.max_lag for move in run.moves))
    assert found.lost_pitches == max((move.lost_pitches for move in run.moves), key=abs)
    first = run.stalls[0] if run.stalls else None
    assert (found.stall_s, found.stall_line) == (first and first.time_s, first and first.line)
    assert (found.outcome == "ok") == (not run.stalls and run.trip is None)


def test_compiled_and_plain_rows_have_the_same_bits():
    assert figures(LVDT3, compiled=True) == figures(LVDT3, compiled=False)


def test_settling_is_that_of_the_recording():
    program = mopro.compile(MOVE.format(v=30, a=0.5, d=4))
    recording = mopro.emulate(program, settle_s=0.5)
    (move,) = recording.run.moves
    assert figures(program).settling_s == pytest.approx(settled_after_s(recording, move), abs=1e-3)


def test_a_move_that_the_next_one_follows_too_soon_does_not_settle():
    close = "UU012500/1\nVEL1 30\nACC1 0.5\nMRI1 4\nWX1\nMRI1 -4\nWX1\n"
    assert figures(mopro.compile(close)).settling_s is None
    apart = close.replace("WX1\nMRI1 -4", "WX1\nWT900\nMRI1 -4")
    assert figures(mopro.compile(apart)).settling_s is not None


def test_what_ends_a_run_is_told():
    stalled = figures(mopro.compile(MOVE.format(v=30, a=3, d=5)))
    assert stalled.outcome == "stalled"
    assert stalled.why.startswith("axis 1 lost ")
    assert stalled.why.endswith("pitches at line 4")
    tripped = figures(mopro.compile(MOVE.format(v=40, a=0.5, d=60)))
    assert (tripped.outcome, tripped.why) == ("tripped", "limit-switch of axis 1 at line 4")


@pytest.mark.parametrize(
    ("text", "machine", "why"),
    [
        ("UU012500/1\nACC1 1\nMRI1 1\nWX1\n", MACHINE, "line 3: axis 1 has no velocity"),
        (MOVE.format(v=9, a=1, d=1), MACHINE.with_parameter("viscous_drag", "b", -1e9), "b = -1e"),
        (MOVE.format(v=9, a=1, d=1), replace(MACHINE, axis=STIFF), "too fast for the emulator"),
    ],
    ids=["no motion", "no effect", "too stiff"],
)
def test_a_run_that_is_not_to_be_had_is_a_row_that_says_why(text, machine, why):
    found = figures(mopro.compile(text), machine)
    assert found.outcome == "refused"
    assert why in found.why
    assert found.time_s is found.force_margin is None


def test_the_energy_is_that_of_the_coils():
    """Eq. 3.12: four pairs at rest, and the moving one's current, over the times of LVDT3."""
    run = mopro.emulate(LVDT3).run
    moving_s = sum(move.duration_s for move in run.moves)
    drive, more_A = MACHINE.drive, MACHINE.heat.moving_current_A
    at_rest_W = 4 * drive.phase_current_A**2 * drive.coil_resistance_ohm
    moving_W = more_A**2 * drive.coil_resistance_ohm
    expected_J = at_rest_W * run.duration_s + moving_W * moving_s
    assert figures(LVDT3).coil_energy_J == pytest.approx(expected_J, rel=1e-12)


def test_half_the_current_at_rest_is_a_quarter_of_the_heat():
    held = MACHINE.with_effects({"hold_current_reduction": {"h": 0.5, "t_h": 0.0}})
    rest = "UU012500/1\nVEL1 30\nACC1 0.5\nMRI1 0.5\nWX1\nWT9000\n"
    full, half = (figures(mopro.compile(rest), m).coil_energy_J for m in (MACHINE, held))
    assert half / full == pytest.approx(1 / 4, abs=0.02)


def test_temperatures_are_told_of_a_machine_with_an_effect_on_heat():
    plain, warm = figures(LVDT3), figures(LVDT3, MACHINE.with_effects(HEAT))
    assert plain.end_temperature_C is plain.hour_temperature_C is None
    recorded = mopro.emulate(LVDT3, MACHINE.with_effects(HEAT))["temperature_C"]
    assert warm.end_temperature_C == pytest.approx(recorded[-1], abs=1e-4)
    assert warm.hour_temperature_C > warm.end_temperature_C + 1


def test_an_hour_of_runs_is_as_warm_as_an_hour_of_the_loop():
    machine = MACHINE.with_effects(HEAT)
    once = "UU012500/1\nVEL1 30\nACC1 0.5\nMRI1 4\nWX1\nMRI1 -4\nWX1\nWT4000\n"
    text = once.replace("MRI1 4", ":A\nMRI1 4") + "JUMP A\n"
    looped = figures(mopro.compile(text), machine, for_s=1.0)
    repeated = figures(mopro.compile(once), machine)
    assert repeated.hour_temperature_C == pytest.approx(looped.hour_temperature_C, abs=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "UU012500/1\nVEL1 1\nACC1 100\nMRI1 0.0001\nWX1\n",
        ":A\nWT1\nJUMP A\n",
    ],
    ids=["moves", "statements"],
)
def test_more_than_an_hour_may_have_gives_no_temperature(text):
    found = figures(mopro.compile(text), MACHINE.with_effects(HEAT), for_s=1.0)
    assert found.hour_temperature_C is None
    assert math.isfinite(found.end_temperature_C)
