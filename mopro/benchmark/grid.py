"""Specifications of the cases of each grid: effects, sizes, sensors and kinds of programs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from mopro.benchmark.hidden import HIDDEN_EFFECTS, POSITION, THERMAL
from mopro.benchmark.reference import disturbances

LASER, ENCODER, LVDT, THERMOCOUPLE = "laser", "encoder", "lvdt", "thermocouple"

# Effects large enough for an LVDT: profile errors, scale, clock, hum, delays, lost pitches.
_COARSE = (
    "acceleration_scale", "velocity_scale", "profile_tick", "controller_clock", "start_delay",
    "lost_steps", "sensor_gain", "sensor_nonlinearity", "sensor_bandwidth", "trigger_delay",
    "sample_clock", "hum",
)  # fmt: skip
# Effects that pairs and triples are drawn from: large enough for a laser.
_PAIRABLE = (
    "payload_mass", "viscous_drag", "quadratic_drag", "coulomb_friction", "umbilical_spring",
    "electrical_damping", "force_constant", "detent_force", "phase_gain_imbalance",
    "quadrature_error", "phase_current_offset", "current_third_harmonic", "current_loop_lag",
    "acceleration_scale", "velocity_scale", "profile_tick", "controller_clock", "start_delay",
    "pitch_scale", "backlash", "periodic_error", "sensor_gain", "sensor_nonlinearity",
    "sensor_bandwidth", "trigger_delay", "sample_clock", "hum",
)  # fmt: skip
# Effects that look alike if all strokes have one direction and one speed.
_ALIKE = (
    "trigger_delay", "start_delay", "current_loop_lag", "sensor_bandwidth", "viscous_drag",
    "velocity_scale", "controller_clock", "force_constant",
)  # fmt: skip


@dataclass(frozen=True)
class CaseSpec:
    """Specification of one case.

    `effects` are pairs of a name and a class of size (`sizes.SIZE_CLASSES`, or "ends" for an
    end of the plausible range); `style` is the kind of program; there are `runs` of about
    `run_s` seconds.
    """

    group: str
    sensor: str
    effects: tuple[tuple[str, str], ...] = ()
    disturbance: str = ""
    style: str = "strokes"
    runs: int = 5
    run_s: float = 5.0


def case_specs(grid: str, seed: int) -> list[CaseSpec]:
    """The cases of a grid in random order, so that a number does not reveal a case's kind."""
    generator = np.random.default_rng([seed, 1])
    found = list({"smoke": _smoke, "small": _small, "full": _full}[grid](generator))
    order = generator.permutation(len(found))
    return [found[i] for i in order]


def _single(name: str, size: str, sensor: str, runs: int = 5, run_s: float = 5.0) -> CaseSpec:
    style = "two axes" if name == "cross_axis_coupling" else "strokes"
    if HIDDEN_EFFECTS[name].thermal:
        return _warm("single", (name, size))
    return CaseSpec("single", sensor, ((name, size),), style=style, runs=runs, run_s=run_s)


def _warm(group: str, *effects: tuple[str, str], runs: int = 2, run_s: float = 3600.0) -> CaseSpec:
    return CaseSpec(group, THERMOCOUPLE, effects, style="cycles", runs=runs, run_s=run_s)


def _null(sensor: str, style: str = "strokes", runs: int = 5, run_s: float = 5.0) -> CaseSpec:
    if sensor == THERMOCOUPLE:
        return _warm("none")
    return CaseSpec("none", sensor, style=style, runs=runs, run_s=run_s)


def _several(g: np.random.Generator, count: int, runs: int = 5, run_s: float = 5.0) -> CaseSpec:
    """A pair or triple of effects from different families, so that none looks like another."""
    names: list[str] = []
    while len(names) < count:
        name = str(g.choice(_PAIRABLE))
        if HIDDEN_EFFECTS[name].family not in {HIDDEN_EFFECTS[n].family for n in names}:
            names.append(name)
    sizes = [str(g.choice(["clear", "strong", "strong"])) for _ in names]
    group = {2: "pair", 3: "triple"}[count]
    effects = tuple(zip(names, sizes, strict=True))
    return CaseSpec(group, LASER, effects, runs=runs, run_s=run_s)


