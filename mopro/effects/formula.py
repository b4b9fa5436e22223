"""Effects that a file states as formulas, as objects like those of the catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar

import numpy as np

from mopro.effects.base import Domain, Effect, Floats, Parameter, Scene, View
from mopro.effects.search import Values, residual_m, targets_m
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.formula.closures import closure_of
from mopro.formula.dimension import dimension_of_unit, factor_of, words
from mopro.formula.written import (
    AMPLITUDE,
    PERIOD,
    THRESHOLD,
    EffectParameter,
    Written,
    WrittenEffect,
)
from mopro.machine.formulas import AS_FORCE, AS_FRICTION, COMMAND, MEASUREMENT

# As the catalogue's laws of dry friction have it where it is not fitted.
_PRESLIDING_M = 5e-6
# Starts of an amplitude without any, as shares of its range: of a force, and of a place.
_FORCE_STARTS, _PLACE_STARTS = (3e-3, 3e-2), (1e-4,)
# A shape without a range: shares of the span of what has its unit, and where it starts.
_SHAPES, _SHAPE_STARTS = (0.01, 1.0), (0.05, 0.25)
# Shortest and longest period, in the span of its variable.
_PERIODS, _PERIOD_STARTS = (0.005, 0.5), (0.02, 0.05, 0.15, 0.4)
# Points of the grid of a search along a shape and along a period, most of all together, and most
# samples of a series that it takes.
_GRID, _PERIOD_GRID, _MOST_POINTS, _MOST_SAMPLES = 12, 400, 2000, 2000
# Times at which the size of a term is taken, in each run.
_TIMES = 400
_DIFFERENCE = {AS_FORCE: 1e-4, AS_FRICTION: 1e-4, COMMAND: 1e-5, MEASUREMENT: 1e-5}


@cache
def effect_of(written: WrittenEffect) -> Effect:
    """The effect that a file states; of one class for all files that state the same."""
    base = {
        AS_FORCE: FormulaForce, AS_FRICTION: FormulaFriction, COMMAND: FormulaCommand,
        MEASUREMENT: FormulaMeasurement,
    }[written.enters]  # fmt: skip
    facts: dict[str, Any] = {
        "name": written.name,
        "written": written,
        "of_one_run": "t" in written.term.formula.names,
        "parameters": tuple(map(_parameter, written.parameters)),
        "__doc__": f"A file's formula.\n\n{written.enters}: {written.term.formula.text}",
    }
    kind = type("FormulaEffect", (base,), facts | base.terms(written))
    made: Effect = kind()
    return made


@dataclass(frozen=True)
class FormulaParameter(Parameter):
    """A parameter in any unit that formulas know."""

    def converted(self, number: float, unit: str) -> float:
        if dimension_of_unit(unit) != dimension_of_unit(self.unit):
            raise ValueError(f"'{unit}' does not measure what {self.unit} does")
        return number * factor_of(unit) / factor_of(self.unit)


def _parameter(p: EffectParameter) -> Parameter:
    low, high = _ends(p) or (0.0 if p.positive else -math.inf, math.inf)
    start = p.start if isinstance(p.start, float) else 0.0 if p.role == AMPLITUDE else 1.0
    if p.role != AMPLITUDE and not isinstance(p.start, float) and math.isfinite(low + high):
        start = (low + high) / 2
    return FormulaParameter(
        p.name, p.unit, "", start, (low, high), min(low, 0.0) if p.role == AMPLITUDE else low,
        high, "of the file", null=0.0 if p.role == AMPLITUDE else start,
        role=Role.AMPLITUDE if p.role == AMPLITUDE else _role_of_shape(p),
    )  # fmt: skip


def _ends(p: EffectParameter) -> tuple[float, float] | None:
    """The stated range, if it is of numbers."""
    if isinstance(p.low, float) and isinstance(p.high, float):
        return p.low, p.high
    return None


class FormulaEffect(Effect):
    """Base of effects that a file states; `written` is what it states."""

    written: ClassVar[WrittenEffect]

    @classmethod
    def terms(cls, written: WrittenEffect) -> dict[str, Any]:
        """Terms of the equation of motion, as attributes of the effect's class."""
        return {}

    def value(self, names: Mapping[str, Any], time_s: Floats, p: Sequence[float]) -> Floats:
        """The formula at each of `time_s`, for the effect's parameters `p`."""
        from mopro.formula.evaluate import evaluate

        own = {
            stated.name: value * stated.factor
            for stated, value in zip(self.written.parameters, p, strict=True)
        }
        return evaluate(self.written.term.formula, {**names, **own}, time_s)

    def forms(self, view: View) -> Iterator[Candidate]:
        """One form, its ranges from the sizes of the runs unless the file states them.

        None if the term does nothing in these runs. Raises ModelError for a term without
        finite values in them.
        """
        sizes = _Sizes.of(view)
        shapes = {p.name: self._shape(p, sizes) for p in self.written.parameters if _is_shape(p)}
        made = []
        for p in self.written.parameters:
            found = shapes.get(p.name) or self._amplitude(p, shapes, sizes)
            if found is None:
                return
            made.append(found)
        flexible = any(p.role == PERIOD for p in self.written.parameters)
        find = self._search(view, made) if shapes and self.written.enters == MEASUREMENT else None
        yield self.form(*made, flexible=flexible, find_starts=find)

    def _shape(self, p: EffectParameter, sizes: _Sizes) -> Fitted:
        low, high = _PERIODS if p.role == PERIOD else _SHAPES
        starts = _PERIOD_STARTS if p.role == PERIOD else _SHAPE_STARTS
        if p.low is not None and p.high is not None:
            ends = tuple(p.sized(end, sizes.names) for end in (p.low, p.high))
            chosen = tuple(ends[0] + share * (ends[1] - ends[0]) for share in _SHAPE_STARTS)
        else:
            span = sizes.span_of(p, self.written) / p.factor
            ends, chosen = (low * span, high * span), tuple(share * span for share in starts)
        begun = p.begun(sizes.names)
        chosen = chosen if begun is None else (begun,)
        return Fitted(
            p.name, p.unit, ends[0], ends[1], chosen, _role_of_shape(p),
            null=self.parameter(p.name).null, inverse=p.role == PERIOD and ends[0] > 0,
            difference=_DIFFERENCE[self.written.enters],
        )  # fmt: skip

    def _amplitude(
        self, p: EffectParameter, shapes: Mapping[str, Fitted], sizes: _Sizes
    ) -> Fitted | None:
        if p.low is not None and p.high is not None:
            low, high = (p.sized(end, sizes.names) for end in (p.low, p.high))
        else:
            largest = self._largest(p, shapes, sizes)
            if not largest:
                return None
            high = sizes.scale(self.written.enters) / largest
            low = 0.0 if p.positive or self.written.enters == AS_FRICTION else -high
        in_force = self.written.enters in (AS_FORCE, AS_FRICTION)
        shares = _FORCE_STARTS if in_force else _PLACE_STARTS
        starts = tuple(share * (high if high > 0 else low) for share in shares)
        begun = p.begun(sizes.names)
        starts = starts if begun is None else (begun,)
        difference = _DIFFERENCE[self.written.enters]
        return Fitted(p.name, p.unit, low, high, starts, difference=difference)

    def _largest(self, p: EffectParameter, shapes: Mapping[str, Fitted], sizes: _Sizes) -> float:
        """The largest change (SI) by the term in the runs, for one unit of an amplitude."""
        off = [shapes[q.name].starts[0] if q.name in shapes else 0.0
               for q in self.written.parameters]  # fmt: skip
        one = [1.0 if q.name == p.name else value
               for q, value in zip(self.written.parameters, off, strict=True)]  # fmt: skip
        largest = 0.0
        for names in sizes.runs:
            time_s = names["t"]
            change = np.abs(self.value(names, time_s, one) - self.value(names, time_s, off))
            if not np.isfinite(change).all():
                at = int(np.flatnonzero(~np.isfinite(change))[0])
                raise self._not_finite(time_s[at], names["x"][at])
            largest = max(largest, float(change.max()))
        return largest

    def _not_finite(self, time_s: float, x: float) -> Exception:
        message = (
            f"the formula gives no finite number at {time_s:.6g} s, where x is {x:.6g} m: "
            "it divides by zero, or runs away"
        )
        assert self.written.value is not None, "it was read from a file"
        return self.written.value["formula"].error(message, "not-finite")

    # -- search for shapes of a measurement ------------------------------------------------

    def _search(
        self, view: View, parameters: Sequence[Fitted]
    ) -> Callable[[ResidualView], Iterator[Values]]:
        """Search for shapes: where on a grid the term takes most of the residual away."""
        shapes = [p for p in parameters if p.role is not Role.AMPLITUDE]
        sizes = [p for p in parameters if p.role is Role.AMPLITUDE]

        def find(fit: ResidualView) -> Iterator[Values]:
            best: tuple[float, dict[str, float]] = (0.0, {})
            series = list(_series(view, fit))
            for point in _grid(shapes):
                gain, found = self._gain(point, sizes, series)
                if gain > best[0]:
                    best = gain, {**point, **found}
            if best[1]:
                yield {p.name: best[1][p.name] for p in parameters}

        return find

    def _gain(
        self, point: Mapping[str, float], sizes: Sequence[Fitted], series: Sequence[_Series]
    ) -> tuple[float, dict[str, float]]:
        """Fall of the sum of squares with these shapes, and the sizes that give it."""
        off = dict.fromkeys((p.name for p in sizes), 0.0) | dict(point)
        columns = []
        for size in sizes:
            own = off | {size.name: 1.0}
            values = [own[p.name] for p in self.written.parameters]
            blocks = [s.whitened(self.value(s.names, s.names["t"], values)) for s in series]
            columns.append(np.nan_to_num(np.concatenate(blocks)))
        basis, left = np.stack(columns, axis=1), np.concatenate([s.residual for s in series])
        best = np.linalg.lstsq(basis, left, rcond=1e-9)[0]
        gain = float(left @ left - np.sum((left - basis @ best) ** 2))
        found = {p.name: p.within(v) for p, v in zip(sizes, best.tolist(), strict=True)}
        first = sizes[0]
        if found[first.name] == first.null:
            found[first.name] = first.starts[0]
        return gain, found


