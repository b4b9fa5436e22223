"""The effects of a stated machine as candidates, their ranges from the data's sizes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mopro.engine.assumed import LEAST_SHARE
from mopro.engine.candidate import RUN, Candidate, Law, Parameter, ResidualView, Role
from mopro.engine.series import Series, Settings
from mopro.formula.columns import Columns, Sampled
from mopro.formula.dimension import Dimension, dimension_of_unit
from mopro.formula.evaluate import Floats, evaluate
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
    WrittenEffect,
)
from mopro.stated.base import DIFFERENCE
from mopro.stated.data import Reading, Run
from mopro.stated.model import POWER, Number
from mopro.stated.names import capacity_of, inertia_of, names_of, units_of
from mopro.stated.of_sensors import stands_apart
from mopro.stated.simulation import BASE, Known, Model, term_of

# An amplitude is looked for up to this multiple of what would make the term as large as the
# quantity that it is added to, and simulated first at this share of it.
_LARGEST, _PROBED = 10.0, 0.01
# A start is looked for by a simulation at this share of the range's end, and within these shares.
_TRIED, _LEAST_START, _MOST_START = 1e-5, 3e-5, 0.1
# Distance of a start from the value of the machine's file, as a share of the range.
_START_DISTANCE = 0.1
# Tolerances within which a number is looked for.
_WIDER = 5.0
# Periods of an effect of a program that are tried: each takes simulations of all runs.
_MOST_PERIODS = 1000
_NAME = re.compile(r"[A-Za-z_]\w*")


def candidates(model: Model, data: Sequence[Series], settings: Settings) -> list[Candidate]:
    """All effects as candidates, and the numbers that are known with a tolerance.

    `settings` are those of the free numbers without effects, at which terms are measured.
    """
    found = [_of_number(n) for n in model.machine.numbers.values() if n.tolerance]
    if model.machine.kind == "python":
        return found + [_of_foreign(model, effect) for effect in model.forms]
    sized, columns = _sizes(model, settings), _columns(model.forms)
    waves = any(map(_of_time, model.forms)) and _shows_waves_in_time(model, settings)
    for effect in model.forms:
        if _of_time(effect) and not waves:
            continue
        made = _candidate(model, effect, data, settings, sized, columns.get(effect))
        if made is not None:
            bearing = [run for run in model.experiment.trials if effect.name not in run.without]
            recurs = _of_time(effect) and _records(bearing) > 1
            found.append(replace(made, of_run_time=recurs))
    names = {(c.name, c.form) for c in found}
    return [c for c in found if c.extends is None or (c.name, c.extends) in names]


def _of_time(effect: WrittenEffect) -> bool:
    """True for a listed wave in time; one that the user offers is tried in any case."""
    periodic = any(p.role == PERIOD for p in effect.parameters)
    return periodic and not effect.own and "t" in effect.term.formula.names


def _shows_waves_in_time(model: Model, settings: Settings) -> bool:
    """True if the data can tell a wave in time from one in what a single run happens to do.

    Several runs can. In a single one such a wave is a draft, but at one speed, where it is one in
    place as well and is told with that, and where the command was made from the readings.
    """
    run = model.experiment.trials[0]
    several = _records(model.experiment.trials) > 1
    return several or run.feedback or _at_one_speed(model, run, settings)


def _records(runs: Sequence[Run]) -> int:
    """The number of records among the runs: parts of one share its accidents."""
    return len({run.record for run in runs})


def _at_one_speed(model: Model, run: Run, settings: Settings) -> bool:
    """True if a straight line in time leaves at most a tenth of the place's standard deviation."""
    x = model.values_in(run, settings)["x"]
    line = np.polynomial.Polynomial.fit(run.time_s, x, 1)
    return bool(np.std(x - line(run.time_s)) <= LEAST_SHARE * np.std(x))


def in_one_run(model: Model, every: Sequence[Candidate]) -> dict[str, list[Candidate]]:
    """Each effect among `every` candidate as it is on in one run alone, by the name of that.

    Without those that the machine has in all runs.
    """
    names = {form.name for form in model.forms} - model.machine.active.keys()
    tried = [c for c in every if c.name in names and RUN not in {p.name for p in c.parameters}]
    return {
        run.name: [c.in_run(run.name, nth) for c in tried if c.name not in run.without]
        for nth, run in enumerate(model.experiment.trials)
    }


