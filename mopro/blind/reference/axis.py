"""A mass under a force that holds from row to row, with a dry friction that can hold it.

    m a = f - b v - k x + effects,    |friction| at rest <= its limit

RK4 with steps of at most `_STEP_S`; a step in which the mass turns is cut there by bisection, as
the friction changes its side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.blind.reference.held import State, pieces, stepped

Floats = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]
# Of motions up to some 10 Hz a step errs by a millionth.
_STEP_S = 1e-3
_BISECTIONS = 40
# Rates of place, speed, lagging force and lagging reading, and the friction's limit.
Law = Callable[[float, State, float, float], tuple[tuple[float, float, float, float], float]]


def readings(
    columns: Mapping[str, Floats], numbers: Mapping[str, float], effects: Effects
) -> Floats:
    """Place (m), shape (1, rows), of a mass that begins at rest at 0.

    Columns `time_s` and `force_N`; numbers mass (kg), viscous (N s/m), spring (N/m).
    """
    times, law = columns["time_s"].tolist(), _law(numbers, effects)
    given = _forces(columns["force_N"], effects).tolist()
    delay = _of(effects, "input_delay", "d")
    lags = _of(effects, "sensor_lag", "tau") > 0
    state: list[float] = [0.0, 0.0, given[0], 0.0]
    seen = np.zeros((1, len(times)))
    for row, source, begin, end in pieces(times, delay):
        count = max(math.ceil((end - begin) / _STEP_S), 1)
        for nth in range(count):
            h = (end - begin) / count
            state = _step(law, begin + nth * h, h, state, given[source])
        seen[0, row + 1] = state[3 if lags else 0]
    return seen


def _of(effects: Effects, name: str, parameter: str) -> float:
    return float(effects.get(name, {}).get(parameter, 0.0))


def _forces(force: Floats, effects: Effects) -> Floats:
    """The force after what is done to the input."""
    width = _of(effects, "input_dead_zone", "w")
    passed: Floats = force - np.sign(force) * np.minimum(np.abs(force), width)
    by_sign = _of(effects, "direction_dependent_gain", "k_u") * np.abs(force)
    found: Floats = passed + by_sign + _of(effects, "input_gain", "k") * force
    return found


def _law(numbers: Mapping[str, float], effects: Effects) -> Law:
    mass, viscous, spring = numbers["mass"], numbers["viscous"], numbers["spring"]
    drag = viscous + _of(effects, "viscous_drag", "b")
    square, cube = _of(effects, "quadratic_drag", "d"), _of(effects, "cubic_damping", "b3")
    stiffness = spring + _of(effects, "stiffness", "k")
    hard, bent = _of(effects, "cubic_stiffness", "k3"), _of(effects, "bent spring", "q")
    bias, fading = _of(effects, "bias_force", "g"), _of(effects, "fading damping", "f")
    s, c = _of(effects, "cogging", "s"), _of(effects, "cogging", "c")
    wave = 2 * math.pi / (_of(effects, "cogging", "P") or 1.0)
    gain = _of(effects, "direction_dependent_gain", "k")
    dry, start = _of(effects, "dry_friction", "Fc"), _of(effects, "dry_friction", "Fs")
    speed = _of(effects, "dry_friction", "vs") or 1.0
    place = _of(effects, "friction of place", "F1")
    slow, slow_reading = _of(effects, "input_lag", "tau"), _of(effects, "sensor_lag", "tau")

    def law(
        t: float, state: State, push: float, way: float
    ) -> tuple[tuple[float, float, float, float], float]:
        x, v, z, y = state
        force = (z if slow > 0 else push) * (1 + gain * way)
        force += bias - drag * (1 - fading * t) * v - stiffness * x
        force -= square * v * abs(v) + cube * v**3 + hard * x**3 + bent * x * x
        if s or c:
            force += s * math.sin(wave * x) + c * math.cos(wave * x)
        limit = dry + start * math.exp(-((v / speed) ** 2)) + place * abs(x)
        return (
            v,
            (force - way * limit) / mass,
            (push - z) / slow if slow > 0 else 0.0,
            (x - y) / slow_reading if slow_reading > 0 else 0.0,
        ), limit / mass

    return law


def _step(law: Law, t: float, h: float, state: State, push: float) -> list[float]:
    """The state after a step, in which the mass may turn once or stay at rest."""
    way = math.copysign(1.0, state[1]) if state[1] else _way_from_rest(law, t, state, push)
    if not way:
        return _held(law, t, h, state, push)
    new = _moved(law, t, h, state, push, way)
    if new[1] * way >= 0:
        return new
    low, high = 0.0, h
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        turned = _moved(law, t, middle, state, push, way)
        low, high = (middle, high) if turned[1] * way >= 0 else (low, middle)
    turned = _moved(law, t, low, state, push, way)
    turned[1] = 0.0
    way = _way_from_rest(law, t + low, turned, push)
    if not way:
        return _held(law, t + low, h - low, turned, push)
    return _moved(law, t + low, h - low, turned, push, way)


def _way_from_rest(law: Law, t: float, state: State, push: float) -> float:
    """The side to which the force moves the mass; 0 if the friction holds it."""
    for way in (1.0, -1.0):
        rates, _ = law(t, state, push, way)
        if rates[1] * way > 0:
            return way
    return 0.0


def _moved(law: Law, t: float, h: float, state: State, push: float, way: float) -> list[float]:
    return stepped(lambda now, own: law(now, own, push, way)[0], t, state, h)


def _held(law: Law, t: float, h: float, state: State, push: float) -> list[float]:
    """A step at rest: what lags goes on."""

    def rates(now: float, own: State) -> State:
        return (0.0, 0.0, *law(now, own, push, 0.0)[0][2:])

    return stepped(rates, t, state, h)
