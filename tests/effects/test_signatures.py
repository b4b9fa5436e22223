"""Every effect on: a signature of the right sign and size; off: not one bit changes.

Closed forms follow from statics: an axis of stiffness K = k F0 gives F/K to a force F
that is slow against its 83 Hz.
"""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

import mopro
from mopro.effects import catalogue
from mopro.emulator import Emulator
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.plant.drive_scaling import DriveScaling
from mopro.plant.heat import HeatHistory
from mopro.plant.measurement import measure
from mopro.plant.stepped_heat import SteppedHeat

MACHINE = load_machine("chow1992")
K = MACHINE.axis.stiffness_N_m
k = MACHINE.axis.wave_number_1_m
F0 = MACHINE.axis.pull_out_force_N
M = MACHINE.axis.moving_mass_kg
IN = 0.0254
SETUP = "UU012500/1\nVEL0 {vel}\nACC0 {acc}\n"
FORTH_AND_BACK = "MRI1 4.0\nWX1\nWT300\nMRI1 -4.0\nWX1\nWT300\n"


def run(body=FORTH_AND_BACK, vel=15.0, acc=0.1, effects=None, **options):
    program = mopro.compile(SETUP.format(vel=vel, acc=acc) + body)
    return mopro.emulate(program, resolved=False, effects=effects, **options)


def change(name, values, column="position_1_m", **options):
    """Times, and how much the effect adds to the nominal recording."""
    off, on = run(**options), run(effects={name: values}, **options)
    n = min(len(off), len(on))
    return off["time_s"][:n], on[column][:n] - off[column][:n], off


def mean_between(times, values, start, end):
    return float(values[(times >= start) & (times <= end)].mean())


@pytest.fixture(scope="module")
def nominal():
    return run()


@pytest.mark.parametrize("name", catalogue())
def test_at_the_value_where_it_vanishes_an_effect_leaves_the_motion(name, nominal):
    neutral = catalogue()[name].neutral(MACHINE)
    on = run(effects={name: neutral})
    assert np.abs(on["position_1_m"] - nominal["position_1_m"]).max() < 2e-8
    assert np.abs(on["temperature_C"] - nominal["temperature_C"]).max() < 1e-9


def test_switched_off_not_a_bit_changes(nominal):
    """A machine that once had every effect, and has none now, is the nominal one."""
    everything = {name: effect.neutral(MACHINE) for name, effect in catalogue().items()}
    machine = MACHINE.with_effects(everything)
    assert len(Emulator(machine).active) == len(everything)
    again = run(effects={})
    assert nominal.columns.keys() == again.columns.keys()
    for name, values in nominal.columns.items():
        assert np.array_equal(values, again[name]), name


# Cruise of a long move: 15 in/s from 0.15 s to 0.8 s; the corner's ringing has faded.
LONG = "MRI1 12.0\nWX1\n"
LONG_CRUISE = (0.5, 0.78)
CRUISE = (0.2, 0.26)
V = 15 * IN


@pytest.mark.parametrize(
    ("name", "values", "expected_m", "turns"),
    [
        ("viscous_drag", {"b": 9.0}, -9.0 * V / K, True),
        ("quadratic_drag", {"c": 5.0}, -5.0 * V * V / K, True),
        ("coulomb_friction", {"Fc": 6.0}, -6.0 / K, True),
        ("constant_force", {"F_b": 2.0}, 2.0 / K, False),
        ("current_loop_lag", {"tau": 2e-4}, -math.atan(k * V * 2e-4) / k, True),
        ("profile_tick", {"T": 1e-3}, -V * 1e-3, True),
        ("start_delay", {"d": 5e-3}, -V * 5e-3, True),
    ],
)
@pytest.mark.parametrize("direction", [1, -1])
def test_what_lags_in_cruise(name, values, expected_m, turns, direction):
    body = LONG if direction > 0 else LONG.replace("12", "-12")
    times, added, _ = change(name, values, body=body)
    expected = expected_m * (direction if turns else 1)
    assert mean_between(times, added, *LONG_CRUISE) == pytest.approx(expected, rel=3e-3)


def test_static_load_of_ten_newtons():
    """14.5875 µm at F0 = 111 N, from the first sample on: asin(F/F0)/k."""
    _, added, _ = change("constant_force", {"F_b": -10.0}, body="WT20\n")
    assert added == pytest.approx(-14.5875e-6, abs=2e-10)


