"""Physics and faults that no catalogue of effects has, and disturbances of a reading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, lfilter

from mopro.blind.reference import equation as m
from mopro.blind.reference.motor import Floats, Generator


@dataclass(frozen=True)
class Foreign:
    """One foreign matter: its kind and its numbers, in SI."""

    name: str
    numbers: Mapping[str, float]


@dataclass(frozen=True)
class Disturbance:
    """A disturbance that is in no catalogue; `size_m` (m) multiplies its shape."""

    name: str
    numbers: Mapping[str, float]
    size_m: float


# -- foreign mechanics: numbers of the equation of motion, and lost microsteps of the command -----


def mechanics(foreign: Foreign | None, mass_kg: float) -> dict[str, float]:
    """The numbers of the equation of motion (`equation.NAMES`) that `foreign` changes.

    lugre, place_friction, fading_friction: `N`, `presliding` (m), and of each its own;
    hysteretic_spring: `N`, `reach` (m); structural_mode: `share` of the mass, `f` (Hz), `zeta`;
    direction_gain: `e`. Other kinds change none.
    """
    if foreign is None or foreign.name not in _KINDS:
        return {}
    return {"states": float(m.STATES), **_KINDS[foreign.name](dict(foreign.numbers), mass_kg)}


def _friction(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    bristle = n["N"] / n["presliding"]
    static = n.get("static", 1.0)
    return {
        "grip": n["N"],
        "grip_static": (static - 1.0) * n["N"],
        "grip_speed": n.get("vs", 1.0),
        "bristle": bristle,
        "bristle_damping": n.get("inner", 0.0) * 2 * math.sqrt(bristle * mass_kg),
        "rough": n.get("depth", 0.0),
        "rough_wave": 2 * math.pi / n.get("length", 1.0),
        "rough_phase": n.get("phi", 0.0),
        "fade": n.get("fade", 0.0),
        "fade_s": n.get("tau", 1.0),
    }


def _spring(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    return {"loop": n["N"], "loop_reach": n["reach"]}


def _mode(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    """A part of the forcer's mass on a spring; the whole mass stays the same."""
    own = n["share"] * mass_kg
    w = 2 * math.pi * n["f"]
    return {
        "mass": mass_kg - own,
        "mode_mass": own,
        "mode_stiffness": own * w * w,
        "mode_damping": 2 * n["zeta"] * w * own,
    }


def _direction(n: dict[str, float], mass_kg: float) -> dict[str, float]:
    return {"lopsided": n["e"]}


_KINDS = {
    "lugre": _friction,
    "place_friction": _friction,
    "fading_friction": _friction,
    "hysteretic_spring": _spring,
    "structural_mode": _mode,
    "direction_gain": _direction,
}


def with_lost_microsteps(command: Floats, foreign: Foreign | None, microstep_m: float) -> Floats:
    """The command without a microstep now and then while it moves, always behind."""
    if foreign is None or foreign.name != "missing_microsteps":
        return command
    found: list[Floats] = []
    behind_m = 0.0
    times = _moments(foreign, float(command[-1, m.T0]))
    for row in command:
        moving = row[m.V0 : m.J0 + 1].any()
        rest = row.copy()
        rest[m.X0] -= behind_m
        for at_s in times[(times > row[m.T0]) & (times < row[m.T1])] if moving else ():
            first, rest = cut(rest, float(at_s))
            step = math.copysign(microstep_m, rest[m.V0] or rest[m.A0])
            rest[m.X0] -= step
            behind_m += step
            found.append(first)
        found.append(rest)
    return np.array(found)


def _moments(foreign: Foreign, until_s: float) -> Floats:
    """Times (s) of about `rate` per second, at uneven distances."""
    k = np.arange(1, math.ceil(until_s * foreign.numbers["rate"]) + 1)
    uneven = 0.35 * np.sin(12.9898 * k + foreign.numbers["phi"])
    return np.asarray((k - 0.5 + uneven) / foreign.numbers["rate"])


def cut(row: Floats, at_s: float) -> tuple[Floats, Floats]:
    """The row until `at_s`, and from there on."""
    before, after = row.copy(), row.copy()
    tau = at_s - row[m.T0]
    x, v, a, j = row[m.X0 : m.J0 + 1]
    before[m.T1] = after[m.T0] = at_s
    after[m.X0] = x + tau * (v + tau * (a / 2 + tau * j / 6))
    after[m.V0], after[m.A0] = v + tau * (a + tau * j / 2), a + tau * j
    after[m.SLIP] = 0.0
    return before, after


# -- foreign faults of clock, signal, noise and storage of a sensor ----------------------------


def clock(taken_s: Floats, foreign: Foreign | None, generator: Generator) -> Floats:
    """True times (s) of the samples, ascending.

    jittered_clock: `share` of the interval, uniform to either side, less than a half;
    stepping_clock: `step` (s) is skipped `every` seconds.
    """
    if foreign is None:
        return taken_s
    n = foreign.numbers
    if foreign.name == "jittered_clock":
        interval = float(taken_s[1] - taken_s[0])
        return taken_s + n["share"] * interval * generator.uniform(-1.0, 1.0, len(taken_s))
    if foreign.name == "stepping_clock":
        return taken_s + n["step"] * np.floor(np.maximum(taken_s, 0.0) / n["every"])
    return taken_s


