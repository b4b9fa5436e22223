"""A nonlinear sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted

_LVDT_HALF_RANGE_M = 0.254
# Number of starts for the middle of the cubic.
_MIDDLES_TRIED = 7


class SensorNonlinearity(Effect):
    """The sensor is nonlinear towards the ends of its range.

    x' = x + 2 half (c3 u³ + c5 u⁵), u = (x - mid)/half: c3 and c5 are shares of the full
    range 2 half, mid and half in m. Source: appendix D.1, "at the ends of the core
    travel, the linearity decreases"; 0.25 % of the range.
    """

    name = "sensor_nonlinearity"
    domain = Domain.MEASUREMENT
    parameters = (
        Parameter("c3", "1", "ratio", 2.5e-3, (-0.01, 0.01), -0.5, 0.5, "cubic, of full range"),
        Parameter("c5", "1", "ratio", 0.0, (-0.01, 0.01), -0.5, 0.5, "quintic, of full range"),
        Parameter("mid", "m", "length", 0.0, (-0.3, 0.3), -2.0, 2.0, "middle of the range"),
        Parameter(
            "half", "m", "length", _LVDT_HALF_RANGE_M, (0.01, 1.0), 1e-4, 10.0, "half the range",
            null=_LVDT_HALF_RANGE_M, unit_of=("c3", "c5"),
        ),
    )  # fmt: skip

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        c3, c5, mid, half = p
        u = (x - mid) / half
        square = u * u
        bent: Floats = x + 2 * half * u * square * (c3 + c5 * square)
        return bent

    def forms(self, view: View) -> Iterator[Candidate]:
        """Polynomials about the middle of the travel, or about a fitted one."""
        low, high = view.travel_m()
        middle, half = (low + high) / 2, _LVDT_HALF_RANGE_M
        cubic = replace(self.fitted("c3", 1e-3), low=-0.1, high=0.1, plausible=(-0.05, 0.05))
        quintic = replace(cubic, name="c5")
        yield self.form(cubic, form="cubic", fixed={"c5": 0.0, "mid": middle, "half": half})
        yield self.form(
            cubic, quintic, form="cubic and quintic", fixed={"mid": middle, "half": half},
            extends="cubic", flexible=True,
        )  # fmt: skip
        # Travel to one side of the sensor's middle shows little nonlinearity about its own middle.
        places = tuple(np.linspace(low - half / 2, high + half / 2, _MIDDLES_TRIED).tolist())
        mid = Fitted("mid", "m", low - half, high + half, places, Role.SHAPE, null=middle)
        elsewhere = self.form(
            cubic, mid, form="cubic, middle fitted", fixed={"c5": 0.0, "half": half},
            extends="cubic", can_enter_first=True, flexible=True,
        )  # fmt: skip
        yield elsewhere
        yield replace(
            elsewhere, parameters=(cubic, quintic, mid), fixed={"half": half},
            form="cubic and quintic, middle fitted", extends=elsewhere.form,
        )  # fmt: skip
