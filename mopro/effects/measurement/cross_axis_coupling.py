"""A sensor that is not square to the other axis."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate


class CrossAxisCoupling(Effect):
    """The sensor is not square to the other axis.

    y' = y + gamma x with x the other axis; gamma in rad. Source: assumed.
    """

    name = "cross_axis_coupling"
    domain = Domain.MEASUREMENT
    acts_last = True
    parameters = (Parameter("gamma", "rad", "angle", 3e-4, (-1e-3, 1e-3), -0.1, 0.1, "angle"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x + p[0] * scene.other_m

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("gamma", 2e-4))
