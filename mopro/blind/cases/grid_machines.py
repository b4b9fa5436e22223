"""The grid `machines`: machines beside the motor, a fifth of them with nothing hidden."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mopro.blind.cases.of_machines import LISTED, UNLISTED

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

    `listed` are keys of `of_machines.LISTED`, `unlisted` is one of UNLISTED or "". The noise is
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


def machines(g: np.random.Generator) -> Iterator[MachineSpec]:
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


def _listed(g: np.random.Generator, kind: str, nth: int) -> tuple[str, ...]:
    keys = list(LISTED[kind])
    first = keys[nth % len(keys)]
    own = LISTED[kind][first][0]
    others = [key for key in keys if LISTED[kind][key][0] != own]
    return (first, str(g.choice(others))) if g.random() < _PAIR else (first,)


def _spec(g: np.random.Generator, kind: str, listed: tuple[str, ...], unlisted: str) -> MachineSpec:
    noise = str(g.choice(list(_NOISES), p=list(_NOISES.values())))
    troubles = tuple(name for name in _TROUBLES if g.random() < _TROUBLED)
    return MachineSpec(kind, listed, unlisted, int(g.integers(1, 7)), noise, troubles)