def unlisted(model: Model, data: Sequence[Series], settings: Settings) -> list[Candidate]:
    """The free-form terms in the model's equations as candidates, at `settings` as above."""
    sized = _sizes(model, settings)
    made = ((term, _candidate(model, term, data, settings, sized)) for term in model.unlisted)
    return [replace(c, law=_law(model, term)) for term, c in made if c is not None]


def _law(model: Model, term: WrittenEffect) -> Law:
    """Law of a free-form term, for its drafts: a power is called heat there, as in the motor's."""
    units = {FORCE: "force", FRICTION: "force", POWER: "power"}
    unit = units_of(model.experiment)[units.get(term.enters, "u")]
    enters = "heat" if term.enters == POWER else term.enters

    def written(values: Mapping[str, float]) -> str:
        """The formula with its numbers (SI)."""
        text = term.term.formula.text
        return _NAME.sub(lambda m: f"{values[m[0]]:.4g}" if m[0] in values else m[0], text)

    return Law(enters, term.of, unit, written)


def _of_number(number: Number) -> Candidate:
    reach = number.tolerance * abs(number.value)
    value = number.value
    parameter = Parameter(
        number.name, number.unit, value - _WIDER * reach, value + _WIDER * reach,
        (value + reach / 2,), null=value, tolerated=(value - reach, value + reach),
    )  # fmt: skip
    return Candidate(number.name, (parameter,))


def _of_foreign(model: Model, effect: WrittenEffect) -> Candidate:
    made = []
    for p in effect.parameters:
        if not isinstance(p.low, float) or not isinstance(p.high, float):
            assert effect.value is not None
            message = f"expected a range of {p.name}: the model is a program, and tells no sizes"
            raise effect.value[p.name].error(message, "missing-key")
        role = Role.AMPLITUDE if p.role == AMPLITUDE else role_of_shape(p)
        if isinstance(p.start, float):
            starts: tuple[float, ...] = (p.start,)
        elif p.role == PERIOD and p.high > 0:
            starts = _periods(p.low, p.high, _span(model, p))
        else:
            starts = (p.low + 0.55 * (p.high - p.low),)
        made.append(Parameter(p.name, p.unit, p.low, p.high, starts, role))
        if p.role == PERIOD:
            # Many periods away a small step of it is a part of a wave.
            made[-1] = replace(made[-1], difference=DIFFERENCE)
    flexible = any(p.role == PERIOD for p in effect.parameters)
    return Candidate(
        effect.name, tuple(made), effect.form, extends=effect.extends, flexible=flexible
    )


def _span(model: Model, p: EffectParameter) -> float:
    """The longest way of an input, or of time, that a period of a program may be in; in its unit.

    That of the whole range where nothing has its dimension.
    """
    dimension, units = dimension_of_unit(p.unit), model.experiment.units
    spans = [
        float(np.ptp(values))
        for run in model.experiment.trials
        for name, values in (("", run.time_s), *run.inputs.items())
        if dimension_of_unit(units.get(name, "s")) == dimension
    ]
    assert isinstance(p.high, float)
    return max(spans, default=0.0) / p.factor or p.high


def _periods(low: float, high: float, span: float) -> tuple[float, ...]:
    """Periods of a range, the longest first, half a wave over `span` apart, or as far as there are
    `_MOST_PERIODS`: from one of them a fit finds any between.
    """
    least = max(low, high / _MOST_PERIODS)
    count = math.ceil(2 * span * (1 / least - 1 / high)) + 1
    rates = np.linspace(1 / high, 1 / least, min(max(count, 2), _MOST_PERIODS))
    return tuple((1 / rates).tolist())