def _is_shape(p: EffectParameter) -> bool:
    return p.role != AMPLITUDE


def _role_of_shape(p: EffectParameter) -> Role:
    """A threshold is found on a grid: where the term jumps, no slope leads to it."""
    return Role.SEARCHED if p.role == THRESHOLD else Role.SHAPE


class FormulaForce(FormulaEffect):
    """Base of those that enter as a force (N), of the place, the speed and the motor's force."""

    domain = Domain.DYNAMICS
    kernel_group = "forces"

    @classmethod
    def terms(cls, written: WrittenEffect) -> dict[str, Any]:
        names = written.term.formula.names
        if "motor" in names:
            of_motor = _closure(written.term, ("x", "v", "motor"), written)

            def reaction(x: float, v: float, motor_N: float, *p: float) -> float:
                return of_motor((x, v, motor_N, *p))

            return {"reaction": staticmethod(reaction)}
        of_motion = _closure(written.term, ("x", "v"), written)

        def force(x: float, v: float, *p: float) -> float:
            return of_motion((x, v, *p))

        return {"force": staticmethod(force)}


class FormulaFriction(FormulaEffect):
    """Base of those that enter as the limit (N) of a dry friction, with Dahl's presliding."""

    domain = Domain.DYNAMICS
    kernel_group = "forces"

    @staticmethod
    def slide(z: float, dx: float, *p: float) -> float:
        if dx >= 0.0:
            return 1.0 - (1.0 - z) * math.exp(-dx / _PRESLIDING_M)
        return (1.0 + z) * math.exp(dx / _PRESLIDING_M) - 1.0

    @classmethod
    def terms(cls, written: WrittenEffect) -> dict[str, Any]:
        if "motor" in written.term.formula.names:
            of_motor = _closure(written.term, ("x", "v", "motor"), written)

            def reaction(x: float, v: float, z: float, motor_N: float, *p: float) -> float:
                return -z * of_motor((x, v, motor_N, *p))

            return {"reaction": staticmethod(reaction)}
        of_motion = _closure(written.term, ("x", "v"), written)

        def force(x: float, v: float, z: float, *p: float) -> float:
            return -z * of_motion((x, v, *p))

        return {"force": staticmethod(force)}


