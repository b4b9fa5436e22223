"""Machines of other kinds, drawn with one hidden effect each: what `mopro reconcile` names.

    python bench/other_machines.py [--cases 60] [--seed 1] [--jobs 2] [--keep FOLDER]

Axes under a force, machines that go where they are told, and thermal nodes, in turn. Their
numbers, motions, noise (white, of unknown size, or coloured) and the effect are drawn; one in ten
has none, and a part has one that nobody listed. The records are made here, by a solver of their
own: RK4 with steps of a hundredth of a sample, which are cut by bisection where an axis turns.
Prints each miss and a table; a case is right if

- listed: the hidden effect, or one that these data cannot tell from it, is named, and nothing else,
- unlisted: nothing is named without a doubt, and a term of its variable is drafted,
- none: the answer is `none`.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.rigs import DRIVEN
from mopro.experiment.opened import open_experiment

# Whitened size of the hidden effect from which on it should be found; 3 times in coloured noise.
LEAST_SIGMAS = 20.0
MEMORY = 0.8
SUBSTEPS = 100
# What of each kind is hidden: listed effects with those that are the same to a linear machine, and
# unlisted ones with their variables. The same probability each.
LAG = frozenset({"input_lag", "sensor_lag"})
LISTED = {
    "axis": {
        "dry_friction": {"dry_friction"}, "stribeck": {"dry_friction"},
        "quadratic_drag": {"quadratic_drag"}, "cubic_damping": {"cubic_damping"},
        "cubic_stiffness": {"cubic_stiffness"}, "cogging": {"cogging"},
        "bias_force": {"bias_force"}, "input_delay": {"input_delay"}, "input_lag": LAG,
        "sensor_lag": LAG, "direction_dependent_gain": {"direction_dependent_gain", "input_gain"},
    },
    "kinematic": {
        "backlash": {"backlash"}, "scale": {"scale"}, "lag": {"lag"}, "delay": {"delay"},
        "periodic_error": {"periodic_error"}, "drift": {"drift"},
    },
    "thermal": {
        "coupling": {"coupling"}, "radiation": {"radiation"}, "sensor_lag": {"sensor_lag"},
        "input_delay": {"input_delay"}, "surroundings_drift": {"surroundings_drift"},
    },
}  # fmt: skip
UNLISTED = {
    "axis": {"friction of place": {"x"}, "bent spring": {"x"}, "fading damping": {"t", "v"}},
    "kinematic": {"bow": {"x"}, "bent scale": {"x"}},
    "thermal": {"growing loss": {"t"}, "bent input": {"command"}, "vent": {"T"}},
}
NONE_IN = 10

Floats = Any
# Rates (K/s) at a time, by the rise and the duty of each node, with the hidden effect or without.
Rates = Callable[[float, Floats, Floats, bool], Floats]


@dataclass(frozen=True)
class Case:
    """A record in `folder`: the kind of its machine, what it hides and its noise."""

    folder: Path
    kind: str
    hidden: str
    noise: str


# -- axes ------------------------------------------------------------------------------------

AXIS_NUMBERS = (
    "mass", "viscous", "spring", "quadratic_drag", "cubic_damping", "bent spring",
    "cubic_stiffness", "bias_force", "cogging", "period", "direction_dependent_gain",
    "fading damping", "dry_friction", "stribeck", "speed", "friction of place", "input_lag",
    "sensor_lag",
)  # fmt: skip


@njit(cache=True)
def _rates(t, x, v, z, y, push, way, p):
    """Rates of place, speed, lagging input and lagging sensor, moving in direction `way`."""
    given = z if p[16] > 0 else push
    force = given * (1 + p[10] * way) - p[1] * (1 - p[11] * t) * v - p[2] * x
    force -= p[3] * v * abs(v) + p[4] * v**3 + p[5] * x * x + p[6] * x**3 + p[7]
    force -= p[8] * math.sin(2 * math.pi * x / p[9])
    dry = p[12] + p[13] * math.exp(-((v / p[14]) ** 2)) + p[15] * abs(x)
    return (
        v, (force - way * dry) / p[0], (push - z) / p[16] if p[16] > 0 else 0.0,
        (x - y) / p[17] if p[17] > 0 else 0.0, dry,
    )  # fmt: skip


@njit(cache=True)
def _moved(t, h, state, push, way, p):
    x, v, z, y = state
    a = _rates(t, x, v, z, y, push, way, p)
    s = h / 2
    b = _rates(t + s, x + s * a[0], v + s * a[1], z + s * a[2], y + s * a[3], push, way, p)
    c = _rates(t + s, x + s * b[0], v + s * b[1], z + s * b[2], y + s * b[3], push, way, p)
    d = _rates(t + h, x + h * c[0], v + h * c[1], z + h * c[2], y + h * c[3], push, way, p)
    return (
        x + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0]),
        v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1]),
        z + h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2]),
        y + h / 6 * (a[3] + 2 * b[3] + 2 * c[3] + d[3]),
    )


@njit(cache=True)
def _axis(pushes, step_s, substeps, p):
    """Place and lagging reading (2, samples) of an axis that begins at rest under held forces."""
    state, seen = (0.0, 0.0, 0.0, 0.0), np.empty((2, len(pushes)))
    for i, push in enumerate(pushes):
        seen[0, i], seen[1, i] = state[0], state[3]
        for k in range(substeps):
            t, h = (i + k / substeps) * step_s, step_s / substeps
            way = math.copysign(1.0, state[1]) if state[1] != 0.0 else 0.0
            if way == 0.0:
                rates = _rates(t, state[0], 0.0, state[2], state[3], push, 0.0, p)
                if abs(rates[1]) * p[0] > rates[4]:
                    way = math.copysign(1.0, rates[1])
                else:
                    rest = _moved(t, h, state, push, 0.0, p)
                    state = (state[0], 0.0, rest[2], rest[3])
                    continue
            new = _moved(t, h, state, push, way, p)
            if new[1] * way < 0.0:
                low, high = 0.0, h
                for _ in range(40):
                    middle = (low + high) / 2
                    if _moved(t, middle, state, push, way, p)[1] * way < 0.0:
                        high = middle
                    else:
                        low = middle
                turned = _moved(t, low, state, push, way, p)
                state = (turned[0], 0.0, turned[2], turned[3])
                rates = _rates(t + low, state[0], 0.0, state[2], state[3], push, 0.0, p)
                if abs(rates[1]) * p[0] > rates[4]:
                    way = math.copysign(1.0, rates[1])
                    state = _moved(t + low, h - low, state, push, way, p)
            else:
                state = new
    return seen


def _excitation(rng: np.random.Generator, t: Floats) -> Floats:
    """A force or duty of at most 1 that begins at 0."""
    if rng.integers(2):
        rates, sizes = rng.uniform(0.15, 3.0, 6), rng.uniform(0.3, 1.0, 6)
        push = (sizes[:, None] * np.sin(2 * np.pi * rates[:, None] * t)).sum(axis=0)
        return push / np.abs(push).max()
    held = max(int(rng.uniform(0.2, 0.8) / (t[1] - t[0])), 1)
    steps = rng.uniform(-1.0, 1.0, len(t) // held + 1)
    steps[0] = 0.0
    return np.repeat(steps, held)[: len(t)]


def axis(rng: np.random.Generator, hidden: str) -> tuple[dict[str, Floats], Floats, str, str]:
    """Columns with the hidden effect, the reading without (mm), and the texts of both files."""
    t = np.arange(int(rng.integers(800, 2500))) * float(rng.choice([0.005, 0.01, 0.02]))
    step_s, most = float(t[1]), rng.uniform(5.0, 30.0)
    mass = rng.uniform(0.5, 5.0)
    numbers = dict.fromkeys(AXIS_NUMBERS, 0.0) | {"mass": mass, "period": 1.0, "speed": 1.0}
    numbers["viscous"] = rng.uniform(0.5, 4.0) * mass
    numbers["spring"] = rng.choice([0.0, rng.uniform(5.0, 60.0) * mass])
    pushes = most * _excitation(rng, t)

    def run(pushed: Floats, substeps: int = SUBSTEPS) -> Floats:
        return _axis(pushed, step_s, substeps, np.array([numbers[n] for n in AXIS_NUMBERS]))

    (plain, _) = run(pushes)
    far, fast = np.abs(plain).max(), np.abs(np.gradient(plain, t)).max()
    share, pushed = rng.uniform(0.05, 0.3), pushes
    unit = {
        "dry_friction": 0.5, "stribeck": 0.4, "quadratic_drag": fast**-2,
        "cubic_damping": fast**-3, "bent spring": far**-2, "cubic_stiffness": 2 * far**-3,
        "bias_force": 0.5, "cogging": 0.5, "friction of place": far**-1,
    }  # fmt: skip
    if hidden in unit:
        numbers[hidden] = share * most * unit[hidden]
    if hidden == "stribeck":
        numbers |= {"dry_friction": numbers["stribeck"], "speed": fast * rng.uniform(0.03, 0.1)}
    if hidden == "cogging":
        numbers["period"] = far * rng.uniform(0.1, 0.4)
    if hidden == "direction_dependent_gain":
        numbers[hidden] = share
    if hidden == "fading damping":
        numbers[hidden] = 2 * share / t[-1]
    if hidden in LAG:
        numbers[hidden] = rng.uniform(3.0, 10.0) * step_s
    if hidden == "input_delay":
        late = int(rng.integers(1, 8))
        pushed = np.r_[np.zeros(late), pushes[:-late]]
    x, lagging = run(pushed)
    seen = lagging if numbers["sensor_lag"] else x
    tolerance = 0.1 * mass
    machine = f"""\