def _candidate(
    model: Model, effect: WrittenEffect, data: Sequence[Series], settings: Settings, sized: Sized,
    columns: Columns | None = None,
) -> Candidate | None:  # fmt: skip
    """The candidate of an effect; None for one that does nothing, or cannot show, in these data."""
    if effect.crosses and not _crosses(model, effect, settings):
        return None
    shapes = []
    for p in effect.parameters:
        if p.role != AMPLITUDE:
            shape = shape_of(effect, p, sized)
            if shape is None:
                return None
            shapes.append(shape)
    fixed = {p.name: p.starts[0] for p in shapes}
    sizes = _scale_of(model, effect, settings, data)
    amplitudes = []
    for p in effect.parameters:
        if p.role == AMPLITUDE:
            made = _amplitude(model, effect, p, {**fixed}, settings, sized, sizes)
            if made is None:
                return None
            if p.start is None and p.low is None:
                made = _probed(model, effect, made, fixed, data, settings)
            amplitudes.append(made)
    parameters = _in_order(effect, [*shapes, *amplitudes])
    own = model.machine.active.get(effect.name)
    if own is not None:
        parameters = tuple(_about(p, own.get(p.name, 0.0)) for p in parameters)
    find = None
    if shapes and effect.enters == MEASUREMENT:
        find = Search(effect, parameters, MOST_PERIODS_OF_SPAN, _samples_of(model, effect), columns)
    # A form that is searched for needs no plain one to begin from.
    extends = effect.extends if find is None else None
    return Candidate(
        effect.name, parameters, effect.form, extends=extends, can_enter_first=extends is not None,
        flexible=any(p.role == PERIOD for p in effect.parameters), find_starts=find,
    )  # fmt: skip


def _columns(forms: Sequence[WrittenEffect]) -> dict[WrittenEffect, Columns]:
    """The columns of each effect of the measurement with shapes, one for all forms with the same.

    Those are searched for one after the other, in the same residuals.
    """
    alike: dict[Hashable, list[WrittenEffect]] = {}
    for form in forms:
        shapes = tuple((p.name, p.unit) for p in form.parameters if p.role != AMPLITUDE)
        if shapes and form.enters == MEASUREMENT:
            alike.setdefault((form.name, shapes), []).append(form)
    shared = [(own, Columns(own)) for own in alike.values()]
    return {form: columns for own, columns in shared for form in own}


def _samples_of(model: Model, effect: WrittenEffect) -> Callable[[ResidualView], list[Sampled]]:
    """The samples of a fit as a search for the shapes of `effect` sees them."""

    def samples(view: ResidualView) -> list[Sampled]:
        runs: dict[str, Known] = {
            run.name: {**model.values_in(run, view.settings), **model.values(view.settings)}
            for run in model.experiment.trials
        }
        every = zip(model.readings, view.residuals, view.sigmas, strict=True)
        return [
            _sampled(model, effect, run, reading, runs[run.name], left, float(sigma))
            for (run, reading), left, sigma in every
        ]

    return samples


def _sampled(
    model: Model, effect: WrittenEffect, run: Run, reading: Reading, known: Known,
    left: Floats, sigma: float,
) -> Sampled:  # fmt: skip
    sensor = reading.sensor
    names = {**known, "y": evaluate(sensor.reads.formula, known, run.time_s)}
    shown = model.shows(effect, sensor) and effect.name not in run.without
    factor = (sensor.sign or 1) * (sensor.scale or 1.0) / sensor.factor if shown else 0.0
    return Sampled(
        names, run.time_s, reading.rows, left, sigma, factor, is_aligned=sensor.zero is None
    )


def _crosses(model: Model, effect: WrittenEffect, settings: Settings) -> bool:
    """True if the data can tell a share of an input in a sensor from all else in its readings."""
    unused = {form.crosses for form in model.forms} - {effect.crosses}
    read = []
    for run in model.experiment.trials:
        known = {n: v for n, v in model.values_in(run, settings).items() if n not in unused}
        finite = {n: v for n, v in known.items() if np.isfinite(v).all()}
        read += [(r, finite) for r in run.readings if model.shows(effect, r.sensor)]
    return stands_apart(read, effect.crosses)


def _in_order(effect: WrittenEffect, made: Sequence[Parameter]) -> tuple[Parameter, ...]:
    by_name = {p.name: p for p in made}
    return tuple(by_name[p.name] for p in effect.parameters)


def _about(parameter: Parameter, null: float) -> Parameter:
    """`parameter` of an effect that the machine's file switches on: its null is the value there."""
    if parameter.role is not Role.AMPLITUDE:
        return replace(parameter, starts=(min(max(null, parameter.low), parameter.high),))
    low, high = min(parameter.low, null), max(parameter.high, null)
    moved = replace(parameter, null=null, low=low, high=high)
    step = _START_DISTANCE if moved.scaled(null) < 1 - _START_DISTANCE else -_START_DISTANCE
    return replace(moved, starts=(moved.value(moved.scaled(null) + step),))


