"""The emulator against an integrator that shares no code with it."""

import numpy as np
import pytest

import mopro
from helpers import reference_axis as reference
from mopro.program.compile import compile_file

UM, NM = 1e-6, 1e-9
INCH = reference.INCH


@pytest.fixture(scope="module")
def lvdt3(programs_folder):
    return compile_file(programs_folder / "LVDT3.CMD")


@pytest.fixture(scope="module")
def forth():
    return reference.SmoothMove(15 * INCH, 40 * INCH, 600 * INCH)


def test_smooth_command_over_all_of_lvdt3(lvdt3, forth):
    """Bound of the issue: 0.1 µm. Reached: 0.03 nm in motion, 1 nm where rest is declared."""
    back = reference.SmoothMove(-15 * INCH, 40 * INCH, 600 * INCH)
    command = reference.Stepwise((0.0, forth), (forth.duration + 2.0, back))
    recording = mopro.emulate(lvdt3, resolved=False)
    times = recording["time_s"]
    exact, _ = reference.smooth_response(command, [0.0, 0.0], np.append(times, command.duration))
    assert recording.run.duration_s == pytest.approx(command.duration, abs=1e-9)
    assert np.abs(recording["position_1_m"] - exact[:-1]).max() < NM
    assert not recording["position_2_m"].any()


def test_the_command_of_the_reference_is_the_same_at_one_time_and_at_many(forth):
    times = np.linspace(0.0, 1.1 * forth.duration, 1001)
    assert forth.xs(times) == pytest.approx([forth.x(t) for t in times], rel=1e-14)


def test_microsteps_over_a_move_of_lvdt3_and_its_ring_down(lvdt3, forth):
    """187,500 microsteps met one by one. Bound of the issue: 1 µm. Stated here: 10 nm."""
    recording = mopro.emulate(lvdt3, for_s=forth.duration + 0.05)
    exact = reference.stepped_response(forth, recording["time_s"])
    assert np.abs(recording["position_1_m"] - exact).max() < 10 * NM


def test_slow_microsteps_shake_the_motor_as_they_do_the_reference():
    """82 microsteps a second, at the natural frequency, where steps are felt most."""
    program = mopro.compile("UU012500/1\nVEL1 0.00656\nACC1 0.01\nPARA1+\nMRI1 0.004\nWX1\n")
    recording = mopro.emulate(program)
    command = reference.SmoothMove(0.004 * INCH, 0.00656 * INCH, 10 * INCH)
    exact = reference.stepped_response(command, recording["time_s"])
    smooth, _ = reference.smooth_response(command, [0.0, 0.0], recording["time_s"])
    assert np.abs(recording["position_1_m"] - exact).max() < 10 * NM
    assert np.abs(smooth - exact).max() > 2 * UM


@pytest.mark.parametrize("payload_kg", [0.0, 2.26796])
def test_payload_adds_mass_and_leaves_the_drive_as_it_is(lvdt3, forth, payload_kg):
    recording = mopro.emulate(lvdt3, resolved=False, payload_kg=payload_kg, for_s=forth.duration)
    exact, _ = reference.smooth_response(
        forth, [0.0, 0.0], recording["time_s"], reference.MASS + payload_kg
    )
    assert np.abs(recording["position_1_m"] - exact).max() < NM


def test_half_the_step_changes_nothing_a_sensor_could_see(lvdt3):
    coarse, fine = (mopro.emulate(lvdt3, max_step_s=dt) for dt in (50e-6, 25e-6))
    assert np.abs(coarse["position_1_m"] - fine["position_1_m"]).max() < 2 * NM
