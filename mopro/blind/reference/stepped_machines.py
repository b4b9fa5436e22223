"""Machines beside the motor that are stepped through time, and the plants of all kinds.

A plant gives the readings of its sensors, shape (sensors, rows), for the columns of one run, its
numbers, and effects by name with their parameters: SI throughout, temperatures in °C.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from mopro.blind.reference.closed_form_machines import behind, effort, slide
from mopro.blind.reference.motor import Floats, Hidden, of

Columns = dict[str, Floats]
Plant = Callable[[Mapping[str, Floats], Mapping[str, float], Hidden], Floats]
State = Sequence[float]
Rates = Callable[[float, State], State]


# -- Runge-Kutta's method under inputs that hold from row to row -------------------------------


def stepped(rates: Rates, t: float, state: State, h: float) -> list[float]:
    """The state after a step of `h` by the classical method of fourth order."""

    def moved(by: State, share: float) -> list[float]:
        return [s + share * d for s, d in zip(state, by, strict=True)]

    a = rates(t, state)
    b = rates(t + h / 2, moved(a, h / 2))
    c = rates(t + h / 2, moved(b, h / 2))
    d = rates(t + h, moved(c, h))
    return [
        s + h / 6 * (p + 2 * q + 2 * r + u) for s, p, q, r, u in zip(state, a, b, c, d, strict=True)
    ]


def pieces(times: Sequence[float], delay: float) -> list[tuple[int, int, float, float]]:
    """Stretches with one input each: the row before it, the row of its input, begin and end (s).

    The input of a row holds from its time plus `delay` to that of the next; before, the first's.
    """
    found = []
    given = 0
    late = [t + delay for t in times]
    while given + 1 < len(times) and late[given + 1] <= times[0]:
        given += 1
    for row, (begin, end) in enumerate(pairwise(times)):
        while given + 1 < len(times) and late[given + 1] < end:
            if late[given + 1] > begin:
                found.append((row, given, begin, late[given + 1]))
                begin = late[given + 1]
            given += 1
        found.append((row, given, begin, end))
    return found


# -- a mass under a force that holds from row to row, with a dry friction that can hold it -----

#     m a = f - b v - k x + effects,    |friction| at rest <= its limit
#
# RK4 with steps of at most `_STEP_S`; a step in which the mass turns is cut there by bisection, as
# the friction changes its side. Of motions up to some 10 Hz a step errs by a millionth.
_STEP_S = 1e-3
_BISECTIONS = 40
# Rates of place, speed, lagging force and lagging reading, and the friction's limit.
Law = Callable[[float, State, float, float], tuple[tuple[float, float, float, float], float]]


def mass(columns: Mapping[str, Floats], numbers: Mapping[str, float], effects: Hidden) -> Floats:
    """Place (m), shape (1, rows), of a mass that begins at rest at 0.

    Columns `time_s` and `force_N`; numbers mass (kg), viscous (N s/m), spring (N/m).
    """
    times, law = columns["time_s"].tolist(), _law(numbers, effects)
    given = _forces(columns["force_N"], effects).tolist()
    delay = of(effects, "input_delay", "d")
    lags = of(effects, "sensor_lag", "tau") > 0
    state: list[float] = [0.0, 0.0, given[0], 0.0]
    seen = np.zeros((1, len(times)))
    for row, source, begin, end in pieces(times, delay):
        count = max(math.ceil((end - begin) / _STEP_S), 1)
        for nth in range(count):
            h = (end - begin) / count
            state = _step(law, begin + nth * h, h, state, given[source])
        seen[0, row + 1] = state[3 if lags else 0]
    return seen


def _forces(force: Floats, effects: Hidden) -> Floats:
    """The force after what is done to the input."""
    width = of(effects, "input_dead_zone", "w")
    passed: Floats = force - np.sign(force) * np.minimum(np.abs(force), width)
    by_sign = of(effects, "direction_dependent_gain", "k_u") * np.abs(force)
    found: Floats = passed + by_sign + of(effects, "input_gain", "k") * force
    return found


def _law(numbers: Mapping[str, float], effects: Hidden) -> Law:
    mass, viscous, spring = numbers["mass"], numbers["viscous"], numbers["spring"]
    drag = viscous + of(effects, "viscous_drag", "b")
    square, cube = of(effects, "quadratic_drag", "d"), of(effects, "cubic_damping", "b3")
    stiffness = spring + of(effects, "stiffness", "k")
    hard, bent = of(effects, "cubic_stiffness", "k3"), of(effects, "bent spring", "q")
    bias, fading = of(effects, "bias_force", "g"), of(effects, "fading damping", "f")
    s, c = of(effects, "cogging", "s"), of(effects, "cogging", "c")
    wave = 2 * math.pi / (of(effects, "cogging", "P") or 1.0)
    gain = of(effects, "direction_dependent_gain", "k")
    dry, start = of(effects, "dry_friction", "Fc"), of(effects, "dry_friction", "Fs")
    speed = of(effects, "dry_friction", "vs") or 1.0
    place = of(effects, "friction of place", "F1")
    slow, slow_reading = of(effects, "input_lag", "tau"), of(effects, "sensor_lag", "tau")

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
    return stepped(lambda time_s, own: law(time_s, own, push, way)[0], t, state, h)


def _held(law: Law, t: float, h: float, state: State, push: float) -> list[float]:
    """A step at rest: what lags goes on."""

    def rates(time_s: float, own: State) -> State:
        return (0.0, 0.0, *law(time_s, own, push, 0.0)[0][2:])

    return stepped(rates, t, state, h)


# -- nodes that heaters warm and the surroundings cool, by RK4 in steps of a quarter of a row --

_ZERO_C = -273.15
_STEPS = 4


def nodes(columns: Mapping[str, Floats], numbers: Mapping[str, float], effects: Hidden) -> Floats:
    """Temperatures (°C), shape (nodes, rows), of nodes that begin as warm as the surroundings.

    Columns `time_s` and `duty1`, `duty2` (shares of 1); numbers `nodes`, `begin` (°C), and of each
    node i `a<i>` (K/s) and `U<i>` (1/s).
    """
    t, nodes = columns["time_s"], int(numbers["nodes"])
    gain = 1 + of(effects, "input_gain", "k")
    duty = [(gain * columns[f"duty{i + 1}"]).tolist() for i in range(nodes)]
    state: list[float] = [numbers["begin"]] * nodes
    seen = np.empty((nodes, len(t)))
    seen[:, 0] = state
    for row, source, begin, end in pieces(t.tolist(), of(effects, "input_delay", "d")):
        pushes = [own[source] for own in duty]
        h = (end - begin) / _STEPS
        rates = _Rates(pushes, numbers, effects)
        for nth in range(_STEPS):
            state = stepped(rates, begin + nth * h, state, h)
        seen[:, row + 1] = state
    if tau := of(effects, "sensor_lag", "tau"):
        seen = np.array([behind(t, own, tau) for own in seen])
    return seen + of(effects, "sensor_drift", "s") * t


class _Rates:
    """Rates (K/s) of the nodes while the inputs hold."""

    def __init__(self, pushes: State, numbers: Mapping[str, float], effects: Hidden) -> None:
        self._pushes, self._numbers = pushes, numbers
        keys = [(name, key) for name, own in effects.items() for key in own]
        self._of = {(name, key): float(effects[name][key]) for name, key in keys}

    def __call__(self, t: float, state: State) -> list[float]:
        of, numbers = self._of.get, self._numbers
        ambient = numbers["begin"] + of(("other_surroundings", "dT"), 0.0)
        ambient += of(("surroundings_drift", "r"), 0.0) * t
        cold = ambient - _ZERO_C
        found = []
        for i, own in enumerate(state):
            rise, push = own - ambient, self._pushes[i]
            loss = numbers[f"U{i + 1}"] * (1 + of(("growing loss", "g"), 0.0) * t)
            heat = push - of(("bent input", "q"), 0.0) * push * push
            rate = numbers[f"a{i + 1}"] * heat - loss * rise
            exchange = sum(other - own for other in state)
            rate += of(("coupling", "k"), 0.0) * exchange
            rate += of(("unequal_coupling", "d"), 0.0) * exchange * (i == 0)
            fourth = ((own - _ZERO_C) ** 4 - cold**4) / (4 * cold**3)
            rate -= of(("radiation", "r"), 0.0) * fourth
            rate -= of(("free_convection", "c"), 0.0) * rise * abs(rise) ** 0.25
            rate += of(("crosstalk", "x12"), 0.0) * (sum(self._pushes) - push)
            over = max(own - of(("vent", "level"), 0.0), 0.0)
            found.append(rate - of(("vent", "k"), 0.0) * over)
        return found


PLANTS: dict[str, Plant] = {
    "axis": mass,
    "kinematic": slide,
    "thermal": nodes,
    "effort": effort,
    # Somebody's program of a slide.
    "python": slide,
}
