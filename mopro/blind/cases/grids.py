"""The grids by name, and the specifications of the cases of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import cycle

import numpy as np

from mopro.blind.cases import grid_base as base
from mopro.blind.cases import grid_machines as machines
from mopro.blind.cases import grid_standard as standard
from mopro.blind.cases.effects import HIDDEN_EFFECTS, POSITION, THERMAL
from mopro.blind.cases.foreign_kinds import FOREIGN_KINDS
from mopro.blind.cases.grid_machines import MachineSpec
from mopro.blind.cases.spec import (
    COARSE,
    ENCODER,
    LASER,
    LVDT,
    THERMOCOUPLE,
    CaseSpec,
    single,
    warm,
)
from mopro.blind.cases.stated import StatedEffects

_SIZES = ("faint", "clear", "strong")
# Of each sensor: cases with an effect, and cases with none.
_COUNTS = {LVDT: (48, 16), ENCODER: (72, 16), THERMOCOUPLE: (36, 12)}
_OF_CONSTANTS = {LVDT: (84, 16), THERMOCOUPLE: (84, 16)}
_EFFECTS = {LVDT: COARSE, ENCODER: POSITION, THERMOCOUPLE: THERMAL}
_ONE_SPEED, _CUT = 0.3, 0.3  # shares of the cases
_HEATED_S = 1800.0


def short(g: np.random.Generator) -> Iterator[CaseSpec]:
    """200 cases; of three some are at one speed only, and some are cut off before the end."""
    return _cases(g, _COUNTS)


def constants(g: np.random.Generator) -> Iterator[CaseSpec]:
    """200 cases as of `short`; what their effects assume is anywhere in its plausible range."""
    return (replace(case, constants=True) for case in _cases(g, _OF_CONSTANTS))


def _cases(g: np.random.Generator, counts: Mapping[str, tuple[int, int]]) -> Iterator[CaseSpec]:
    for sensor, (hidden, none) in counts.items():
        names = cycle(g.permutation(_EFFECTS[sensor]))
        for _ in range(hidden):
            yield _case(g, sensor, ((str(next(names)), str(g.choice(_SIZES))),))
        for _ in range(none):
            yield _case(g, sensor, ())


def _case(g: np.random.Generator, sensor: str, effects: tuple[tuple[str, str], ...]) -> CaseSpec:
    style = "one speed" if g.random() < _ONE_SPEED else "strokes"
    if any(name == "cross_axis_coupling" for name, _ in effects):
        style = "two axes"
    if sensor == THERMOCOUPLE:
        style = "cycles"
    run_s = _HEATED_S if sensor == THERMOCOUPLE else 5.0
    cut = bool(g.random() < _CUT)
    return CaseSpec("short", sensor, effects, style=style, runs=1, run_s=run_s, cut=cut)


FACTORS = (0.3, 3.0)


def noise(g: np.random.Generator) -> Iterator[CaseSpec]:
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


def foreign(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Each kind eight times, half of them beside an effect."""
    for kind in FOREIGN_KINDS.values():
        others = [name for name in _BESIDE if name not in kind.akin]
        for sensor in (LASER, LASER, LASER, ENCODER):
            yield CaseSpec("foreign", sensor, foreign=kind.name, runs=3)
            beside = ((str(g.choice(others)), "strong"),)
            yield CaseSpec("foreign", sensor, beside, foreign=kind.name, runs=3)


# Fewer and shorter runs than in other grids, as each rival is fitted when a case is made.
_RUNS, _RUN_S = 3, 4.0


def deleted(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Each effect of the catalogue at 60 σ or more, or as large as it can be."""
    for name in HIDDEN_EFFECTS:
        yield single(name, "strong", LASER, _RUNS, _RUN_S, "deleted", True)


Spec = CaseSpec | MachineSpec

GRIDS: dict[str, Callable[[np.random.Generator], Iterator[Spec]]] = {
    "smoke": standard.smoke,
    "small": standard.small,
    "full": standard.full,
    "deleted": deleted,
    "foreign": foreign,
    "short": short,
    "constants": constants,
    "noise": noise,
    "base": base.base,
    "machines": machines.machines,
}

# Tolerance that the machine file states in the cases of a grid, as a share of each number.
TOLERANCES = {"base": base.TOLERANCE}


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
