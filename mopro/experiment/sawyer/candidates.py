"""The catalogue's effects as candidates of the diagnosis.

Each effect states the forms in which it is fitted. This module selects those that the
experiment's quantities can show, and adapts them to the machine file: effects that it has
already, and numbers that it states with a tolerance.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from mopro.effects import Domain, Effect, catalogue_of
from mopro.effects.effect import AXIS, WIDER
from mopro.effects.unlisted import unlisted_terms
from mopro.engine.assumed import CLEAR
from mopro.engine.candidate import RUN, Candidate, Parameter, Role
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.steady import lasts
from mopro.instruments.quantity import Quantity
from mopro.machine import Machine

# Distance of a start from the machine's own value, as a share of the parameter's range.
_START_DISTANCE = 0.1


def candidates(model: ForwardModel, left_out: Collection[str] = ()) -> list[Candidate]:
    """Candidates that the experiment's sensors can show, in all their forms.

    Effects whose names are in `left_out` are no candidates.
    """
    experiment = model.experiment
    quantities = {r.sensor.quantity for t in experiment.trials for r in t.readings}
    selected: list[Candidate] = []
    slow = any(quantity.slow for quantity in quantities)
    if any(quantity.follows_motion for quantity in quantities):
        selected += _of_motion(model)
    if slow or experiment.tables:
        selected += _of_heat(model, lasting=True)
    if slow:
        selected += _of_heat(model, lasting=False)
    kept = [candidate for candidate in selected if candidate.name not in left_out]
    return [_on_the_machine(candidate, model) for candidate in kept]


def in_one_run(model: ForwardModel, every: Collection[Candidate]) -> dict[str, list[Candidate]]:
    """Each of `every` candidate as it is on in one run alone, by the name of that.

    Without those that the machine has in all runs, and those that tell their run themselves.
    """
    tried = [
        c for c in every if not model.own(c.name) and RUN not in {p.name for p in c.parameters}
    ]
    trials = enumerate(model.experiment.trials)
    return {trial.name: [c.in_run(trial.name, nth) for c in tried] for nth, trial in trials}


def unlisted(model: ForwardModel) -> list[Candidate]:
    """The free-form terms inside the simulator that the experiment's sensors can show."""
    experiment = model.experiment
    quantities = {r.sensor.quantity for t in experiment.trials for r in t.readings}
    domains = set()
    if any(quantity.follows_motion for quantity in quantities):
        domains.add(Domain.DYNAMICS)
    if experiment.tables or any(quantity.slow for quantity in quantities):
        domains.add(Domain.HEAT)
    terms = [term for term in unlisted_terms() if term.domain in domains]
    return [candidate for term in terms for candidate in term.candidates(model)]


def _of_motion(model: ForwardModel) -> Iterator[Candidate]:
    """Candidates for sensors that follow the motion.

    Effects that change statements are left out unless every run has a program.
    """
    programmed = all(trial.program is not None for trial in model.experiment.trials)
    sensors = [reading.sensor for _, reading in model.readings()]
    for effect in catalogue_of(model.machine).values():
        if effect.domain is Domain.HEAT or (effect.changes_program and not programmed):
            continue
        seen = {s.axis for s in sensors if _shows(effect, s.quantity)}
        if not seen:
            continue
        for candidate in effect.candidates(model):
            yield candidate
            if effect.domain is Domain.MEASUREMENT and len(seen) > 1:
                yield from (_on_one(candidate, axis) for axis in sorted(seen))


def _shows(effect: Effect, quantity: Quantity) -> bool:
    """True if a sensor of `quantity` follows the motion and can show `effect`."""
    reaches = effect.domain is not Domain.MEASUREMENT or effect.retimes or quantity.sees_place
    return quantity.follows_motion and reaches


def _of_heat(model: ForwardModel, lasting: bool) -> Iterator[Candidate]:
    """Thermal candidates: those that change the steady state (`lasting`), or all others.

    A few rows of final rises tell no assumed constant from the sizes that it multiplies: with
    tables alone they keep their values.
    """
    machine = model.experiment.machine
    for effect in catalogue_of(machine).values():
        if effect.domain is Domain.HEAT and lasts(effect, machine) is lasting:
            yield from effect.candidates(model) if model.experiment.trials else effect.forms(model)