def test_spring_pulls_in_proportion_to_the_way():
    times, added, off = change("umbilical_spring", {"k_h": 40.0, "x_h": 0.05})
    resting = (times > 0.66) & (times < 0.7)
    x = off["position_1_m"][resting].mean()
    assert added[resting].mean() == pytest.approx(-40.0 * (x - 0.05) / K, rel=0.01)
    assert added[0] == pytest.approx(40.0 * 0.05 / K, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "values", "factor"),
    [("payload_mass", {"dm": 1.0}, 1.0 / M), ("force_constant", {"e": 0.1}, 1 / 1.1 - 1)],
)
def test_what_changes_the_lag_under_acceleration(name, values, factor):
    """Nominal lag m a / K; averaged over whole swings of a long ramp."""
    options = {"vel": 30.0, "acc": 0.05, "body": "MRI1 15.0\nWX1\n"}
    times, added, _ = change(name, values, **options)
    a = 50 * IN
    expected = -factor * M * a / K
    assert mean_between(times, added, 0.3, 0.5) == pytest.approx(expected, rel=0.03)


def test_electrical_damping_sets_the_ring_down():
    on = run(effects={"electrical_damping": {"zeta": 0.01}}, body="MRI1 1.0\nWX1\nWT300\n")
    x = on["position_1_m"] - on["command_1_m"]
    after = on["time_s"] > on.run.moves[0].duration_s
    ring, t = x[after], on["time_s"][after]
    tops = [i for i in range(1, len(ring) - 1) if ring[i - 1] < ring[i] > ring[i + 1]]
    slope = np.polyfit(t[tops], np.log(ring[tops]), 1)[0]
    assert slope == pytest.approx(-0.01 * math.sqrt(K / M), rel=0.05)


def test_force_constant_falls_with_temperature():
    """Hot from a quarter of an hour's standing: the side load moves it further by 1/(1 - α ΔT)."""
    effects = {"constant_force": {"F_b": 5.0}}
    hot = effects | {"force_constant_temperature": {"alpha": 1e-3, "T0": 24.87}}
    on = run(body="WT900000\n", rate_hz=0.1, effects=hot, compiled=True)
    rise = on["temperature_C"][-1] - 24.87
    assert rise > 5
    expected = math.asin(5.0 / (F0 * (1 - 1e-3 * rise))) / k
    assert on["position_1_m"][-1] == pytest.approx(expected, rel=2e-4)


# A slow scan over a few pitches shows what is periodic in the pitch.
SCAN = {"body": "MRI1 0.12\nWX1\n", "vel": 0.1, "acc": 0.001}


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("detent_force", {"Fd": 1.0}, lambda u: -1.0 / K * np.sin(4 * u)),
        ("detent_force", {"Fd": 1.0, "phi": 1.0}, lambda u: -1.0 / K * np.sin(4 * u + 1.0)),
        ("phase_gain_imbalance", {"eps": 0.04}, lambda u: -0.02 / k * np.sin(2 * u)),
        ("quadrature_error", {"phi": 0.02}, lambda u: 0.01 / k * (1 + np.cos(2 * u))),
        (
            "phase_current_offset",
            {"o_a": 0.02, "o_b": 0.01},
            lambda u: (0.01 * np.cos(u) - 0.02 * np.sin(u)) / k,
        ),
        ("current_third_harmonic", {"s": 0.02}, lambda u: 0.02 / k * np.sin(4 * u)),
    ],
)
def test_what_repeats_with_the_pitch(name, values, expected):
    times, added, off = change(name, values, **SCAN)
    inside = (times > 0.4) & (times < 1.0)
    wanted = expected(k * off["command_1_m"][inside])
    error = np.sqrt(np.mean((added[inside] - wanted) ** 2)) / np.sqrt(np.mean(wanted**2))
    assert error < 0.05


def test_presliding_follows_its_exponential():
    """A crawl over 5 µm of command: K (x_c - x) = Fc (1 - exp(-x/delta))."""
    effects = {"coulomb_friction": {"Fc": 10.0, "delta": 1e-5}}
    on = run("MRI1 0.0002\nWX1\n", vel=0.001, acc=0.0001, effects=effects)
    x, command = on["position_1_m"], on["command_1_m"]
    left = K * (command - x) - 10.0 * (1 - np.exp(-x / 1e-5))
    assert np.abs(left).max() < 0.03
    assert 10.0 * (1 - np.exp(-x[-1] / 1e-5)) > 1.5


