"""Separation of the alternatives of a verdict by a run (σ), to design the next experiment."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from itertools import combinations

import numpy as np

from mopro.engine.series import Floats, Settings
from mopro.engine.verdict import Named, Verdict

# In σ: a pair so far apart needs no more data. A margin of ten in χ² is then nearly certain
# even if the effect is a fifth smaller than estimated.
AMPLE_SIGMAS = 8.0
# In σ: a pair that is no further apart is not separated.
LEAST_SIGMAS = 2.0
_MOST_ALTERNATIVES = 8

Pairs = Mapping[tuple[str, str], float]
# An effect by its name, and the settings of the whole model with it.
Side = tuple[str, Settings]


def family_pairs(verdict: Verdict, effect: Named) -> Iterator[tuple[Side, Side]]:
    """All pairs of an effect of a verdict and its alternatives."""
    alternatives = list(effect.alternatives.items())[:_MOST_ALTERNATIVES]
    return combinations([(effect.name, verdict.settings), *alternatives], 2)


def size_error(effect: Named) -> float:
    """Relative standard error of the size of an effect, by the σ that it explains."""
    return 1 / max(effect.sigmas, 1.0)


def score(squares: Floats) -> Floats:
    """Sum over pairs (last axis) of the squared separations, each capped at the ample one."""
    capped: Floats = np.sum(np.minimum(squares, AMPLE_SIGMAS**2), axis=-1)
    return capped


def distance(difference: Floats, free: Floats) -> float:
    """Minimum over z of √(|difference - free z|² + |z|²); each z has the prior N(0, 1)."""
    projected = free.T @ difference
    z = np.linalg.solve(free.T @ free + np.eye(free.shape[1]), projected)
    return math.sqrt(max(float(difference @ difference - projected @ z), 0.0))


def from_named(pairs: Pairs, named: Collection[str]) -> dict[str, float]:
    """The separation of each alternative from the named effect."""
    return {other: sigmas for (one, other), sigmas in pairs.items() if one in named}


def sigma_words(sigmas: float) -> str:
    return f"{sigmas:.0f} σ" if sigmas >= 1000 else f"{sigmas:.3g} σ"


def separation_words(pairs: Pairs, named: Collection[str]) -> str:
    """Text: separation (σ) of each alternative of the `named` effects; pairs not separated."""
    separations = from_named(pairs, named)
    separated = [f"{n} by {sigma_words(s)}" for n, s in separations.items() if s > LEAST_SIGMAS]
    alike = [name for name, s in separations.items() if s <= LEAST_SIGMAS]
    twins = [
        f"{one} from {other}"
        for (one, other), s in pairs.items()
        if s <= LEAST_SIGMAS and not {one, other} & {*named, *alike}
    ]
    summary = f"it should separate {', '.join(separated)}"
    remaining = ", ".join([*alike, *twins])
    return summary + (f"; it does not distinguish {remaining}" if remaining else "")
