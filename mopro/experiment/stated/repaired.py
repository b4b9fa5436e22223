"""Writes the machine file with the numbers that were fitted and the effects that were found.

A number of `[base]` and a parameter of an effect may have the same name: they are of different
tables. The values are those that fit without drafts, which are in no machine file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from mopro.engine.candidate import RUN
from mopro.engine.series import Settings
from mopro.engine.verdict import Estimate, Named, Verdict
from mopro.experiment.conclude.machine_file import (
    HEAD,
    quoted,
    runs_line,
    without_effects,
    without_replaced,
)
from mopro.experiment.conclude.wording import interval_words, value_words
from mopro.experiment.stated.of_runs import fitted_on, of_one_run
from mopro.formula.written import toml_lines
from mopro.source import Source
from mopro.stated.data import StatedExperiment
from mopro.stated.file import read_stated
from mopro.stated.model import StatedMachine
from mopro.stated.names import effects_of
from mopro.stated.simulation import BASE

_KEY = re.compile(r"\s*(?:base\s*\.\s*)?([A-Za-z_]\w*)\s*=")
_TOP = re.compile(r"\s*base\s*\.")


def machine_text(experiment: StatedExperiment, verdict: Verdict) -> str:
    """Text of the machine's file, each fitted number with its interval, and the effects found."""
    rig = experiment.machine
    place = Path(experiment.source.name).name
    found = [effect for effect in verdict.fitted if not corrects(rig, effect.name)]
    names = {effect.name for effect in found}
    kept = without_effects(_with_numbers(rig, verdict, place), names)
    own = read_stated(rig.source).effects
    lines = list(without_replaced(kept, own, rig.effects))
    stated = {tuple(toml_lines(effect)) for effect in own}
    # The file may switch on what the experiment states.
    used = names | rig.active.keys()
    for written in rig.effects:
        if written.name in used and tuple(toml_lines(written)) not in stated:
            lines += ["", *toml_lines(written)]
    for effect in found:
        lines += ["", *_section(experiment, effect, verdict, place)]
    return "\n".join(lines).rstrip("\n") + "\n"


def machine_of(rig: StatedMachine, text: str) -> StatedMachine:
    """The machine of a repaired file, in the unit that its sensors gave it; ModelError."""
    return replace(read_stated(Source(f"{rig.name} (reconciled)", text)), unit=rig.unit)


def corrects(rig: StatedMachine, name: str) -> bool:
    """True if what was fitted under this name is a number of the machine, known to a tolerance."""
    return name in rig.numbers and rig.numbers[name].tolerance > 0


def as_written(settings: Settings) -> Settings:
    """The settings with the digits that a file has."""
    return {
        name: {parameter: _rounded(value) for parameter, value in own.items()}
        for name, own in settings.items()
    }


def _with_numbers(rig: StatedMachine, verdict: Verdict, place: str) -> Source:
    """The file, each fitted number with its value in the place of the old one."""
    fitted = dict(_fitted(rig, verdict))
    section, lines = "", []
    for line in rig.source.lines:
        head, key = HEAD.match(line), _KEY.match(line)
        section = head[2] if head else section
        if key and key[1] in fitted and (section == "base" or _TOP.match(line)):
            named = key[1]
            before = verdict.base_before.get(BASE, {}).get(named, rig.numbers[named].value)
            stated = _number(named, rig, *fitted[named], before, place)
            line = f"{line[: key.end(1)]} = {stated}"
        lines.append(line)
    return Source(rig.source.name, "\n".join(lines))


def _fitted(rig: StatedMachine, verdict: Verdict) -> Iterator[tuple[str, tuple[float, Estimate]]]:
    """The numbers of the machine that were fitted: name, value to write, and estimate."""
    settings = verdict.settings_alone
    for name, estimate in verdict.base.items():
        if name in rig.numbers:
            yield name, (settings[BASE][name], estimate)
    for effect in verdict.fitted:
        if corrects(rig, effect.name):
            own = settings[effect.name][effect.name]
            yield effect.name, (own, effect.parameters[effect.name])


def _number(
    name: str, rig: StatedMachine, value: float, estimate: Estimate, before: float, place: str
) -> str:
    number = rig.numbers[name]
    tolerance = f", tolerance = {number.tolerance!r}" if number.tolerance else ""
    tolerance += f", before = {_rounded(before)!r}"
    stated = f'{{ value = {_rounded(value)!r}, unit = "{number.unit}"{tolerance} }}'
    return f"{stated}  # {_origin(value, estimate, place)}"


def _origin(value: float, estimate: Estimate, place: str) -> str:
    interval = f"95 %: {_plain(interval_words(estimate))}"
    if _rounded(value) == _rounded(estimate.value):
        return f"{interval}; fitted with {_plain(place)}"
    beside = f"{_plain(value_words(estimate))}, {interval}"
    return f"fitted with {_plain(place)}, without the drafts; beside them {beside}"


def _section(
    experiment: StatedExperiment, effect: Named, verdict: Verdict, place: str
) -> Iterator[str]:
    """Lines of the section that switches an effect on."""
    name = effect.name
    yield f"[effects.{name if name.isascii() and name.isidentifier() else quoted(name)}]"
    values = verdict.settings_alone.get(name, {})
    for parameter, value in (values if effect.run is None else without_run(values)).items():
        estimate = effect.parameters.get(parameter)
        if estimate is None:
            yield f"{parameter} = {_rounded(value)!r}"
        else:
            stated = f'{{ value = {_rounded(value)!r}, unit = "{estimate.unit}" }}'
            yield f"{parameter} = {stated}  # {_origin(value, estimate, place)}"
    if name in effects_of_runs(experiment, [effect]):
        yield runs_line(fitted_on(experiment, effect))
    if effect.indistinguishable_from:
        yield f"# or instead of it: {_plain(', '.join(effect.indistinguishable_from))}"


def effects_of_runs(experiment: StatedExperiment, found: Collection[Named]) -> list[str]:
    """The names of those effects that belong to the runs that they were fitted on."""
    keys = {(effect.name, effect.form) for effect in found}
    of_time = [
        effect.name
        for effect in effects_of(experiment)
        if (effect.name, effect.form) in keys and of_one_run(effect, experiment.units)
    ]
    return [*of_time, *(effect.name for effect in found if effect.run is not None)]


def without_run(values: Mapping[str, float]) -> dict[str, float]:
    """The parameters of an effect that is on in one run alone, without the number of that."""
    return {name: value for name, value in values.items() if name != RUN}


def _rounded(value: float) -> float:
    """The value with eight digits: more than any data determine."""
    return float(f"{value:.8g}")


def _plain(text: str) -> str:
    """Text that may stand in a comment."""
    return "".join(c if c.isprintable() else " " for c in text)