kind = "axis"
name = "drawn"
unit = "mm"
[base]
mass = {{ value = {mass * rng.uniform(0.95, 1.05)}, unit = "kg", tolerance = {tolerance} }}
viscous = {{ value = {numbers["viscous"] * 0.8}, unit = "N s/m", free = true, \
range = [0, {numbers["viscous"] * 5}] }}
"""
    if numbers["spring"]:
        machine += f"""\
spring = {{ value = {numbers["spring"] * 0.9}, unit = "N/m", free = true, \
range = [0, {numbers["spring"] * 5}] }}
"""
    experiment = DRIVEN.replace("noise_rms = 0.2", "noise_rms = NOISE")
    columns = {"time_s": t, "force_N": pushes, "position_mm": 1e3 * seen}
    return columns, 1e3 * plain, machine, experiment


# -- machines that go where they are told ----------------------------------------------------


def _behind(x: Floats, step_s: float, lag_s: float) -> Floats:
    """A lag of the first order of straight lines between samples, in closed form."""
    share, answer, late = math.exp(-step_s / lag_s), np.empty_like(x), x[0]
    for i, place in enumerate(x):
        answer[i] = late
        slope = (x[min(i + 1, len(x) - 1)] - place) / step_s
        late = (late - place + slope * lag_s) * share + place + slope * (step_s - lag_s)
    return answer


def _played(x: Floats, width: float) -> Floats:
    """Place behind a play that is taken up in the direction of the first motion."""
    answer, place = np.empty_like(x), x[0] - width / 2
    for i, target in enumerate(x):
        place = min(max(place, target - width / 2), target + width / 2)
        answer[i] = place
    return answer


def kinematic(rng: np.random.Generator, hidden: str) -> tuple[dict[str, Floats], Floats, str, str]:
    """As `axis`, of a machine that goes where it is told, in mm; it has no file of its own."""
    t = np.arange(int(rng.integers(150, 1500))) * float(rng.choice([0.01, 0.05, 1.0]))
    travel, step_s = rng.uniform(20.0, 300.0), float(t[1])
    if rng.integers(2):
        places = np.r_[0.0, np.sort(rng.uniform(0.1, 1.0, 2)), rng.uniform(0.0, 1.0, 6)] * travel
        x = np.interp(t, np.linspace(0.0, t[-1], 2 * len(places)), np.repeat(places, 2))
    else:
        x = travel / 2 * (1 - np.cos(2 * np.pi * rng.integers(1, 4) * t / t[-1]))
    size, middle = travel * 10 ** rng.uniform(-4.5, -3.0), x - (x.min() + x.max()) / 2
    seen = x.copy()
    if hidden == "backlash":
        seen = _played(x, 2 * size)
    elif hidden == "scale":
        seen = x * (1 + 2 * size / travel)
    elif hidden == "lag":
        seen = _behind(x, step_s, step_s * rng.uniform(1.0, 6.0))
    elif hidden == "delay":
        seen = np.interp(t - step_s * rng.uniform(0.3, 4.0), t, x)
    elif hidden == "periodic_error":
        angle = 2 * np.pi * x / (travel * rng.uniform(0.04, 0.3)) + rng.uniform(0.0, 2 * np.pi)
        seen = x + size * np.sin(angle)
    elif hidden == "drift":
        seen = x + 2 * size * t / t[-1]
    elif hidden == "bow":
        seen = x + 4 * size * (middle / travel) ** 2
    elif hidden == "bent scale":
        seen = x + 8 * size * (middle / travel) ** 3
    experiment = """\
