"""The machine file that a diagnosis comes to: the machine, and what it was found to lack."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from mopro.diagnosis import Named, Verdict
from mopro.effects import catalogue
from mopro.effects.base import AXIS, Effect, angle_in
from mopro.experiment.conclude.wording import origin_words, reservation
from mopro.experiment.model import Experiment
from mopro.machine import Machine
from mopro.machine.file import read_machine
from mopro.source import Source

# A section's head, and the key that a line begins with.
_HEAD = re.compile(r"\s*\[+([^\]]+)\]")
_KEY = re.compile(r"""\s*([\w.\-"' \t]+?)\s*=""")


def lasting(experiment: Experiment, verdict: Verdict) -> list[Named]:
    """What belongs to the machine; a step in one run, or a sensor's zero, is no property of it."""
    runs = tuple(trial.name for trial in experiment.trials)
    return [
        effect
        for effect in verdict.fitted
        if effect.name in catalogue() and reservation(effect, verdict, runs) is None
    ]


def machine_text(experiment: Experiment, verdict: Verdict) -> str:
    """The machine file with what was fitted, each effect with its origin."""
    machine = experiment.machine
    source = machine.source or Source(machine.name, "")
    named = lasting(experiment, verdict)
    kept = "\n".join(_without(source, {effect.name for effect in named})).rstrip("\n")
    place = Path(experiment.source.name).name
    sections = [
        "\n".join(_section(catalogue()[effect.name], effect, verdict, place)) for effect in named
    ]
    return "\n\n".join([kept, *sections]) + "\n"


def machine_with(experiment: Experiment, verdict: Verdict) -> Machine:
    """The machine that `machine_text` describes, read as any other file is."""
    return read_machine(
        Source(f"{experiment.machine.name} (reconciled)", machine_text(experiment, verdict))
    )


def _without(source: Source, effects: set[str]) -> Iterator[str]:
    """The file's lines without what they say of these effects."""
    section: list[str] = []
    for line in source.text.splitlines():
        head, key = _HEAD.match(line), _KEY.match(line)
        if head:
            section = _path(head[1])
        place = section + (_path(key[1]) if key and not head else [])
        if place[:1] != ["effects"] or not effects.intersection(place[1:2]):
            yield line


def _path(dotted: str) -> list[str]:
    return [part.strip().strip("\"'") for part in dotted.split(".")]


def _values(effect: Named, verdict: Verdict) -> Mapping[str, float]:
    return verdict.settings.get(effect.name, {})


def _section(effect: Effect, named: Named, verdict: Verdict, place: str) -> Iterator[str]:
    values = dict(_values(named, verdict))
    for p in effect.parameters:
        if p.per_run:
            values.setdefault(p.name, values.get(angle_in(0, p.name), 0.0))
    yield f"[effects.{named.name}]"
    if values.get(AXIS):
        yield f"axes = [{int(values[AXIS])}]"
    for parameter in effect.parameters:
        # Eight digits are more than any data know, and the same wherever it is computed.
        value = float(f"{values.get(parameter.name, parameter.default):.8g}")
        estimate = named.parameters.get(parameter.name)
        origin, words = "assumed", f"with it in {place}"
        if estimate is not None:
            origin, words = "measured", f"{place}, {origin_words(estimate)}"
            words += "".join(f"; or {rival}" for rival in named.indistinguishable_from)
        stated = f'unit = "{parameter.unit}", origin = "{origin}", place = {_quoted(words)}'
        yield f"{parameter.name} = {{ value = {value!r}, {stated} }}"


def _quoted(text: str) -> str:
    """A TOML string: those of JSON are, but for one character and for what is no text."""
    shown = text.encode("utf-8", "replace").decode().replace("\x7f", " ")
    return json.dumps(shown, ensure_ascii=False)