# -- sizes -------------------------------------------------------------------------------


def _sizes(model: Model, settings: Settings) -> Sized:
    names = {"step": math.inf, "length": 0.0, "x_span": 0.0, "v_max": 0.0, "a_max": 0.0}
    runs = []
    for run in model.experiment.trials:
        values = model.values_in(run, settings)
        runs.append((values, np.unique(np.concatenate([r.rows for r in run.readings]))))
        names["step"] = min(names["step"], float(np.median(np.diff(run.time_s))))
        names["length"] = max(names["length"], float(np.ptp(run.time_s)))
        for name, of in (("x_span", "x"), ("v_max", "v"), ("a_max", "a")):
            size = float(np.ptp(values[of]) if of == "x" else np.max(np.abs(values[of]))) if (
                of in values
            ) else 0.0  # fmt: skip
            names[name] = max(names[name], size)
        for name, signals in (("u", (*run.inputs,)), ("T", model.machine.nodes)):
            low, high = f"{name}_low", f"{name}_high"
            for own in (values[s] for s in signals if s in values and np.isfinite(values[s]).all()):
                names[low] = min(names.get(low, math.inf), float(np.min(own)))
                names[high] = max(names.get(high, -math.inf), float(np.max(own)))
    return Sized.of(runs, names_of(model.experiment), names, _counts(model))


def _counts(model: Model) -> dict[Dimension, float]:
    """The step (SI) of the finest converter of each dimension; 0 where a sensor has none."""
    found: dict[Dimension, float] = {}
    for _, reading in model.readings:
        sensor = reading.sensor
        step = sensor.step * sensor.factor
        found[sensor.dimension] = min(found.get(sensor.dimension, step), step)
    return found


def _amplitude(
    model: Model, effect: WrittenEffect, p: EffectParameter, fixed: Mapping[str, float],
    settings: Settings, sized: Sized, scale: float,
) -> Parameter | None:  # fmt: skip
    if p.low is not None and p.high is not None:
        low, high = (p.sized(end, sized.names) for end in (p.low, p.high))
        if not low < high:
            return None
        # The middle of most ranges is 0, where the effect is off.
        share = 0.55 if low < 0 else 0.05
        start = low + share * (high - low) or high / 10
    else:
        size = _size_of_term(model, effect, p.name, fixed, settings)
        if not size or not math.isfinite(size):
            return None
        high = _LARGEST * scale / size
        low = 0.0 if p.positive or effect.enters == FRICTION else -high
        start = _PROBED * high
    begun = p.begun(sized.names)
    start = start if begun is None else begun
    difference = 1e-3 if effect.enters == COMMAND else DIFFERENCE
    return Parameter(p.name, p.unit, low, high, (start,), difference=difference)


def _probed(
    model: Model, effect: WrittenEffect, parameter: Parameter, fixed: Mapping[str, float],
    data: Sequence[Series], settings: Settings,
) -> Parameter:  # fmt: skip
    """`parameter` with a range and a start from what one simulation shows it to do.

    It starts where it changes the predictions by about what is left of the data. A long motion
    magnifies what a force does, so that the size of a term alone tells little.
    """
    tried = parameter.high * _TRIED
    off = dict.fromkeys((p.name for p in effect.parameters), 0.0) | dict(fixed)
    with_it = {**settings, effect.name: off | {parameter.name: tried}}
    change = residual = 0.0
    for series, one, other in zip(data, model(settings), model(with_it), strict=True):
        reach = float(np.ptp(series.values)) or 1.0
        change = max(change, _scatter(other - one) / reach)
        residual = max(residual, _scatter(series.values - one) / reach)
    if not change or not math.isfinite(change):
        return parameter
    # Alone it would change the readings by several times their range.
    high = min(parameter.high, _LARGEST * tried / change)
    low = parameter.low if parameter.low == 0 else -high
    start = min(max(tried * residual / change, _LEAST_START * high), _MOST_START * high)
    return replace(parameter, low=low, high=high, starts=(start,))


def _scatter(values: Floats) -> float:
    """The RMS of values about their mean."""
    return float(np.std(values))


