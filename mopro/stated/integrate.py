"""Integration of an axis and of thermal nodes in time; the equations are codes of formulas.

Variables of the codes: 0 is the time (s), then the states, then the inputs, then constants.
Codes come in segments, given by their first and last index (m, 2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.engine.assumed import TINY
from mopro.formula.bytecode import MOST_STACKED, value_of
from mopro.process.jit import njit

Floats = NDArray[np.float64]
_compiled: Callable[..., Any] = njit(cache=True, nogil=True, error_model="numpy")
# Beyond it a state has run away, and the integration ends.
_FARTHEST = 1e12
# Reversals within one step, beyond which the axis rests for the remainder of it.
_MOST_REVERSALS = 8


@_compiled
def _set_inputs(
    variables: Floats, first: int, inputs: Floats, ends: Floats, i: int, share: float
) -> None:
    """Inputs between rows i - 1 and i: linear from where they are behind the row to their end."""
    for k in range(inputs.shape[0]):
        begin = inputs[k, i - 1]
        variables[first + k] = begin + share * (ends[k, i - 1] - begin)


@_compiled
def _accelerated(
    at: float, x: float, v: float, way: float, codes: Any, segments: Any, variables: Floats,
    stack: Floats,
) -> float:  # fmt: skip
    """The acceleration, dry friction opposed to a motion of direction `way` (0 for none).

    A law that depends on the sign of the speed has that of `way`, also where the step goes past 0.
    """
    if way != 0.0 and way * v <= 0.0:
        v = way * TINY
    variables[0], variables[1], variables[2] = at, x, v
    pushed: float = value_of(codes, segments[0, 0], segments[0, 1], variables, stack)
    if way != 0.0:
        pushed -= way * value_of(codes, segments[1, 0], segments[1, 1], variables, stack)
    return pushed


@_compiled
def _advanced(
    first: float, h: float, x: float, v: float, way: float, codes: Any, segments: Any,
    variables: Floats, stack: Floats, inputs: Floats, ends: Floats, i: int, begin: float,
    span: float,
) -> tuple[float, float]:  # fmt: skip
    """Position and velocity after `h` from time `first`, by a step of the RK4 method."""
    _set_inputs(variables, 3, inputs, ends, i, (first - begin) / span)
    a1 = _accelerated(first, x, v, way, codes, segments, variables, stack)
    _set_inputs(variables, 3, inputs, ends, i, (first + h / 2 - begin) / span)
    v2 = v + h / 2 * a1
    a2 = _accelerated(first + h / 2, x + h / 2 * v, v2, way, codes, segments, variables, stack)
    v3 = v + h / 2 * a2
    a3 = _accelerated(first + h / 2, x + h / 2 * v2, v3, way, codes, segments, variables, stack)
    _set_inputs(variables, 3, inputs, ends, i, (first + h - begin) / span)
    v4 = v + h * a3
    a4 = _accelerated(first + h, x + h * v3, v4, way, codes, segments, variables, stack)
    return x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


@_compiled
def _rubbed(
    first: float, h: float, x: float, v: float, codes: Any, segments: Any, variables: Floats,
    stack: Floats, inputs: Floats, ends: Floats, i: int, begin: float, span: float,
) -> tuple[float, float]:  # fmt: skip
    """One step with dry friction, which holds an axis at rest or turns with its motion.

    A step ends where the velocity passes zero, and what is left of it begins there.
    """
    for _ in range(_MOST_REVERSALS):
        way = np.sign(v)
        if v == 0.0:
            _set_inputs(variables, 3, inputs, ends, i, (first - begin) / span)
            pushed = _accelerated(first, x, v, 0.0, codes, segments, variables, stack)
            limit = value_of(codes, segments[1, 0], segments[1, 1], variables, stack)
            if abs(pushed) <= limit:
                return x, v
            way = np.sign(pushed)
        x1, v1 = _advanced(
            first, h, x, v, way, codes, segments, variables, stack, inputs, ends, i, begin, span
        )
        if way * v1 >= 0.0:
            return x1, v1
        if v == 0.0:
            return x, v
        part = h * v / (v - v1)
        for _ in range(2):
            x1, v1 = _advanced(
                first, part, x, v, way, codes, segments, variables, stack, inputs, ends, i,
                begin, span,
            )  # fmt: skip
            part = min(max(part * v / (v - v1), 0.0), h) if v != v1 else part
        x1, v1 = _advanced(
            first, part, x, v, way, codes, segments, variables, stack, inputs, ends, i, begin, span
        )
        x, v, first, h = x1, 0.0, first + part, h - part
        if h <= 0.0:
            return x, v
    return x, v


@_compiled
def axis(
    codes: Any, segments: Any, variables: Floats, time_s: Floats, inputs: Floats, ends: Floats,
    longest_s: float, states: Floats,
) -> None:  # fmt: skip
    """Position and velocity (2, n) at `time_s`, from those of the first column of `states`.

    Segments: the acceleration, and the limit of dry friction as an acceleration. Steps of the
    RK4 method are of `longest_s` at most. NaN from where the axis runs away.
    """
    stack = np.empty(MOST_STACKED)
    x, v = states[0, 0], states[1, 0]
    dry = segments[1, 1] > segments[1, 0]
    for i in range(1, len(time_s)):
        begin, span = time_s[i - 1], time_s[i] - time_s[i - 1]
        steps = int(max(1.0, math.ceil(span / longest_s - 1e-6)))
        h = span / steps
        for step in range(steps):
            if dry:
                x, v = _rubbed(
                    begin + step * h, h, x, v, codes, segments, variables, stack, inputs, ends, i,
                    begin, span,
                )  # fmt: skip
            else:
                x, v = _advanced(
                    begin + step * h, h, x, v, 0.0, codes, segments, variables, stack, inputs,
                    ends, i, begin, span,
                )  # fmt: skip
        if not (abs(x) < _FARTHEST and abs(v) < _FARTHEST):
            states[:, i:] = np.nan
            return
        states[0, i], states[1, i] = x, v


@_compiled
def _rates(
    at: float, share: float, state: Floats, i: int, codes: Any, segments: Any, variables: Floats,
    stack: Floats, inputs: Floats, ends: Floats, found: Floats,
) -> None:  # fmt: skip
    """Rates of all states, into `found`, at a time and at this share of the way to row `i`."""
    count = len(state)
    variables[0] = at
    variables[1 : 1 + count] = state
    _set_inputs(variables, 1 + count, inputs, ends, i, share)
    for j in range(count):
        found[j] = value_of(codes, segments[j, 0], segments[j, 1], variables, stack)


@_compiled
def nodes(
    codes: Any, segments: Any, variables: Floats, time_s: Floats, inputs: Floats, ends: Floats,
    longest_s: float, states: Floats,
) -> None:  # fmt: skip
    """States (m, n) of coupled first-order equations, from the first column, by the RK4 method.

    Segments: the rate of each state. NaN from where one of them runs away.
    """
    stack = np.empty(MOST_STACKED)
    state = states[:, 0].copy()
    a, b, c, d = np.empty((4, len(state)))
    for i in range(1, len(time_s)):
        span = time_s[i] - time_s[i - 1]
        steps = int(max(1.0, math.ceil(span / longest_s - 1e-6)))
        h, begin = span / steps, time_s[i - 1]
        for step in range(steps):
            t, middle = begin + step * h, (step + 0.5) / steps
            given = (i, codes, segments, variables, stack, inputs, ends)
            _rates(t, step / steps, state, *given, a)
            _rates(t + h / 2, middle, state + h / 2 * a, *given, b)
            _rates(t + h / 2, middle, state + h / 2 * b, *given, c)
            _rates(t + h, (step + 1) / steps, state + h * c, *given, d)
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
        if not np.all(np.abs(state) < _FARTHEST):
            states[:, i:] = np.nan
            return
        states[:, i] = state
