"""Effects that are hidden in machines beside the motor, and the grid `machines` of their cases.

Some effects are listed, and some are such as nobody listed. Each draw gives the parameters (SI) of
an effect that changes the motion by some percent; how much it shows is decided by the noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from mopro.blind.reference.motor import Generator

Parameters = dict[str, float]


@dataclass(frozen=True)
class Span:
    """Sizes of a run without effects, in SI.

    `drive`: largest input (N, or a share of 1); `x`, `v`, `a`: largest place, speed, acceleration
    (of nodes: rise); `rate`: the machine's rate of loss (1/s) or size of its reading.
    """

    drive: float
    x: float
    v: float
    a: float
    step_s: float
    length_s: float
    rate: float = 1.0


Draw = Callable[[Generator, Span], Parameters]


def _share(g: Generator) -> float:
    return float(g.uniform(0.05, 0.3))


def _sized(name: str, most: Callable[[Span], float], signed: bool = False) -> Draw:
    def draw(g: Generator, s: Span) -> Parameters:
        sign = float(g.choice([-1.0, 1.0])) if signed else 1.0
        return {name: sign * _share(g) * most(s)}

    return draw


def _steps(name: str, low: float, high: float) -> Draw:
    return lambda g, s: {name: float(g.uniform(low, high)) * s.step_s}


def _wave(size: Callable[[Span], float], low: float, high: float) -> Draw:
    def draw(g: Generator, s: Span) -> Parameters:
        height, angle = _share(g) * size(s), g.uniform(0.0, 2 * math.pi)
        period = 2 * s.x * g.uniform(low, high)
        return {"P": period, "s": height * math.cos(angle), "c": height * math.sin(angle)}

    return draw


def _stribeck(g: Generator, s: Span) -> Parameters:
    limit = 0.4 * _share(g) * s.drive
    return {"Fc": limit, "Fs": limit * g.uniform(0.5, 1.5), "vs": s.v * g.uniform(0.03, 0.1)}


def _play(g: Generator, s: Span) -> Parameters:
    return {"w": 2 * _small(g) * s.x, "begun": float(g.choice([-1.0, 0.0]))}


def _small(g: Generator) -> float:
    return float(10 ** g.uniform(-4.0, -2.5))


def _small_wave(g: Generator, s: Span) -> Parameters:
    height, angle = _small(g) * s.x, g.uniform(0.0, 2 * math.pi)
    period = s.x * g.uniform(0.05, 0.4)
    return {"P": period, "s": height * math.cos(angle), "c": height * math.sin(angle)}


def _gravity(g: Generator, s: Span) -> Parameters:
    size, angle = _share(g) * s.rate, g.uniform(0.0, 2 * math.pi)
    return {"gs": size * math.cos(angle), "gc": size * math.sin(angle)}


def _drift(g: Generator, s: Span) -> Parameters:
    return {"r": float(g.choice([-1.0, 1.0])) * _small(g) * s.x / s.length_s}


# By kind and key, the name of the effect and its draw.
_LISTED: Mapping[str, Mapping[str, tuple[str, Draw]]] = {
    "axis": {
        "dry friction": ("dry_friction", _sized("Fc", lambda s: 0.5 * s.drive)),
        "Stribeck": ("dry_friction", _stribeck),
        "quadratic_drag": ("quadratic_drag", _sized("d", lambda s: s.drive / s.v**2)),
        "cubic_damping": ("cubic_damping", _sized("b3", lambda s: s.drive / s.v**3)),
        "cubic_stiffness": ("cubic_stiffness", _sized("k3", lambda s: 2 * s.drive / s.x**3)),
        "bias_force": ("bias_force", _sized("g", lambda s: 0.5 * s.drive, signed=True)),
        "cogging": ("cogging", _wave(lambda s: 0.5 * s.drive, 0.05, 0.2)),
        "by direction": (
            "direction_dependent_gain", _sized("k", lambda s: 1.0, signed=True),
        ),
        "input_dead_zone": ("input_dead_zone", _sized("w", lambda s: 0.5 * s.drive)),
        "input_delay": ("input_delay", _steps("d", 1.0, 8.0)),
        "input_lag": ("input_lag", _steps("tau", 3.0, 12.0)),
        "sensor_lag": ("sensor_lag", _steps("tau", 3.0, 12.0)),
    },
    "kinematic": {
        "backlash": ("backlash", _play),
        "scale": ("scale", lambda g, s: {"k": float(g.choice([-1, 1])) * _small(g)}),
        "lag": ("lag", _steps("tau", 1.0, 6.0)),
        "delay": ("delay", _steps("d", 0.3, 4.0)),
        "periodic_error": ("periodic_error", _small_wave),
        "drift": ("drift", _drift),
    },
    "thermal": {
        "coupling": ("coupling", _sized("k", lambda s: 2 * s.rate)),
        "radiation": ("radiation", _sized("r", lambda s: 2 * s.rate)),
        "free_convection": (
            "free_convection", _sized("c", lambda s: 2 * s.rate / s.x**0.25),
        ),
        "sensor_lag": ("sensor_lag", _steps("tau", 3.0, 15.0)),
        "input_delay": ("input_delay", _steps("d", 3.0, 15.0)),
        "crosstalk": ("crosstalk", _sized("x12", lambda s: s.a)),
        "surroundings_drift": (
            "surroundings_drift", _sized("r", lambda s: 20.0 / s.length_s, signed=True),
        ),
    },
    "effort": {
        "dry friction": ("dry_friction", _sized("Fc", lambda s: s.rate)),
        "Stribeck": ("dry_friction", lambda g, s: _stribeck(g, replace(s, drive=s.rate))),
        "quadratic_drag": ("quadratic_drag", _sized("d", lambda s: s.rate / s.v**2)),
        "cubic_damping": ("cubic_damping", _sized("b3", lambda s: s.rate / s.v**3)),
        "stiffness": ("stiffness", _sized("k", lambda s: s.rate / s.x)),
        "cubic_stiffness": ("cubic_stiffness", _sized("k3", lambda s: s.rate / s.x**3)),
        "cogging": ("cogging", _wave(lambda s: 0.5 * s.rate, 0.05, 0.2)),
        "gravity": ("gravity", _gravity),
        "sensor_lag": ("sensor_lag", _steps("tau", 2.0, 8.0)),
        "delay": ("delay", _steps("d", 1.0, 5.0)),
    },
}  # fmt: skip
# Somebody's program of a slide knows all that a slide may have but the play.
LISTED = {
    **_LISTED,
    "python": {key: own for key, own in _LISTED["kinematic"].items() if key != "backlash"},
}
# Unlisted ones, with the variables that a draft may be of.
UNLISTED: Mapping[str, Mapping[str, tuple[Draw, tuple[str, ...]]]] = {
    "axis": {
        "friction of place": (_sized("F1", lambda s: s.drive / s.x), ("x",)),
        "bent spring": (_sized("q", lambda s: s.drive / s.x**2), ("x",)),
        "fading damping": (_sized("f", lambda s: 2 / s.length_s), ("t", "v")),
    },
    "kinematic": {
        "bow": (lambda g, s: {"q": 4 * _small(g) / s.x, "middle": s.x / 2}, ("x",)),
        "bent scale": (lambda g, s: {"q": 8 * _small(g) / s.x**2, "middle": s.x / 2}, ("x",)),
    },
    "thermal": {
        "growing loss": (_sized("g", lambda s: 2 / s.length_s), ("t",)),
        "bent input": (_sized("q", lambda s: 1.0), ("command",)),
        "vent": (
            lambda g, s: {"k": 4 * _share(g) * s.rate, "level": 22 + s.x * g.uniform(0.3, 0.6)},
            ("T",),
        ),
    },
    "effort": {
        "friction of place": (_sized("F1", lambda s: s.rate / s.x), ("x",)),
    },
    "python": {
        "bow": (lambda g, s: {"q": 4 * _small(g) / s.x, "middle": s.x / 2}, ("x", "y", "command")),
    },
}  # fmt: skip
# Effects of the time since a run began, which belong to that run.
OF_A_RUN = frozenset({"drift", "surroundings_drift", "fading damping", "growing loss"})

# -- the grid: a fifth of the machines has nothing hidden --------------------------------------

_CASES = 300
_SHARES = {"axis": 0.34, "kinematic": 0.16, "thermal": 0.24, "effort": 0.18, "python": 0.08}
_NONE, _UNLISTED, _PAIR = 0.2, 0.12, 0.15
_NOISES = {"stated": 0.5, "unknown": 0.15, "half": 0.1, "double": 0.1, "coloured": 0.15}
# Trouble of the log, each drawn for itself.
_TROUBLES = ("outliers", "gap", "irregular")
_TROUBLED = 0.15


@dataclass(frozen=True)
class MachineSpec:
    """A case: kind of machine, keys of what is hidden in it, runs, noise, troubles of the log.

    `listed` are keys of `LISTED`, `unlisted` is one of UNLISTED or "". The noise is
    stated, unknown, coloured, or stated as `half` or `double` of what it is.
    """

    kind: str
    listed: tuple[str, ...]
    unlisted: str
    runs: int
    noise: str
    troubles: tuple[str, ...]

    @property
    def group(self) -> str:
        return "unlisted" if self.unlisted else "listed" if self.listed else "none"


def machines(g: Generator) -> Iterator[MachineSpec]:
    """Kinds in their shares, each with what it hides in turn."""
    for kind, share in _SHARES.items():
        count = round(_CASES * share)
        none, odd = round(_NONE * count), round(_UNLISTED * count)
        for i in range(count):
            listed: tuple[str, ...] = ()
            unlisted = ""
            if none <= i < none + odd:
                unlisted = list(UNLISTED[kind])[i % len(UNLISTED[kind])]
            elif i >= none:
                listed = _listed(g, kind, i)
            yield _spec(g, kind, listed, unlisted)


def _listed(g: Generator, kind: str, nth: int) -> tuple[str, ...]:
    keys = list(LISTED[kind])
    first = keys[nth % len(keys)]
    own = LISTED[kind][first][0]
    others = [key for key in keys if LISTED[kind][key][0] != own]
    return (first, str(g.choice(others))) if g.random() < _PAIR else (first,)


def _spec(g: Generator, kind: str, listed: tuple[str, ...], unlisted: str) -> MachineSpec:
    noise = str(g.choice(list(_NOISES), p=list(_NOISES.values())))
    troubles = tuple(name for name in _TROUBLES if g.random() < _TROUBLED)
    return MachineSpec(kind, listed, unlisted, int(g.integers(1, 7)), noise, troubles)
