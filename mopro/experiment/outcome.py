"""The machine file that a diagnosis comes to: the machine, and what it was found to lack."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from mopro.diagnosis import Named, Verdict
from mopro.emulator.effects import catalogue
from mopro.emulator.effects.base import Effect
from mopro.experiment.model import Experiment
from mopro.experiment.motor import AXIS, RUN, angle_in
from mopro.machine import Machine
from mopro.machine.file import load_machine, read_machine
from mopro.source import Source

_SECTION = re.compile(r"\s*\[")


def lasting(verdict: Verdict) -> list[Named]:
    """What belongs to the machine; a step in one run, or a sensor's zero, is no property of it."""
    return [
        effect
        for effect in verdict.effects
        if effect.name in catalogue() and _values(effect, verdict).get(RUN, -1) == -1
        and effect.name != "sensor_offset"
    ]  # fmt: skip


def machine_text(experiment: Experiment, verdict: Verdict) -> str:
    """The machine file with the effects that were named, each with its origin."""
    machine = experiment.machine
    source = machine.source or Source(machine.name, "")
    named = lasting(verdict)
    kept = "\n".join(_without(source, {effect.name for effect in named})).rstrip("\n")
    sections = [
        "\n".join(_section(catalogue()[effect.name], effect, verdict, experiment.source.name))
        for effect in named
    ]
    return "\n\n".join([kept, *sections]) + "\n"


def machine_with(experiment: Experiment, verdict: Verdict) -> Machine:
    """The machine that `machine_text` describes, read as any other file is."""
    return read_machine(
        Source(f"{experiment.machine.name} (reconciled)", machine_text(experiment, verdict))
    )


def _without(source: Source, effects: set[str]) -> Iterator[str]:
    """The file's lines without the sections of these effects."""
    skipping = False
    for line in source.text.splitlines():
        if _SECTION.match(line):
            skipping = any(line.strip().startswith(f"[effects.{name}]") for name in effects)
        if not skipping:
            yield line


def _values(effect: Named, verdict: Verdict) -> Mapping[str, float]:
    return verdict.settings.get(effect.name, {})


def _section(effect: Effect, named: Named, verdict: Verdict, place: str) -> Iterator[str]:
    values = dict(_values(named, verdict))
    values.setdefault("phi", values.get(angle_in(0), 0.0))
    yield f"[effects.{named.name}]"
    if values.get(AXIS):
        yield f"axes = [{int(values[AXIS])}]"
    for parameter in effect.parameters:
        value = values.get(parameter.name, parameter.default)
        estimate = named.parameters.get(parameter.name)
        origin = f'origin = "assumed", place = "with it in {place}"'
        if estimate is not None:
            low, high = estimate.ci95
            origin = f'origin = "measured", place = "{place}, 95 %: {low:.4g} to {high:.4g}"'
        yield f'{parameter.name} = {{ value = {value!r}, unit = "{parameter.unit}", {origin} }}'


__all__ = ["lasting", "load_machine", "machine_text", "machine_with"]
