"""Thermal expansion of the platen."""

from __future__ import annotations

from collections.abc import Iterator

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.engine.candidate import Candidate

_STEEL_1_K = 11.35e-6


class PlatenExpansion(Effect):
    """The platen expands with its temperature.

    x' = x (1 + alpha ΔT), ΔT = dT + share (T - T_air): dT in K is the platen's rise above
    the temperature at which it was made, `share` its share of the forcer's rise (1 is the
    worst case of chapter 3.1.2); alpha in 1/K. Source: eq. 3.29, 3.53, 3.54.
    """

    name = "platen_expansion"
    domain = Domain.MEASUREMENT
    families = ("scale",)
    parameters = (
        Parameter(
            "dT", "K", "temperature difference", 20.0, (0.0, 40.0), -100.0, 100.0, "warmer by"
        ),
        Parameter("share", "1", "ratio", 0.0, (0.0, 1.0), 0.0, 1.0, "of the forcer's rise"),
        Parameter(
            "alpha", "1/K", "expansion", _STEEL_1_K, (9.9e-6, 12.8e-6), 0.0, 1e-4,
            "expansion of steel", null=_STEEL_1_K,
        ),
    )  # fmt: skip

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        warmer = p[0] + p[1] * (scene.temperature_C - scene.air_C)
        grown: Floats = x * (1 + p[2] * warmer)
        return grown

    @property
    def needs_temperature(self) -> bool:
        return True

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("dT", 10.0), fixed={"share": 0.0, "alpha": _STEEL_1_K})
        with_it = {"dT": 0.0, "alpha": _STEEL_1_K}
        yield self.form(self.fitted("share", 0.5), form="with the forcer", fixed=with_it)
