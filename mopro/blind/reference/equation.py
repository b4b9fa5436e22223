"""The equation of motion of one axis and its integration.

    m ẍ = Kf (-i_a sin kx + i_b cos kx) + c_s (ẋ_c - ẋ) + loads

SciPy's DOP853 tableau (Dormand and Prince, 8(5,3)) with its own step control, compiled:
steps adapt to the error and end at every sample and corner of the command. State:
x (m), v (m/s), the friction's z, the phase currents over I; with foreign mechanics also the
deflection of the bristles (m), the spring's loop, x and v of a second mass.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.integrate import DOP853

STATES = 9
X, V, Z, IA, IB, W, H, XM, VM = range(STATES)
# The states without foreign mechanics, in the number `states`; others are not integrated.
PLAIN_STATES = 5
# Names of the equation's numbers, and their indices in the vector p.
NAMES = (
    "wave", "force", "mass", "damping", "viscous", "quadratic", "friction", "presliding",
    "spring", "spring_at", "constant", "detent", "detent_phase", "gain", "quadrature",
    "offset_a", "offset_b", "third", "lag_s", "supply", "ohm", "henry", "current", "emf", "loop_s",
    "breakaway", "breakaway_speed", "pressed", "states",
    "grip", "grip_static", "grip_speed", "bristle", "bristle_damping",
    "rough", "rough_wave", "rough_phase", "fade", "fade_s",
    "loop", "loop_reach", "mode_mass", "mode_stiffness", "mode_damping", "lopsided",
)  # fmt: skip
(
    WAVE, FORCE, MASS, DAMPING, VISCOUS, QUADRATIC, FRICTION, PRESLIDING,
    SPRING, SPRING_AT, CONSTANT, DETENT, DETENT_PHASE, GAIN, QUADRATURE,
    OFFSET_A, OFFSET_B, THIRD, LAG_S, SUPPLY, OHM, HENRY, CURRENT, EMF, LOOP_S,
    BREAKAWAY, BREAKAWAY_SPEED, PRESSED, USED,
    GRIP, GRIP_STATIC, GRIP_SPEED, BRISTLE, BRISTLE_DAMPING,
    ROUGH, ROUGH_WAVE, ROUGH_PHASE, FADE, FADE_S,
    LOOP, LOOP_REACH, MODE_MASS, MODE_STIFFNESS, MODE_DAMPING, LOPSIDED,
) = range(len(NAMES))  # fmt: skip
# Columns of the command's rows: from t0 to t1, x + v τ + a τ²/2 + j τ³/6 with τ = t - t0;
# the current's share at both ends; the force constant's factor at both ends; the axis
# is set back by `slip` (m) at t0.
T0, T1, X0, V0, A0, J0, SHARE, F_FROM, F_TO, SLIP = range(COLUMNS := 10)

_STAGES = DOP853.n_stages
_A, _B, _C = DOP853.A[:_STAGES, :_STAGES].copy(), DOP853.B.copy(), DOP853.C[:_STAGES].copy()
_E3, _E5 = DOP853.E3.copy(), DOP853.E5.copy()
TOLERANCE = np.array([1e-12, 1e-9, 1e-7, 1e-8, 1e-8, 1e-13, 1e-7, 1e-12, 1e-9])


@njit(cache=True)
def setpoints(theta, share, p):  # type: ignore[no-untyped-def]
    """Setpoints of the phase currents over I, and their derivatives by the angle theta."""
    ia = share * ((1 + p[GAIN] / 2) * math.cos(theta) - p[THIRD] * math.cos(3 * theta))
    ib = share * (
        (1 - p[GAIN] / 2) * math.sin(theta + p[QUADRATURE]) + p[THIRD] * math.sin(3 * theta)
    )
    da = -share * ((1 + p[GAIN] / 2) * math.sin(theta) - 3 * p[THIRD] * math.sin(3 * theta))
    db = share * (
        (1 - p[GAIN] / 2) * math.cos(theta + p[QUADRATURE]) + 3 * p[THIRD] * math.cos(3 * theta)
    )
    return ia + p[OFFSET_A], ib + p[OFFSET_B], da, db


@njit(cache=True)
def loads(x, v, z, p):  # type: ignore[no-untyped-def]
    """Sum of the other forces on the forcer (N)."""
    friction = p[FRICTION]
    if p[BREAKAWAY] != 0:
        friction += p[BREAKAWAY] * math.exp(-((v / p[BREAKAWAY_SPEED]) ** 2))
    return (
        p[CONSTANT]
        - p[VISCOUS] * v
        - p[QUADRATIC] * v * abs(v)
        - friction * z
        - p[SPRING] * (x - p[SPRING_AT])
        - p[DETENT] * math.sin(4 * p[WAVE] * x + p[DETENT_PHASE])
    )


@njit(cache=True)
def foreign(t, y, p, out):  # type: ignore[no-untyped-def]
    """Force (N) of the foreign mechanics; writes the derivatives of their states to `out`."""
    x, v, force = y[X], y[V], 0.0
    out[W] = out[H] = out[XM] = out[VM] = 0.0
    if p[GRIP] > 0:
        limit = p[GRIP] + p[GRIP_STATIC] * math.exp(-((v / p[GRIP_SPEED]) ** 2))
        out[W] = v - p[BRISTLE] * abs(v) / limit * y[W]
        share = 1 + p[ROUGH] * math.sin(p[ROUGH_WAVE] * x + p[ROUGH_PHASE])
        share *= 1 - p[FADE] * (1 - math.exp(-t / p[FADE_S]))
        force -= share * (p[BRISTLE] * y[W] + p[BRISTLE_DAMPING] * out[W])
    if p[LOOP] > 0:
        out[H] = (v - abs(v) * y[H]) / p[LOOP_REACH]
        force -= p[LOOP] * y[H]
    if p[MODE_MASS] > 0:
        pull = p[MODE_STIFFNESS] * (x - y[XM]) + p[MODE_DAMPING] * (v - y[VM])
        out[XM], out[VM] = y[VM], pull / p[MODE_MASS]
        force -= pull
    return force


@njit(cache=True)
def slope(t, y, row, p, out):  # type: ignore[no-untyped-def]
    """Write the time derivative of the state `y` under the command of `row` to `out`."""
    tau = t - row[T0]
    xc = row[X0] + tau * (row[V0] + tau * (row[A0] / 2 + tau * row[J0] / 6))
    vc = row[V0] + tau * (row[A0] + tau * row[J0] / 2)
    ia, ib, da, db = setpoints(p[WAVE] * xc, row[SHARE], p)
    x, v = y[X], y[V]
    sine, cosine = math.sin(p[WAVE] * x), math.cos(p[WAVE] * x)
    out[IA] = out[IB] = 0.0
    if p[LAG_S] > 0:
        out[IA], out[IB] = (ia - y[IA]) / p[LAG_S], (ib - y[IB]) / p[LAG_S]
        ia, ib = y[IA], y[IB]
    elif p[SUPPLY] > 0:
        w = p[WAVE] * vc
        back_a, back_b = -p[EMF] * v * sine, p[EMF] * v * cosine
        most, ohm, henry, amps = p[SUPPLY], p[OHM], p[HENRY], p[CURRENT]
        want_a = amps * (ohm * y[IA] + henry * (da * w + (ia - y[IA]) / p[LOOP_S])) + back_a
        want_b = amps * (ohm * y[IB] + henry * (db * w + (ib - y[IB]) / p[LOOP_S])) + back_b
        va, vb = min(max(want_a, -most), most), min(max(want_b, -most), most)
        out[IA] = ((va - back_a) / amps - ohm * y[IA]) / henry
        out[IB] = ((vb - back_b) / amps - ohm * y[IB]) / henry
        ia, ib = y[IA], y[IB]
    done = (t - row[T0]) / (row[T1] - row[T0])
    strength = p[FORCE] * (row[F_FROM] + (row[F_TO] - row[F_FROM]) * done)
    if p[LOPSIDED] != 0 and vc != 0:
        strength *= 1 + (p[LOPSIDED] if vc > 0 else -p[LOPSIDED])
    motor = strength * (ib * cosine - ia * sine)
    pull = motor + p[DAMPING] * (vc - v) - p[PRESSED] * abs(motor) * y[Z]
    out[X] = v
    if p[USED] > PLAIN_STATES:
        pull += foreign(t, y, p, out)
    out[V] = (pull + loads(x, v, y[Z], p)) / p[MASS]
    out[Z] = (v - abs(v) * y[Z]) / p[PRESLIDING]


@njit(cache=True)
def _step(t, y, h, row, p, k, trial, tolerance):  # type: ignore[no-untyped-def]
    """One trial step from k[0] = slope(t, y); returns the error over the tolerance (≤ 1: good)."""
    states = int(p[USED])
    for stage in range(1, _STAGES + 1):
        for n in range(states):
            total = 0.0
            for i in range(stage):
                total += (_B[i] if stage == _STAGES else _A[stage, i]) * k[i, n]
            trial[n] = y[n] + h * total
        slope(t + (h if stage == _STAGES else _C[stage] * h), trial, row, p, k[stage])
    five = three = 0.0
    for n in range(states):
        e5 = e3 = 0.0
        for i in range(_STAGES + 1):
            e5 += _E5[i] * k[i, n]
            e3 += _E3[i] * k[i, n]
        five += (e5 / tolerance[n]) ** 2
        three += (e3 / tolerance[n]) ** 2
    if five == 0.0 and three == 0.0:
        return 0.0
    return h * five / math.sqrt((five + 0.01 * three) * states)


@njit(cache=True)
def _leap(start, end, y, row, p, h, tolerance):  # type: ignore[no-untyped-def]
    """Integrate `y` from `start` to `end` in place; returns the last accepted step size."""
    k = np.empty((_STAGES + 1, STATES))
    trial = np.zeros(STATES)
    t = start
    slope(t, y, row, p, k[0])
    while t < end:
        last = t + h >= end * (1 - 1e-15)
        take = end - t if last else h
        error = _step(t, y, take, row, p, k, trial, tolerance)
        if error > 1.0 and take > 1e-9:
            h = take * max(0.2, 0.9 * error ** (-1.0 / 8.0))
            continue
        y[:] = trial
        k[0] = k[_STAGES]
        t = end if last else t + take
        grown = take * (5.0 if error == 0.0 else min(5.0, 0.9 * error ** (-1.0 / 8.0)))
        h = max(h, grown) if last else grown
    return h


@njit(cache=True)
def response(times, rows, p, start, tolerance, out):  # type: ignore[no-untyped-def]
    """Write x, v, acceleration and command at ascending `times` to `out`, shape (len(times), 4).

    Before the first row the axis rests in the state `start`; the last row has no end.
    """
    y = np.zeros(STATES)
    y[: len(start)] = start
    y[XM] = start[X]
    rate = np.empty(STATES)
    n, count = 0, len(times)
    h = 1e-5
    while n < count and times[n] <= rows[0, T0]:
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = start[X], 0.0, 0.0, rows[0, X0]
        n += 1
    for i in range(len(rows)):
        row = rows[i]
        t = row[T0]
        y[X] -= row[SLIP]
        end = row[T1] if i + 1 < len(rows) else math.inf
        h = min(h, 1e-4)
        while n < count and times[n] <= end:
            h = _leap(t, times[n], y, row, p, h, tolerance)
            t = times[n]
            slope(t, y, row, p, rate)
            tau = t - row[T0]
            out[n, 0], out[n, 1], out[n, 2] = y[X], y[V], rate[V]
            out[n, 3] = row[X0] + tau * (row[V0] + tau * (row[A0] / 2 + tau * row[J0] / 6))
            n += 1
        if n == count:
            return
        _leap(t, end, y, row, p, h, tolerance)
