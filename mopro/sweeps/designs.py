"""Designs: which points of what is varied are run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from mopro.sweeps.targets import Value, VaryError
from mopro.sweeps.varied import MOST_POINTS, Varied

GRID, RANDOM, SOBOL = DESIGNS = ("grid", "random", "sobol")
MOST_SEED = 2**63 - 1


@dataclass(frozen=True)
class Design:
    """All combinations of the levels (grid), or `count` points that are drawn by `seed`.

    `random` draws each point by itself, `sobol` a scrambled Sobol sequence, which fills the space
    more evenly.
    """

    kind: str = GRID
    count: int | None = None
    seed: int = 0

    def points(self, varied: Sequence[Varied]) -> list[tuple[Value, ...]]:
        """The points, each with a value of all `varied`; VaryError for none or too many."""
        self._check(varied)
        if self.kind == GRID:
            return list(product(*(each.levels for each in varied)))
        return [
            tuple(each.at(share) for each, share in zip(varied, shares, strict=True))
            for shares in self._shares(len(varied))
        ]

    def _check(self, varied: Sequence[Varied]) -> None:
        if self.kind not in DESIGNS:
            raise VaryError(f"there is no design {self.kind}: expected {', '.join(DESIGNS)}")
        if self.kind != GRID:
            if self.count is None:
                raise VaryError(f"the design {self.kind} needs a number of points (--points)")
            count = self.count
        else:
            if self.count is not None:
                raise VaryError(
                    "a grid has all points: a number of them (--points) goes with "
                    "the designs random and sobol"
                )
            for each in varied:
                if each.drawn:
                    raise VaryError(
                        f"vary {each.name}: a grid needs a step, START:STOP:STEP; the designs "
                        "random and sobol draw from a range"
                    )
            count = math.prod(len(each.levels) for each in varied)
        if not 1 <= count <= MOST_POINTS:
            raise VaryError(
                f"{count} points: expected 1 to {MOST_POINTS}; take fewer values, or draw points "
                "by the design sobol"
            )

    def _shares(self, dimensions: int) -> Iterator[list[float]]:
        """Points of the unit cube."""
        from scipy.stats import qmc

        assert self.count is not None
        if self.kind == RANDOM:
            drawn: Any = np.random.default_rng(self.seed).random((self.count, dimensions))
        else:
            sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(self.seed))
            # A power of two, which the sequence is even for; less of it is its beginning.
            drawn = sequence.random_base2(math.ceil(math.log2(self.count)))[: self.count]
        yield from drawn.tolist()
