"""The integrator of one axis: the hot loop of the emulator.

Written in the part of Python that numba compiles, and run either way: as it stands for
short work, where importing a compiler would take longer, and compiled for long work.
Both give the same bits.

    m ẍ = F0 sin(k (x_c - x)) + c_s (ẋ_c - ẋ)

by classical Runge-Kutta (RK4) between knots, in equal steps of at most `max_step`; no
step straddles a corner of the command. Positions are in metres, the command's segments
in microsteps.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

# Below this change within one step (in microsteps) the staircase is taken at mid-step.
_FLAT_U = 1e-6


def integrate(
    knots: Sequence[float],
    row_of: Sequence[int],
    anchor_of: Sequence[float],
    x_of: Sequence[float],
    v_of: Sequence[float],
    a_of: Sequence[float],
    j_of: Sequence[float],
    wave_number: float,
    pull_out: float,
    damping: float,
    microstep: float,
    resolved: bool,
    max_step: float,
    max_way: float,
    rest: float,
    position: MutableSequence[float],
    velocity: MutableSequence[float],
    lag_low: MutableSequence[float],
    lag_high: MutableSequence[float],
) -> int:
    """Fill in the motion at each knot, from the state at the first; gives the steps taken.

    knots: n times in s; row_of: for each of the n - 1 intervals the command's segment,
    an index into anchor_of (s), x_of, v_of, a_of and j_of (microsteps and s);
    wave_number: k in 1/m; pull_out: F0/m in m/s²; damping: c_s/m in 1/s; microstep: in
    m; resolved: whether the drive's angle moves in whole microsteps; max_step: in s;
    max_way: the most that axis or command may go in a step, in m; rest: how far from its
    tooth (m), and how slow by the same measure, an axis under a constant command may be
    when it is taken to have come to rest. Outputs: position (m) and velocity (m/s) at the
    knots, and for each interval the least and greatest lag x_c - x (m).
    """
    natural = math.sqrt(wave_number * pull_out)
    x = position[0]
    v = velocity[0]
    row = -1
    anchor = 0.0
    ux = uv = ua = uj = 0.0
    steps = 0
    for i in range(len(knots) - 1):
        t = knots[i]
        length = knots[i + 1] - t
        if row_of[i] != row:
            row = row_of[i]
            anchor = anchor_of[row]
            ux = x_of[row]
            uv = v_of[row]
            ua = a_of[row]
            uj = j_of[row]
        holding = uv == 0.0 and ua == 0.0 and uj == 0.0
        if holding:
            angle = wave_number * (ux * microstep - x)
            if (
                abs(v) < rest * natural
                and abs(math.sin(angle)) < rest * wave_number
                and math.cos(angle) > 0.0
            ):
                v = 0.0
                position[i + 1] = x
                velocity[i + 1] = v
                lag_low[i] = lag_high[i] = ux * microstep - x
                continue
        tau = t - anchor
        u0 = ux + tau * (uv + tau * (ua / 2 + tau * uj / 6))
        w0 = (uv + tau * (ua + tau * uj / 2)) * microstep
        way = max(abs(v), abs(w0)) * length
        count = max(1, math.ceil(max(length / max_step, way / max_way) - 1e-9))
        steps += count
        h = length / count
        half = h / 2
        low = high = u0 * microstep - x
        for n in range(count):
            tau_mid = t + (n + 0.5) * h - anchor
            tau_end = t + (n + 1) * h - anchor
            u_mid = ux + tau_mid * (uv + tau_mid * (ua / 2 + tau_mid * uj / 6))
            u1 = ux + tau_end * (uv + tau_end * (ua / 2 + tau_end * uj / 6))
            w_mid = (uv + tau_mid * (ua + tau_mid * uj / 2)) * microstep
            w1 = (uv + tau_end * (ua + tau_end * uj / 2)) * microstep
            # The staircase of microsteps differs from the smooth command by a sawtooth.
            # Its mean over the step, from its integral -r²/2, keeps the impulse right
            # however many microsteps a step spans, where sampling it would alias.
            shift = 0.0
            if resolved and not holding:
                r0 = u0 - math.floor(u0 + 0.5)
                r1 = u1 - math.floor(u1 + 0.5)
                if abs(u1 - u0) > _FLAT_U:
                    shift = -(r1 * r1 - r0 * r0) / (2.0 * (u1 - u0))
                else:
                    shift = -(u_mid - math.floor(u_mid + 0.5))
            c0 = (u0 + shift) * microstep
            c_mid = (u_mid + shift) * microstep
            c1 = (u1 + shift) * microstep
            a1 = pull_out * math.sin(wave_number * (c0 - x)) + damping * (w0 - v)
            v2 = v + half * a1
            a2 = pull_out * math.sin(wave_number * (c_mid - x - half * v)) + damping * (w_mid - v2)
            v3 = v + half * a2
            a3 = pull_out * math.sin(wave_number * (c_mid - x - half * v2)) + damping * (w_mid - v3)
            v4 = v + h * a3
            a4 = pull_out * math.sin(wave_number * (c1 - x - h * v3)) + damping * (w1 - v4)
            x += h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            u0 = u1
            w0 = w1
            lag = u1 * microstep - x
            if lag < low:
                low = lag
            if lag > high:
                high = lag
        position[i + 1] = x
        velocity[i + 1] = v
        lag_low[i] = low
        lag_high[i] = high
    return steps
