"""The grids `smoke`, `small` and `full`: effects alone and together, and none."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle

import numpy as np

from mopro.blind.cases.effects import HIDDEN_EFFECTS, POSITION, THERMAL
from mopro.blind.cases.spec import (
    COARSE,
    ENCODER,
    LASER,
    LVDT,
    PAIRABLE,
    THERMOCOUPLE,
    CaseSpec,
    single,
    warm,
)
from mopro.blind.reference.uncatalogued import DISTURBANCES

# Effects that look alike if all strokes have one direction and one speed.
_ALIKE = (
    "trigger_delay", "start_delay", "current_loop_lag", "sensor_bandwidth", "viscous_drag",
    "velocity_scale", "controller_clock", "force_constant",
)  # fmt: skip


def _null(sensor: str, style: str = "strokes", runs: int = 5, run_s: float = 5.0) -> CaseSpec:
    if sensor == THERMOCOUPLE:
        return warm("none")
    return CaseSpec("none", sensor, style=style, runs=runs, run_s=run_s)


def _several(g: np.random.Generator, count: int, runs: int = 5, run_s: float = 5.0) -> CaseSpec:
    """A pair or triple of effects from different families, so that none looks like another."""
    names: list[str] = []
    while len(names) < count:
        name = str(g.choice(PAIRABLE))
        if HIDDEN_EFFECTS[name].family not in {HIDDEN_EFFECTS[n].family for n in names}:
            names.append(name)
    sizes = [str(g.choice(["clear", "strong", "strong"])) for _ in names]
    group = {2: "pair", 3: "triple"}[count]
    effects = tuple(zip(names, sizes, strict=True))
    return CaseSpec(group, LASER, effects, runs=runs, run_s=run_s)


def full(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Every effect at several sizes and sensors, none, pairs, triples, and look-alikes."""
    sizes = cycle(["clear", "strong", "ends"])
    for name in POSITION:
        yield single(name, next(sizes), LASER)
        yield single(name, "faint", LASER)
    for name in g.choice(POSITION, 17, replace=False):
        yield single(str(name), str(g.choice(["faint", "clear", "strong", "ends"])), ENCODER)
    for name in COARSE:
        yield single(name, str(g.choice(["faint", "clear", "strong"])), LVDT)
    for name in THERMAL:
        yield single(name, "faint", THERMOCOUPLE)
        yield single(name, next(sizes), THERMOCOUPLE)
    for sensor, count in ((LASER, 24), (ENCODER, 12), (LVDT, 12), (THERMOCOUPLE, 8)):
        yield from (_null(sensor) for _ in range(count))
    yield from (_null(LASER, "two axes") for _ in range(6))
    yield from (_several(g, 2) for _ in range(30))
    for name in ("platen_conduction", "convection_scale"):
        yield warm("pair", (name, "clear"), ("speed_dependent_heat", "strong"))
    yield from (_several(g, 3) for _ in range(12))
    for name in DISTURBANCES:
        for sensor in (LASER, LASER, ENCODER, LVDT):
            yield CaseSpec("off catalogue", sensor, disturbance=name)
    for name in _ALIKE:
        yield _alike(name, ENCODER)
        yield _alike(name, LASER)


def _alike(name: str, sensor: str) -> CaseSpec:
    return CaseSpec("alike", sensor, ((name, "clear"),), style="one speed", runs=2, run_s=3.0)


def small(g: np.random.Generator) -> Iterator[CaseSpec]:
    """A few cases of each kind, for work on the diagnosis."""
    sizes = cycle(["clear", "strong", "ends"])
    for name in g.choice(POSITION, 14, replace=False):
        yield single(str(name), next(sizes), LASER, run_s=4.0)
    for name in g.choice(POSITION, 5, replace=False):
        yield single(str(name), "faint", LASER, run_s=4.0)
    for name in g.choice(COARSE, 3, replace=False):
        yield single(str(name), "clear", LVDT)
        yield single(str(name), "strong", ENCODER, run_s=4.0)
    for name in g.choice(THERMAL, 2, replace=False):
        yield single(str(name), "strong", THERMOCOUPLE)
    for sensor in (LASER, LASER, ENCODER, LVDT, THERMOCOUPLE):
        yield _null(sensor, run_s=4.0)
    for count in (2, 2, 2, 3):
        yield _several(g, count, run_s=4.0)
    for name in DISTURBANCES:
        yield CaseSpec("off catalogue", LASER, disturbance=name, run_s=4.0)
    for name in g.choice(_ALIKE, 2, replace=False):
        yield _alike(str(name), ENCODER)


def smoke(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Twelve easy cases with short runs, quick enough for continuous integration."""
    short = {"runs": 2, "run_s": 2.5}
    for name in ("payload_mass", "trigger_delay", "detent_force", "sensor_nonlinearity"):
        yield single(name, "strong", LASER, **short)  # type: ignore[arg-type]
    yield single("acceleration_scale", "strong", LVDT, **short)  # type: ignore[arg-type]
    yield single("coulomb_friction", "strong", ENCODER, **short)  # type: ignore[arg-type]
    yield warm("single", ("platen_conduction", "strong"), runs=1, run_s=600.0)
    yield _null(LASER, **short)  # type: ignore[arg-type]
    yield _null(ENCODER, **short)  # type: ignore[arg-type]
    yield _several(g, 2, **short)  # type: ignore[arg-type]
    yield CaseSpec("off catalogue", LASER, disturbance="local_bump", runs=2, run_s=2.5)
    yield CaseSpec("off catalogue", LASER, disturbance="random_walk", runs=2, run_s=2.5)