def test_halving_the_step_leaves_friction_alone():
    effects = {"coulomb_friction": {"Fc": 5.0}}
    coarse, fine = (run(effects=effects, max_step_s=h) for h in (50e-6, 25e-6))
    assert np.abs(coarse["position_1_m"] - fine["position_1_m"]).max() < 2e-8


def test_hold_current_falls_after_the_time_and_heats_less():
    effects = {"constant_force": {"F_b": 5.0}}
    reduced = effects | {"hold_current_reduction": {"h": 0.5, "t_h": 0.2}}
    on = run(body="MRI1 1.0\nWX1\nWT2000\n", effects=reduced)
    off = run(body="MRI1 1.0\nWX1\nWT2000\n", effects=effects)
    end_s = on.run.moves[0].duration_s
    jump = on["position_1_m"] - off["position_1_m"]
    early = (on["time_s"] > end_s + 0.15) & (on["time_s"] < end_s + 0.199)
    assert np.abs(jump[early]).max() < 1e-9
    assert jump[-1] == pytest.approx((math.asin(10 / F0) - math.asin(5 / F0)) / k, rel=1e-3)
    current = np.hypot(on["phase_a_1_A"][-1], on["phase_b_1_A"][-1])
    assert current == pytest.approx(2.0, rel=1e-6)
    # Axis 1 saves for all but the move and 0.2 s; axis 2, which never moves, from 0.2 s on.
    saved_J = 2 * 16 * 2.0 * 0.75 * (2 * 2.0 - 0.2 + end_s - 0.2)
    cooler = off["temperature_C"][-1] - on["temperature_C"][-1]
    assert cooler == pytest.approx(saved_J / (M * 883), rel=0.01)


def test_voltage_limit_lags_above_a_corner_speed_only():
    """Pull-out falls with speed: with ample supply nothing changes, with little it stalls."""
    body = "MRI1 15.0\nWX1\n"
    ample = {"voltage_saturation": {"Vb": 150.0}}
    scarce = {"voltage_saturation": {"Vb": 8.0}}
    fast = {"vel": 40.0, "acc": 0.25, "body": body}
    slow = {"vel": 8.0, "acc": 0.25, "body": "MRI1 4.0\nWX1\n"}
    assert not run(effects=ample, **fast).run.stalled
    assert run(effects=scarce, **fast).run.stalled
    assert not run(effects=scarce, **slow).run.stalled


@pytest.mark.parametrize(("e", "sign"), [(0.2, 1), (-0.2, -1)])
def test_acceleration_scale_grows_with_the_square_of_time(e, sign):
    times, added, _ = change("acceleration_scale", {"e": e})
    assert sign * added[times < 0.12][-1] > 0
    at = np.searchsorted(times, 0.1)
    assert added[at] == pytest.approx(e * 100 * IN * times[at] ** 2 / 2, rel=0.03)


def test_velocity_scale_grows_with_time_in_cruise():
    times, added, _ = change("velocity_scale", {"e": 0.01})
    cruise = (times > 0.2) & (times < 0.26)
    rate = np.polyfit(times[cruise], added[cruise], 1)[0]
    assert rate == pytest.approx(0.01 * V, rel=0.05)


def test_controller_clock_runs_ahead_in_proportion_to_time():
    times, added, off = change("controller_clock", {"e": 1e-3})
    at = (times > 0.9) & (times < 1.1)
    expected = 1e-3 * times[at] * off["velocity_1_m_s"][: len(times)][at]
    assert added[at] == pytest.approx(expected, abs=6e-6)
    assert np.abs(expected).max() > 1e-4


def test_start_delay_once_and_before_each_move():
    once = run(effects={"start_delay": {"d": 0.01}}).run
    each = run(effects={"start_delay": {"d": 0.01, "every_move": 1}}).run
    starts = [[round(m.start_s, 9) for m in r.moves] for r in (run().run, once, each)]
    (a, b), late, later = starts
    assert late == pytest.approx([a + 0.01, b + 0.01])
    assert later == pytest.approx([a + 0.01, b + 0.02])


def test_a_held_tick_is_late_by_half_of_it_and_damps_on_its_own():
    """Between updates the command stands, and the drive damps against it: c_s v / K more."""
    body = {"body": "MRI1 1.0\nWX1\n", "vel": 1.0, "acc": 0.01}
    times, added, _ = change("profile_tick", {"T": 1e-3, "interpolate": 0}, **body)
    expected = -IN * (0.5e-3 + MACHINE.axis.drive_damping_N_s_m / K)
    assert mean_between(times, added, 0.5, 0.8) == pytest.approx(expected, rel=0.05)


