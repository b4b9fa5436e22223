"""The grids by name, and the specifications of the cases of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mopro.blind.grids import base, deleted, foreign, machines, noise, short, standard
from mopro.blind.grids.machines import MachineSpec
from mopro.blind.hidden.spec import CaseSpec
from mopro.blind.hidden.stated import StatedEffects

Spec = CaseSpec | MachineSpec

GRIDS: dict[str, Callable[[np.random.Generator], Iterator[Spec]]] = {
    "smoke": standard.smoke,
    "small": standard.small,
    "full": standard.full,
    "deleted": deleted.deleted,
    "foreign": foreign.foreign,
    "short": short.short,
    "constants": short.constants,
    "noise": noise.noise,
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
