"""A cyclic error."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View, phase
from mopro.effects.search import Values, strongest_lines
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted

_PERIODS_TRIED = 3
_FINEST_PERIOD_M = 1e-4
_PERIOD = Fitted(
    "lambda", "m", 8e-5, 0.15, role=Role.SHAPE, inverse=True, difference=1e-6, plausible=(1e-4, 0.1)
)


class PeriodicError(Effect):
    """A cyclic error of the teeth or of the sensor's scale.

    x' = x + A sin(2πx/lambda + phi); A and lambda in m, phi in rad. Source: assumed.
    """

    name = "periodic_error"
    domain = Domain.MEASUREMENT
    parameters = (
        Parameter("A", "m", "length", 5e-6, (1e-6, 1e-4), 0.0, 0.01, "amplitude"),
        Parameter(
            "lambda", "m", "length", 1.016e-3, (1e-4, 0.1), 1e-6, 10.0, "period", null=1.016e-3
        ),
        Parameter(
            "phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase", role=Role.PHASE
        ),
    )

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        ripple: Floats = x + p[0] * np.sin(2 * math.pi * x / p[1] + p[2])
        return ripple

    def forms(self, view: View) -> Iterator[Candidate]:
        amplitude = Fitted("A", "m", 0.0, 1e-2)
        yield self.form(
            amplitude,
            _PERIOD,
            phase("phi"),
            flexible=True,
            find_starts=lambda fit: _lines(view, fit),
        )


def _lines(view: View, fit: ResidualView) -> Iterator[Values]:
    """Starting values from the strongest spectral lines over position."""
    for sine, cosine, period in strongest_lines(view, fit, _FINEST_PERIOD_M, _PERIODS_TRIED):
        yield {
            "A": math.hypot(sine, cosine),
            "lambda": period,
            "phi": math.atan2(cosine, sine),
        }
