"""The motion of one axis: its equation, and the Runge-Kutta steps through an interval.

    m ẍ = F + Σ F_i + c_s (ẋ_c - ẋ)

F is the motor's force, F0 g sin(k (x_c - x)) of an ideal drive with the gain g, and
F0 (i_b cos kx - i_a sin kx) of any other, with the currents over I. F_i are the effects'
terms. A drive that is switched off damps nothing.

States that follow the path are taken at each stage from the way since the step began, and
currents behind a lag from their setpoints, which no stiffness disturbs; only the currents of
a loop whose voltage may not suffice are integrated with the motion. Positions are in metres,
the command's segments in microsteps.

Each function is composed for a set of effects from those that it calls, and then runs as it
stands or compiled by numba, with the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, floor, sin
from typing import Any

from mopro.plant.kernel.drive import Drive, DriveNumbers, Electric, charge_end, drive_of
from mopro.plant.kernel.effect_terms import (
    Forces,
    Numbers,
    Pair,
    Path,
    Prepare,
    Slides,
    TermSet,
    forces,
    slides,
)

# Below this change within one step (in microsteps) the staircase is taken at mid-step.
FLAT_U = 1e-6

# What pulls the forcer: the command (m) of an ideal drive, or the currents (ia, ib) over I.
Field = Any
# k (1/m), the motor's greatest force over m (m/s²), c_s/m (1/s), m (kg), 1/m (1/kg), as a division
# takes longer than the rest of a force.
AxisNumbers = tuple[float, float, float, float, float]
# Position (m), velocity (m/s), the states that follow the path and those of the drive.
State = tuple[float, float, Path, Electric]
# The command as polynomials of the time since `begin`: begin (s), the coefficients of the
# position (microsteps and s), and those of the speed (m and s).
Segment = tuple[float, float, float, float, float, float, float, float]
# The state after an interval, the least and the greatest lag in it (m), and the command's
# position (microsteps) and speed (m/s) at its end.
Interval = tuple[State, float, float, float, float]
Acceleration = Callable[[Field, float, float, float, Path, float, AxisNumbers, Numbers], float]


@dataclass(frozen=True)
class Parts:
    """The composed functions of one set of effects, and which parts of the motion it has.

    `direct`: the motor's force comes straight from the command; `saturable`: the voltage of
    its loops is limited; `nominal`: there is nothing but the nominal equation of motion,
    whose currents and forces follow from the positions and are not recorded.
    """

    acceleration: Acceleration
    drive: Drive
    slid: Slides
    direct: bool
    saturable: bool
    on_path: bool
    nominal: bool


def parts_of(terms: TermSet, nominal: bool, prepare: Prepare) -> Parts:
    """The functions of a set of effects, each made ready by `prepare`."""
    pull, others = prepare(pull_of_currents), forces(terms, prepare)
    return Parts(
        prepare(acceleration_of(pull, terms.direct, others, terms.has_forces)),
        drive_of(terms, prepare),
        slides(terms, prepare),
        terms.direct,
        terms.voltage is not None,
        bool(terms.on_path),
        nominal,
    )


def start_of(terms: TermSet) -> State:
    """The state at rest at 0, with the ideal currents of command 0."""
    lagged = () if terms.lag is None else (1.0, 0.0)
    coil = () if terms.voltage is None else (1.0, 0.0)
    return 0.0, 0.0, (0.0,) * len(terms.on_path), (lagged, coil)


def pull_of_currents(currents: Pair, x: float, k: float, strength: float) -> float:
    """F = F0 (i_b cos kx - i_a sin kx), in the unit of strength, with the currents over I."""
    ia, ib = currents
    angle = k * x
    return strength * (ib * cos(angle) - ia * sin(angle))


def acceleration_of(
    pull: Callable[..., float], direct: bool, others: Forces, has_others: bool
) -> Acceleration:
    """The equation of motion; `direct`: F = F0 g sin(k (x_c - x)) rather than `pull`."""

    def acceleration(
        field: Field, w: float, x: float, v: float, z: Path, dx: float,
        axis: AxisNumbers, numbers: Numbers,
    ) -> float:  # fmt: skip
        """ẍ in m/s² at x (m) and v (m/s); w is ẋ_c (m/s), and z the states dx (m) before x."""
        k, strength, damping, mass, per_kg = axis
        a = strength * sin(k * (field - x)) if direct else pull(field, x, k, strength)
        if has_others:
            a += others(mass * a, x, v, z, dx, numbers) * per_kg
        return a + damping * (w - v)

    return acceleration


def step_of(parts: Parts, prepare: Prepare) -> Callable[..., State]:
    """One step of the classical Runge-Kutta method (RK4)."""
    acceleration, slid = parts.acceleration, parts.slid
    through, charged = parts.drive.through, parts.drive.charged
    combined = prepare(charge_end)
    direct, saturable, on_path = parts.direct, parts.saturable, parts.on_path

    def step(
        x: float, v: float, z: Path, electric: Electric,
        c0: float, c_mid: float, c1: float, w0: float, w_mid: float, w1: float,
        u0: float, u_mid: float, u1: float,
        h: float, free: bool, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> State:  # fmt: skip
        """The state h (s) later, the command going from c0 over c_mid to c1 (m).

        w0, w_mid, w1: its speeds (m/s); u0, u_mid, u1: the smooth command (microsteps);
        free: whether the loops have all the voltage that they can ask for.
        """
        f1: Field
        f2: Field
        f4: Field
        half = h / 2
        if direct:
            f1, f2, f4 = c0, c_mid, c1
        else:
            k = axis[0]
            in_step, f1, f2, f4, electric = through(
                electric, c0, c_mid, c1, u0, u_mid, u1, h, free, k, drive, numbers
            )
        f3 = f2
        a1 = acceleration(f1, w0, x, v, z, 0.0, axis, numbers)
        if saturable and not free:
            f2 = charged(f1, half, in_step[0], c0, w0, x, v, f1, k, drive, numbers)
        dx, v2 = half * v, v + half * a1
        a2 = acceleration(f2, w_mid, x + dx, v2, z, dx, axis, numbers)
        if saturable and not free:
            f3 = charged(f1, half, in_step[1], c_mid, w_mid, x + dx, v2, f2, k, drive, numbers)
        dx, v3 = half * v2, v + half * a2
        a3 = acceleration(f3, w_mid, x + dx, v3, z, dx, axis, numbers)
        if saturable and not free:
            f4 = charged(f1, h, in_step[1], c_mid, w_mid, x + dx, v3, f3, k, drive, numbers)
        dx, v4 = h * v3, v + h * a3
        a4 = acceleration(f4, w1, x + dx, v4, z, dx, axis, numbers)
        if saturable and not free:
            f5 = charged(f1, h, in_step[2], c1, w1, x + dx, v4, f4, k, drive, numbers)
            electric = electric[0], combined(f1, f2, f3, f4, f5)
        # As h/6 (v1 + 2 v2 + 2 v3 + v4).
        sixth = h / 6
        dx = h * (v + sixth * (a1 + a2 + a3))
        if on_path:
            z = slid(z, dx, numbers)
        return x + dx, v + sixth * (a1 + 2.0 * (a2 + a3) + a4), z, electric

    return step


def interval_of(step: Callable[..., State]) -> Callable[..., Interval]:
    """Several equal steps under one segment of the command."""

    def interval(
        state: State, t: float, h: float, count: int, segment: Segment, u0: float, w0: float,
        microstep: float, stairs: bool, free: bool,
        axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> Interval:  # fmt: skip
        """From t (s) on, where the command is at u0 (microsteps) and w0 (m/s), `count` steps of h.

        stairs: whether the drive's angle moves in whole microsteps.

        The staircase of microsteps differs from the smooth command by a sawtooth. Its mean
        over the step, from its integral -r²/2, keeps the impulse right however many
        microsteps a step spans, where sampling it would alias.
        """
        x, v, z, electric = state
        begin, p0, p1, p2, p3, q0, q1, q2 = segment
        r0 = u0 - floor(u0 + 0.5)
        low = high = u0 * microstep - x
        shift, n = 0.0, 0.0
        for _ in range(count):
            tau = t + (n + 0.5) * h - begin
            u_mid = p0 + tau * (p1 + tau * (p2 + tau * p3))
            w_mid = q0 + tau * (q1 + tau * q2)
            n += 1.0
            tau = t + n * h - begin
            u1 = p0 + tau * (p1 + tau * (p2 + tau * p3))
            w1 = q0 + tau * (q1 + tau * q2)
            if stairs:
                du, r1 = u1 - u0, u1 - floor(u1 + 0.5)
                if du > FLAT_U or du < -FLAT_U:
                    shift = (r0 * r0 - r1 * r1) / (2.0 * du)
                else:
                    shift = floor(u_mid + 0.5) - u_mid
                r0 = r1
            x, v, z, electric = step(
                x, v, z, electric,
                (u0 + shift) * microstep, (u_mid + shift) * microstep, (u1 + shift) * microstep,
                w0, w_mid, w1, u0, u_mid, u1, h, free, axis, drive, numbers,
            )  # fmt: skip
            u0, w0 = u1, w1
            lag = u1 * microstep - x
            if lag < low:
                low = lag
            if lag > high:
                high = lag
        return (x, v, z, electric), low, high, u0, w0

    return interval
