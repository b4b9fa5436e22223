"""Free-form forces that act beyond a speed, or in one place, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import ClassVar

import numpy as np

from mopro.effects.effect import Floats, Parameter, View
from mopro.effects.forces import PRESLIDING, PRESLIDING_M, DahlFriction
from mopro.effects.free_forces import Force, motions
from mopro.effects.free_form import size
from mopro.effects.starts import Values, force_N, targets_m
from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted

# Speeds, places and widths that are tried; widths are shares of the travel. Halved, the start is
# outside of the minimum of every fourth patch.
_SPEEDS, _PLACES, _WIDTHS = 40, 48, (1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64)
_FINEST_WIDTH, _WIDEST = 1 / 200, 1 / 2


class _BeyondSpeed(Force):
    """A force of one size against the motion, above a speed: a seal that lifts, a clipped drive."""

    name, of, text = "force beyond a speed", "v", "sign(v) * (abs(v) > v0)"
    parameters = (
        size("N"),
        Parameter("v0", "m/s", "velocity", 0.1, (1e-3, 1.0), 0.0, 10.0, "speed", null=0.1),
    )

    @staticmethod
    def force(x: float, v: float, c: float, v0: float) -> float:
        return c * math.copysign(1.0, v) if abs(v) > v0 else 0.0

    def written(self, values: Mapping[str, float]) -> str:
        return f"{values['c']:.4g} * sign(v) * (abs(v) > {values['v0']:.4g})"

    def forms(self, view: View) -> Iterator[Candidate]:
        fastest = max((float(np.abs(v).max()) for _, v in motions(view)), default=0.0)
        if not fastest:
            return
        speed = Fitted("v0", "m/s", LEAST_SHARE * fastest, fastest, role=Role.SHAPE)
        yield self.form(
            self.size(view.machine.axis.pull_out_force_N), speed,
            find_starts=lambda fit: _speeds(view, fit, speed), law=self.law,
        )  # fmt: skip


_PLACE = Parameter("x0", "m", "length", 0.0, (-1.0, 1.0), -10.0, 10.0, "place")
_WIDTH = Parameter("w", "m", "length", 0.01, (1e-3, 1.0), 1e-6, 10.0, "width", null=0.01)


class _InOnePlace(Force):
    """Base of the terms that are c times a hump over the place.

    `assumed`: what a dry friction takes for granted; nothing of another force.
    """

    of = "x"
    assumed: ClassVar[Mapping[str, float]] = {}

    def written(self, values: Mapping[str, float]) -> str:
        c, x0, w = (values[name] for name in ("c", "x0", "w"))
        side = "sign(v) * " if self.assumed else ""
        return f"{c:.4g} * {side}exp(-((x - {x0:.4g}) / {w:.4g})**2)"

    def forms(self, view: View) -> Iterator[Candidate]:
        places = [x for x, _ in motions(view)]
        if not any(np.ptp(x) > 0 for x in places):
            return
        low, high = (float(end(np.concatenate(places))) for end in (np.min, np.max))
        reach = high - low
        place = Fitted("x0", "m", low, high, role=Role.SHAPE)
        width = Fitted("w", "m", _FINEST_WIDTH * reach, _WIDEST * reach, role=Role.SHAPE)
        yield self.form(
            self.size(view.machine.axis.pull_out_force_N), place, width, fixed=self.assumed,
            find_starts=lambda fit: _places(view, fit, place, self.assumed), law=self.law,
        )  # fmt: skip


class _ForceInOnePlace(_InOnePlace):
    """A tooth that is stronger, a cable that drags there."""

    name = "force in one place"
    parameters = (size("N"), _PLACE, _WIDTH)

    @staticmethod
    def force(x: float, v: float, c: float, x0: float, w: float) -> float:
        return c * math.exp(-(((x - x0) / w) ** 2))


class _FrictionInOnePlace(_InOnePlace):
    """Dirt on the platen: a dry friction whose direction is that of Dahl's model."""

    name = "friction in one place"
    parameters = (size("N"), PRESLIDING, _PLACE, _WIDTH)
    slide = staticmethod(DahlFriction.slide)
    assumed: ClassVar[Mapping[str, float]] = {"delta": PRESLIDING_M}

    @staticmethod
    def force(x: float, v: float, z: float, c: float, delta: float, x0: float, w: float) -> float:
        return c * z * math.exp(-(((x - x0) / w) ** 2))


def _speeds(view: View, fit: ResidualView, speed: Fitted) -> Iterator[Values]:
    """The start where a force above a speed takes most of the force that the residual calls for."""
    _, v, wanted = _called_for(view, fit)
    shapes = (
        ({"v0": v0}, np.sign(v) * (np.abs(v) > v0))
        for v0 in np.linspace(speed.low, speed.high, _SPEEDS + 2)[1:-1].tolist()
    )
    yield from _largest(shapes, wanted)


def _places(
    view: View, fit: ResidualView, place: Fitted, assumed: Mapping[str, float]
) -> Iterator[Values]:
    """The start where a force in one place takes most of the force that the residual calls for.

    One that is a dry friction where something is `assumed` of that.
    """
    x, v, wanted = _called_for(view, fit)
    side = np.sign(v) if assumed else np.ones(len(v))
    reach = place.high - place.low
    shapes = (
        (
            {"x0": x0, "w": share * reach, **assumed},
            side * np.exp(-(((x - x0) / (share * reach)) ** 2)),
        )
        for x0 in np.linspace(place.low, place.high, _PLACES).tolist()
        for share in _WIDTHS
    )
    yield from _largest(shapes, wanted)


def _called_for(view: View, fit: ResidualView) -> tuple[Floats, Floats, Floats]:
    """Place (m), speed (m/s) and the force (N) that the residual calls for, at all samples."""
    targets = targets_m(view, fit)
    readings = view.positions()
    rows = [row for row, x in targets.items() if len(x) > 1]
    speeds = [np.gradient(targets[row], readings[row][1].time_s) for row in rows]
    forces = [force_N(view, fit, row) for row in rows]
    return (
        np.concatenate([targets[row] for row in rows]),
        np.concatenate(speeds),
        np.concatenate(forces),
    )


def _largest(shapes: Iterable[tuple[Values, Floats]], wanted: Floats) -> Iterator[Values]:
    """The values of the shape that takes most of what is wanted, with its size."""
    most: float = 0.0
    best: Values = {}
    for values, shape in shapes:
        power, product = float(shape @ shape), float(shape @ wanted)
        if power > 0 and product**2 / power > most:
            most, best = product**2 / power, {"c": product / power, **values}
    if best:
        yield best


LOCAL: tuple[type[Force], ...] = (_BeyondSpeed, _ForceInOnePlace, _FrictionInOnePlace)