def signal(
    seen: Floats, time_s: Floats, rise_K: Floats | None, foreign: Foreign | None, g: Generator
) -> Floats:
    """The reading (m) with a changed signal.

    wandering_gain: `rms` with the memory `tau` (s); thermal_bow: `bow` (m/K) at the distance
    `half` (m) from the start, in proportion to the forcer's `rise_K`.
    """
    if foreign is None:
        return seen
    n = foreign.numbers
    if foreign.name == "wandering_gain":
        memory = math.exp(-float(time_s[1] - time_s[0]) / n["tau"])
        return seen * (1 + n["rms"] * autoregressive(len(seen), memory, g))
    if foreign.name == "thermal_bow" and rise_K is not None:
        return seen + n["bow"] * rise_K * (seen / n["half"]) ** 2
    return seen


def noise(count: int, rms: float, foreign: Foreign | None, generator: Generator) -> Floats:
    """Noise of the stated size: white, or coloured for ar1_noise (`phi`) and flicker_noise."""
    if foreign is not None and foreign.name == "ar1_noise":
        return rms * autoregressive(count, foreign.numbers["phi"], generator)
    if foreign is not None and foreign.name == "flicker_noise":
        return rms * _flicker(count, generator)
    return generator.normal(0.0, rms, count)


def autoregressive(count: int, phi: float, generator: Generator) -> Floats:
    """Stationary noise of unit variance whose neighbours correlate by `phi`."""
    white = generator.standard_normal(count)
    first = white[0]
    driven = math.sqrt(1 - phi * phi) * white
    driven[0] = first
    return np.asarray(lfilter([1.0], [1.0, -phi], driven))


def _flicker(count: int, generator: Generator) -> Floats:
    """Noise of unit variance whose power falls as 1/f, down to one period of the record."""
    frequencies = np.arange(count // 2 + 1, dtype=np.float64)
    frequencies[0] = np.inf
    shape = frequencies**-0.5
    spectrum = shape * np.fft.rfft(generator.standard_normal(count))
    power = 2 * np.sum(shape[1:] ** 2) / count
    return np.asarray(np.fft.irfft(spectrum, count) / math.sqrt(power))


def stored_badly(
    reading: Floats, sigma: float, rate_hz: float, foreign: Foreign | None, g: Generator
) -> Floats:
    """The stored reading, in its unit.

    dropouts: zero for `lasts` seconds, `rate` times a second; outliers: `count` samples off by
    20 to 500 `sigma`; sticking_sensor: the last reading for `lasts` seconds, `rate` times a second.
    """
    if foreign is None or foreign.name not in ("dropouts", "outliers", "sticking_sensor"):
        return reading
    kept, n = reading.copy(), foreign.numbers
    if foreign.name == "outliers":
        at = g.choice(len(kept), int(n["count"]), replace=False)
        size = np.exp(g.uniform(math.log(20.0), math.log(500.0), len(at)))
        kept[at] += sigma * size * g.choice([-1.0, 1.0], len(at))
        return kept
    lasts = max(round(n["lasts"] * rate_hz), 2)
    times = max(round(n["rate"] * len(kept) / rate_hz), 1)
    for start in np.sort(g.integers(1, max(len(kept) - lasts, 2), times)):
        kept[start : start + lasts] = 0.0 if foreign.name == "dropouts" else kept[start - 1]
    return kept


# -- disturbances ------------------------------------------------------------------------------

DISTURBANCES = ("local_bump", "time_drift", "frame_sway", "random_walk")


def disturbance(
    name: str,
    numbers: Mapping[str, float],
    time_s: Floats,
    x: Floats,
    acceleration: Floats,
    generator: Generator,
) -> Floats:
    """The disturbance `name` over one series, shape (n,), dimensionless.

    local_bump: `at`, `width` (m); time_drift: `tau` (s); frame_sway: `f` (Hz), `zeta`;
    random_walk: none.
    """
    if name == "local_bump":
        return np.asarray(np.exp(-(((x - numbers["at"]) / numbers["width"]) ** 2) / 2))
    if name == "time_drift":
        return np.asarray(1 - np.exp(-time_s / numbers["tau"]))
    if name == "frame_sway":
        return _sway(time_s[1] - time_s[0], acceleration, numbers["f"], numbers["zeta"])
    return np.cumsum(generator.standard_normal(len(time_s)))


def _sway(step_s: float, acceleration: Floats, f_hz: float, zeta: float) -> Floats:
    """Displacement of an elastic frame under the motor's reaction force, per unit mass ratio."""
    w = 2 * math.pi * f_hz
    numerator, denominator, _ = cont2discrete(
        ([1.0], [1.0, 2 * zeta * w, w * w]), step_s, method="foh"
    )
    return np.asarray(lfilter(np.ravel(numerator), denominator, acceleration))
