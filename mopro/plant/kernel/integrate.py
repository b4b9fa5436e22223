"""One axis through time: `integrate`, the outermost function of the kernel.

Comparisons stand where `min` and `max` might: numba compiles each of those as a function.

Between knots the motion goes in equal steps. No step straddles a corner of the command, and
an axis that has come to rest under a command at rest stays where it is.
"""

from __future__ import annotations

from collections.abc import Callable, MutableSequence, Sequence
from math import ceil, cos, floor, nan, sin, sqrt

from mopro.plant.kernel.drive import LOOP_STEP_S, DriveNumbers
from mopro.plant.kernel.effect_terms import Numbers, Pair, Prepare
from mopro.plant.kernel.equation_of_motion import (
    AxisNumbers,
    Parts,
    Segment,
    State,
    interval_of,
    pull_of_currents,
    step_of,
)

# The speed (m/s) beyond which an axis has run away, as under a drag that drives it: its motion is
# NaN from there on, as its steps would never end. Fifty times that of the fastest such motors;
# doubled, a runaway takes twice as long.
RUNAWAY_M_S = 100.0

# k (1/m), F0 (N), c_s (N s/m), mass (kg), microstep (m), I (A), R (ohm), L (H).
Plant = tuple[float, float, float, float, float, float, float, float]
# The longest step (s), the farthest that axis or command may go in one (m), and how far from
# where it stays an axis is taken to rest (m).
Limits = tuple[float, float, float]
# Rows of numbers: lists in plain Python, an array for compiled code.
Table = Sequence[Sequence[float]]
# Rows to fill in, one for each knot. Of the motion: position (m), velocity (m/s), least and
# greatest lag x_c - x (m) since the knot before. Of the drive: see `record`.
Results = Sequence[MutableSequence[float]]
Rates = Callable[
    [float, float, State, AxisNumbers, DriveNumbers, Numbers], tuple[float, Pair, Pair]
]
Integrate = Callable[..., tuple[int, State]]


def command_at(segment: Segment, t: float) -> Pair:
    """The command's position (microsteps) and speed (m/s) at t (s)."""
    begin, p0, p1, p2, p3, q0, q1, q2 = segment
    tau = t - begin
    return p0 + tau * (p1 + tau * (p2 + tau * p3)), q0 + tau * (q1 + tau * q2)


def axis_and_drive(plant: Plant, factors: Sequence[float]) -> tuple[AxisNumbers, DriveNumbers]:
    """The numbers of axis and drive.

    factors: on the currents (1); the motor's greatest force (m/s²) and c_s (1/s) over m; Kf (N/A).
    """
    k, mass, amps = plant[0], plant[3], plant[5]
    drive = (factors[0], factors[3], amps, plant[6], plant[7], plant[4])
    return (k, factors[1], factors[2], mass, 1.0 / mass), drive


def rates_of(parts: Parts) -> Rates:
    """The function for the rates of change of a state."""
    acceleration = parts.acceleration
    drives = parts.drive
    loop_setpoints, lag_rates, phases = drives.loop_setpoints, drives.lag_rates, drives.phases
    direct, saturable = parts.direct, parts.saturable

    def rates(
        c: float, w: float, state: State, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers
    ) -> tuple[float, Pair, Pair]:
        """ẍ (m/s²) and the rates (1/s) of the lagged currents and of those of the coils."""
        x, v, z, (lagged, coil) = state
        k, gain = axis[0], drive[0]
        if direct:
            return acceleration(c, w, x, v, z, 0.0, axis, numbers), (0.0, 0.0), (0.0, 0.0)
        field = loop_setpoints(lagged, c, gain, k, numbers)
        of_lag, of_coil = lag_rates(lagged, c, gain, k, numbers), (0.0, 0.0)
        if saturable:
            of_coil = phases(field, c, w, x, v, coil, k, drive, numbers)[1]
            field = (coil[0], coil[1])
        return acceleration(field, w, x, v, z, 0.0, axis, numbers), of_lag, of_coil

    return rates


