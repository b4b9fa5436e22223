"""The grids `short` and `constants`: one run of one program, seen by one instrument."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import cycle

import numpy as np

from mopro.blind.hidden.effects import POSITION, THERMAL
from mopro.blind.hidden.spec import COARSE, ENCODER, LVDT, THERMOCOUPLE, CaseSpec

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