def _on_one(candidate: Candidate, axis: int) -> Candidate:
    """The candidate on one axis alone, as each axis has a sensor of its own."""
    form = f"{candidate.form}, axis {axis}".removeprefix(", ")
    extends = f"{candidate.extends}, axis {axis}".removeprefix(", ")
    return replace(
        candidate,
        form=form,
        fixed={**candidate.fixed, AXIS: axis},
        extends=None if candidate.extends is None else extends,
    )


# -- what the machine's file states ------------------------------------------------


def _on_the_machine(candidate: Candidate, model: ForwardModel) -> Candidate:
    own = model.own(candidate.name)
    if own:
        candidate = _from_the_machine(candidate, own)
    effect = catalogue_of(model.machine)[candidate.name]
    if effect.of_sensor:
        return _of_sensors(candidate, effect.of_sensor, model)
    return _with_tolerance(candidate, effect, model.machine)


def _of_sensors(candidate: Candidate, tolerance: str, model: ForwardModel) -> Candidate:
    """Candidate whose sizes are calibrations within the `tolerance` that its sensors state.

    They are fitted with every set to first order; beside little noise the rest shows as well.
    """
    axis = candidate.fixed.get(AXIS)
    sensors = [r.sensor for _, r in model.readings() if axis in (None, r.sensor.axis)]
    moving = [sensor for sensor in sensors if sensor.quantity.follows_motion]
    reach = CLEAR * min((getattr(sensor, tolerance) for sensor in moving), default=0.0)
    if not reach:
        return candidate
    (own,) = candidate.parameters
    ends = own.null - reach, own.null + reach
    return replace(candidate, parameters=(replace(own, tolerated=ends),))


def _from_the_machine(candidate: Candidate, own: Mapping[str, float]) -> Candidate:
    """Candidate for an effect that the machine has already: its null is the machine's `own` value.

    Fixed parameters that no form states take the machine's values.
    """
    fixed = {name: own.get(name, value) for name, value in candidate.fixed.items()}
    parameters = tuple(
        _about(p, own[p.name]) if p.role is Role.AMPLITUDE and p.name in own else p
        for p in candidate.parameters
    )
    return replace(
        candidate, parameters=parameters, fixed=candidate.fixed if candidate.form else fixed
    )


def _about(parameter: Parameter, null: float) -> Parameter:
    """`parameter` with its null at `null`, and starts away from it."""
    low, high = parameter.low, parameter.high
    moved = replace(parameter, null=null, low=min(low, null), high=max(high, null))
    place = moved.scaled(null)
    step = _START_DISTANCE if place < 1 - _START_DISTANCE else -_START_DISTANCE
    away = moved.value(place + step)
    starts = dict.fromkeys(away if start == null else start for start in parameter.starts)
    return replace(moved, starts=tuple(starts))


def _with_tolerance(candidate: Candidate, effect: Effect, machine: Machine) -> Candidate:
    """Candidate with the tolerance of the number that the effect corrects, if the file has one.

    The tolerance is about the file's number, also where an effect in the file changes it.
    """
    number = effect.toleranced(machine)
    if number is None:
        return candidate

    def tolerance(key: str) -> float:
        source = machine.provenance.get(key)
        return source.tolerance if source else 0.0

    if not (reach := number.reach(tolerance)):
        return candidate
    (own,) = candidate.parameters
    middle, stated = number.middle, effect.parameter(own.name)
    low, high = own.plausible or (own.low, own.high)
    tolerant = replace(
        own,
        low=max(min(own.low, middle - WIDER * reach), stated.low),
        high=min(max(own.high, middle + WIDER * reach), stated.high),
        plausible=(min(low, middle - reach), max(high, middle + reach)),
        tolerated=(middle - reach, middle + reach),
    )
    return replace(candidate, parameters=(tolerant,))