def rests_of(parts: Parts, rates: Rates) -> Callable[..., bool]:
    """The test for an axis at rest under a command at rest."""
    nominal = parts.nominal

    def rests(
        c: float, state: State, rest: float, natural: float,
        axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> bool:  # fmt: skip
        """True if the axis is within `rest` (m) of its equilibrium, and as slow.

        natural: its natural frequency √(k F0 / m) in 1/s.
        """
        k = axis[0]
        if abs(state[1]) >= rest * natural:
            return False
        if nominal:
            angle = k * (c - state[0])
            return abs(sin(angle)) < rest * k and cos(angle) > 0.0
        a, of_lag, of_coil = rates(c, 0.0, state, axis, drive, numbers)
        slow = rest * k * natural
        return (
            abs(a) < rest * natural * natural
            and (abs(of_lag[0]) < slow and abs(of_lag[1]) < slow)
            and (abs(of_coil[0]) < slow and abs(of_coil[1]) < slow)
        )

    return rests


def record_of(parts: Parts, prepare: Prepare) -> Callable[..., None]:
    """The function that records the drive's quantities."""
    loop_setpoints, phases = parts.drive.loop_setpoints, parts.drive.phases
    pull = prepare(pull_of_currents)
    saturable = parts.saturable

    def record(
        electrical: Results, at: int, u: float, w: float, resolved: bool,
        state: State, plant: Plant, axis: AxisNumbers, drive: DriveNumbers, numbers: Numbers,
    ) -> None:  # fmt: skip
        """Currents over I, voltages (V; 0 of an ideal drive) and motor force (N) at a knot."""
        c = (floor(u + 0.5) if resolved else u) * plant[4]
        x, v, _, (lagged, coil) = state
        k = axis[0]
        currents, volts = loop_setpoints(lagged, c, drive[0], k, numbers), (0.0, 0.0)
        if saturable:
            volts = phases(currents, c, w, x, v, coil, k, drive, numbers)[0]
            currents = (coil[0], coil[1])
        row = electrical[at]
        row[0], row[1] = currents[0], currents[1]
        row[2], row[3] = volts[0], volts[1]
        row[4] = pull(currents, x, k, drive[1] * drive[2])

    return record


def pace_of(parts: Parts, command: Callable[..., Pair]) -> Callable[..., tuple[int, bool]]:
    """The function that divides an interval into steps."""
    suffices, saturable = parts.drive.suffices, parts.saturable

    def pace(
        t: float, length: float, u: float, w: float, segment: Segment, state: State,
        limits: Limits, plant: Plant, drive: DriveNumbers, numbers: Numbers,
    ) -> tuple[int, bool]:  # fmt: skip
        """The number of steps in `length` s, and whether the loops have voltage enough in all.

        An axis gains no more speed than twice the motor's greatest force gives it.
        """
        longest, speed, free = limits[0], abs(state[1]), True
        if abs(w) > speed:
            speed = abs(w)
        if saturable:
            fastest, w_end = speed, abs(command(segment, t + length)[1])
            if w_end > fastest:
                fastest = w_end
            fastest += 2.0 * plant[1] / plant[3] * length
            free = suffices(state[3], u * plant[4], fastest, plant[0], drive, numbers)
            if not free and longest > LOOP_STEP_S:
                longest = LOOP_STEP_S
        count = length / longest
        if speed * length / limits[1] > count:
            count = speed * length / limits[1]
        whole = ceil(count - 1e-9)
        return whole if whole > 1 else 1, free

    return pace


def integrate_of(parts: Parts, prepare: Prepare) -> Integrate:
    """The way through time, composed of functions that `prepare` has made ready."""
    interval = prepare(interval_of(prepare(step_of(parts, prepare))))
    nominal, rests = parts.nominal, prepare(rests_of(parts, prepare(rates_of(parts))))
    command, strengths = prepare(command_at), prepare(axis_and_drive)
    record, pace = prepare(record_of(parts, prepare)), prepare(pace_of(parts, command))

    def integrate(
        knots: Sequence[float], row_of: Sequence[int], rows: Table,
        factor_of: Sequence[int], factors: Table, plant: Plant, limits: Limits, resolved: bool,
        numbers: Numbers, state: State, motion: Results, electrical: Results,
    ) -> tuple[int, State]:  # fmt: skip
        """Fill in the motion at each knot; gives the steps taken and the last state.

        knots: n times (s); row_of, factor_of: for each interval between them the row of its
        segment in `rows` (see Segment; and 1 where the command rests), and of its factors in
        `factors` (see axis_and_drive); resolved: whether the drive's angle moves in whole
        microsteps; state: at the first knot; electrical: no rows unless wanted.
        """
        microstep, natural = plant[4], sqrt(plant[0] * plant[1] / plant[3])
        recorded, resting = len(electrical) > 0, False
        steps, row, factor, here = 0, -1, -1, motion[0]
        here[0], here[1] = state[0], state[1]
        for i in range(len(knots) - 1):
            t, length = knots[i], knots[i + 1] - knots[i]
            if factor_of[i] != factor:
                factor, resting = factor_of[i], False
                axis, drive = strengths(plant, factors[factor])
            if row_of[i] != row:
                row, resting = row_of[i], False
                r = rows[row]
                segment, holding = (r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7]), r[8] > 0.0
                u, w = command(segment, t)
            if i == 0 and not nominal and recorded:
                record(electrical, i, u, w, resolved, state, plant, axis, drive, numbers)
            if abs(state[1]) > RUNAWAY_M_S:
                state = (nan, nan, state[2], state[3])
            here = motion[i + 1]
            if resting or (
                holding and rests(u * microstep, state, limits[2], natural, axis, drive, numbers)
            ):
                # What rests without speed rests until command or forces change.
                resting = state[1] == 0.0
                state = (state[0], 0.0, state[2], state[3])
                here[2] = here[3] = u * microstep - state[0]
            else:
                count, free = pace(t, length, u, w, segment, state, limits, plant, drive, numbers)
                steps += count
                state, here[2], here[3], u, w = interval(
                    state, t, length / count, count, segment, u, w, microstep,
                    resolved and not holding, free, axis, drive, numbers,
                )  # fmt: skip
            here[0], here[1] = state[0], state[1]
            if not nominal:
                u, w = command(segment, knots[i + 1])
                if recorded:
                    record(electrical, i + 1, u, w, resolved, state, plant, axis, drive, numbers)
        return steps, state

    return integrate