def _full(g: np.random.Generator) -> Iterator[CaseSpec]:
    sizes = cycle(["clear", "strong", "ends"])
    for name in POSITION:
        yield _single(name, next(sizes), LASER)
        yield _single(name, "faint", LASER)
    for name in g.choice(POSITION, 17, replace=False):
        yield _single(str(name), str(g.choice(["faint", "clear", "strong", "ends"])), ENCODER)
    for name in _COARSE:
        yield _single(name, str(g.choice(["faint", "clear", "strong"])), LVDT)
    for name in THERMAL:
        yield _single(name, "faint", THERMOCOUPLE)
        yield _single(name, next(sizes), THERMOCOUPLE)
    for sensor, count in ((LASER, 24), (ENCODER, 12), (LVDT, 12), (THERMOCOUPLE, 8)):
        yield from (_null(sensor) for _ in range(count))
    yield from (_null(LASER, "two axes") for _ in range(6))
    yield from (_several(g, 2) for _ in range(30))
    for name in ("platen_conduction", "convection_scale"):
        yield _warm("pair", (name, "clear"), ("speed_dependent_heat", "strong"))
    yield from (_several(g, 3) for _ in range(12))
    for name in disturbances.NAMES:
        for sensor in (LASER, LASER, ENCODER, LVDT):
            yield CaseSpec("off catalogue", sensor, disturbance=name)
    for name in _ALIKE:
        yield _alike(name, ENCODER)
        yield _alike(name, LASER)


def _alike(name: str, sensor: str) -> CaseSpec:
    return CaseSpec("alike", sensor, ((name, "clear"),), style="one speed", runs=2, run_s=3.0)


def _small(g: np.random.Generator) -> Iterator[CaseSpec]:
    sizes = cycle(["clear", "strong", "ends"])
    for name in g.choice(POSITION, 14, replace=False):
        yield _single(str(name), next(sizes), LASER, run_s=4.0)
    for name in g.choice(POSITION, 5, replace=False):
        yield _single(str(name), "faint", LASER, run_s=4.0)
    for name in g.choice(_COARSE, 3, replace=False):
        yield _single(str(name), "clear", LVDT)
        yield _single(str(name), "strong", ENCODER, run_s=4.0)
    for name in g.choice(THERMAL, 2, replace=False):
        yield _single(str(name), "strong", THERMOCOUPLE)
    for sensor in (LASER, LASER, ENCODER, LVDT, THERMOCOUPLE):
        yield _null(sensor, run_s=4.0)
    for count in (2, 2, 2, 3):
        yield _several(g, count, run_s=4.0)
    for name in disturbances.NAMES:
        yield CaseSpec("off catalogue", LASER, disturbance=name, run_s=4.0)
    for name in g.choice(_ALIKE, 2, replace=False):
        yield _alike(str(name), ENCODER)


def _smoke(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Twelve easy cases with short runs, quick enough for continuous integration."""
    short = {"runs": 2, "run_s": 2.5}
    for name in ("payload_mass", "trigger_delay", "detent_force", "sensor_nonlinearity"):
        yield _single(name, "strong", LASER, **short)  # type: ignore[arg-type]
    yield _single("acceleration_scale", "strong", LVDT, **short)  # type: ignore[arg-type]
    yield _single("coulomb_friction", "strong", ENCODER, **short)  # type: ignore[arg-type]
    yield _warm("single", ("platen_conduction", "strong"), runs=1, run_s=600.0)
    yield _null(LASER, **short)  # type: ignore[arg-type]
    yield _null(ENCODER, **short)  # type: ignore[arg-type]
    yield _several(g, 2, **short)  # type: ignore[arg-type]
    yield CaseSpec("off catalogue", LASER, disturbance="local_bump", runs=2, run_s=2.5)
    yield CaseSpec("off catalogue", LASER, disturbance="random_walk", runs=2, run_s=2.5)
