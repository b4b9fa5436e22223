"""Predictions of all readings of an experiment on a stated machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mopro.engine.assumed import FIT_TOLERANCE, PROPORTIONAL
from mopro.engine.candidate import RUN
from mopro.engine.series import Settings, unless_run_away
from mopro.errors import DataError
from mopro.formula import Formula, parse
from mopro.formula.bytecode import FIXED, MOVING, NONE, TIMED, Assembler, Program
from mopro.formula.evaluate import Floats, Functions, evaluate
from mopro.formula.expressions import substituted
from mopro.formula.signals import BEGINNINGS, ENDS, SIGNALS
from mopro.formula.written import COMMAND, FORCE, FRICTION, MEASUREMENT, WrittenEffect
from mopro.stated.data import Reading, Run, Sensor, StatedExperiment
from mopro.stated.model import AMBIENT, AXIS, INPUT, KINEMATIC, POWER, THERMAL
from mopro.stated.names import (
    axis_law,
    capacity_of,
    effects_of,
    inertia_of,
    sensors_of,
    unlisted_of,
)
from mopro.stated.rates import Rates, rate_between

BASE = "base"
SCALE = "scale of {}"
START = "start of {}, {}"
# Effects that are on, with their parameters in SI.
Active = tuple[tuple[WrittenEffect, Mapping[str, float]], ...]
# Names of formulas with their values.
Known = Mapping[str, Floats | float]
Simulate = Callable[[Mapping[str, float], Mapping[str, Floats]], Mapping[str, Any]]
# Halvings of the step of integration after which it is taken as it is.
_MOST_HALVINGS = 6
# Change by a halved step, as a share of the range of a state, that is small enough.
_STEP_ERROR = 1e-4
# Share of an effect's response by which the rounding of later times may change it.
_SAME_RESPONSE = 1e-6


@dataclass(frozen=True)
class Motion:
    """States of one run at its rows, by name, with its inputs as the model saw them."""

    states: Mapping[str, Floats]
    inputs: Mapping[str, Floats]


@dataclass(frozen=True)
class _Setup:
    """A run under settings: the numbers of the model in SI, and the effects that are on in it."""

    run: Run
    settings: Settings
    values: Mapping[str, float]
    active: Active

    def entering(self, place: str) -> list[tuple[WrittenEffect, Mapping[str, float]]]:
        return [(effect, own) for effect, own in self.active if effect.enters == place]


@dataclass(frozen=True)
class _Equations:
    """Equations of a set of effects as a program; `slots` are the places of their numbers."""

    program: Program
    slots: Mapping[str, int]


class Model:
    """The model of an experiment: called with settings, it predicts each reading in its unit.

    `forms`: all effects that may be switched on; the settings' parameters tell the form.
    `unlisted`: free-form terms, which a diagnosis may switch on. `foreign`: the function of a
    model that is a program.
    """

    def __init__(
        self,
        experiment: StatedExperiment,
        foreign: Simulate | None = None,
    ) -> None:
        self.experiment = experiment
        self.machine = experiment.machine
        self.forms = effects_of(experiment)
        self.unlisted = unlisted_of(experiment)
        self._by_name: dict[str, list[WrittenEffect]] = {}
        for effect in sorted(self._every, key=lambda form: len(form.parameters)):
            self._by_name.setdefault(effect.name, []).append(effect)
        self._place = {name: i for i, name in enumerate(dict.fromkeys(e.name for e in self._every))}
        self.foreign = foreign
        self._equations: dict[tuple[tuple[str, str], ...], _Equations] = {}
        self._steps: dict[str, float] = {}
        self._rates: dict[str, Rates] = {}

    def __call__(self, settings: Settings) -> list[Floats]:
        if self.foreign is not None:
            return [
                own for run in self.experiment.trials for own in self._of_foreign(run, settings)
            ]
        values = self.values(settings)
        setups = (self._setup(run, settings, values) for run in self.experiment.trials)
        return [own for setup in setups for own in self._readings(setup)]

    @property
    def runs_on(self) -> bool:
        """True if a prediction may get out of phase: of an axis, or of a program."""
        return self.foreign is not None or self.machine.kind == AXIS

    @cached_property
    def readings(self) -> list[tuple[Run, Reading]]:
        """Each reading with its run, in the order of the predictions."""
        return [(run, reading) for run in self.experiment.trials for reading in run.readings]

    def on(self, trials: Iterable[Run]) -> Model:
        """This model with other runs of its machine, and the effects that it has."""
        other = copy(self)
        other.experiment = replace(self.experiment, trials=tuple(trials))
        other._steps, other._rates = {}, {}
        vars(other).pop("readings", None)
        return other

    def hangs_on_the_clock(self, name: str, settings: Settings) -> bool:
        """True if what an effect of a program does is another thing where all runs begin later.

        Formulas tell whether they have `t`; a program is asked, with the time of each run later by
        the length of that run.
        """
        if self.foreign is None or name not in self._by_name:
            return False
        without = {other: own for other, own in settings.items() if other != name}
        early, late = (
            np.concatenate([a - b for a, b in zip(m(settings), m(without), strict=True)])
            for m in (self, self._later())
        )
        most = float(np.max(np.abs(early), initial=0.0))
        return not np.max(np.abs(late - early), initial=0.0) <= _SAME_RESPONSE * most

    def _later(self) -> Model:
        """This model of a program with the time column of each run later by its length."""
        other, columns = copy(self), []
        for run, own in zip(self.experiment.trials, self.experiment.columns, strict=True):
            heading = run.headings["t"][0]
            columns.append({**own, heading: own[heading] + np.ptp(own[heading])})
        other.experiment = replace(self.experiment, columns=tuple(columns))
        return other

    # -- numbers and effects -----------------------------------------------------------

    @property
    def _every(self) -> tuple[WrittenEffect, ...]:
        return (*self.forms, *self.unlisted)

    def values(self, settings: Settings) -> dict[str, float]:
        """The numbers of the model in SI."""
        stated = self._stated(settings)
        return {name: value * self.machine.numbers[name].factor for name, value in stated.items()}

    def _stated(self, settings: Settings) -> dict[str, float]:
        """The numbers of the model in their units: free ones are of the base.

        One with a tolerance is a candidate of its own; an effect may be called as a free one is.
        """
        found = {}
        for name, number in self.machine.numbers.items():
            own = settings.get(name if number.tolerance else BASE, {})
            found[name] = float(own.get(name, number.value))
        return found

    def active(self, run: Run, settings: Settings) -> Active:
        """The effects that are on in a run, with their parameters in SI."""
        found = []
        on = self._place.keys() & (settings.keys() | self.machine.active.keys())
        for name in sorted(on, key=self._place.__getitem__):
            own = self._switched(name, settings, run)
            if own is not None:
                effect = self.form(name, own.keys())
                values = {p.name: own.get(p.name, 0.0) * p.factor for p in effect.parameters}
                found.append((effect, values))
        return tuple(found)

    def _switched(self, name: str, settings: Settings, run: Run) -> Mapping[str, float] | None:
        """The parameters of an effect that the settings, or the machine's file, have on in a run.

        In the settings it may be on in one run alone, unless it has a parameter of that name.
        """
        own = settings.get(name, self.machine.active.get(name))
        if own is None or name in run.without:
            return None
        if RUN not in own or any(
            RUN in {p.name for p in f.parameters} for f in self._by_name[name]
        ):
            return own
        in_it = self.experiment.trials[int(own[RUN])] is run
        return {key: value for key, value in own.items() if key != RUN} if in_it else None

    def form(self, name: str, parameters: Collection[str]) -> WrittenEffect:
        """The form of an effect that has these parameters."""
        forms = self._by_name[name]
        fits = (form for form in forms if set(parameters) <= {p.name for p in form.parameters})
        return next(fits, forms[-1])

    def values_in(self, run: Run, settings: Settings) -> dict[str, Floats]:
        """Time, inputs and states of a run, with the speed and acceleration of an axis."""
        motion = self.motion(run, settings)
        found = {"t": run.time_s, **motion.inputs, **motion.states}
        return {**found, **self.rates_of(run, found)}

    def rates_of(self, run: Run, known: Known) -> dict[str, Floats]:
        """Speed and acceleration of a position among the names; none without one."""
        if "x" not in known:
            return {}
        if "v" in known:
            v = np.asarray(known["v"])
            return {"v": v, "a": rate_between(v, run.time_s)}
        x, rates = np.asarray(known["x"]), self.rates(run)
        return {"v": rates.velocity(x), "a": rates.second(x)}

    def rates(self, run: Run) -> Rates:
        """Derivatives of a kinematic machine's position, over widths by the noise of its inputs."""
        if run.name not in self._rates:
            x = self._followed(_Setup(run, {}, self.values({}), ()), run.inputs)
            self._rates[run.name] = Rates.of(run.time_s, x)
        return self._rates[run.name]

    def _rated(self, run: Run, known: Known, formulas: Iterable[Formula]) -> Known:
        """The names, with the speed and acceleration if a formula asks for one that is missing."""
        missing = {"v", "a"} & frozenset().union(*(f.names for f in formulas)) - known.keys()
        return {**known, **self.rates_of(run, known)} if missing else known

    # -- one run -----------------------------------------------------------------------

    def _setup(self, run: Run, settings: Settings, values: Mapping[str, float]) -> _Setup:
        return _Setup(run, settings, values, self.active(run, settings))

    def of(self, run: Run, settings: Settings) -> list[Floats]:
        """The readings of one of the runs."""
        return self._readings(self._setup(run, settings, self.values(settings)))

    def varied(self, run: Run, settings: Settings, name: str, change: Floats) -> list[Floats]:
        """The readings of a run if one of its inputs were changed by `change` (rows, SI)."""
        inputs = {**run.inputs, name: run.inputs[name] + change}
        setup = self._setup(run, settings, self.values(settings))
        return self._readings(replace(setup, run=replace(run, inputs=inputs)))

    def _readings(self, setup: _Setup) -> list[Floats]:
        run, motion = setup.run, self._motion(setup)
        known: Known = {"t": run.time_s, **motion.inputs, **setup.values, **motion.states}
        terms = [effect.term.formula for effect, _ in setup.entering(MEASUREMENT)]
        known = self._rated(run, known, [*terms, *(r.sensor.reads.formula for r in run.readings)])
        return [self._reading(reading, known, setup) for reading in run.readings]

    def _reading(self, reading: Reading, known: Known, setup: _Setup) -> Floats:
        sensor, time_s = reading.sensor, setup.run.time_s
        value = evaluate(sensor.reads.formula, known, time_s)
        for effect, own in setup.entering(MEASUREMENT):
            if self.shows(effect, sensor):
                value = value + term_of(effect, own, {**known, "y": value}, time_s)
        scale = setup.settings.get(BASE, {}).get(SCALE.format(sensor.name), sensor.scale or 1.0)
        return (sensor.sign or 1) * scale / sensor.factor * value[reading.rows]

    def shows(self, effect: WrittenEffect, sensor: Sensor) -> bool:
        """True if the sensor is one that an effect of the measurement is for."""
        if effect.target:
            return effect.target == sensor.name
        own = sensors_of(self.experiment)
        return effect.own or sensor.dimension == own[0].dimension

    def motion(self, run: Run, settings: Settings) -> Motion:
        """States of the machine at the rows of a run."""
        return self._motion(self._setup(run, settings, self.values(settings)))

    def _motion(self, setup: _Setup) -> Motion:
        inputs, ends = self._inputs(setup)
        if self.machine.kind == KINEMATIC:
            return Motion({"x": self._followed(setup, inputs)}, inputs)
        return Motion(self._integrated(setup, inputs, ends), inputs)

    def _inputs(self, setup: _Setup) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """The inputs behind each row, and at the end of the line from there to the next row."""
        run = setup.run
        inputs, ends = dict(run.inputs), dict(run.inputs)
        held = run.held if self.machine.kind != KINEMATIC else frozenset()
        values: dict[str, Floats | float] = {"t": run.time_s, **setup.values}
        for effect, own in setup.entering(INPUT):
            for name in [name for name in inputs if effect.target in ("", name)]:
                # What follows on an effect of a held input takes that for held at its mean.
                known = {**values, **inputs, "u": (inputs[name] + ends[name]) / 2}
                changes = [
                    term_of(effect, own, known, run.time_s, functions)
                    for functions in ((BEGINNINGS, ENDS) if name in held else (SIGNALS,))
                ]
                inputs[name], ends[name] = inputs[name] + changes[0], ends[name] + changes[-1]
        for name in ends.keys() - held:
            ends[name] = _of_next(inputs[name])
        return inputs, ends

    def _followed(self, setup: _Setup, inputs: Mapping[str, Floats]) -> Floats:
        """Position of a kinematic machine: each effect acts on what those before it left."""
        run = setup.run
        known: dict[str, Any] = {"t": run.time_s, **inputs, **setup.values}
        x = evaluate(self.machine.laws["position"].formula, known, run.time_s)
        for effect, own in setup.entering(COMMAND):
            before = self._rated(run, {**known, "x": x}, [effect.term.formula])
            x = x + term_of(effect, own, before, run.time_s)
        return x

    def _of_foreign(self, run: Run, settings: Settings) -> list[Floats]:
        numbers = self._stated(settings)
        for effect in self.forms:
            own = self._switched(effect.name, settings, run) or {}
            numbers |= {p.name: float(own.get(p.name, 0.0)) for p in effect.parameters}
        assert self.foreign is not None
        assert self.machine.python is not None
        position = self.experiment.trials.index(run)
        found = self.foreign(numbers, dict(self.experiment.columns[position]))
        try:
            return [_array(found, r.sensor.name, len(run.time_s))[r.rows] for r in run.readings]
        except ValueError as error:
            file, function = self.machine.python
            raise DataError(f"{file}: {function} returns {error}", "failed-model") from error

    # -- equations ---------------------------------------------------------------------

    def _integrated(
        self, setup: _Setup, inputs: Mapping[str, Floats], ends: Mapping[str, Floats]
    ) -> dict[str, Floats]:
        """The states of a run, by steps that are halved until that hardly changes a first one.

        It is little beside the range, and beside the noise as long as halving pays: where a law
        jumps, smaller steps are hardly better.
        """
        name, time_s = setup.run.name, setup.run.time_s
        if name in self._steps:
            return self._stepped(setup, inputs, ends, self._steps[name])
        step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
        found = self._stepped(setup, inputs, ends, step_s)
        change = math.inf
        for _ in range(_MOST_HALVINGS):
            halved = self._stepped(setup, inputs, ends, step_s / 2)
            before, change = change, _seen(setup.run, found, halved)
            seen = FIT_TOLERANCE < change < before / PROPORTIONAL**2
            if _alike(found, halved) and not seen:
                break
            found, step_s = halved, step_s / 2
        self._steps[name] = step_s
        return found

    def _stepped(
        self, setup: _Setup, inputs: Mapping[str, Floats], ends: Mapping[str, Floats],
        step_s: float,
    ) -> dict[str, Floats]:  # fmt: skip
        from mopro.stated import integrate

        run, names = setup.run, self.states
        equations = self._equations_of([effect for effect, _ in setup.active])
        program, slots, numbers = equations.program, equations.slots, equations.program.numbers()
        for name, value in setup.values.items():
            numbers[slots[name]] = value
        for effect, own in setup.active:
            for parameter, value in own.items():
                numbers[slots[f"{effect.name}.{parameter}"]] = value
        states = np.zeros((len(names), len(run.time_s)))
        states[:, 0] = [self._start(run, name, setup.settings) for name in names]
        lines = [(inputs[name], ends[name]) for name in self.experiment.units]
        if self.machine.kind == THERMAL:
            lines = self._beside_surroundings(setup, inputs, ends, states[:, 0])
        shape = len(lines), len(run.time_s)
        packed, until = (np.array([own[i] for own in lines]).reshape(shape) for i in (0, 1))
        given = (
            program.operations, program.segments, program.results, numbers, run.time_s, packed,
            until, step_s,
        )  # fmt: skip
        if self.machine.kind == AXIS:
            integrate.axis(*given, states)
        else:
            integrate.nodes(*given, np.empty((5, len(names))), states)
        return dict(zip(names, states, strict=True))

    def _beside_surroundings(
        self, setup: _Setup, inputs: Mapping[str, Floats], ends: Mapping[str, Floats],
        first: Floats,
    ) -> list[tuple[Floats, Floats]]:  # fmt: skip
        """The inputs, and the surroundings of each node: as it begins where no input tells them."""
        run, shift = setup.run, np.zeros(len(setup.run.time_s))
        for effect, own in setup.entering(AMBIENT):
            shift = shift + term_of(effect, own, {"t": run.time_s}, run.time_s)
        shifted = _of_next(shift)
        lines = [
            (inputs[n] + shift, ends[n] + (shift if n in run.held else shifted))
            if n == "ambient"
            else (inputs[n], ends[n])
            for n in self.experiment.units
        ]
        return lines + [(at + shift, at + shifted) for at in first.tolist()]

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the states that are integrated."""
        return ("x", "v") if self.machine.kind == AXIS else self.machine.nodes

    def _start(self, run: Run, state: str, settings: Settings) -> float:
        # A node that no sensor reads begins with the first that one reads.
        state = state if state in run.start else next(iter(run.start))
        stated = run.start[state]
        if stated is not None:
            return stated
        found = float(settings.get(BASE, {}).get(START.format(run.name, state), 0.0))
        return found * self.machine.factor if self.machine.kind == AXIS else found

    def _equations_of(self, active: Sequence[WrittenEffect]) -> _Equations:
        key = tuple((effect.name, effect.form) for effect in active)
        if key not in self._equations:
            self._equations[key] = self._assembled(active)
        return self._equations[key]

    def _assembled(self, active: Sequence[WrittenEffect]) -> _Equations:
        inputs = self.experiment.units
        every = ["t", *self.states, *inputs]
        changes = [TIMED, *[MOVING] * len(self.states), *[TIMED] * len(inputs)]
        every += [f"ambient {node}" for node in self.machine.nodes]
        changes += [TIMED] * len(self.machine.nodes)
        every += self.machine.numbers
        every += [f"{effect.name}.{p.name}" for effect in active for p in effect.parameters]
        changes += [FIXED] * (len(every) - len(changes))
        slots = {name: place for place, name in enumerate(every)}
        assembler = Assembler(changes)
        if self.machine.kind == AXIS:
            values = self._accelerations(assembler, slots, active)
        else:
            values = [self._rate(assembler, slots, active, node) for node in self.machine.nodes]
        return _Equations(assembler.program(values), slots)

    def _accelerations(
        self, assembler: Assembler, slots: Mapping[str, int], active: Sequence[WrittenEffect]
    ) -> list[int]:
        """The acceleration, and the limit of dry friction as an acceleration, if any."""
        terms = {
            place: [_term(assembler, e, slots) for e in active if e.enters == place]
            for place in (FORCE, FRICTION)
        }
        law, inertia = axis_law(self.experiment), inertia_of(self.machine)
        own = [] if law is None else [assembler.value(law, slots)]
        dry = [assembler.value(parse("dry"), slots)] if "dry" in self.machine.numbers else []
        by = assembler.value(parse(inertia), slots) if inertia else NONE
        force = assembler.quotient(assembler.sum([*own, *terms[FORCE]]), by)
        friction = assembler.quotient(assembler.sum([*dry, *terms[FRICTION]]), by)
        zero = assembler.value(parse("0"), slots)
        stated = [assembler.value(law.formula, slots) for law in self.machine.laws.values()]
        moving = assembler.sum([*stated, *([force] if force != NONE else [])])
        if friction == NONE and assembler.jumps(moving):
            # Steps end where the velocity passes zero, as those with dry friction do.
            friction = zero
        return [moving if moving != NONE else zero, friction]

    def _exchange(self, node: str, slots: Mapping[str, int]) -> tuple[Formula, dict[str, int]]:
        """Sum of the differences (K) of the other nodes to this one, and the slots of names in it.

        Of the rises since the beginning where the zeros of the sensors are free.
        """
        others = [other for other in self.machine.nodes if other != node]
        if not self.experiment.begins_in_balance:
            return parse(" + ".join(f"({other} - T)" for other in others) or "0"), {}
        beginnings = {f"_at_{i}": slots[f"ambient {other}"] for i, other in enumerate(others)}
        rises = (f"({other} - _at_{i} - T + ambient)" for i, other in enumerate(others))
        return parse(" + ".join(rises) or "0"), beginnings

    def _rate(
        self,
        assembler: Assembler,
        slots: Mapping[str, int],
        active: Sequence[WrittenEffect],
        node: str,
    ) -> int:
        """The rate of one thermal node."""
        law = self.machine.laws[node].formula
        ambient = "ambient" if "ambient" in slots else f"ambient {node}"
        own = {**slots, "T": slots[node], "ambient": slots[ambient]}
        exchange, beginnings = self._exchange(node, slots)
        foreign = [name for name in self.experiment.units if name not in law.names]
        foreign = [name for name in foreign if name != "ambient"]
        inner = {
            "exchange": exchange,
            "in_first": parse("1" if node == self.machine.nodes[0] else "0"),
            "foreign": parse(foreign[0] if foreign else "0"),
        }
        terms = [
            _term(assembler, effect, {**own, **beginnings}, inner)
            for effect in active
            if effect.enters == POWER
        ]
        capacity = capacity_of(self.machine)
        by = assembler.value(parse(capacity), slots) if capacity else NONE
        return assembler.quotient(assembler.sum([assembler.value(law, own), *terms]), by)


def _term(
    assembler: Assembler, effect: WrittenEffect, slots: Mapping[str, int],
    inner: Mapping[str, Formula] | None = None,
) -> int:  # fmt: skip
    own = {p.name: slots[f"{effect.name}.{p.name}"] for p in effect.parameters}
    formula = substituted(effect.term.formula, inner) if inner else effect.term.formula
    return assembler.value(formula, {**slots, **own})


def _array(found: Any, sensor: str, rows: int) -> Floats:
    """The array of a sensor in what a model that is a program returns; ValueError if it is none."""
    expected = f"expected a dict with an array of {rows} numbers for {sensor}"
    if not isinstance(found, Mapping):
        raise ValueError(f"{type(found).__name__}, {expected}")
    if sensor not in found:
        raise ValueError(f"{', '.join(map(str, found)) or 'an empty dict'}, {expected}")
    try:
        values = np.asarray(found[sensor])
    except ValueError as error:
        raise ValueError(f"for {sensor} no array ({error}), {expected}") from error
    if values.dtype.kind not in "buif" or values.shape != (rows,):
        raise ValueError(f"an array of {values.dtype} and of shape {values.shape}, {expected}")
    return unless_run_away(values.astype(float))


def _of_next(values: Floats) -> Floats:
    """The value at the next row; the last one at the last."""
    return np.concatenate((values[1:], values[-1:]))


def term_of(
    effect: WrittenEffect, own: Mapping[str, float], known: Known, time_s: Floats,
    functions: Functions = SIGNALS,
) -> Floats:  # fmt: skip
    return evaluate(effect.term.formula, {**known, **own}, time_s, functions)


def _seen(run: Run, one: Mapping[str, Floats], other: Mapping[str, Floats]) -> float:
    """Chi-squared by which the readings of states tell two predictions apart, of known noise."""
    total = 0.0
    for reading in run.readings:
        sensor, state = reading.sensor, reading.sensor.reads.formula.text
        if state in one and sensor.noise_rms:
            apart = (one[state] - other[state])[reading.rows] * (sensor.scale or 1.0)
            total += float(np.sum((apart / (sensor.factor * sensor.noise_rms)) ** 2))
    return total


def _alike(one: Mapping[str, Floats], other: Mapping[str, Floats]) -> bool:
    """True if no state differs by more than a small share of its range; NaN never does."""
    for name, values in one.items():
        reach = float(np.ptp(other[name])) if np.isfinite(other[name]).all() else np.nan
        if not np.max(np.abs(values - other[name])) <= _STEP_ERROR * reach:
            return False
    return True
