"""The full electrical drive, two forcers an axis, trips, and the platen's elongation."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

import mopro
from mopro.machine import load_machine
from mopro.machine.model import Forcers
from mopro.plant.platen import elongation_m

MACHINE = load_machine("chow1992")
FULL = replace(MACHINE, drive=replace(MACHINE.drive, model="full"))
SETUP = "UU012500/1\nVEL0 {vel}\nACC0 {acc}\n"
R, L = 2.0, 2e-3
WAVE_NUMBER = 2 * math.pi / MACHINE.axis.pitch_m


def run(body, machine=MACHINE, vel=40.0, acc=0.25, **options):
    return mopro.emulate(mopro.compile(SETUP.format(vel=vel, acc=acc) + body), machine, **options)


def test_energy_in_is_heat_and_field_and_work():
    """∫v·i = ∫R i² + change of ½L i² + ∫F ẋ over a move that saturates the supply."""
    on = run("MRI1 8.0\nWX1\n", FULL, rate_hz=1e5, resolved=False, compiled=True)
    t, force, speed = on["time_s"], on["force_1_N"], on["velocity_1_m_s"]
    phases = [(on[f"phase_{n}_1_A"], on[f"voltage_{n}_1_V"]) for n in "ab"]
    assert max(np.abs(v).max() for _, v in phases) == 75.0
    into = sum(trapezoid(v * i, t) for i, v in phases)
    heat = sum(trapezoid(R * i * i, t) for i, _ in phases)
    field = sum(L / 2 * (i[-1] ** 2 - i[0] ** 2) for i, _ in phases)
    work = trapezoid(force * speed, t)
    assert into == pytest.approx(heat + field + work, rel=1e-4)
    braked = np.abs(trapezoid(np.abs(force * speed), t))
    assert braked > 1.0


def test_locked_rotor_current_settles_at_v_over_r():
    """A drive that may not give enough: i → V/R with τ = L/R, heat I²R."""
    heavy = replace(FULL, drive=replace(FULL.drive, phase_current_A=1000.0))
    effects = {"voltage_saturation": {"Vb": 8.0}, "payload_mass": {"dm": 50.0}}
    on = run("WT20\n", heavy, rate_hz=1e4, effects=effects)
    assert on["phase_a_1_A"][-1] == pytest.approx(8.0 / R, rel=1e-3)
    assert R * on["phase_a_1_A"][-1] ** 2 == pytest.approx(32.0, rel=2e-3)
    assert on["phase_b_1_A"][-1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("loop", [{"current_loop_lag": {"tau": 2e-4}}, {"voltage_saturation": {}}])
@pytest.mark.parametrize(
    ("setpoints", "angle"),
    [
        ({"phase_current_offset": {"o_a": 0.01, "o_b": 0.02}}, math.atan2(0.02, 1.01)),
        ({"phase_gain_imbalance": {"eps": 0.05}}, 0.0),
        ({"quadrature_error": {"phi": 0.03}}, None),
    ],
)
def test_a_run_begins_at_rest_where_the_distorted_currents_hold_the_axis(loop, setpoints, angle):
    at_rest = run("WT40\n", rate_hz=2e3, effects=loop | setpoints)
    place = at_rest["position_1_m"]
    assert np.ptp(place) < 1e-12
    assert np.abs(at_rest["velocity_1_m_s"]).max() < 1e-9
    without = run("WT40\n", rate_hz=2e3, effects=setpoints)["position_1_m"]
    assert place[0] == pytest.approx(without[0], abs=1e-12)
    if angle is not None:
        assert place[0] == pytest.approx(angle / WAVE_NUMBER, abs=1e-11)


def test_equal_forcers_do_not_turn_the_motor_and_a_weak_one_does():
    body = "MRI1 4.0\nWX1\n"
    equal = run(body, replace(MACHINE, forcers=Forcers()))
    assert np.abs(equal["yaw_rad"]).max() == 0.0
    weak = run(body, replace(MACHINE, forcers=Forcers(strength_2=0.8)))
    assert np.abs(weak["yaw_rad"]).max() > 1e-5
    # Under even acceleration: arm k ψ (1.8 cos ke + 2 cos 0·...) balances 0.2 sin ke.
    early = (weak["time_s"] > 0.05) & (weak["time_s"] < 0.15)
    assert weak["yaw_rad"][early].mean() > 0
    late = (weak["time_s"] > 0.2) & (weak["time_s"] < 0.25)
    assert weak["yaw_rad"][late].mean() < 0
    assert np.ptp(weak["position_1_m"] - equal["position_1_m"]) > 1e-6


class TestTrips:
    def test_a_limit_switch_brakes_and_gives_the_program_up(self):
        on = run("MRI2 31.0\nWX2\nMRI1 1.0\nWX1\n")
        trip = on.run.trip
        assert (trip["kind"], trip["axis"], trip["line"]) == ("limit-switch", 2, 4)
        assert not on.run.complete
        assert [m.line for m in on.run.moves] == [4]
        assert not on.run.moves[0].complete
        before = on["command_2_m"][on["time_s"] <= trip["time_s"]]
        assert before[-1] == pytest.approx(0.762, abs=2e-3)
        assert np.ptp(on["command_2_m"][-200:]) == 0

    def test_no_line_runs_after_a_trip(self):
        """The motion of line 6 would have begun while axis 2 brakes."""
        on = run("MRI2 31.0\nWT900\nMRI1 1.0\nWX0\n")
        assert on.run.trip["time_s"] < 0.9 < on["time_s"][-1]
        assert set(on["line"].tolist()) == {4}
        assert np.ptp(on["command_1_m"]) == 0

    def test_axes_that_move_together_brake_along_their_path(self):
        on = run("MR1 8.0\nMR2 32.0\nGO\nWX0\n")
        assert on.run.trip["axis"] == 2
        stray = on["command_1_m"] - on["command_2_m"] / 4
        assert np.abs(stray).max() < 1.5 * MACHINE.microstep_m

    def test_beyond_the_switch_there_is_an_edge(self):
        """At 40 in/s the brake takes 3.2 in: the forcer meets its stop and loses pitches."""
        on = run("MRI2 36.0\nWX2\n")
        stop = 0.762 + MACHINE.limits.overtravel_m
        assert stop < on["position_2_m"].max() < stop + 2e-3
        assert on["command_2_m"][-1] > stop + 0.05
        assert on.run.moves[0].lost_pitches > 50

    def test_a_stroke_that_fits_is_placed_where_it_fits(self):
        assert run("MRI2 -29.9\nWX2\n").run.trip is None
        assert run("MRI2 10.0\nWX2\nMRI2 -25.0\nWX2\n").run.trip is None

    def test_too_much_heat_switches_the_current_off(self):
        rated = replace(MACHINE, heat=replace(MACHINE.heat, rated_C=25.5))
        on = run(":B1\nMRI1 4.0\nWX1\nMRI1 -4.0\nWX1\nJUMP B1\n", rated, for_s=30.0)
        trip = on.run.trip
        assert trip["kind"] == "over-temperature"
        assert on["temperature_C"].max() == pytest.approx(25.5, abs=0.1)
        off = on["time_s"] > trip["time_s"] + 1e-3
        assert off.sum() > 100
        for column in ("phase_a_1_A", "phase_b_1_A", "force_1_N"):
            assert np.abs(on[column][off]).max() == 0.0
            assert np.abs(on[column][~off]).max() > 1.0
        assert on["temperature_C"][-1] < on["temperature_C"].max()
        assert not on.run.complete


def test_elongation_along_one_axis_and_on_a_diagonal():
    rise, alpha = 30.0, 9.9e-6
    along = elongation_m(MACHINE, rise, (0.0, 0.4064))["low"]
    assert along == pytest.approx((alpha * rise * 0.1778, alpha * rise * 0.4064))
    steep = elongation_m(MACHINE, rise, (0.2, 0.2 * math.sqrt(3)))["low"]
    tan60 = math.sqrt(3)
    expected = (alpha * rise * 0.1778 * (1 + 1 / tan60), alpha * rise * 0.1778 * (1 + tan60))
    assert steep == pytest.approx(expected)


def test_a_run_reports_the_platens_elongation():
    body = "MR1 4.0\nMR2 4.0\nGO\nWX1\nWX2\nWT1000\n"
    platen = run(body).run.as_json()["platen"]
    x, y = platen["elongation_high_m"]
    assert x == pytest.approx(y)
    assert x == pytest.approx(12.8e-6 * platen["rise_K"] * 2 * 0.1778)
