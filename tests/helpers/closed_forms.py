"""The check cases of the plant that have a closed form: got against expected.

    python tests/helpers/closed_forms.py

prints them; tests/plant/test_closed_forms.py holds each to its tolerance.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import mopro
from mopro.machine import load_machine
from mopro.plant.kernel.build import kernel
from mopro.plant.kernel.effect_terms import TermSet
from mopro.plant.kernel.equation_of_motion import start_of

MACHINE = load_machine("chow1992")
AXIS = MACHINE.axis
K, F0, M = AXIS.wave_number_1_m, AXIS.pull_out_force_N, AXIS.moving_mass_kg
PITCH, IN, LBF, POUND = AXIS.pitch_m, 0.0254, 4.4482216152605, 0.45359237


def integrated(times, x0, v0, *, acceleration=0.0, damping=0.0, f0=F0, mass=M, h=20e-6, rest_m=0.0):
    """The nominal kernel: steps taken, positions and velocities at `times`.

    `acceleration` is the smooth command's in m/s², `damping` in N s/m.
    """
    microstep, intervals = PITCH / 500, len(times) - 1
    coefficients = [0.0, 0.0, 0.0, acceleration / microstep / 2, 0.0, 0.0, acceleration, 0.0]
    rows = [[*coefficients, float(acceleration == 0)]]
    motion = np.zeros((len(times), 4)).tolist()
    terms, factors = TermSet(()), [1.0, f0 / mass, damping / mass, f0]
    steps, _ = kernel(terms, True, False)(
        times.tolist(), [0] * intervals, rows, [0] * intervals, [factors],
        (K, f0, damping, mass, microstep, 1.0, 1.0, 1.0), (h, math.inf, rest_m), False,
        (), (x0, v0, *start_of(terms)[2:]), motion, [],
    )  # fmt: skip
    position, velocity, _, _ = np.array(motion).T
    return steps, position, velocity


def swing(x0, v0=0.0, *, acceleration=0.0, zeta=0.0, f0=F0, mass=M, until=0.2, knots=4001, h=20e-6):
    """Times and lag of an axis whose command starts at rest and accelerates evenly.

    In the command's own frame even acceleration is a static load of mass x acceleration.
    """
    times = np.linspace(0.0, until, knots)
    damping = 2 * zeta * math.sqrt(K * f0 * M)
    how = {"acceleration": acceleration, "damping": damping, "f0": f0, "mass": mass, "h": h}
    _, x, v = integrated(times, x0, v0, **how)
    return times, acceleration * times**2 / 2 - x, acceleration * times - v


def frequency_of(times, lag):
    """From upward crossings of zero, each placed between samples by a cubic through four."""
    at = np.flatnonzero((lag[:-1] < 0) & (lag[1:] >= 0))
    crossings = []
    for i in at[(at > 1) & (at < len(lag) - 3)]:
        t, y = times[i - 1 : i + 3], lag[i - 1 : i + 3]
        crossings.append(np.polynomial.Polynomial.fit(y, t, 3)(0.0))
    return (len(crossings) - 1) / (crossings[-1] - crossings[0])


def pendulum_frequency(amplitude):
    """f0 / AGM ratio: exact for F0 sin(k x), by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(K * amplitude / 2)
    while abs(a - b) > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.sqrt(K * F0 / M) / (2 * math.pi) * a


def swing_frequency(amplitude_m):
    times, lag, _ = swing(amplitude_m)
    return frequency_of(times, lag)


def static_lag_um(force_N):
    lag = math.asin(force_N / F0) / K
    _, found, _ = swing(-lag * 0.98, acceleration=force_N / M, zeta=0.3, until=0.4, knots=401)
    return found[-1] * 1e6


def steady_lag_um(acceleration_in_s2, payload_kg=0.0):
    _, lag, _ = swing(
        0.0, acceleration=acceleration_in_s2 * IN, zeta=0.2, f0=25 * LBF,
        mass=M + payload_kg, until=0.3, knots=601,
    )  # fmt: skip
    return lag[-1] * 1e6


def pull_out_share():
    """The largest step of acceleration that an undamped axis holds, in F0/m, by bisection."""
    low, high = 0.5, 1.0
    for _ in range(14):
        share = (low + high) / 2
        _, lag, _ = swing(0.0, acceleration=share * F0 / M, until=0.5, knots=1001)
        low, high = (share, high) if lag.max() < PITCH / 2 else (low, share)
    return low


def slip_residue():
    """Distance in pitches between a whole pitch and the rest of an axis thrown off its tooth."""
    _, lag, _ = swing(0.0, 0.7, zeta=0.03, until=1.0)
    pitches = lag[-1] / PITCH
    assert abs(round(pitches)) >= 1, "it must slip to begin with"
    return abs(pitches - round(pitches))


