"""The file of a stated machine with the numbers that were fitted and the effects that were found.

A number of `[base]` and a parameter of an effect may have the same name: they are of different
tables. The values are those that fit without drafts, which are in no machine file.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from mopro.engine.candidate import RUN
from mopro.engine.series import Settings
from mopro.engine.verdict import Estimate, Named, Verdict
from mopro.experiment.machine_file import rounded, runs_lines, with_effects
from mopro.experiment.wording import interval_words, value_words
from mopro.formula.written import WrittenEffect
from mopro.machine.run_effects import absence_notes, files_of, known_absent, others
from mopro.source import Source
from mopro.stated.data import StatedExperiment
from mopro.stated.file import read_stated
from mopro.stated.model import AMBIENT, StatedMachine
from mopro.stated.names import effects_of
from mopro.stated.simulation import BASE, Model
from mopro.tomlfile.edit import Text


def machine_text(model: Model, verdict: Verdict) -> str:
    """Text of the machine's file, each fitted number with its interval, and the effects found."""
    experiment = model.experiment
    machine, place = experiment.machine, Path(experiment.source.name).name
    found = [effect for effect in verdict.fitted if not corrects(machine, effect.name)]
    sections = {e.name: [*_section(model, e, verdict, place)] for e in found}
    # The file may switch on what the experiment states.
    used = sections.keys() | machine.active.keys()
    formulas = [effect for effect in machine.effects if effect.name in used]
    own = read_stated(machine.source).effects
    return with_effects(_with_numbers(machine, verdict, place), own, formulas, sections)


def machine_of(machine: StatedMachine, text: str) -> StatedMachine:
    """The machine of a repaired file, in the unit that its sensors gave it; ModelError."""
    return replace(read_stated(Source(f"{machine.name} (reconciled)", text)), unit=machine.unit)


def corrects(machine: StatedMachine, name: str) -> bool:
    """True if what was fitted under this name is a number of the machine, known to a tolerance."""
    return name in machine.numbers and machine.numbers[name].tolerance > 0


def as_written(settings: Settings) -> Settings:
    """The settings with the digits that a file has."""
    return {
        name: {parameter: rounded(value) for parameter, value in own.items()}
        for name, own in settings.items()
    }


def _with_numbers(machine: StatedMachine, verdict: Verdict, place: str) -> Text:
    """The file, each fitted number with its value in the place of the old one."""
    text = Text.of(machine.source)
    for name, (value, estimate) in _fitted(machine, verdict):
        before = verdict.base_before.get(BASE, {}).get(name, machine.numbers[name].value)
        stated = _number(name, machine, value, estimate, before, place)
        text = text.with_value(("base", name), stated)
    return text


def _fitted(
    machine: StatedMachine, verdict: Verdict
) -> Iterator[tuple[str, tuple[float, Estimate]]]:
    """The numbers of the machine that were fitted: name, value to write, and estimate."""
    settings = verdict.settings_alone
    for name, estimate in verdict.base.items():
        if name in machine.numbers:
            yield name, (settings[BASE][name], estimate)
    for effect in verdict.fitted:
        if corrects(machine, effect.name):
            own = settings[effect.name][effect.name]
            yield effect.name, (own, effect.parameters[effect.name])


def _number(
    name: str, machine: StatedMachine, value: float, estimate: Estimate, before: float, place: str
) -> str:
    number = machine.numbers[name]
    tolerance = f", tolerance = {number.tolerance!r}" if number.tolerance else ""
    tolerance += f", before = {rounded(before)!r}"
    stated = f'{{ value = {rounded(value)!r}, unit = "{number.unit}"{tolerance} }}'
    return f"{stated}  # {_origin(value, estimate, place)}"


def _origin(value: float, estimate: Estimate, place: str) -> str:
    interval = f"95 %: {_plain(interval_words(estimate))}"
    if rounded(value) == rounded(estimate.value):
        return f"{interval}; fitted with {_plain(place)}"
    beside = f"{_plain(value_words(estimate))}, {interval}"
    return f"fitted with {_plain(place)}, without the drafts; beside them {beside}"


def _section(model: Model, effect: Named, verdict: Verdict, place: str) -> Iterator[str]:
    """Lines of the section that switches an effect on."""
    values = verdict.settings_alone.get(effect.name, {})
    for parameter, value in (values if effect.run is None else _without_run(values)).items():
        estimate = effect.parameters.get(parameter)
        if estimate is None:
            yield f"{parameter} = {rounded(value)!r}"
        else:
            stated = f'{{ value = {rounded(value)!r}, unit = "{estimate.unit}" }}'
            yield f"{parameter} = {stated}  # {_origin(value, estimate, place)}"
    if effects_of_runs(model, [effect], verdict.settings_alone):
        yield from runs_lines(fitted_on(model.experiment, effect))
    if effect.indistinguishable_from:
        yield f"# or instead of it: {_plain(', '.join(effect.indistinguishable_from))}"


def effects_of_runs(model: Model, found: Collection[Named], settings: Settings) -> list[str]:
    """The names of those effects that belong to the runs that they were fitted on."""
    keys = {(effect.name, effect.form) for effect in found}
    of_time = [
        effect.name
        for effect in effects_of(model.experiment)
        if (effect.name, effect.form) in keys
        and (
            of_one_run(effect, model.experiment.units)
            or model.hangs_on_the_clock(effect.name, settings)
        )
    ]
    return [*of_time, *(effect.name for effect in found if effect.run is not None)]


def _without_run(values: Mapping[str, float]) -> dict[str, float]:
    """The parameters of an effect that is on in one run alone, without the number of that."""
    return {name: value for name, value in values.items() if name != RUN}


# -- effects of a run's own time ------------------------------------------------------------


def of_one_run(effect: WrittenEffect, units: Mapping[str, str]) -> bool:
    """True for an effect that says nothing of runs that it was not fitted on.

    Its term is one of the time since that run began or, without an input `ambient` (`units` are
    those of the inputs), of how warm it was around then.
    """
    surroundings = effect.enters == AMBIENT and AMBIENT not in units
    return surroundings or "t" in effect.term.formula.names


def fitted_on(experiment: StatedExperiment, effect: Named) -> dict[str, str]:
    """The data files of the runs that have `effect`, each with its checksum."""
    return files_of([
        run
        for run in experiment.trials
        if effect.name not in run.without and effect.run in (None, run.name)
    ])  # fmt: skip


def kept_to_their_runs(experiment: StatedExperiment) -> StatedExperiment:
    """The experiment with the effects that its machine has in certain runs off in all others.

    Such an effect is no part of the machine where none of those runs is here.
    """
    machine, trials = experiment.machine, experiment.trials
    notes = (*experiment.notes, *absence_notes(machine.name, machine.runs, trials))
    active = {
        name: own
        for name, own in machine.active.items()
        if name not in machine.runs or len(others(machine.runs[name], trials)) < len(trials)
    }
    kept = tuple(
        replace(run, without=run.without | absent)
        for run, absent in zip(trials, known_absent(machine.runs, trials), strict=True)
    )
    return replace(experiment, machine=replace(machine, active=active), trials=kept, notes=notes)


def _plain(text: str) -> str:
    """Text that may stand in a comment."""
    return "".join(c if c.isprintable() else " " for c in text)
