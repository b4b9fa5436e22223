"""The grids by name, and the specifications of the cases of each.

`smoke`, `small` and `full` have effects alone and together, and none; the others ask one question
each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import cycle

import numpy as np

from mopro.blind.cases.foreign_kinds import FOREIGN_KINDS
from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS, POSITION, THERMAL
from mopro.blind.cases.machine_kinds import MachineSpec, machines
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
from mopro.blind.cases.stated_effects import StatedEffects
from mopro.blind.reference.motor import Generator
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


def _several(g: Generator, count: int, runs: int = 5, run_s: float = 5.0) -> CaseSpec:
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


def full(g: Generator) -> Iterator[CaseSpec]:
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


def small(g: Generator) -> Iterator[CaseSpec]:
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


def smoke(g: Generator) -> Iterator[CaseSpec]:
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


_SIZES = ("faint", "clear", "strong")
# Of each sensor: cases with an effect, and cases with none.
_COUNTS = {LVDT: (48, 16), ENCODER: (72, 16), THERMOCOUPLE: (36, 12)}
_OF_CONSTANTS = {LVDT: (84, 16), THERMOCOUPLE: (84, 16)}
_EFFECTS = {LVDT: COARSE, ENCODER: POSITION, THERMOCOUPLE: THERMAL}
_ONE_SPEED, _CUT = 0.3, 0.3  # shares of the cases
_HEATED_S = 1800.0


def short(g: Generator) -> Iterator[CaseSpec]:
    """200 cases; of three some are at one speed only, and some are cut off before the end."""
    return _cases(g, _COUNTS)


def constants(g: Generator) -> Iterator[CaseSpec]:
    """200 cases as of `short`; what their effects assume is anywhere in its plausible range."""
    return (replace(case, constants=True) for case in _cases(g, _OF_CONSTANTS))


def _cases(g: Generator, counts: Mapping[str, tuple[int, int]]) -> Iterator[CaseSpec]:
    for sensor, (hidden, none) in counts.items():
        names = cycle(g.permutation(_EFFECTS[sensor]))
        for _ in range(hidden):
            yield _case(g, sensor, ((str(next(names)), str(g.choice(_SIZES))),))
        for _ in range(none):
            yield _case(g, sensor, ())


def _case(g: Generator, sensor: str, effects: tuple[tuple[str, str], ...]) -> CaseSpec:
    style = "one speed" if g.random() < _ONE_SPEED else "strokes"
    if any(name == "cross_axis_coupling" for name, _ in effects):
        style = "two axes"
    if sensor == THERMOCOUPLE:
        style = "cycles"
    run_s = _HEATED_S if sensor == THERMOCOUPLE else 5.0
    cut = bool(g.random() < _CUT)
    return CaseSpec("short", sensor, effects, style=style, runs=1, run_s=run_s, cut=cut)


FACTORS = (0.3, 3.0)


def noise(g: Generator) -> Iterator[CaseSpec]:
    """For each factor 24 effects at two sizes, 4 thermal ones, and nothing hidden."""
    for factor in FACTORS:
        for name in g.choice(POSITION, 24, replace=False):
            sensor, size = str(g.choice([LASER, ENCODER])), str(g.choice(["clear", "strong"]))
            yield replace(single(str(name), size, sensor, runs=3), noise_factor=factor)
        for name in g.choice(THERMAL, 4, replace=False):
            yield replace(single(str(name), "strong", LASER), noise_factor=factor)
        for sensor in (LASER, LASER, LASER, ENCODER, ENCODER, ENCODER, LVDT, LVDT):
            yield CaseSpec("none", sensor, runs=3, noise_factor=factor)
        yield replace(warm("none"), noise_factor=factor)


# Effects with a response of their own, so that their size can be asked for.
_BESIDE = (
    "viscous_drag", "quadratic_drag", "detent_force", "phase_gain_imbalance", "umbilical_spring",
    "acceleration_scale", "sensor_nonlinearity", "periodic_error", "hum",
)  # fmt: skip


def foreign(g: Generator) -> Iterator[CaseSpec]:
    """Each kind eight times, half of them beside an effect."""
    for kind in FOREIGN_KINDS.values():
        others = [name for name in _BESIDE if name not in kind.akin]
        for sensor in (LASER, LASER, LASER, ENCODER):
            yield CaseSpec("foreign", sensor, foreign=kind.name, runs=3)
            beside = ((str(g.choice(others)), "strong"),)
            yield CaseSpec("foreign", sensor, beside, foreign=kind.name, runs=3)


# Fewer and shorter runs than in other grids, as each rival is fitted when a case is made.
_RUNS, _RUN_S = 3, 4.0


def deleted(g: Generator) -> Iterator[CaseSpec]:
    """Each effect of the catalogue at 60 σ or more, or as large as it can be."""
    for name in HIDDEN_EFFECTS:
        yield single(name, "strong", LASER, _RUNS, _RUN_S, "deleted", True)


# The share by which each number with a tolerance is off, and the tolerance that is stated.
DEVIATION, TOLERANCE = 0.10, 0.15
# Effects that are nothing but a base number that is off.
_BASE = ("electrical_damping", "force_constant", "force_constant_temperature", "payload_mass")


def base(g: Generator) -> Iterator[CaseSpec]:
    """Each effect that is no base number, with two sensors in turn, and nothing hidden."""
    for i, name in enumerate(n for n in (*POSITION, *THERMAL) if n not in _BASE):
        size = str(g.choice(["clear", "strong"]))
        yield replace(single(name, size, (LASER, ENCODER)[i % 2], runs=3), base=True)
    for sensor in (LASER, LASER, LASER, LASER, ENCODER, ENCODER, ENCODER, ENCODER):
        yield CaseSpec("none", sensor, runs=3, base=True)


Spec = CaseSpec | MachineSpec

_GRIDS = (smoke, small, full, deleted, foreign, short, constants, noise, base, machines)
GRIDS: dict[str, Callable[[Generator], Iterator[Spec]]] = {grid.__name__: grid for grid in _GRIDS}

# Tolerance that the machine file states in the cases of a grid, as a share of each number.
TOLERANCES = {"base": TOLERANCE}


def case_specs(grid: str, seed: int, stated: StatedEffects | None = None) -> list[Spec]:
    """The cases of a grid in random order, so that a number does not reveal a case's kind.

    With effects of a user's file, `stated`, also those in which one of them is hidden.
    """
    generator = np.random.default_rng([seed, 1])
    found = [*GRIDS[grid](generator), *(stated.specs() if stated else ())]
    order = generator.permutation(len(found))
    return [found[i] for i in order]


def spread(numbers: list[str], count: int | None) -> list[str]:
    """`count` of `numbers`, evenly spread; all if `count` is None or not less than there are."""
    if count is None or count >= len(numbers):
        return numbers
    return [numbers[i * len(numbers) // count] for i in range(count)]
