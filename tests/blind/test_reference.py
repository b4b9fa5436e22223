"""The reference plant against closed forms, tighter tolerances and SciPy's own solver."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from mopro.blind.reference import axis, equation, heat
from mopro.blind.reference.listing import timeline
from mopro.blind.reference.motor import INCH_M
from mopro.blind.reference.motor import THESIS as n
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument

LASER = Instrument("laser", "position", 1, "position_1_in", INCH_M, 2000.0, 2e-5, 0.0)
MOVE = "UU012500/1\nVEL1 20.0\nACC1 0.25\nMRI1 4.0\nWX1\nWT300\nMRI1 -4.0\nWX1\nWT300\n"
STILL = np.array([[0.0, 10.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0]])

# Effects whose equations differ from the nominal one in kind.
HIDDEN = [
    {},
    {"coulomb_friction": {"Fc": 5.0, "delta": 3e-6}},
    {"current_loop_lag": {"tau": 1e-4}},
    {"voltage_saturation": {"Vb": 45.0}},
    {"detent_force": {"Fd": 8.0, "phi": 1.0}, "quadratic_drag": {"c": 5.0}},
    {"current_third_harmonic": {"s": 0.04}, "phase_gain_imbalance": {"eps": 0.1}},
    {"stribeck_friction": {"Fc": 3.0, "Fs": 6.0, "vs": 0.05, "delta": 3e-6}},
    {"load_dependent_friction": {"mu": 0.2, "delta": 3e-6}},
    {"umbilical_spring": {"k_h": 40.0, "x_h": 0.1}, "viscous_drag": {"b": 9.0}},
]


def swing(amplitude_m, damping=0.0):
    """Zero crossings' frequency of a free swing from rest at `amplitude_m`."""
    numbers = axis.numbers({"electrical_damping": {"zeta": damping}})
    times = np.arange(0.0, 1.0, 1e-5)
    out = np.empty((len(times), 4))
    start = np.array([amplitude_m, 0.0, 0.0, 1.0, 0.0])
    equation.response(times, STILL, numbers, start, equation.TOLERANCE, out)
    x = out[:, 0]
    up = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings = times[up] - x[up] * 1e-5 / (x[up + 1] - x[up])
    return (len(crossings) - 1) / (crossings[-1] - crossings[0])


def test_a_pendulum_s_frequencies():
    assert swing(1e-8) == pytest.approx(82.6895, abs=1e-3)
    assert swing(0.2e-3) == pytest.approx(74.8364, abs=1e-3)
    assert swing(0.4e-3) == pytest.approx(51.0491, abs=1e-3)
    small = math.sqrt(n.wave_1_m * n.force_N / n.mass_kg) / (2 * math.pi)
    period = 2 / math.pi * ellipk(math.sin(n.wave_1_m * 0.3e-3 / 2) ** 2) / small
    assert swing(0.3e-3) == pytest.approx(1 / period, abs=1e-3)


def test_ten_newtons_push_it_aside_by_the_arcsine():
    numbers = axis.numbers({"constant_force": {"F_b": 10.0}})
    assert axis.equilibrium(STILL[0], numbers)[0] == pytest.approx(14.5875e-6, abs=1e-10)


@pytest.mark.parametrize(("acceleration", "lag_um"), [(250, 23.6), (600, 57.6)])
def test_lag_under_even_acceleration(acceleration, lag_um):
    a = acceleration * INCH_M
    row = np.array([[0.0, 2.0, 0.0, 0.0, a, 0.0, 1.0, 1.0, 1.0, 0.0]])
    numbers = axis.numbers({"force_constant": {"e": 111.2 / 111.0 - 1}})
    times = np.array([1.2])
    ((x, *_, command),) = axis.axis_response(times, row, numbers)
    assert (command - x) * 1e6 == pytest.approx(lag_um, abs=0.05)
    exact = math.asin(n.mass_kg * a / 111.2) / n.wave_1_m
    assert command - x == pytest.approx(exact, abs=1e-10)


@pytest.mark.parametrize("zeta", [0.01, 0.03])
def test_a_ring_down_has_the_set_damping(zeta):
    numbers = axis.numbers({"electrical_damping": {"zeta": zeta}})
    times = np.arange(0.0, 0.5, 1e-5)
    out = np.empty((len(times), 4))
    start = np.array([1e-8, 0.0, 0.0, 1.0, 0.0])
    equation.response(times, STILL, numbers, start, equation.TOLERANCE / 1e4, out)
    x = out[:, 0]
    peaks = np.flatnonzero((x[1:-1] > x[:-2]) & (x[1:-1] > x[2:])) + 1
    decrement = np.log(x[peaks[0]] / x[peaks[10]]) / 10
    damping = decrement / math.hypot(2 * math.pi, decrement)
    assert damping == pytest.approx(zeta, rel=2e-3)


def test_current_lag_turns_the_angle_by_its_arctangent():
    speed, tau = 0.05, 1e-4
    row = np.array([[0.0, 2.0, 0.0, speed, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0]])
    ((x, *_, command),) = axis.axis_response(
        np.array([1.5]), row, axis.numbers({"current_loop_lag": {"tau": tau}})
    )
    angle = math.atan(n.wave_1_m * speed * tau)
    assert command - x == pytest.approx(angle / n.wave_1_m, rel=1e-6)


