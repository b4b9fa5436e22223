"""Force of the umbilical."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate, Role
from mopro.engine.candidate import Parameter as Fitted

_FREE_END = Fitted("x_h", "m", -0.9, 0.9, (0.0,), Role.SHAPE, plausible=(-0.6, 0.6))


class UmbilicalSpring(Effect):
    """The umbilical pulls the forcer towards its rest position like a spring.

    F = -k_h (x - x_h), k_h in N/m, x_h in m from the start. Source: chapter 2.2 names
    the umbilical; figures assumed.
    """

    name = "umbilical_spring"
    domain = Domain.DYNAMICS
    kernel_group = "forces"
    families = ("scale",)
    parameters = (
        Parameter("k_h", "N/m", "stiffness", 20.0, (5.0, 50.0), 0.0, 1000.0, "stiffness"),
        Parameter("x_h", "m", "length", 0.0, (-0.5, 0.5), -2.0, 2.0, "where it hangs freely"),
    )

    @staticmethod
    def force(x: float, v: float, k_h: float, x_h: float) -> float:
        return -k_h * (x - x_h)

    def forms(self, view: View) -> Iterator[Candidate]:
        stiffness = self.fitted("k_h", 10.0)
        spring = self.form(stiffness, fixed={"x_h": 0.0})
        yield spring
        yield replace(
            spring, parameters=(stiffness, _FREE_END), fixed={}, form="free end fitted", extends=""
        )
