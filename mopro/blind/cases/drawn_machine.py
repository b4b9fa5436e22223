"""Machines beside the motor, drawn at random: numbers, motions, sizes of what is hidden."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from mopro.blind.cases.machine_kinds import Span
from mopro.blind.reference.motor import Floats, Generator, Hidden
from mopro.blind.reference.stepped_machines import PLANTS, Columns

# Rows of all runs of a case together, at most.
_ROWS = 8000
_RATES_HZ = {
    "axis": (250.0, 500.0, 1000.0),
    "effort": (250.0, 500.0, 1000.0),
    "kinematic": (20.0, 100.0, 250.0),
    "python": (20.0, 100.0, 250.0),
    "thermal": (0.2, 0.5, 1.0),
}
_JITTER = 0.2
# Stated tolerance, as a share; a number is off by less.
TOLERANCE = 0.1


@dataclass(frozen=True)
class Machine:
    """A drawn machine: its kind and true numbers (SI), and what its files state of them.

    `free` are the numbers that are fitted from another start, `errors` the relative errors of those
    that have a tolerance. With `start` the files state where a run begins, with `zero` that the
    sensor has no offset.
    """

    kind: str
    numbers: dict[str, float]
    free: tuple[str, ...] = ()
    errors: dict[str, float] = field(default_factory=dict)
    start: bool = False
    zero: bool = True


def drawn(g: Generator, kind: str) -> Machine:
    """A machine of a kind."""
    numbers, free = _NUMBERS[kind](g)
    stated = [name for name in numbers if name not in (*free, "nodes", "begin", "spring")]
    errors = {str(g.choice(stated)): TOLERANCE * float(g.uniform(-0.9, 0.9))} if stated else {}
    start, zero = kind == "axis" and bool(g.integers(2)), bool(g.integers(2))
    return Machine(kind, numbers, free, errors, start, zero)


def _axis(g: Generator) -> tuple[dict[str, float], tuple[str, ...]]:
    mass = g.uniform(0.5, 5.0)
    spring = g.choice([0.0, g.uniform(20.0, 400.0) * mass])
    numbers = {"mass": mass, "viscous": g.uniform(0.5, 6.0) * mass, "spring": float(spring)}
    return numbers, ("viscous", "spring") if spring else ("viscous",)


def _kinematic(g: Generator) -> tuple[dict[str, float], tuple[str, ...]]:
    return {}, ()


def _thermal(g: Generator) -> tuple[dict[str, float], tuple[str, ...]]:
    nodes = int(g.integers(1, 3))
    numbers = {"nodes": float(nodes), "begin": g.uniform(18.0, 26.0)}
    for i in range(1, nodes + 1):
        loss = 1 / g.uniform(60.0, 300.0)
        numbers |= {f"a{i}": loss * g.uniform(20.0, 80.0), f"U{i}": loss}
    return numbers, tuple(name for name in numbers if name[0] in "aU")


def _effort(g: Generator) -> tuple[dict[str, float], tuple[str, ...]]:
    numbers = {"inertia": g.uniform(0.5, 5.0) * 1e-3, "damping": g.uniform(2.0, 20.0) * 1e-3}
    return numbers, tuple(numbers)


_NUMBERS = {
    "axis": _axis, "kinematic": _kinematic, "thermal": _thermal, "effort": _effort,
    "python": _kinematic,
}  # fmt: skip


# -- motions ---------------------------------------------------------------------------------


def columns(g: Generator, machine: Machine, runs: int, irregular: bool) -> Columns:
    """The columns of one of `runs` runs, without readings."""
    rate_hz = float(g.choice(_RATES_HZ[machine.kind]))
    rows = int(g.integers(400, 2400)) // (1 if runs < 4 else 2)
    t = np.arange(min(rows, _ROWS // runs)) / rate_hz
    if irregular:
        t[1:] += g.uniform(-_JITTER, _JITTER, len(t) - 1) / rate_hz
    return {"time_s": t, **_MOTIONS[machine.kind](g, machine, t)}


def _forces(g: Generator, machine: Machine, t: Floats) -> Columns:
    return {"force_N": 10 * machine.numbers["mass"] * g.uniform(0.3, 2.0) * _excitation(g, t)}


def _excitation(g: Generator, t: Floats) -> Floats:
    """Shares of at most 1 that begin at 0: sines, or steps that are held."""
    if g.integers(2):
        rates, sizes = g.uniform(0.4, 6.0, 6), g.uniform(0.3, 1.0, 6)
        push = (sizes[:, None] * np.sin(2 * np.pi * rates[:, None] * t)).sum(axis=0)
        found: Floats = push / np.abs(push).max()
        return found
    held = g.uniform(0.08, 0.4)
    steps = g.uniform(-1.0, 1.0, int(t[-1] / held) + 2)
    steps[0] = 0.0
    chosen: Floats = steps[(t / held).astype(int)]
    return chosen


def _commands(g: Generator, machine: Machine, t: Floats) -> Columns:
    travel = g.uniform(0.02, 0.3)
    if g.integers(2):
        places = np.r_[0.0, np.sort(g.uniform(0.1, 1.0, 2)), g.uniform(0.0, 1.0, 6)] * travel
        moved = np.interp(t, np.linspace(0.0, t[-1], 2 * len(places)), np.repeat(places, 2))
        return {"command_m": moved}
    turns = g.integers(1, 4)
    return {"command_m": travel / 2 * (1 - np.cos(2 * np.pi * turns * t / t[-1]))}


def _heating(g: Generator, machine: Machine, t: Floats) -> Columns:
    held = g.uniform(60.0, 300.0)
    count = int(t[-1] / held) + 2
    found = {}
    for i in range(int(machine.numbers["nodes"])):
        steps = np.r_[0.0, g.uniform(0.0, 0.8, count - 1)]
        found[f"duty{i + 1}"] = steps[(t / held).astype(int)]
    return found


def _swinging(g: Generator, machine: Machine, t: Floats) -> Columns:
    """A place with its exact speed and acceleration: some sines."""
    rates = 2 * np.pi * g.uniform(0.2, 2.0, 4)[:, None]
    sizes, angles = g.uniform(0.2, 1.0, 4)[:, None], g.uniform(0.0, 2 * np.pi, 4)[:, None]
    phase = rates * t + angles
    return {
        "angle_rad": (sizes * np.sin(phase)).sum(axis=0),
        "speed": (sizes * rates * np.cos(phase)).sum(axis=0),
        "acceleration": (-sizes * rates**2 * np.sin(phase)).sum(axis=0),
    }


_MOTIONS: dict[str, Callable[[Generator, Machine, Floats], Columns]] = {
    "axis": _forces, "kinematic": _commands, "thermal": _heating, "effort": _swinging,
    "python": _commands,
}  # fmt: skip


def span(machine: Machine, run: Columns) -> Span:
    """The sizes of a run without effects."""
    t, numbers = run["time_s"], machine.numbers
    seen = PLANTS[machine.kind](run, numbers, {})
    step_s, length_s = float(np.median(np.diff(t))), float(t[-1])
    if machine.kind == "thermal":
        rise = float(np.abs(seen - numbers["begin"]).max())
        return Span(1.0, rise, 0.0, numbers["a1"], step_s, length_s, numbers["U1"])
    if machine.kind == "effort":
        x, v, a = (float(np.abs(run[n]).max()) for n in ("angle_rad", "speed", "acceleration"))
        return Span(1.0, x, v, a, step_s, length_s, float(np.abs(seen).max()))
    place = seen[0]
    fast = float(np.abs(np.gradient(place, t)).max())
    drive = float(np.abs(run["force_N"]).max()) if machine.kind == "axis" else 1.0
    return Span(drive, float(np.abs(place).max()), fast, 0.0, step_s, length_s)


# -- hidden changes, less what the free numbers take up -----------------------------------------

# Relative step of a number for its derivative.
_STEP = 1e-4
_EVALUATIONS = 40


def stacked(machine: Machine, runs: Sequence[Columns], numbers: Mapping[str, float],
            effects: Hidden) -> Floats:  # fmt: skip
    """Readings of all runs, (rows of all sensors of all runs,), each series less its mean.

    The mean goes where the zero of the sensor is free.
    """
    series = [own for run in runs for own in seen(machine.kind, run, numbers, effects)]
    return np.concatenate([own if machine.zero else own - own.mean() for own in series])


def seen(kind: str, run: Columns, numbers: Mapping[str, float], effects: Hidden) -> Floats:
    """Readings (sensors, rows) of a run; NaN where the machine runs away."""
    try:
        return PLANTS[kind](run, numbers, effects)
    except OverflowError:
        return np.full((1, len(run["time_s"])), np.nan)


def visible(machine: Machine, runs: Sequence[Columns], effects: Hidden) -> dict[str, float]:
    """Size of each effect in the readings (their unit, root of the sum of squares).

    Of its change the part that no change of the free numbers makes, to first order.
    """
    every = stacked(machine, runs, machine.numbers, effects)
    taken = np.array([
        stacked(machine, runs, {**machine.numbers, name: value * (1 + _STEP)}, effects) - every
        for name, value in machine.numbers.items()
        if name in machine.free or name in machine.errors
    ])  # fmt: skip
    base = np.linalg.qr(taken.T)[0] if len(taken) else np.zeros((len(every), 0))
    found = {}
    for name in effects:
        others = {key: own for key, own in effects.items() if key != name}
        change = every - stacked(machine, runs, machine.numbers, others)
        found[name] = float(np.linalg.norm(change - base @ (base.T @ change)))
    return found


def left_by(
    machine: Machine, runs: Sequence[Columns], truth: Hidden, named: Hidden, sigma: float
) -> float:
    """Chi-squared that the effects `named`, refitted with the free numbers, leave of `truth`."""
    target = stacked(machine, runs, machine.numbers, truth)
    fitted = [*machine.free, *machine.errors]
    keys = [(name, parameter) for name, own in named.items() for parameter in own]
    start = np.array(
        [machine.numbers[n] for n in fitted] + [named[n][parameter] for n, parameter in keys]
    )
    scale = np.where(start == 0, 1e-6, np.abs(start))

    def rest(z: Floats) -> Floats:
        values = z * scale
        numbers = {
            **machine.numbers,
            **dict(zip(fitted, values[: len(fitted)].tolist(), strict=True)),
        }
        effects: dict[str, dict[str, float]] = {name: {} for name in named}
        for (name, parameter), value in zip(keys, values[len(fitted) :].tolist(), strict=True):
            effects[name][parameter] = value
        found: Floats = (stacked(machine, runs, numbers, effects) - target) / sigma
        return np.nan_to_num(found, nan=1e6, posinf=1e6, neginf=-1e6)

    first = rest(start / scale)
    if not len(start):
        return float(first @ first)
    best = least_squares(rest, start / scale, max_nfev=_EVALUATIONS, diff_step=1e-5)
    return float(min(first @ first, 2 * best.cost))
