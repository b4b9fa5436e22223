"""Effects that a file states as formulas, as objects like those of the catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar

import numpy as np

from mopro.effects.effect import Domain, Effect, Floats, Parameter, Scene, View
from mopro.effects.starts import targets_m
from mopro.engine.candidate import Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.formula.closures import closure_of
from mopro.formula.columns import Sampled
from mopro.formula.dimension import dimension_of_unit, factor_of, words
from mopro.formula.shape_search import Search
from mopro.formula.shapes import MOST_PERIODS_OF_SPAN, Sized, role_of_shape, shape_of
from mopro.formula.written import (
    AMPLITUDE,
    COMMAND,
    FORCE,
    FRICTION,
    MEASUREMENT,
    PERIOD,
    EffectParameter,
    Written,
    WrittenEffect,
)
from mopro.machine.formulas import NAMES

# As the catalogue's laws of dry friction have it where it is not fitted.
_PRESLIDING_M = 5e-6
# Starts of an amplitude without any, as shares of its range: of a force, and of a place.
_FORCE_STARTS, _PLACE_STARTS = (3e-3, 3e-2), (1e-4,)
# Times at which the size of a term is taken, in each run.
_TIMES = 400
_DIFFERENCE = {FORCE: 1e-4, FRICTION: 1e-4, COMMAND: 1e-5, MEASUREMENT: 1e-5}


@cache
def effect_of(written: WrittenEffect) -> Effect:
    """The effect that a file states; of one class for all files that state the same."""
    base = {
        FORCE: FormulaForce, FRICTION: FormulaFriction, COMMAND: FormulaCommand,
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
        role=Role.AMPLITUDE if p.role == AMPLITUDE else role_of_shape(p),
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
        found = {p.name: self._shape(p, sizes) for p in self.written.parameters if _is_shape(p)}
        shapes = {name: shape for name, shape in found.items() if shape is not None}
        if len(shapes) < len(found):
            return
        made = []
        for p in self.written.parameters:
            parameter = shapes.get(p.name) or self._amplitude(p, shapes, sizes)
            if parameter is None:
                return
            made.append(parameter)
        flexible = any(p.role == PERIOD for p in self.written.parameters)
        find = None
        if shapes and self.written.enters == MEASUREMENT:
            find = Search(self.written, tuple(made), MOST_PERIODS_OF_SPAN, _samples_of(view))
        yield self.form(*made, flexible=flexible, find_starts=find)

    def _shape(self, p: EffectParameter, sizes: _Sizes) -> Fitted | None:
        made = shape_of(self.written, p, sizes.sized)
        if p.low is None and not sizes.sized.extent(self.written, dimension_of_unit(p.unit)).span:
            raise self._without_range(p)
        null, difference = self.parameter(p.name).null, _DIFFERENCE[self.written.enters]
        return made and replace(made, null=null, difference=difference)

    def _without_range(self, p: EffectParameter) -> Exception:
        of = words(dimension_of_unit(p.unit))
        message = f"expected a range of {p.name}: no size of the runs is in {of}"
        assert self.written.value is not None, "it was read from a file"
        return self.written.value[p.name].error(message, "missing-key")

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
            low = 0.0 if p.positive or self.written.enters == FRICTION else -high
        in_force = self.written.enters in (FORCE, FRICTION)
        shares = _FORCE_STARTS if in_force else _PLACE_STARTS
        starts = tuple(share * (high if high > 0 else low) for share in shares)
        begun = p.begun(sizes.names)
        starts = starts if begun is None else (begun,)
        difference = _DIFFERENCE[self.written.enters]
        return Fitted(p.name, p.unit, low, high, starts, difference=difference)

    def _largest(self, p: EffectParameter, shapes: Mapping[str, Fitted], sizes: _Sizes) -> float:
        """The largest change (SI) by the term in the runs, for one unit of an amplitude."""
        at_null = [shapes[q.name].starts[0] if q.name in shapes else 0.0
               for q in self.written.parameters]  # fmt: skip
        one = [1.0 if q.name == p.name else value
               for q, value in zip(self.written.parameters, at_null, strict=True)]  # fmt: skip
        largest = 0.0
        for names in sizes.runs:
            time_s = names["t"]
            change = np.abs(self.value(names, time_s, one) - self.value(names, time_s, at_null))
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


def _is_shape(p: EffectParameter) -> bool:
    return p.role != AMPLITUDE


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
    """Commanded motions of the runs, as names of formulas, and the sizes taken from them.

    `x_span` (m) and `pull_out_N`: sizes of what terms are added to.
    """

    runs: tuple[dict[str, Floats], ...]
    sized: Sized
    x_span: float
    pull_out_N: float

    @property
    def names(self) -> Mapping[str, float]:
        """The names that formulas of a range may use."""
        return self.sized.names

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
        read = [(own, np.arange(len(own["t"]))) for own in _as_read(view)] or [
            (own, np.arange(_TIMES)) for own in runs
        ]
        sized = Sized.of(read, NAMES[MEASUREMENT], names)
        return cls(tuple(runs), sized, names["x_span"], view.machine.axis.pull_out_force_N)

    def scale(self, enters: str) -> float:
        """The size (SI) of the quantity that a term is added to."""
        return self.pull_out_N if enters in (FORCE, FRICTION) else self.x_span


def _as_read(view: View) -> Iterator[dict[str, Floats]]:
    """The motion of the model without effects at the samples of each position sensor."""
    places = view.targets({})
    for row, (_, reading) in view.positions().items():
        if len(reading.time_s) > 1:
            yield _in_time(places[row] * reading.sensor.unit_si, reading.time_s)


def _scene_of(position_u: Floats, time_s: Floats, view: View) -> dict[str, Floats]:
    names = _in_time(position_u * view.machine.microstep_m, time_s)
    air, motor = view.machine.heat.ambient_C, view.machine.axis.moving_mass_kg * names["a"]
    return {**names, "y": names["x"], "T": np.full_like(time_s, air), "motor": motor}


# -- samples of a search -------------------------------------------------------------------


def _samples_of(view: View) -> Callable[[ResidualView], list[Sampled]]:
    """The samples of the position sensors in a fit, as a search for shapes sees them."""

    def samples(fit: ResidualView) -> list[Sampled]:
        targets, air = targets_m(view, fit), view.machine.heat.ambient_C
        found = []
        for row, (_, reading) in view.positions().items():
            x, time_s, unit = targets[row], reading.time_s, reading.sensor.unit_si
            names = {**_in_time(x, time_s), "y": x, "T": np.full_like(x, air)}
            left, sigma = fit.residuals[row], float(fit.sigmas[row])
            rows = np.arange(len(x))
            found.append(Sampled(names, time_s, rows, left, sigma, 1 / unit, is_aligned=True))
        return found

    return samples
