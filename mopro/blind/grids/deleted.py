"""The grid `deleted`: each effect hidden once, and left out of the candidates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mopro.blind.hidden.effects import HIDDEN_EFFECTS
from mopro.blind.hidden.spec import LASER, CaseSpec, single

# Fewer and shorter runs than in other grids, as each rival is fitted when a case is made.
_RUNS, _RUN_S = 3, 4.0


def deleted(g: np.random.Generator) -> Iterator[CaseSpec]:
    """Each effect of the catalogue at 60 σ or more, or as large as it can be."""
    for name in HIDDEN_EFFECTS:
        yield single(name, "strong", LASER, _RUNS, _RUN_S, "deleted", True)
