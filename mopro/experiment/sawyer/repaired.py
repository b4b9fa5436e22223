"""The motor's machine file with the effects that a diagnosis found."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from mopro.effects import catalogue_of
from mopro.effects.effect import AXIS, Effect, Parameter, angle_in
from mopro.engine.verdict import Named, Verdict
from mopro.experiment.machine_file import rounded, runs_lines, with_effects
from mopro.experiment.sawyer.trials import Experiment
from mopro.experiment.wording import origin_words, reservation
from mopro.machine import Machine
from mopro.machine.file import read_machine
from mopro.machine.run_effects import files_of, known_absent, nth_of
from mopro.source import Source
from mopro.tomlfile.edit import Text, quoted

_REPAIRED = re.compile(r"(.*)-repaired(?:-(\d+))?", re.DOTALL)


def lasting(experiment: Experiment, verdict: Verdict) -> list[Named]:
    """The fitted effects that are properties of the machine, unlike an event in one run."""
    runs = tuple(trial.name for trial in experiment.trials)
    effects = catalogue_of(experiment.machine)
    return [
        effect
        for effect in verdict.fitted
        if effect.name in effects and reservation(effect, verdict, runs) is None
    ]


def of_runs(experiment: Experiment, verdict: Verdict) -> dict[str, dict[str, str]]:
    """The effects of the machine file that belong to the runs that they were fitted on, with these.

    They say nothing of any other run.
    """
    effects, trials = catalogue_of(experiment.machine), experiment.trials
    absent = known_absent(experiment.machine.runs, trials)
    return {
        named.name: files_of([
            t for t, out in zip(trials, absent, strict=True)
            if named.name not in out and named.run in (None, t.name)
        ])
        for named in lasting(experiment, verdict)
        if trials and (named.run is not None or effects[named.name].belongs_to_runs)
    }  # fmt: skip


def machine_text(experiment: Experiment, verdict: Verdict) -> str:
    """Text of the machine file with the fitted effects, each with its origin."""
    machine = experiment.machine
    source = machine.source or Source(machine.name, "")
    named, runs = lasting(experiment, verdict), of_runs(experiment, verdict)
    sections = {e.name: [*_section(experiment, e, verdict, runs.get(e.name, {}))] for e in named}
    own = read_machine(source).formulas if machine.formulas else ()
    formulas = [effect for effect in machine.formulas if effect.name in sections]
    text = Text.of(source)
    for key, value in (("verdict", verdict.verdict), ("name", repaired_name(machine.name))):
        text = _with_key(text, key, quoted(value))
    return with_effects(text, own, formulas, sections)


def _with_key(text: Text, key: str, value: str) -> Text:
    """The text with `value` for the key, in its place or before all others."""
    if (key,) in text:
        return text.with_value((key,), value)
    return Text.of(Source("", f"{key} = {value}\n{text}"))


def machine_of(machine: Machine, text: str) -> Machine:
    """The machine of a repaired file; ModelError."""
    return read_machine(Source(f"{machine.name} (reconciled)", text))


def repaired_name(name: str) -> str:
    """The name of a machine file with effects added: one that differs from the base's."""
    match = _REPAIRED.fullmatch(name)
    if match is None:
        return f"{name}-repaired"
    return f"{match[1]}-repaired-{int(match[2] or 1) + 1}"


def _section(
    experiment: Experiment, named: Named, verdict: Verdict, runs: Mapping[str, str]
) -> Iterator[str]:
    """Lines of the section that switches an effect on, in `runs` alone if there are any."""
    effect = catalogue_of(experiment.machine)[named.name]
    values = verdict.settings_alone.get(named.name, {})
    place = Path(experiment.source.name).name
    if values.get(AXIS):
        yield f"axes = [{int(values[AXIS])}]"
    found = [nth_of(trial.data, runs) for trial in experiment.trials]
    in_order = [found.index(nth) for nth in range(len(runs))]
    for parameter, key, fitted in _keys(effect, values, in_order):
        own = values.get(fitted, values.get(parameter.name, parameter.default))
        estimate = named.parameters.get(fitted)
        origin, place_stated = "assumed", f"with it in {place}"
        if estimate is not None:
            origin, place_stated = "measured", f"{place}, {origin_words(estimate)}"
            place_stated += "".join(f"; or {name}" for name in named.indistinguishable_from)
        stated = f'unit = "{parameter.unit}", origin = "{origin}", place = {quoted(place_stated)}'
        yield f"{key} = {{ value = {rounded(own)!r}, {stated} }}"
    yield from runs_lines(runs)


def _keys(
    effect: Effect, values: Mapping[str, float], runs: Sequence[int]
) -> Iterator[tuple[Parameter, str, str]]:
    """Each parameter with its name in the file and that under which it was fitted.

    One of another value in each of several `runs` (places of the experiment's) once for each.
    """
    for p in effect.parameters:
        if not (p.per_run and runs and angle_in(runs[0], p.name) in values):
            yield p, p.name, p.name
        elif len(runs) == 1:
            yield p, p.name, angle_in(runs[0], p.name)
        else:
            for nth, run in enumerate(runs):
                yield p, angle_in(nth, p.name), angle_in(run, p.name)
