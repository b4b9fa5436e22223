"""Nodes that heaters warm and the surroundings cool, by RK4 in steps of a quarter of a row."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mopro.blind.reference.held import State, pieces, stepped
from mopro.blind.reference.kinematic import behind

Floats = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]
_ZERO_C = -273.15
_STEPS = 4


def readings(
    columns: Mapping[str, Floats], numbers: Mapping[str, float], effects: Effects
) -> Floats:
    """Temperatures (°C), shape (nodes, rows), of nodes that begin as warm as the surroundings.

    Columns `time_s` and `duty1`, `duty2` (shares of 1); numbers `nodes`, `begin` (°C), and of each
    node i `a<i>` (K/s) and `U<i>` (1/s).
    """
    t, nodes = columns["time_s"], int(numbers["nodes"])
    gain = 1 + _of(effects, "input_gain", "k")
    duty = [(gain * columns[f"duty{i + 1}"]).tolist() for i in range(nodes)]
    state: list[float] = [numbers["begin"]] * nodes
    seen = np.empty((nodes, len(t)))
    seen[:, 0] = state
    for row, source, begin, end in pieces(t.tolist(), _of(effects, "input_delay", "d")):
        pushes = [own[source] for own in duty]
        h = (end - begin) / _STEPS
        rates = _Rates(pushes, numbers, effects)
        for nth in range(_STEPS):
            state = stepped(rates, begin + nth * h, state, h)
        seen[:, row + 1] = state
    if tau := _of(effects, "sensor_lag", "tau"):
        seen = np.array([behind(t, own, tau) for own in seen])
    return seen + _of(effects, "sensor_drift", "s") * t


def _of(effects: Effects, name: str, parameter: str) -> float:
    return float(effects.get(name, {}).get(parameter, 0.0))


class _Rates:
    """Rates (K/s) of the nodes while the inputs hold."""

    def __init__(self, pushes: State, numbers: Mapping[str, float], effects: Effects) -> None:
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
