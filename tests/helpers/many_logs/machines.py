"""Twenty small machines in closed form or integrated here: columns of SI arrays, none of mopro's.

Each is a function of a random generator and times (s) that gives its columns in a log's order.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from helpers.many_logs.units import SIZES, TURN


@dataclass
class Column:
    """A column: `values` in SI (NaN where there is none), written in `unit` with the word `blank`.

    `digits` are significant ones, `span` (SI) that after which an unwrapped value goes on,
    `cells` words that stand in place of a number, by row.
    """

    role: str
    name: str
    unit: str
    values: np.ndarray
    digits: int = 10
    blank: str = ""
    span: float | None = None
    cells: dict | None = None
    heading: str = ""
    form: str = ""


def steps(rng, t, rest_s=0.8):
    """Places between 0 and 1 that are reached by smooth moves, with rests between."""
    place, at, values = 0.0, 0.0, np.zeros(len(t))
    while at < t[-1]:
        begin = at + rng.uniform(rest_s, 2 * rest_s)
        takes = rng.uniform(0.6, 1.6)
        goal = rng.uniform(0.3, 1.0) if place < 0.3 else rng.uniform(0, 0.25)
        phase = np.clip((t - begin) / takes, 0, 1)
        moved = (goal - place) * (3 * phase**2 - 2 * phase**3)
        values = np.where(t >= begin, place + moved, np.where(t >= at, place, values))
        place, at = goal, begin + takes
    return values


def pushes(rng, t):
    """A push between -1 and 1 that changes every second or so."""
    edges = np.cumsum(rng.uniform(0.5, 1.5, int(t[-1]) * 3 + 9))
    levels = rng.uniform(-1, 1, len(edges) + 1)
    levels[0] = 0.7
    return levels[np.searchsorted(edges, t)]


def through_play(u, width):
    y = np.empty_like(u)
    y[0] = u[0]
    for i in range(1, len(u)):
        y[i] = min(max(y[i - 1], u[i] - width / 2), u[i] + width / 2)
    return y


def lagged(u, t, tau):
    """The exact answer of a first-order lag to values that are held."""
    y = np.empty_like(u)
    y[0] = u[0]
    for i in range(1, len(u)):
        y[i] = u[i - 1] + (y[i - 1] - u[i - 1]) * np.exp(-(t[i] - t[i - 1]) / tau)
    return y


def summed(speed, t):
    return np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))))


def _noise(rng, t, size):
    return size * rng.normal(size=len(t))


def _followed(unit, reach, response, seen_unit=None, names=("command", "position"), span=1.0):
    """A machine that goes where it is told: `reach` in `unit`, `response(rng, t, u)` in SI."""

    def make(rng, t):
        told = reach * SIZES[unit] * rng.uniform(0.5, 1.0) * steps(rng, t)
        seen = response(rng, t, told) + _noise(rng, t, 3e-4 * span * float(np.ptp(told)))
        return [
            Column("command", names[0], unit, told),
            Column("sensor", names[1], seen_unit or unit, seen),
        ]

    return make


def _turning(unit, turns):
    def make(rng, t):
        told = TURN * turns * rng.uniform(0.6, 1.0) * steps(rng, t)
        seen = lagged(told, t, 0.02) + _noise(rng, t, 2e-3)
        return [
            Column("command", "angle target", unit, told), Column("sensor", "angle", unit, seen)
        ]  # fmt: skip

    return make


def _counting(command, reach, per_unit):
    """Counts of an encoder for a command in another unit."""

    def make(rng, t):
        told = reach * SIZES[command] * rng.uniform(0.6, 1.0) * steps(rng, t)
        seen = np.round(per_unit / SIZES[command] * told + _noise(rng, t, 1.0))
        return [
            Column("command", "target", command, told),
            Column("sensor", "encoder", "count", seen),
        ]

    return make


def _driven(effort, size, seen, gain, tau, name="drive"):
    """An effort on an inertia with a drag; its speed or its place is read."""

    def make(rng, t):
        push = size * SIZES[effort] * pushes(rng, t)
        speed = lagged(gain / (size * SIZES[effort]) * push, t, tau)
        speed -= speed[0] * np.exp(-t / tau)
        values = speed if "/" in seen or seen == "rpm" else summed(speed, t)
        label = "speed" if "/" in seen or seen == "rpm" else "position"
        noise = _noise(rng, t, 1e-3 * float(np.ptp(values)))
        return [Column("input", name, effort, push), Column("sensor", label, seen, values + noise)]

    return make


def _heated(heat, size, warmth, nodes=1):
    def make(rng, t):
        power = size * SIZES[heat] * (0.1 + np.abs(pushes(rng, t)))
        columns = [Column("input", "heater", heat, power)]
        share = power / (size * SIZES[heat])
        rise = 30 * (lagged(share, t, 4.0) - share[0] * np.exp(-t / 4.0))
        for n in range(nodes):
            rise = rise if n == 0 else 0.6 * lagged(rise, t, 2.0)
            values = 20 + rise + _noise(rng, t, 0.02)
            columns.append(Column("sensor", ("block temp", "case temp")[n], warmth, values))
        return columns

    return make


def _speed_loop(unit, size):
    def make(rng, t):
        told = size * SIZES[unit] * pushes(rng, t)
        seen = lagged(told, t, 0.08) + _noise(rng, t, 1e-3 * size * SIZES[unit])
        return [
            Column("input", "speed target", unit, told),
            Column("sensor", "speed actual", unit, seen),
        ]

    return make


def _two_sensors(rng, t):
    told = 0.03 * rng.uniform(0.5, 1) * steps(rng, t)
    near, far = through_play(told, 5e-5), through_play(told, 1.2e-4)
    return [
        Column("command", "setpoint", "mm", told),
        Column("sensor", "encoder", "mm", near + _noise(rng, t, 2e-6)),
        Column("sensor", "laser", "um", far + _noise(rng, t, 3e-6)),
    ]


def _swinging(rng, t):
    """A free pendulum of small swings."""
    angle = rng.uniform(0.1, 0.3) * np.exp(-0.1 * t) * np.cos(6.3 * t)
    return [Column("sensor", "angle", "rad", angle + _noise(rng, t, 1e-3))]


@dataclass(frozen=True)
class Machine:
    """A base machine. `kind` is that of mopro, `options` are what its log needs; `hides` is named
    by reconcile; `tags` are facts that kinds of logs ask for."""

    make: Callable
    kind: str = "kinematic"
    options: tuple[str, ...] = ()
    hides: str | None = None
    tags: frozenset[str] = frozenset()


def _plays(rng, t, u):
    return through_play(u, rng.uniform(0.004, 0.01) * float(np.ptp(u)))


def _late(rng, t, u):
    return np.interp(t - rng.uniform(0.1, 0.2), t, u)


def _same(rng, t, u):
    return u


_FACTOR = frozenset({"factor"})
MACHINES = {
    "play, mm": Machine(_followed("mm", 20, _plays), hides="backlash", tags=_FACTOR),
    "scale, um": Machine(_followed("um", 900, lambda r, t, u: 1.004 * u), tags=_FACTOR | {"files"}),
    "lag, in": Machine(_followed("in", 3, lambda r, t, u: lagged(u, t, 0.05)), tags=_FACTOR),
    "delay, deg": Machine(
        _followed("deg", 80, _late, names=("angle setpoint", "angle actual")), tags=_FACTOR
    ),
    "nothing, mrad": Machine(
        _followed("mrad", 40, _same, names=("cmd angle", "angle")), tags=_FACTOR | {"files"}
    ),
    "zero, m": Machine(
        _followed("m", 0.4, lambda r, t, u: u + 0.01, names=("target pos", "actual pos")),
        tags=_FACTOR | {"files"},
    ),
    "turns, deg": Machine(_turning("deg", 5), tags=frozenset({"turns"})),
    "turns, rad": Machine(_turning("rad", 4), tags=frozenset({"turns"})),
    "mm to counts": Machine(_counting("mm", 60, 1000), tags=frozenset({"counts", "files"})),
    "turns to counts": Machine(_counting("rev", 12, 4096), tags=frozenset({"counts"})),
    "force, mm": Machine(_driven("N", 4, "mm", 0.02, 0.3, "force"), "axis"),
    "torque, rad/s": Machine(_driven("Nm", 0.2, "rad/s", 30, 0.4, "torque"), "axis"),
    "voltage, rpm": Machine(_driven("V", 12, "rpm", 90, 0.2, "voltage"), "axis"),
    "current, rad": Machine(_driven("A", 2, "rad", 3, 0.3, "motor current"), "axis"),
    "duty, mm/s": Machine(_driven("duty", 0.9, "mm/s", 0.1, 0.25, "pwm"), "axis"),
    "speed loop, rpm": Machine(_speed_loop("rpm", 900), "axis"),
    "heater, W": Machine(_heated("W", 40, "C"), "thermal"),
    "heater, %": Machine(_heated("%", 90, "K", 2), "thermal"),
    "two sensors": Machine(_two_sensors),
    "pendulum": Machine(_swinging, "axis", ("--kind", "axis")),
}  # fmt: skip