def ring_down_zeta(zeta):
    _, lag, _ = swing(1e-6, zeta=zeta, until=0.12, knots=12001)
    tops = np.flatnonzero((lag[1:-1] < lag[:-2]) & (lag[1:-1] <= lag[2:])) + 1
    decrement = np.log(lag[tops[0]] / lag[tops[-1]]) / (len(tops) - 1)
    return float(decrement / math.hypot(2 * math.pi, decrement))


def energy_drift():
    """Relative, over a second without damping, RK4 at 20 µs."""
    _, lag, speed = swing(0.2e-3, until=1.0)
    energy = M * speed**2 / 2 + F0 / K * (1 - np.cos(K * lag))
    return float(np.abs(energy / energy[0] - 1).max())


def locked_rotor():
    """Times (s) and current (A) of a phase that is switched from 1 A to 8 V, held in place.

    A setpoint far beyond what 8 V can drive keeps the voltage at its limit; 500 kg keep
    the forcer in place, and the move that ends the hold current takes longer than this.
    """
    machine = replace(MACHINE, drive=replace(MACHINE.drive, model="full", phase_current_A=1000.0))
    effects = {
        "voltage_saturation": {"Vb": 8.0},
        "payload_mass": {"dm": 50.0},
        "hold_current_reduction": {"t_h": 0.05, "h": 0.001},
    }
    text = "UU012500/1\nVEL1 0.00008\nACC1 0.00008\nWT200\nMRI1 0.00008\nWT20\n"
    recording = mopro.emulate(
        mopro.compile(text), machine, rate_hz=1e5, effects=effects, for_s=0.22, max_step_s=5e-6,
        compiled=True,
    )  # fmt: skip
    after = recording["time_s"] >= 0.2
    return recording["time_s"][after] - 0.2, recording["phase_a_1_A"][after]


def locked_rotor_tau_ms():
    time_s, current = locked_rotor()
    rising = (time_s > 1e-4) & (time_s < 3e-3)
    slope = np.polyfit(time_s[rising], np.log(4.0 - current[rising]), 1)[0]
    return float(-1e3 / slope)


def heat_at_any_phase():
    """The greatest deviation of R (i_a² + i_b²) from R I² over a move, relative."""
    recording = mopro.emulate(mopro.compile("UU012500/1\nVEL1 5\nACC1 0.1\nMRI1 0.2\nWX1\n"))
    heat = 2.0 * (recording["phase_a_1_A"] ** 2 + recording["phase_b_1_A"] ** 2)
    return float(np.abs(heat / 32.0 - 1).max())


@dataclass(frozen=True)
class Case:
    """`expected` within `tolerance`; a bound where `expected` is 0."""

    name: str
    unit: str
    expected: float
    tolerance: float
    got: Callable[[], float]


CASES = (
    Case("small swing", "Hz", 82.6895, 5e-4, lambda: swing_frequency(1e-9)),
    Case("swing of 0.2 mm", "Hz", 74.8364, 5e-4, lambda: swing_frequency(0.2e-3)),
    Case("swing of 0.4 mm", "Hz", 51.0491, 5e-4, lambda: swing_frequency(0.4e-3)),
    Case("static load of 10 N", "µm", 14.5875, 1e-4, lambda: static_lag_um(10.0)),
    Case("steady lag at 250 in/s²", "µm", 23.6, 0.1, lambda: steady_lag_um(250)),
    Case("steady lag at 600 in/s²", "µm", 57.6, 0.1, lambda: steady_lag_um(600)),
    Case("250 in/s² with 5 lb", "µm", 45.0, 0.5, lambda: steady_lag_um(250, 5 * POUND)),
    Case("600 in/s² with 5 lb", "µm", 116.0, 0.5, lambda: steady_lag_um(600, 5 * POUND)),
    Case("pull-out, undamped", "F0/m", 0.7246, 1e-4, pull_out_share),
    Case("residue of a slip", "pitch", 0.0, 0.1, slip_residue),
    Case("ring-down at ζ = 0.03", "1", 0.03, 3e-5, lambda: ring_down_zeta(0.03)),
    Case("energy drift in 1 s", "1", 0.0, 1e-8, energy_drift),
    Case("locked rotor, i at the end", "A", 4.0, 1e-3, lambda: float(locked_rotor()[1][-1])),
    Case("locked rotor, τ = L/R", "ms", 1.0, 0.01, locked_rotor_tau_ms),
    Case("heat I²R at any phase", "1", 0.0, 1e-12, heat_at_any_phase),
)


def main() -> None:
    print(f"{'case':28} {'expected':>10} {'got':>14}  unit")
    for case in CASES:
        print(f"{case.name:28} {case.expected:>10g} {case.got():>14.6g}  {case.unit}")


if __name__ == "__main__":
    main()
