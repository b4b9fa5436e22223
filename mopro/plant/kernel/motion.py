"""The motion of one axis: its equation, one Runge-Kutta step, and the way through time.

    m ẍ = F + Σ F_i + c_s (ẋ_c - ẋ)

F is the motor's force, F0 g sin(k (x_c - x)) of an ideal drive and F0 (i_b cos kx -
i_a sin kx) with the currents over I otherwise; F_i are the effects' terms; a drive
that is switched off damps nothing. States that follow the path are taken at each stage from
the way since the step began, currents behind a lag from their setpoints, which no stiffness
disturbs; only the currents of a loop whose voltage may not suffice are integrated with the
motion. No step straddles a corner of the command.

The functions are composed for one set of effects (see build.py), and run as they stand, or
compiled by numba. Both give the same bits. Positions are in m, segments in microsteps.
"""

from __future__ import annotations

from collections.abc import Callable, MutableSequence, Sequence
from dataclasses import dataclass
from math import ceil, cos, floor, sin, sqrt
from typing import Any

from mopro.plant.kernel.drive import (
    LOOP_STEP_S,
    Currents,
    Drive,
    DriveNumbers,
    drive_of,
)
from mopro.plant.kernel.terms import (
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
# k (1/m), the motor's greatest force (N), c_s (N s/m), mass (kg).
AxisNumbers = tuple[float, float, float, float]
# Position (m), velocity (m/s), the states that follow the path, the lagged currents and those
# of the coils.
State = tuple[float, float, Path, Currents, Currents]
# Times (s), position, velocity, acceleration and jerk of the command (microsteps and s).
Segment = tuple[float, float, float, float, float]
# k (1/m), F0 (N), c_s (N s/m), mass (kg), microstep (m), I (A), R (ohm), L (H).
Plant = tuple[float, float, float, float, float, float, float, float]
# The longest step (s), the farthest that axis or command may go in one (m), and how far from
# where it stays an axis is taken to rest (m).
Limits = tuple[float, float, float]
# The state after an interval, and in it the least and the greatest lag (m); the command's
# position (microsteps) and speed (m/s) at its end.
Interval = tuple[State, float, float, float, float]

Acceleration = Callable[[Field, float, float, float, float, Path, AxisNumbers, Numbers], float]


def command_at(segment: Segment, t: float, microstep: float) -> tuple[float, float]:
    """The command's position (microsteps) and speed (m/s) at t (s)."""
    anchor, u, v, a, j = segment
    tau = t - anchor
    return (
        u + tau * (v + tau * (a / 2 + tau * j / 6)),
        (v + tau * (a + tau * j / 2)) * microstep,
    )


def strengths_at(
    plant: Plant, gain: float, constant: float, direct: bool
) -> tuple[AxisNumbers, DriveNumbers]:
    """The numbers of axis and drive with these factors on the current and on F0.

    direct: whether the gain is to be in the motor's force rather than in the currents.
    """
    k, f0, damping, mass, _, amps, ohms, henries = plant
    strength = f0 * constant
    drive = (gain, k, strength / amps, amps, ohms, henries)
    damped = damping if gain > 0.0 else 0.0
    return (k, strength * gain if direct else strength, damped, mass), drive


def pull_of_command(c: float, x: float, k: float, strength: float) -> float:
    """F = F0 g sin(k (x_c - x)), in N."""
    return strength * sin(k * (c - x))


def pull_of_currents(currents: Pair, x: float, k: float, strength: float) -> float:
    """F = F0 (i_b cos kx - i_a sin kx), in N, with the currents over I."""
    ia, ib = currents
    angle = k * x
    return strength * (ib * cos(angle) - ia * sin(angle))


def acceleration_of(pull: Callable[..., float], others: Forces, has_others: bool) -> Acceleration:
    """The equation of motion, with the motor's force from `pull`."""

    def acceleration(
        field: Field, w: float, x: float, dx: float, v: float, z: Path,
        axis: AxisNumbers, numbers: Numbers,
    ) -> float:  # fmt: skip
        """ẍ (m/s²) at x + dx (m) and v (m/s), the states z being those at x; w is ẋ_c (m/s)."""
        k, strength, damping, mass = axis
        here = x + dx
        force = pull(field, here, k, strength)
        if has_others:
            force += others(force, here, v, z, dx, numbers)
        return (force + damping * (w - v)) / mass

    return acceleration


@dataclass(frozen=True)
class Parts:
    """The composed functions of one set of effects, and which parts of the motion it has.

    `direct`: the motor's force comes straight from the command; `saturable`: the loops'
    voltage is limited; `nominal`: there is nothing but the nominal equation of motion, whose
    currents and forces follow from the positions and are not recorded.
    """

    acceleration: Acceleration
    drive: Drive
    slid: Slides
    direct: bool
    saturable: bool
    on_path: bool
    nominal: bool


def parts_of(terms: TermSet, nominal: bool, prepare: Prepare[Any]) -> Parts:
    """The functions of a set of effects, each made ready by `prepare`."""
    saturable = terms.voltage is not None
    direct = not (saturable or terms.has_setpoints or terms.lag is not None)
    pull = prepare(pull_of_command if direct else pull_of_currents)
    others = forces(terms, prepare)
    return Parts(
        prepare(acceleration_of(pull, others, terms.has_forces)),
        drive_of(terms, prepare),
        slides(terms, prepare),
        direct,
        saturable,
        bool(terms.on_path),
        nominal,
    )


def start_of(terms: TermSet) -> State:
    """The state at rest at 0, with the ideal currents of command 0."""
    lagged = () if terms.lag is None else (1.0, 0.0)
    coil = () if terms.voltage is None else (1.0, 0.0)
    return 0.0, 0.0, (0.0,) * len(terms.on_path), lagged, coil


def step_of(parts: Parts) -> Callable[..., State]:
    """One step of classical Runge-Kutta (RK4)."""
    acceleration, slid = parts.acceleration, parts.slid
    told_through, known, phases = parts.drive.told, parts.drive.known, parts.drive.phases
    direct, saturable, on_path = parts.direct, parts.saturable, parts.on_path

    def step(
        x: float, v: float, z: Path, lagged: Currents, coil: Currents,
        c0: float, c_mid: float, c1: float, w0: float, w_mid: float, w1: float, shift_m: float,
        h: float, free: bool, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> State:  # fmt: skip
        """The state h (s) later, the command going from c0 over c_mid to c1 (m).

        w0, w_mid, w1: its speeds (m/s); shift_m: what of it is the staircase's; free:
        whether the loops have all the voltage that they can ask for.
        """
        half = h / 2
        next_lagged = lagged
        if direct:
            f1, f2, f4 = c0, c_mid, c1
        else:
            gain, k = drive[0], drive[1]
            f1, f2, f4, next_lagged = told_through(lagged, c0, c_mid, c1, h, gain, k, numbers)
        if saturable:
            t1, t2, t4 = f1, f2, f4
            f1 = (coil[0], coil[1])
            if free:
                f2, f4 = known(f1, t1, t2, t4, c0, c_mid, c1, shift_m, h, gain, k)
        f3 = f2
        a1 = acceleration(f1, w0, x, 0.0, v, z, axis, numbers)
        v2 = v + half * a1
        if saturable and not free:
            j1 = phases(t1, c0, w0, x, v, f1, drive, numbers)[1]
            f2 = f1[0] + half * j1[0], f1[1] + half * j1[1]
        a2 = acceleration(f2, w_mid, x, half * v, v2, z, axis, numbers)
        v3 = v + half * a2
        if saturable and not free:
            j2 = phases(t2, c_mid, w_mid, x + half * v, v2, f2, drive, numbers)[1]
            f3 = f1[0] + half * j2[0], f1[1] + half * j2[1]
        a3 = acceleration(f3, w_mid, x, half * v2, v3, z, axis, numbers)
        v4 = v + h * a3
        if saturable and not free:
            j3 = phases(t2, c_mid, w_mid, x + half * v2, v3, f3, drive, numbers)[1]
            f4 = f1[0] + h * j3[0], f1[1] + h * j3[1]
        a4 = acceleration(f4, w1, x, h * v3, v4, z, axis, numbers)
        if saturable and not free:
            j4 = phases(t4, c1, w1, x + h * v3, v4, f4, drive, numbers)[1]
            coil = (
                f1[0] + h / 6 * (j1[0] + 2 * j2[0] + 2 * j3[0] + j4[0]),
                f1[1] + h / 6 * (j1[1] + 2 * j2[1] + 2 * j3[1] + j4[1]),
            )
        elif saturable:
            coil = f4
        dx = h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        if on_path:
            z = slid(z, dx, numbers)
        return x + dx, v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), z, next_lagged, coil

    return step


def interval_of(parts: Parts, step: Callable[..., State]) -> Callable[..., Interval]:
    """Several equal steps under one segment of the command."""

    def interval(
        state: State, t: float, h: float, count: int, segment: Segment, microstep: float,
        stairs: bool, free: bool, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> Interval:  # fmt: skip
        """From time t (s) on, `count` steps of h (s); `stairs`: in whole microsteps (m).

        The staircase of microsteps differs from the smooth command by a sawtooth. Its mean
        over the step, from its integral -r²/2, keeps the impulse right however many
        microsteps a step spans, where sampling it would alias.
        """
        x, v, z, lagged, coil = state
        anchor, ux, uv, ua, uj = segment
        half_a, half_j, sixth_j = ua / 2, uj / 2, uj / 6
        tau = t - anchor
        u0 = ux + tau * (uv + tau * (half_a + tau * sixth_j))
        w0 = (uv + tau * (ua + tau * half_j)) * microstep
        r0 = u0 - floor(u0 + 0.5)
        low = high = u0 * microstep - x
        shift = 0.0
        for n in range(count):
            tau = t + (n + 0.5) * h - anchor
            u_mid = ux + tau * (uv + tau * (half_a + tau * sixth_j))
            w_mid = (uv + tau * (ua + tau * half_j)) * microstep
            tau = t + (n + 1) * h - anchor
            u1 = ux + tau * (uv + tau * (half_a + tau * sixth_j))
            w1 = (uv + tau * (ua + tau * half_j)) * microstep
            if stairs:
                r1 = u1 - floor(u1 + 0.5)
                if abs(u1 - u0) > FLAT_U:
                    shift = (r0 * r0 - r1 * r1) / (2.0 * (u1 - u0))
                else:
                    shift = floor(u_mid + 0.5) - u_mid
                r0 = r1
            x, v, z, lagged, coil = step(
                x, v, z, lagged, coil,
                (u0 + shift) * microstep, (u_mid + shift) * microstep, (u1 + shift) * microstep,
                w0, w_mid, w1, shift * microstep, h, free, axis, drive, numbers,
            )  # fmt: skip
            u0 = u1
            w0 = w1
            lag = u1 * microstep - x
            if lag < low:
                low = lag
            if lag > high:
                high = lag
        return (x, v, z, lagged, coil), low, high, u0, w0

    return interval


def rates_of(parts: Parts) -> Callable[..., tuple[float, Pair, Pair]]:
    """ẍ and the rates of the currents."""
    acceleration, drive_parts = parts.acceleration, parts.drive
    now, lag_rates, phases = drive_parts.now, drive_parts.lag_rates, drive_parts.phases
    direct, saturable = parts.direct, parts.saturable

    def rates(
        c: float, w: float, state: State, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers
    ) -> tuple[float, Pair, Pair]:
        """ẍ (m/s²) and the rates (1/s) of the lagged currents and the coils', as they are now."""
        x, v, z, lagged, coil = state
        gain, k = drive[0], drive[1]
        if direct:
            return acceleration(c, w, x, 0.0, v, z, axis, numbers), (0.0, 0.0), (0.0, 0.0)
        field = now(lagged, c, gain, k, numbers)
        of_coil = (0.0, 0.0)
        if saturable:
            of_coil = phases(field, c, w, x, v, coil, drive, numbers)[1]
            field = (coil[0], coil[1])
        of_lag = lag_rates(lagged, c, gain, k, numbers)
        return acceleration(field, w, x, 0.0, v, z, axis, numbers), of_lag, of_coil

    return rates


def rests_of(parts: Parts, rates: Callable[..., tuple[float, Pair, Pair]]) -> Callable[..., bool]:
    """Whether nothing moves and nothing is about to, under a command at rest."""
    nominal = parts.nominal

    def rests(
        c: float, state: State, rest: float, natural: float,
        axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> bool:  # fmt: skip
        """Whether the axis is within `rest` (m) of where it stays, and as slow.

        natural: its natural frequency √(k F0 / m) in 1/s.
        """
        k = axis[0]
        if abs(state[1]) >= rest * natural:
            return False
        if nominal:
            angle = k * (c - state[0])
            return abs(sin(angle)) < rest * k and cos(angle) > 0.0
        a, of_lag, of_coil = rates(c, 0.0, state, axis, drive, numbers)
        fastest = max(abs(of_lag[0]), abs(of_lag[1]), abs(of_coil[0]), abs(of_coil[1]))
        return abs(a) < rest * natural * natural and fastest < rest * k * natural

    return rests


def record_of(parts: Parts, prepare: Prepare[Any]) -> Callable[..., None]:
    """What is recorded of the drive."""
    now, phases = parts.drive.now, parts.drive.phases
    direct, saturable = parts.direct, parts.saturable
    of_command, of_currents = prepare(pull_of_command), prepare(pull_of_currents)

    def record(
        electrical: Sequence[MutableSequence[float]], at: int, c: float, w: float,
        state: State, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> None:  # fmt: skip
        """Currents over I, voltages (V; 0 of an ideal drive) and motor force (N) at a knot."""
        x, v, _, lagged, coil = state
        k, strength = axis[0], axis[1]
        told = now(lagged, c, drive[0], k, numbers)
        field = told
        volts = (0.0, 0.0)
        if saturable:
            volts = phases(told, c, w, x, v, coil, drive, numbers)[0]
            field = (coil[0], coil[1])
        if direct:
            force = of_command(c, x, k, strength)
        else:
            force = of_currents(field, x, k, strength)
        electrical[0][at] = field[0]
        electrical[1][at] = field[1]
        electrical[2][at] = volts[0]
        electrical[3][at] = volts[1]
        electrical[4][at] = force

    return record


def pace_of(parts: Parts) -> Callable[..., tuple[int, bool]]:
    """How an interval is divided into steps."""
    suffices, saturable = parts.drive.suffices, parts.saturable

    def pace(
        length: float, u: float, w: float, w_end: float, state: State, limits: Limits,
        plant: Plant, drive: DriveNumbers, numbers: Numbers,
    ) -> tuple[int, bool]:  # fmt: skip
        """The number of steps in `length` s, and whether the loops have voltage enough in all.

        An axis gains no more speed than twice the motor's greatest force gives it.
        """
        longest = limits[0]
        v = state[1]
        free = True
        if saturable:
            fastest = max(abs(v), abs(w), abs(w_end)) + 2.0 * plant[1] / plant[3] * length
            free = suffices(state[3], state[4], u * plant[4], fastest, drive, numbers)
            if not free:
                longest = min(longest, LOOP_STEP_S)
        way = max(abs(v), abs(w)) * length
        return max(1, ceil(max(length / longest, way / limits[1]) - 1e-9)), free

    return pace


def integrate_of(parts: Parts, prepare: Prepare[Any]) -> Callable[..., tuple[int, State]]:
    """The way through time, the outermost function of the kernel."""
    interval = prepare(interval_of(parts, prepare(step_of(parts))))
    rests = prepare(rests_of(parts, prepare(rates_of(parts))))
    record, pace = prepare(record_of(parts, prepare)), prepare(pace_of(parts))
    command, strengths = prepare(command_at), prepare(strengths_at)
    direct, nominal = parts.direct, parts.nominal

    def integrate(
        knots: Sequence[float], row_of: Sequence[int], rows: Sequence[Sequence[float]],
        factors: Sequence[Sequence[float]], plant: Plant, limits: Limits, resolved: bool,
        numbers: Numbers, state: State,
        motion: Sequence[MutableSequence[float]], electrical: Sequence[MutableSequence[float]],
    ) -> tuple[int, State]:  # fmt: skip
        """Fill in the motion at each knot; gives the steps taken and the last state.

        knots: n times in s; row_of: for each of the n - 1 intervals the command's segment,
        an index into each of `rows` (see Segment); factors: those on the current and on the
        force constant in each interval; resolved: whether the drive's angle moves in whole
        microsteps; state: at the first knot. Outputs: in `motion` position (m) and velocity
        (m/s) at the knots, and the least and greatest lag x_c - x (m) of each interval; in
        `electrical`, unless nominal, currents over I, voltages (V) and motor force (N).
        """
        microstep = plant[4]
        natural = sqrt(plant[0] * plant[1] / plant[3])
        steps = 0
        for i in range(len(knots) - 1):
            t = knots[i]
            length = knots[i + 1] - t
            row = row_of[i]
            anchor, ua, uj = rows[0][row], rows[3][row], rows[4][row]
            segment = (anchor, rows[1][row], rows[2][row], ua, uj)
            axis, drive = strengths(plant, factors[0][i], factors[1][i], direct)
            u, w = command(segment, t, microstep)
            if i == 0 and not nominal:
                c = (floor(u + 0.5) if resolved else u) * microstep
                record(electrical, 0, c, w, state, axis, drive, numbers)
            holding = segment[2] == 0.0 and ua == 0.0 and uj == 0.0
            if holding and rests(u * microstep, state, limits[2], natural, axis, drive, numbers):
                state = (state[0], 0.0, state[2], state[3], state[4])
                low = high = u * microstep - state[0]
            else:
                w_end = command(segment, t + length, microstep)[1]
                count, free = pace(length, u, w, w_end, state, limits, plant, drive, numbers)
                steps += count
                state, low, high, u, w = interval(
                    state, t, length / count, count, segment, microstep,
                    resolved and not holding, free, axis, drive, numbers,
                )  # fmt: skip
            motion[0][i + 1] = state[0]
            motion[1][i + 1] = state[1]
            motion[2][i] = low
            motion[3][i] = high
            if not nominal:
                c = (floor(u + 0.5) if resolved else u) * microstep
                record(electrical, i + 1, c, w, state, axis, drive, numbers)
        return steps, state

    return integrate
