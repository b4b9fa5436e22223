"""Drift of the air temperature."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Parameter, Surroundings, View
from mopro.engine.candidate import Candidate


class AmbientDrift(Effect):
    """The room warms or cools during the run.

    T_air' = T_air + r t, r in K/s. Source: the experiments took four weeks (chapter
    3.2.2); figures assumed.
    """

    name = "ambient_drift"
    domain = Domain.HEAT
    of_one_run = True
    parameters = (
        Parameter("r", "K/s", "temperature rate", 2.8e-4, (-5.6e-4, 5.6e-4), -0.1, 0.1, "rate"),
    )

    def heat(self, here: Surroundings, *p: float) -> None:
        here.air_C += p[0] * here.time_s

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("r", 1e-4))