machine = "kinematic"
[inputs]
command = { column = "target_mm" }
[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = NOISE
[[run]]
data = "run.csv"
"""
    return {"time_s": t, "target_mm": x, "position_mm": seen}, x, "", experiment


# -- thermal nodes ---------------------------------------------------------------------------


def _warming(
    hidden: str, size: float, begin: float, warming: float, loss: float, lasting_s: float
) -> Rates:
    """The equation of some nodes with a loss, and what is hidden beside it."""
    cold = begin + 273.15
    more: dict[str, Callable[[float, Floats, Floats], Floats]] = {
        "bent input": lambda now_s, rise, push: -warming * size * push**2 / 80.0,
        "growing loss": lambda now_s, rise, push: -loss * size * now_s / lasting_s * rise,
        "surroundings_drift": lambda now_s, rise, push: loss * 10.0 * size * now_s / lasting_s,
        "coupling": lambda now_s, rise, push: size * loss * (rise[::-1] - rise),
        "radiation": lambda now_s, rise, push: (
            -size * loss * ((cold + rise) ** 4 - cold**4) / (4 * cold**3)
        ),
        "vent": lambda now_s, rise, push: -4 * size * loss * np.maximum(rise - 12.0, 0.0),
    }

    def rates(now_s: float, rise: Floats, push: Floats, on: bool) -> Floats:
        plain = warming * push - loss * rise
        return plain + more[hidden](now_s, rise, push) if on and hidden in more else plain

    return rates


def thermal(rng: np.random.Generator, hidden: str) -> tuple[dict[str, Floats], Floats, str, str]:
    """As `axis`, of one or two nodes in °C; they have no file of their own."""
    t = np.arange(int(rng.integers(300, 1200))) * float(rng.choice([1.0, 2.0, 5.0]))
    step_s, loss = float(t[1]), 1 / rng.uniform(60.0, 300.0)
    warming, begin = loss * rng.uniform(0.3, 1.0), rng.uniform(18.0, 26.0)
    nodes = 2 if hidden == "coupling" else int(rng.integers(1, 3))
    held = max(int(rng.uniform(60.0, 300.0) / step_s), 1)
    duty = np.array([
        np.repeat(np.r_[0.0, rng.uniform(0.0, 80.0, len(t) // held)], held)[: len(t)]
        for _ in range(nodes)
    ])  # fmt: skip
    size, given = rng.uniform(0.2, 0.5), duty
    if hidden == "input_delay":
        late = int(rng.integers(3, 15))
        given = np.column_stack([np.zeros((nodes, late)), duty[:, :-late]])

    rates = _warming(hidden, size, begin, warming, loss, float(t[-1]))

    def run(pushed: Floats, on: bool) -> Floats:
        rise, answer, h = np.zeros(nodes), np.empty((nodes, len(t))), step_s / 10
        for i in range(len(t)):
            answer[:, i] = rise
            for k in range(10):
                now_s, push = t[i] + k * h, pushed[:, i]
                a = rates(now_s, rise, push, on)
                b = rates(now_s + h / 2, rise + h / 2 * a, push, on)
                c = rates(now_s + h / 2, rise + h / 2 * b, push, on)
                d = rates(now_s + h, rise + h * c, push, on)
                rise = rise + h / 6 * (a + 2 * b + 2 * c + d)
        return begin + answer

    plain, seen = run(duty, False), run(given, True)
    if hidden == "sensor_lag":
        lag_s = rng.uniform(3.0, 15.0) * step_s
        seen = np.array([_behind(own, step_s, lag_s) for own in seen])
    columns, experiment = {"time_s": t}, 'machine = "thermal"\n[inputs]\n'
    for i in range(nodes):
        columns[f"duty{i + 1}_percent"] = duty[i]
        experiment += f'duty{i + 1} = {{ column = "duty{i + 1}_percent", hold = true }}\n'
    for i in range(nodes):
        columns[f"t{i + 1}_C"] = seen[i]
        experiment += f'[[sensor]]\nname = "t{i + 1}"\nquantity = "temperature"\n'
        experiment += f'column = "t{i + 1}_C"\nnoise_rms = NOISE\n'
    return columns, plain[0], "", experiment + '[[run]]\ndata = "run.csv"\n'


# -- cases -----------------------------------------------------------------------------------

MAKERS = {"axis": axis, "kinematic": kinematic, "thermal": thermal}


def made(folder: Path, rng: np.random.Generator, kind: str) -> Case:
    """The files of a drawn case; drawn again until the hidden effect is large enough."""
    listed, unlisted = LISTED[kind], UNLISTED[kind]
    while True:
        hidden = str(rng.choice([*listed, *unlisted]))
        hidden = "none" if rng.integers(NONE_IN) == 0 else hidden
        columns, plain, machine, experiment = MAKERS[kind](rng, hidden)
        sensors = [name for name in columns if name in ("position_mm", "t1_C", "t2_C")]
        change = columns[sensors[0]] - plain
        noise = str(rng.choice(["white", "unknown", "coloured"]))
        sigma = float(np.ptp(plain)) * 10 ** rng.uniform(-3.7, -2.3)
        if kind == "kinematic" and hidden != "none":
            sigma = float(change.std()) / rng.uniform(2.0, 10.0)
        least = LEAST_SIGMAS * (3 if noise == "coloured" else 1)
        large = change.std() * math.sqrt(len(change)) > least * sigma
        if np.isfinite(change).all() and (hidden == "none" or large):
            break
    for name in sensors:
        white = rng.standard_normal(len(change) + 100)
        if noise == "coloured":
            white = lfilter([math.sqrt(1 - MEMORY**2)], [1, -MEMORY], white)
        columns[name] = columns[name] + sigma * white[100:]
    stated = '"unknown"' if noise == "unknown" else f"{sigma:.4g}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "experiment.toml").write_text(experiment.replace("NOISE", stated), "utf-8")
    if machine:
        (folder / "machine.toml").write_text(machine, "utf-8")
    table = np.column_stack(list(columns.values()))
    np.savetxt(folder / "run.csv", table, "%.9g", ",", header=",".join(columns), comments="")
    return Case(folder, kind, hidden, noise)


def cases(folder: Path, count: int, seed: int) -> Iterator[Case]:
    rng = np.random.default_rng(seed)
    kinds = list(MAKERS)
    for i in range(count):
        yield made(folder / f"{i + 1:03d}", rng, kinds[i % len(kinds)])


def judged(case: Case) -> tuple[str, str]:
    """The score of a case (right, missed or wrong), and the verdict with its names."""
    verdict = (
        open_experiment(case.folder / "experiment.toml").conclude(1, lambda _: None, ()).verdict
    )
    families = [{e.name, *e.indistinguishable_from} for e in verdict.effects]
    drafted = {draft.of for draft in verdict.drafts}
    words = ", ".join([*(" or ".join(sorted(f)) for f in families), *sorted(drafted)])
    answer = f"{verdict.verdict}: {words}" if words else verdict.verdict
    if case.hidden == "none":
        return ("right" if verdict.verdict == "none" else "wrong"), answer
    if case.hidden in UNLISTED[case.kind]:
        of_it = drafted & UNLISTED[case.kind][case.hidden]
        clean = verdict.verdict == "named" or (families and not of_it)
        return ("wrong" if clean else "right" if of_it else "missed"), answer
    right = [bool(f & LISTED[case.kind][case.hidden]) for f in families]
    if not all(right):
        return "wrong", answer
    return ("right" if right and verdict.verdict != "unexplained" else "missed"), answer


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--keep", type=Path, help="folder for the cases")
    chosen = parser.parse_args()
    counts: dict[tuple[str, str], Counter[str]] = {}
    with tempfile.TemporaryDirectory() as temporary, ProcessPoolExecutor(chosen.jobs) as pool:
        every = list(cases(chosen.keep or Path(temporary), chosen.cases, chosen.seed))
        for case, (worth, answer) in zip(every, pool.map(judged, every), strict=True):
            what = "unlisted" if case.hidden in UNLISTED[case.kind] else "listed"
            what = "none" if case.hidden == "none" else what
            counts.setdefault((case.kind, what), Counter())[worth] += 1
            if worth != "right":
                print(case.folder.name, worth, case.kind, case.hidden, case.noise, "|", answer)
    for (kind, what), own in sorted(counts.items()):
        shown = ", ".join(f"{own[worth]} {worth}" for worth in ("right", "missed", "wrong"))
        print(f"{kind:10} {what:9} {own.total():4}: {shown}")


if __name__ == "__main__":
    main()
