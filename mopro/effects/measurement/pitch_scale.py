"""A platen of another pitch."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate


class PitchScale(Effect):
    """The platen's pitch is not what it is said to be.

    x' = x (1 + e); e is a ratio. Source: assumed.
    """

    name = "pitch_scale"
    domain = Domain.MEASUREMENT
    families = ("scale",)
    parameters = (Parameter("e", "1", "ratio", 2e-4, (-5e-4, 5e-4), -0.1, 0.1, "relative excess"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x * (1 + p[0])

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 1e-4))
