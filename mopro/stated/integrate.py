"""Integration of an axis and of thermal nodes in time; the equations are operations of formulas.

Numbers: 0 is the time (s), then the states, then the inputs, then what does not change. Operations,
segments and results are those of a `Program`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.engine.assumed import TINY
from mopro.formula.bytecode import FIXED, MOVING, NONE, TIMED, carry_out, inlined
from mopro.process.jit import njit

Floats = NDArray[np.float64]
_compiled: Callable[..., Any] = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
# Beyond it a state has run away, and the integration ends.
_FARTHEST = 1e12
# Reversals within one step, beyond which the axis rests for the remainder of it.
_MOST_REVERSALS = 8
# Secant steps to where the velocity passes zero.
_TRIALS = 3


@inlined
def _timed(
    at: float, share: float, first: int, operations: Any, segments: Any, numbers: Floats,
    inputs: Floats, ends: Floats, i: int,
) -> None:  # fmt: skip
    """Set the time, the inputs from number `first` on, and what depends on these alone.

    Inputs between rows i - 1 and i: linear from where they are behind the row to their end.
    """
    numbers[0] = at
    for k in range(inputs.shape[0]):
        begin = inputs[k, i - 1]
        numbers[first + k] = begin + share * (ends[k, i - 1] - begin)
    carry_out(operations, segments[TIMED, 0], segments[TIMED, 1], numbers)


@inlined
def _value(nth: int, operations: Any, segments: Any, results: Any, numbers: Floats) -> float:
    """The value number `nth` of the program."""
    carry_out(operations, segments[MOVING + nth, 0], segments[MOVING + nth, 1], numbers)
    value: float = numbers[results[nth]]
    return value


@inlined
def _accelerated(
    x: float, v: float, way: float, operations: Any, segments: Any, results: Any, numbers: Floats
) -> float:
    """The acceleration, dry friction opposed to a motion of direction `way` (0 for none).

    A law that depends on the sign of the speed has that of `way`, also where the step goes past 0.
    """
    if way != 0.0 and way * v <= 0.0:
        v = way * TINY
    numbers[1], numbers[2] = x, v
    pushed: float = _value(0, operations, segments, results, numbers)
    if way != 0.0:
        pushed -= way * _value(1, operations, segments, results, numbers)
    return pushed


@inlined
def _advanced(
    first: float, h: float, x: float, v: float, way: float, operations: Any, segments: Any,
    results: Any, numbers: Floats, inputs: Floats, ends: Floats, i: int, begin: float,
    span: float,
) -> tuple[float, float]:  # fmt: skip
    """Position and velocity after `h` from time `first`, by a step of the RK4 method."""
    given = (operations, segments, numbers, inputs, ends, i)
    program = (operations, segments, results, numbers)
    _timed(first, (first - begin) / span, 3, *given)
    a1 = _accelerated(x, v, way, *program)
    _timed(first + h / 2, (first + h / 2 - begin) / span, 3, *given)
    v2 = v + h / 2 * a1
    a2 = _accelerated(x + h / 2 * v, v2, way, *program)
    v3 = v + h / 2 * a2
    a3 = _accelerated(x + h / 2 * v2, v3, way, *program)
    _timed(first + h, (first + h - begin) / span, 3, *given)
    v4 = v + h * a3
    a4 = _accelerated(x + h * v3, v4, way, *program)
    return x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


@inlined
def _stepped(
    first: float, h: float, x: float, v: float, dry: bool, operations: Any, segments: Any,
    results: Any, numbers: Floats, inputs: Floats, ends: Floats, i: int, begin: float,
    span: float,
) -> tuple[float, float]:  # fmt: skip
    """Position and velocity a step `h` after time `first`.

    Dry friction holds an axis at rest, or turns with its motion: a step ends where the velocity
    passes zero, and what is left of it begins there.
    """
    for _ in range(_MOST_REVERSALS):
        way = np.sign(v) if dry else 0.0
        if dry and v == 0.0:
            share = (first - begin) / span
            _timed(first, share, 3, operations, segments, numbers, inputs, ends, i)
            pushed = _accelerated(x, v, 0.0, operations, segments, results, numbers)
            limit = _value(1, operations, segments, results, numbers)
            if abs(pushed) <= limit:
                return x, v
            way = np.sign(pushed)
        part = h
        for trial in range(_TRIALS + 1):
            x1, v1 = _advanced(
                first, part, x, v, way, operations, segments, results, numbers, inputs, ends, i,
                begin, span,
            )  # fmt: skip
            if trial == 0:
                if not way * v1 < 0.0:
                    return x1, v1
                if v == 0.0:
                    return x, v
                part = h * v / (v - v1)
            elif trial < _TRIALS and v != v1:
                part = min(max(part * v / (v - v1), 0.0), h)
        x, v, first, h = x1, 0.0, first + part, h - part
        if h <= 0.0:
            return x, v
    return x, v


@_compiled
def axis(
    operations: Any, segments: Any, results: Any, numbers: Floats, time_s: Floats,
    inputs: Floats, ends: Floats, longest_s: float, states: Floats,
) -> None:  # fmt: skip
    """Position and velocity (2, n) at `time_s`, from those of the first column of `states`.

    Values of the program: the acceleration, and the limit of dry friction as an acceleration, if
    any. Steps of the RK4 method are of `longest_s` at most. NaN from where the axis runs away.
    """
    carry_out(operations, segments[FIXED, 0], segments[FIXED, 1], numbers)
    x, v = states[0, 0], states[1, 0]
    dry = results[1] != NONE
    for i in range(1, len(time_s)):
        begin, span = time_s[i - 1], time_s[i] - time_s[i - 1]
        steps = int(max(1.0, math.ceil(span / longest_s - 1e-6)))
        h = span / steps
        given = (operations, segments, results, numbers, inputs, ends, i, begin, span)
        for step in range(steps):
            x, v = _stepped(begin + step * h, h, x, v, dry, *given)
        if not (abs(x) < _FARTHEST and abs(v) < _FARTHEST):
            states[:, i:] = np.nan
            return
        states[0, i], states[1, i] = x, v


@inlined
def _rates(
    state: Floats, h: float, before: Floats, operations: Any, segments: Any, results: Any,
    numbers: Floats, found: Floats,
) -> None:  # fmt: skip
    """Rates of all states, into `found`, `h` after `state` at the rates `before`.

    At the time and the inputs that are set.
    """
    for j in range(len(state)):
        numbers[1 + j] = state[j] + h * before[j]
    for j in range(len(state)):
        found[j] = _value(j, operations, segments, results, numbers)


@_compiled
def nodes(
    operations: Any, segments: Any, results: Any, numbers: Floats, time_s: Floats,
    inputs: Floats, ends: Floats, longest_s: float, rates: Floats, states: Floats,
) -> None:  # fmt: skip
    """States (m, n) of coupled first-order equations, from the first column, by the RK4 method.

    Values of the program: the rate of each state. `rates` (5, m) is room to work in. NaN from where
    a state runs away.
    """
    carry_out(operations, segments[FIXED, 0], segments[FIXED, 1], numbers)
    state, a, b, c, d = rates[0], rates[1], rates[2], rates[3], rates[4]
    for j in range(len(state)):
        state[j] = states[j, 0]
    program, first = (operations, segments, results, numbers), 1 + len(state)
    for i in range(1, len(time_s)):
        span = time_s[i] - time_s[i - 1]
        steps = int(max(1.0, math.ceil(span / longest_s - 1e-6)))
        h, begin = span / steps, time_s[i - 1]
        given = (first, operations, segments, numbers, inputs, ends, i)
        for step in range(steps):
            t = begin + step * h
            _timed(t, step / steps, *given)
            _rates(state, 0.0, state, *program, a)
            _timed(t + h / 2, (step + 0.5) / steps, *given)
            _rates(state, h / 2, a, *program, b)
            _rates(state, h / 2, b, *program, c)
            _timed(t + h, (step + 1) / steps, *given)
            _rates(state, h, c, *program, d)
            for j in range(len(state)):
                state[j] += h / 6 * (a[j] + 2 * b[j] + 2 * c[j] + d[j])
        for j in range(len(state)):
            if not abs(state[j]) < _FARTHEST:
                states[:, i:] = np.nan
                return
            states[j, i] = state[j]
