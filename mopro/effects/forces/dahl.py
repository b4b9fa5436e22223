"""Base of friction laws with Dahl's presliding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Effect, Parameter
from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted

PRESLIDING_M = 5e-6
PRESLIDING = Parameter(
    "delta", "m", "length", PRESLIDING_M, (2e-6, 1e-5), 1e-7, 1e-3, "presliding", null=PRESLIDING_M
)
PRESLIDING_FITTED = Fitted(
    "delta", "m", 5e-7, 5e-5, (PRESLIDING_M,), Role.SHAPE, plausible=(1e-6, 2e-5)
)


class DahlFriction(Effect):
    """Base of laws of dry friction whose first two parameters are a force and `delta` (m).

    Their state z, from -1 to 1, is the share of the friction that has built up:
    dz/dx = (1 - z sgn ẋ) / delta. z depends on the path alone, z = s - (s - z0) exp(-|Δx|/delta)
    with s the direction, and is taken so at every stage of the integrator. Source:
    P. R. Dahl's model.
    """

    kernel_group = "forces"

    @staticmethod
    def slide(z: float, dx: float, force_N: float, delta: float, *others: float) -> float:
        if dx >= 0.0:
            return 1.0 - (1.0 - z) * math.exp(-dx / delta)
        return (1.0 + z) * math.exp(dx / delta) - 1.0


def with_presliding(plain: Candidate) -> Iterator[Candidate]:
    """`plain` with delta as it is assumed, and with delta fitted as well."""
    yield replace(plain, fixed={"delta": PRESLIDING_M})
    yield replace(
        plain,
        parameters=(*plain.parameters, PRESLIDING_FITTED),
        form="presliding fitted",
        extends="",
    )