def test_lost_steps_stay_and_are_reported():
    times, added, off = change("lost_steps", {"n": 3, "move": 1})
    middle = off.run.moves[0].duration_s / 2
    assert np.abs(added[times < middle - 1e-3]).max() == 0
    assert added[-1] == pytest.approx(-3 * 1.016e-3, abs=1e-8)
    moves = run(effects={"lost_steps": {"n": 3}}).run.moves
    assert [m.lost_pitches for m in moves] == [3, 0]


# -- measurement: what the sensor shows, the true position untouched ----------------


def seen(effects, sensor=None, body=FORTH_AND_BACK, **options):
    recording = run(body, effects=effects, **options)
    active = Emulator(MACHINE, effects=effects).active
    sensor = sensor or Sensor("laser", POSITION, "position_1_m", 2000.0)
    times, reading = measure(recording, sensor, MACHINE, active)
    return times, reading, recording


STEEL = 11.35e-6


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("pitch_scale", {"e": 3e-4}, lambda t, x, v: 3e-4 * x),
        ("platen_expansion", {"dT": 20.0}, lambda t, x, v: STEEL * 20.0 * x),
        ("sensor_gain", {"g": -2e-3}, lambda t, x, v: -2e-3 * x),
        ("sensor_offset", {"o": 1e-4}, lambda t, x, v: 1e-4 + 0 * x),
        (
            "sensor_nonlinearity",
            {"c3": 0.0025, "c5": 0.001, "mid": 0.02},
            lambda t, x, v: (
                0.508 * (0.0025 * ((x - 0.02) / 0.254) ** 3 + 0.001 * ((x - 0.02) / 0.254) ** 5)
            ),
        ),
        (
            "periodic_error",
            {"A": 5e-6, "lambda": 0.002, "phi": 0.3},
            lambda t, x, v: 5e-6 * np.sin(2 * np.pi * x / 0.002 + 0.3),
        ),
        ("sensor_bandwidth", {"f_c": 100.0}, lambda t, x, v: -v / (2 * np.pi * 100.0)),
        ("trigger_delay", {"t_d": 2e-3}, lambda t, x, v: -v * 2e-3),
        ("sample_clock", {"e": 1e-3}, lambda t, x, v: 1e-3 * t * v),
        (
            "hum",
            {"A": 1e-4, "f": 50.0, "phi": 0.5},
            lambda t, x, v: 1e-4 * np.sin(2 * np.pi * 50 * t + 0.5),
        ),
    ],
)
def test_what_a_sensor_adds(name, values, expected, nominal):
    times, reading, truth = seen({name: values})
    assert np.array_equal(truth["position_1_m"], nominal["position_1_m"])
    added = reading - nominal["position_1_m"]
    wanted = expected(times, nominal["position_1_m"], nominal["velocity_1_m_s"])
    cruise = (times > 0.2) & (times < 0.26)
    tolerance = 0.02 * np.abs(wanted[cruise]).max()
    assert added[cruise] == pytest.approx(wanted[cruise], abs=tolerance)


def test_backlash_shows_at_reversal():
    times, reading, truth = seen({"backlash": {"B": 5e-5}})
    added = reading - truth["position_1_m"]
    assert mean_between(times, added, *CRUISE) == pytest.approx(-2.5e-5, rel=1e-6)
    assert mean_between(times, added, 1.016, 1.076) == pytest.approx(2.5e-5, rel=1e-6)


def test_cross_axis_coupling_shows_on_the_other_axis():
    sensor = Sensor("laser", POSITION, "position_2_m", 2000.0, axis=2)
    _, reading, truth = seen({"cross_axis_coupling": {"gamma": 5e-4}}, sensor)
    assert reading == pytest.approx(5e-4 * truth["position_1_m"], abs=1e-12)


def test_noise_and_the_converters_step_are_those_of_the_sensor(nominal):
    sensor = Sensor("lvdt", POSITION, "position_1_in", 800.0, noise_rms=0.025, adc_step=0.004883)
    generator = np.random.default_rng(7)
    times, reading = measure(nominal, sensor, MACHINE, (), generator)
    true_in = np.interp(times, nominal["time_s"], nominal["position_1_m"]) / IN
    assert np.std(reading - true_in) == pytest.approx(0.025, rel=0.1)
    assert reading / 0.004883 == pytest.approx(np.rint(reading / 0.004883), abs=1e-6)


# -- heat -----------------------------------------------------------------------------

HOUR_S = 1800.0
TIMES = np.arange(0.0, HOUR_S, 2.0)
CAPACITY = M * 883
AIR = 24.87


