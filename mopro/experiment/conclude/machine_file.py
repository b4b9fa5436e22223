"""Writes the machine file with the effects that a diagnosis found."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from mopro.effects import catalogue_of
from mopro.effects.base import AXIS, Effect, angle_in
from mopro.experiment.conclude.wording import origin_words, reservation
from mopro.experiment.model import Experiment
from mopro.formula.written import toml_lines
from mopro.machine import Machine
from mopro.machine.file import read_machine
from mopro.source import Source
from mopro.verdict import Named, Verdict

# The heading of a section, and the key at the start of a line.
_HEAD = re.compile(r"\s*\[+([^\]]+)\]")
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


def machine_text(experiment: Experiment, verdict: Verdict) -> str:
    """Text of the machine file with the fitted effects, each with its origin."""
    machine = experiment.machine
    source = machine.source or Source(machine.name, "")
    named = lasting(experiment, verdict)
    kept = without_effects(source, {effect.name for effect in named})
    remaining = "\n".join(_renamed(kept, repaired_name(machine.name))).rstrip("\n")
    place = Path(experiment.source.name).name
    effects, stated = catalogue_of(machine), _stated_elsewhere(machine, source)
    sections = [
        *("\n".join(stated[e.name]) for e in named if e.name in stated),
        *("\n".join(_section(effects[e.name], e, verdict, place)) for e in named),
    ]
    return "\n\n".join([remaining, *sections]) + "\n"


def _stated_elsewhere(machine: Machine, source: Source) -> dict[str, list[str]]:
    """Sections of the machine's formulas that its file does not state, by their names."""
    if not machine.formulas:
        return {}
    own = {effect.name for effect in read_machine(source).formulas}
    return {e.name: toml_lines(e) for e in machine.formulas if e.name not in own}


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
    top = next((n for n, line in enumerate(kept) if _HEAD.match(line)), len(kept))
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
        head, key = _HEAD.match(line), _KEY.match(line)
        if head:
            section = _path(head[1])
        place = section + (_path(key[1]) if key and not head else [])
        if place[:1] != ["effects"] or not effects.intersection(place[1:2]):
            yield line


def _path(dotted: str) -> list[str]:
    return [part.strip("\"'") for part in _PART.findall(dotted)]


def _values(effect: Named, verdict: Verdict) -> Mapping[str, float]:
    return verdict.settings_alone.get(effect.name, {})


def _section(effect: Effect, named: Named, verdict: Verdict, place: str) -> Iterator[str]:
    values = dict(_values(named, verdict))
    for p in effect.parameters:
        if p.per_run:
            values.setdefault(p.name, values.get(angle_in(0, p.name), 0.0))
    yield f"[effects.{named.name if _BARE.fullmatch(named.name) else quoted(named.name)}]"
    if values.get(AXIS):
        yield f"axes = [{int(values[AXIS])}]"
    for parameter in effect.parameters:
        # Eight digits: more than any data determine, and the same on every platform.
        value = float(f"{values.get(parameter.name, parameter.default):.8g}")
        estimate = named.parameters.get(parameter.name)
        origin, place_stated = "assumed", f"with it in {place}"
        if estimate is not None:
            origin, place_stated = "measured", f"{place}, {origin_words(estimate)}"
            place_stated += "".join(f"; or {name}" for name in named.indistinguishable_from)
        stated = f'unit = "{parameter.unit}", origin = "{origin}", place = {quoted(place_stated)}'
        yield f"{parameter.name} = {{ value = {value!r}, {stated} }}"


def quoted(text: str) -> str:
    """`text` as a TOML string: that of JSON without DEL and unpaired surrogates."""
    shown = text.encode("utf-8", "replace").decode().replace("\x7f", " ")
    return json.dumps(shown, ensure_ascii=False)