def _closure(
    term: Written, names: tuple[str, ...], written: WrittenEffect
) -> Callable[[tuple[float, ...]], float]:
    own = tuple(p.name for p in written.parameters)
    factors = (1.0,) * len(names) + tuple(p.factor for p in written.parameters)
    return closure_of(term.formula, (*names, *own), factors)


class FormulaCommand(FormulaEffect):
    """Base of those that are added to the command (m)."""

    domain = Domain.COMMAND

    def command(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        return x + self.value(_in_time(x, time_s), time_s, p)


class FormulaMeasurement(FormulaEffect):
    """Base of those that are added to what a sensor of the place reads (m)."""

    domain = Domain.MEASUREMENT

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        names = {**_in_time(x, scene.time_s), "y": x, "T": scene.temperature_C}
        return x + self.value(names, scene.time_s, p)


def _in_time(x: Floats, time_s: Floats) -> dict[str, Floats]:
    """Time, place, speed and acceleration."""
    several = len(x) > 1
    v = np.gradient(x, time_s) if several else np.zeros_like(x)
    a = np.gradient(v, time_s) if several else np.zeros_like(x)
    return {"t": time_s, "x": x, "v": v, "a": a}


# -- sizes of the runs ---------------------------------------------------------------------


@dataclass(frozen=True)
class _Sizes:
    """Commanded motions of the runs, as names of formulas, and the sizes taken from them."""

    runs: tuple[dict[str, Floats], ...]
    names: Mapping[str, float]
    pull_out_N: float

    @classmethod
    def of(cls, view: View) -> _Sizes:
        runs = []
        for index in range(len(view.runs)):
            schedule = view.schedule(index)
            time_s = np.linspace(0.0, schedule.duration_s, _TIMES)
            for track in schedule.tracks.values():
                if track.segments:
                    places = [track.state(t).position for t in time_s.tolist()]
                    runs.append(_scene_of(np.array(places), time_s, view))
        names = {
            "length": max((float(n["t"][-1]) for n in runs), default=0.0),
            "x_span": max((float(np.ptp(n["x"])) for n in runs), default=0.0),
            "v_max": max((float(np.max(np.abs(n["v"]))) for n in runs), default=0.0),
            "a_max": max((float(np.max(np.abs(n["a"]))) for n in runs), default=0.0),
        }
        names["step"] = names["length"] / _TIMES
        return cls(tuple(runs), names, view.machine.axis.pull_out_force_N)

    def span_of(self, p: EffectParameter, effect: WrittenEffect) -> float:
        """The span (SI) of what has the unit of a shape; ModelError if nothing has."""
        wanted = dimension_of_unit(p.unit)
        for unit, name in (("m", "x_span"), ("m/s", "v_max"), ("s", "length"), ("m/s2", "a_max")):
            if dimension_of_unit(unit) == wanted and self.names[name] > 0:
                return self.names[name]
        assert effect.value is not None, "it was read from a file"
        message = f"expected a range of {p.name}: no size of the runs is in {words(wanted)}"
        raise effect.value[p.name].error(message, "missing-key")

    def scale(self, enters: str) -> float:
        """The size (SI) of the quantity that a term is added to."""
        return self.pull_out_N if enters in (AS_FORCE, AS_FRICTION) else self.names["x_span"]


def _scene_of(position_u: Floats, time_s: Floats, view: View) -> dict[str, Floats]:
    names = _in_time(position_u * view.machine.microstep_m, time_s)
    air, motor = view.machine.heat.ambient_C, view.machine.axis.moving_mass_kg * names["a"]
    return {**names, "y": names["x"], "T": np.full_like(time_s, air), "motor": motor}


# -- samples of a search -------------------------------------------------------------------


@dataclass(frozen=True)
class _Series:
    """Samples of one sensor: names of formulas, and the residual (m) less its mean, whitened."""

    names: Mapping[str, Floats]
    sigma_m: float
    residual: Floats = field(repr=False)

    def whitened(self, change_m: Floats) -> Floats:
        """A change of the readings (m), less its mean, in standard deviations."""
        apart: Floats = (change_m - change_m.mean()) / self.sigma_m
        return apart


def _series(view: View, fit: ResidualView) -> Iterator[_Series]:
    targets = targets_m(view, fit)
    for row, (_, reading) in view.positions().items():
        every = slice(None, None, max(1, len(reading.time_s) // _MOST_SAMPLES))
        sigma_m = float(fit.sigmas[row]) * reading.sensor.unit_si
        x, time_s = targets[row][every], reading.time_s[every]
        names = {**_in_time(x, time_s), "y": x, "T": np.full_like(x, view.machine.heat.ambient_C)}
        left = residual_m(view, fit, row)[every]
        yield _Series(names, sigma_m, (left - left.mean()) / sigma_m)


def _grid(shapes: Sequence[Fitted]) -> Iterator[dict[str, float]]:
    """Points of the grid of all shapes."""
    axes = np.meshgrid(*map(_along, shapes), indexing="ij")
    flat = [axis.ravel()[:_MOST_POINTS] for axis in axes]
    for point in zip(*(axis.tolist() for axis in flat), strict=True):
        yield {p.name: value for p, value in zip(shapes, point, strict=True)}


def _along(p: Fitted) -> Floats:
    if p.inverse:
        return 1 / np.linspace(1 / p.high, 1 / p.low, _PERIOD_GRID)
    return np.geomspace(p.low, p.high, _GRID) if p.low > 0 else np.linspace(p.low, p.high, _GRID)