@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda h: "+".join(h) or "nominal")
def test_tighter_tolerances_change_nothing_that_a_sensor_could_see(hidden):
    command = axis.rows(timeline(MOVE), 1, hidden)
    numbers, times = axis.numbers(hidden), np.arange(0, 1.2, 5e-4)
    usual = axis.axis_response(times, command, numbers)[:, 0]
    fine = axis.axis_response(times, command, numbers, equation.TOLERANCE / 100)[:, 0]
    assert np.abs(usual - fine).max() < 1e-9


@pytest.mark.parametrize("hidden", HIDDEN[:5], ids=lambda h: "+".join(h) or "nominal")
def test_scipy_s_own_solver_agrees(hidden):
    command = axis.rows(timeline(MOVE), 1, hidden)
    numbers, times = axis.numbers(hidden), np.arange(0, 0.12, 1e-3)
    ours = axis.axis_response(times, command, numbers)[:, 0]
    row = command[0]
    assert row[equation.T1] < times[-1]

    def slope(t, y):
        rate = np.empty(equation.PLAIN_STATES)
        at = int(np.searchsorted(command[:, equation.T0], t, side="right")) - 1
        equation.slope(t, y, command[max(at, 0)], numbers, rate)
        return rate

    state, found = axis.equilibrium(row, numbers), []
    ends = [*command[:, equation.T1][command[:, equation.T1] < times[-1]], times[-1]]
    start = 0.0
    for end in ends:
        inside = times[(times >= start) & (times < end)]
        leg = solve_ivp(slope, (start, end - 1e-13), state, method="LSODA", rtol=1e-10,
                        atol=1e-13, t_eval=np.append(inside, end - 1e-13))  # fmt: skip
        found.append(leg.y[0, :-1])
        state, start = leg.y[:, -1], end
    assert np.abs(np.concatenate(found) - ours[:-1]).max() < 2e-9


def steady_rise_K(text):
    """The final temperature above the air if the program's first 10 ms lasted (eq. 3.26)."""
    (piece,) = heat.heat_intervals(timeline(text), 0.01, {})
    return piece.coil_W / piece.loss_W_K


@pytest.mark.parametrize(
    ("speeds", "distances", "printed"),
    [
        ((0, 0), (0, 0), 76.5517),
        ((3.5, 0), (16, 0), 47.3386),
        ((15, 0), (16, 0), 43.5173),
        ((24, 24), (8, 8), 48.5993),
        ((24, 0), (8, 0), 59.0410),
    ],
)
def test_the_theory_column_of_table_3_2(speeds, distances, printed):
    program = "UU012500/1\n" + "".join(
        f"VEL{axis} {speed}\nACC{axis} 10\nMRI{axis} {distance}\n"
        for axis, speed, distance in zip((1, 2), speeds, distances, strict=True)
        if distance
    )
    rise = steady_rise_K(program + "WT100\n")
    assert rise == pytest.approx(printed, rel=5e-4)


def test_a_warming_at_rest_is_an_exponential():
    times = np.linspace(0, 3600, 50)
    rise = steady_rise_K("UU012500/1\nWT100\n")
    rate = heat.convection_W_K(0.0, n.side_m) / n.capacity_J_K
    found = heat.temperature_C(timeline("UU012500/1\nWT9000000\n"), times, {})
    assert found == pytest.approx(n.air_C + rise * (1 - np.exp(-rate * times)), abs=1e-6)


def test_samples_are_taken_late_by_the_trigger_s_delay():
    generator = np.random.default_rng(0)
    _, (usual,) = ReferencePlant({}).readings(ProgramRun(MOVE), [LASER], generator)
    late = ReferencePlant({"trigger_delay": {"t_d": 2e-3}})
    _, (shifted,) = late.readings(ProgramRun(MOVE), [LASER], generator)
    assert shifted[4:] == pytest.approx(usual[:-4], abs=1e-9)
    assert shifted[:4] == pytest.approx(0.0, abs=1e-12)


def test_play_is_crossed_at_a_reversal():
    backlash = ReferencePlant({"backlash": {"B": 1e-4}})
    generator = np.random.default_rng(0)
    _, (usual,) = ReferencePlant({}).readings(ProgramRun(MOVE), [LASER], generator)
    _, (seen,) = backlash.readings(ProgramRun(MOVE), [LASER], generator)
    play_m = (usual - seen) * INCH_M
    forth, back = 2000 * 14 // 100, 2000 * 72 // 100
    assert play_m[forth] == pytest.approx(5e-5, abs=1e-9)
    assert play_m[back] == pytest.approx(-5e-5, abs=1e-9)


def test_a_lost_step_is_a_whole_pitch():
    lost = ReferencePlant({"lost_steps": {"n": 1.0, "move": 1.0, "at": 0.5}})
    generator = np.random.default_rng(0)
    _, (usual,) = ReferencePlant({}).readings(ProgramRun(MOVE), [LASER], generator)
    _, (seen,) = lost.readings(ProgramRun(MOVE), [LASER], generator)
    assert not lost.stalled
    assert (usual - seen)[-1] == pytest.approx(0.040, abs=1e-6)
