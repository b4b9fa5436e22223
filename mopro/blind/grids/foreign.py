"""The grid `foreign`: matters that no catalogue has, alone and beside an effect that it has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mopro.blind.hidden.foreign_kinds import FOREIGN_KINDS
from mopro.blind.hidden.spec import ENCODER, LASER, CaseSpec

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