@pytest.fixture(scope="module")
def schedule():
    body = ":B1\nMRI1 8.0\nWX1\nMRI1 -8.0\nWX1\nJUMP B1\n"
    return plan(mopro.compile(SETUP.format(vel=24.0, acc=0.25) + body), HOUR_S)


@pytest.fixture(scope="module")
def unheated(schedule):
    return HeatHistory(MACHINE, schedule.moves).temperature_C(TIMES)


def heated(schedule, effects):
    active = Emulator(MACHINE, effects=effects).active
    full = {1: DriveScaling.full(), 2: DriveScaling.full()}
    return SteppedHeat(MACHINE, schedule.moves, active, full, HOUR_S).temperature_C(TIMES)


def early_W(unheated, temperature):
    """Heat (W) added before anything has warmed up: C dT/dt over the first ten seconds."""
    return (temperature - unheated)[5] / TIMES[5] * CAPACITY


def test_without_effects_the_stepped_solution_is_the_exact_one(schedule, unheated):
    assert heated(schedule, {}) == pytest.approx(unheated, abs=1e-6)


def test_speed_dependent_heat_adds_its_watts(schedule, unheated):
    on = heated(schedule, {"speed_dependent_heat": {"kh": 0.05, "ke": 1e-5}})
    f = 24 * IN / 1.016e-3
    assert early_W(unheated, on) == pytest.approx(0.05 * f + 1e-5 * f * f, rel=0.01)


def closed_form(power_W, conductance_W_K):
    rate = conductance_W_K / CAPACITY
    return AIR + power_W / conductance_W_K * (1 - math.exp(-rate * TIMES[-1]))


POWER = (4 * 16 + 1) * 2.0
FILM = POWER / 59.0410  # Table 3.2, row 8: final rise of this motion


@pytest.mark.parametrize(
    ("name", "values", "conductance"),
    [
        ("platen_conduction", {"G": 4.0, "g": 10.0}, FILM + 4.0 + 10.0 * 8 * IN),
        ("convection_scale", {"e": 1.0}, 2 * FILM),
        ("convection_scale", {"e": -0.5}, 0.5 * FILM),
    ],
)
def test_ways_out_of_the_forcer_change_peak_and_time_constant(schedule, name, values, conductance):
    on = heated(schedule, {name: values})
    assert on[-1] == pytest.approx(closed_form(POWER, conductance), abs=0.02)


def test_copper_heats_more_as_it_warms(schedule):
    """P (1 + α ΔT) - hA ΔT: as a smaller conductance hA - α P."""
    on = heated(schedule, {"resistance_tempco": {"T0": AIR}})
    assert on[-1] == pytest.approx(closed_form(POWER, FILM - 0.00393 * POWER), abs=0.02)


def test_radiation_is_stefan_boltzmanns_law(schedule):
    """Heat balance over the run, from the temperature itself."""
    on = heated(schedule, {"radiation": {"eps": 0.5}})
    hot = on + 273.15
    radiated = 0.5 * 5.670374e-8 * (0.05148 + 0.0316) * (hot**4 - (AIR + 273.15) ** 4)
    net = POWER - FILM * (on - AIR) - radiated
    gained = CAPACITY * (on[-1] - on[0])
    assert gained == pytest.approx(trapezoid(net, TIMES), rel=1e-3)
    assert trapezoid(radiated, TIMES) > 0.005 * gained


@pytest.mark.parametrize("r", [5e-4, -5e-4])
def test_ambient_drift_is_followed(schedule, unheated, r):
    """A first-order body follows a ramp: r (t - τ (1 - exp(-t/τ)))."""
    added = heated(schedule, {"ambient_drift": {"r": r}})[-1] - unheated[-1]
    tau, t = CAPACITY / FILM, TIMES[-1]
    assert added == pytest.approx(r * (t - tau * (1 - math.exp(-t / tau))), rel=1e-3)


def test_thermocouple_lags_the_true_temperature():
    recording = run("WT600000\n", rate_hz=0.5)
    sensor = Sensor("tc", TEMPERATURE, "temperature_C", 0.5)
    active = Emulator(MACHINE, effects={"thermocouple_lag": {"tau": 20.0}}).active
    _, reading = measure(recording, sensor, MACHINE, active)
    true = recording["temperature_C"]
    rate = (true[101] - true[99]) / 4.0
    assert reading[100] - true[100] == pytest.approx(-20.0 * rate, rel=0.02)