def _size_of_term(
    model: Model, effect: WrittenEffect, name: str, fixed: Mapping[str, float], settings: Settings
) -> float:
    """The largest change by the term for one unit of a parameter, without other effects.

    ModelError where a term gives no finite number.
    """
    largest = 0.0
    for run in model.experiment.trials:
        off = {p.name: fixed.get(p.name, 0.0) * p.factor for p in effect.parameters}
        one = next(p.factor for p in effect.parameters if p.name == name)
        known: Known = {**model.values_in(run, settings), **model.values(settings)}
        for local in _locals(model, effect, run, known):
            with_one = term_of(effect, {**off, name: one}, {**known, **local}, run.time_s)
            without = term_of(effect, off, {**known, **local}, run.time_s)
            change = np.abs(with_one - without)
            _check_finite(model, effect, change, run, settings)
            largest = max(largest, float(change.max()))
    return largest


def _check_finite(
    model: Model, effect: WrittenEffect, change: Floats, run: Run, settings: Settings
) -> None:
    """ModelError at the term, if it is the user's, or at the run in which the model runs away."""
    if np.isfinite(change).all():
        return
    at = float(run.time_s[np.flatnonzero(~np.isfinite(change))[0]])
    if effect.own and effect.value is not None:
        raise effect.value["formula"].error(
            f"the formula gives no finite number at {at:.6g} s of run {run.name}: "
            "it divides by zero, or runs away", "not-finite",
        )  # fmt: skip
    if run.value is not None:
        free = [n for n in model.machine.numbers.values() if n.free]
        numbers = ", ".join(f"{n.name} = {settings[BASE][n.name]:.4g} {n.unit}" for n in free)
        fitted = f" with {numbers}, as fitted," if numbers else ""
        raise run.value.error(
            f"the model{fitted} runs away: at {at:.6g} s no {effect.name} can be worked out",
            "not-finite", "look at the signs of its law and at the ranges of its numbers",
        )  # fmt: skip


def _locals(model: Model, effect: WrittenEffect, run: Run, known: Known) -> Iterator[Known]:
    """Names that a term has where it enters: one set for each place that it enters."""
    match effect.enters:
        case "measurement":
            for reading in run.readings:
                if model.shows(effect, reading.sensor):
                    formula = reading.sensor.reads.formula
                    yield {"y": evaluate(formula, known, run.time_s)}
        case "input":
            yield from ({"u": own} for n, own in run.inputs.items() if effect.target in ("", n))
        case "power":
            for node in model.machine.nodes:
                yield _in_node(model, node, known)
        case _:
            yield {}


def _in_node(model: Model, node: str, known: Known) -> Known:
    own = np.asarray(known[node])
    others = [np.asarray(known[n]) - own for n in model.machine.nodes if n != node]
    if model.experiment.begins_in_balance:
        others = [other - other[0] for other in others]
    used = model.machine.laws[node].formula.names
    foreign = [known[n] for n in model.experiment.units if n not in used and n != "ambient"]
    return {
        "T": own,
        "ambient": known.get("ambient", float(own[0])),
        "exchange": sum(others, np.zeros_like(own)),
        "in_first": float(node == model.machine.nodes[0]),
        "foreign": foreign[0] if foreign else 0.0,
    }


def _scale_of(
    model: Model, effect: WrittenEffect, settings: Settings, data: Sequence[Series]
) -> float:
    """The size (SI) of the quantity that a term is added to, in these data."""
    machine = model.machine
    found = 0.0
    for run in model.experiment.trials:
        values = model.values_in(run, settings)
        match effect.enters:
            case "force" | "friction":
                inertia = inertia_of(machine)
                mass = model.values(settings)[inertia] if inertia else 1.0
                inputs = [values[n] for n in ("force", "torque") if n in values]
                sizes = [mass * values["a"], *inputs]
            case "power":
                capacity = capacity_of(machine)
                held = model.values(settings)[capacity] if capacity else 1.0
                sizes = [held * np.gradient(values[n], run.time_s) for n in machine.nodes]
            case "input":
                sizes = [own for name, own in run.inputs.items() if effect.target in ("", name)]
            case "ambient":
                sizes = [np.ones(1)]
            case _:
                sizes = [
                    np.array([np.ptp(r.values) * r.sensor.factor])
                    for r in run.readings
                    if effect.target in ("", r.sensor.name)
                ]
        found = max([found, *(float(np.max(np.abs(s))) for s in sizes if np.isfinite(s).all())])
    return found or 1.0
