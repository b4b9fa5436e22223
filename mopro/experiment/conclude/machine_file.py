"""Writes the machine file with the effects that a diagnosis found."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from mopro.effects import catalogue_of
from mopro.effects.base import AXIS, Effect, Parameter, angle_in
from mopro.engine.verdict import Named, Verdict
from mopro.experiment.conclude.wording import origin_words, reservation
from mopro.experiment.sawyer.model import Experiment
from mopro.formula.written import WrittenEffect, toml_lines
from mopro.machine import Machine
from mopro.machine.file import read_machine
from mopro.machine.runs import RUNS, files_of, known_off, nth_of
from mopro.source import Source

# The heading of a section, its brackets first, and the key at the start of a line.
HEAD = re.compile(r"\s*(\[+)\s*([^\]]+?)\s*\]")
_REPAIRED = re.compile(r"(.*)-repaired(?:-(\d+))?", re.DOTALL)
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_PART = re.compile(r'"[^"]*"|\'[^\']*\'|[\w-]+')
_KEY = re.compile(r"""\s*([\w.\-"' \t]+?)\s*=""")


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
    off = known_off(experiment.machine.runs, trials)
    return {
        named.name: files_of([
            t for t, out in zip(trials, off, strict=True)
            if named.name not in out and named.run in (None, t.name)
        ])
        for named in lasting(experiment, verdict)
        if trials and (named.run is not None or effects[named.name].belongs_to_runs)
    }  # fmt: skip


def machine_text(experiment: Experiment, verdict: Verdict) -> str:
    """Text of the machine file with the fitted effects, each with its origin."""
    machine = experiment.machine
    source = machine.source or Source(machine.name, "")
    named = lasting(experiment, verdict)
    names = {effect.name for effect in named}
    own = read_machine(source).formulas if machine.formulas else ()
    formulas = [effect for effect in machine.formulas if effect.name in names]
    kept = without_replaced(without_effects(source, names), own, formulas)
    remaining = "\n".join(_renamed(kept, repaired_name(machine.name))).rstrip("\n")
    stated, runs = [toml_lines(effect) for effect in own], of_runs(experiment, verdict)
    sections = [
        *(lines for lines in map(toml_lines, formulas) if lines not in stated),
        *(_section(experiment, e, verdict, runs.get(e.name, {})) for e in named),
    ]
    return "\n\n".join([remaining, *map("\n".join, sections)]) + "\n"


def without_replaced(
    lines: Iterable[str], stated: Iterable[WrittenEffect], by: Sequence[WrittenEffect]
) -> Iterator[str]:
    """Lines without those `[[effect]]` sections that effects of the same name in `by` replace.

    `stated`: the effects of the lines, in their order.
    """
    names, own = {effect.name for effect in by}, [toml_lines(effect) for effect in by]
    replaced = {nth for nth, e in enumerate(stated) if e.name in names and toml_lines(e) not in own}
    nth, dropped = -1, False
    for line in lines:
        head = HEAD.match(line)
        if head:
            is_effect = head[1] == "[[" and head[2] == "effect"
            nth += is_effect
            dropped = is_effect and nth in replaced
        if not dropped:
            yield line


def repaired_name(name: str) -> str:
    """The name of a machine file with effects added: one that differs from the base's."""
    match = _REPAIRED.fullmatch(name)
    if match is None:
        return f"{name}-repaired"
    return f"{match[1]}-repaired-{int(match[2] or 1) + 1}"


def _renamed(lines: Iterator[str], name: str) -> Iterator[str]:
    """The lines with the file's name stated as `name`, in the place of its own or first."""
    stated = f"name = {quoted(name)}"
    kept = list(lines)
    top = next((n for n, line in enumerate(kept) if HEAD.match(line)), len(kept))
    own = next((n for n, line in enumerate(kept[:top]) if _is_name(line)), None)
    if own is None:
        return iter([stated, *kept])
    return iter([*kept[:own], stated, *kept[own + 1 :]])


def _is_name(line: str) -> bool:
    key = _KEY.match(line)
    return key is not None and _path(key[1]) == ["name"]


def machine_with(experiment: Experiment, verdict: Verdict) -> Machine:
    """Read the machine that `machine_text` describes."""
    return read_machine(
        Source(f"{experiment.machine.name} (reconciled)", machine_text(experiment, verdict))
    )


def without_effects(source: Source, effects: set[str]) -> Iterator[str]:
    """Lines of the file without the sections and keys of these effects."""
    section: list[str] = []
    for line in source.lines:
        head, key = HEAD.match(line), _KEY.match(line)
        if head:
            section = _path(head[2])
        place = section + (_path(key[1]) if key and not head else [])
        if place[:1] != ["effects"] or not effects.intersection(place[1:2]):
            yield line


def _path(dotted: str) -> list[str]:
    return [part.strip("\"'") for part in _PART.findall(dotted)]


def _values(effect: Named, verdict: Verdict) -> Mapping[str, float]:
    return verdict.settings_alone.get(effect.name, {})


def _section(
    experiment: Experiment, named: Named, verdict: Verdict, runs: Mapping[str, str]
) -> Iterator[str]:
    """Lines of the section that switches an effect on, in `runs` alone if there are any."""
    effect, values = catalogue_of(experiment.machine)[named.name], _values(named, verdict)
    place = Path(experiment.source.name).name
    yield f"[effects.{named.name if _BARE.fullmatch(named.name) else quoted(named.name)}]"
    if values.get(AXIS):
        yield f"axes = [{int(values[AXIS])}]"
    found = [nth_of(trial.data, runs) for trial in experiment.trials]
    in_order = [found.index(nth) for nth in range(len(runs))]
    for parameter, key, fitted in _keys(effect, values, in_order):
        # Eight digits: more than any data determine, and the same on every platform.
        own = values.get(fitted, values.get(parameter.name, parameter.default))
        estimate = named.parameters.get(fitted)
        origin, place_stated = "assumed", f"with it in {place}"
        if estimate is not None:
            origin, place_stated = "measured", f"{place}, {origin_words(estimate)}"
            place_stated += "".join(f"; or {name}" for name in named.indistinguishable_from)
        stated = f'unit = "{parameter.unit}", origin = "{origin}", place = {quoted(place_stated)}'
        yield f"{key} = {{ value = {float(f'{own:.8g}')!r}, {stated} }}"
    if runs:
        yield runs_line(runs)


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


def runs_line(runs: Mapping[str, str]) -> str:
    """The line of an effect's section with the `runs` that it belongs to."""
    stated = ", ".join(f"{quoted(file)} = {quoted(checksum)}" for file, checksum in runs.items())
    return f"{RUNS} = {{ {stated} }}  # data files and their CRC-32; off in all other runs"


def quoted(text: str) -> str:
    """`text` as a TOML string: that of JSON without DEL and unpaired surrogates."""
    shown = text.encode("utf-8", "replace").decode().replace("\x7f", " ")
    return json.dumps(shown, ensure_ascii=False)
