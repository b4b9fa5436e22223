"""Writes the machine file with the numbers that were fitted and the effects that were found."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from mopro.experiment.conclude.wording import interval_words
from mopro.formula.written import toml_lines
from mopro.rig.data import RigExperiment
from mopro.rig.file import read_rig
from mopro.rig.model import Rig
from mopro.rig.simulation import BASE
from mopro.source import Source
from mopro.verdict import Estimate, Verdict

_HEAD = re.compile(r"\s*\[+\s*([^\]]+?)\s*\]")
_KEY = re.compile(r"\s*(?:base\s*\.\s*)?([A-Za-z_]\w*)\s*=")
_TOP = re.compile(r"\s*base\s*\.")


def machine_text(experiment: RigExperiment, verdict: Verdict) -> str:
    """Text of the machine's file, each fitted number with its interval, and the effects found."""
    rig = experiment.machine
    place = Path(experiment.source.name).name
    fitted = {name: e for name, e in verdict.base.items() if name in rig.numbers}
    for effect in verdict.fitted:
        fitted |= {n: e for n, e in effect.parameters.items() if n in rig.numbers}
    found = {e.name for e in verdict.fitted if e.name not in rig.numbers}
    lines = list(_without_effects(_with_numbers(rig, fitted, verdict, place), found))
    stated = {effect.name for effect in read_rig(rig.source).effects}
    for written in rig.effects:
        if written.name in found - stated:
            lines += ["", *toml_lines(written)]
    for named in verdict.fitted:
        if named.name in found:
            lines += ["", *_section(named.name, verdict, named.parameters, place)]
            if named.indistinguishable_from:
                lines.append(
                    f"# or instead of it: {_plain(', '.join(named.indistinguishable_from))}"
                )
    return "\n".join(lines).rstrip("\n") + "\n"


def machine_with(experiment: RigExperiment, verdict: Verdict) -> Rig:
    """The machine that `machine_text` describes, in the unit that its sensors gave it."""
    rig = experiment.machine
    made = read_rig(Source(f"{rig.name} (reconciled)", machine_text(experiment, verdict)))
    return replace(made, unit=rig.unit)


def _with_numbers(
    rig: Rig, fitted: Mapping[str, Estimate], verdict: Verdict, place: str
) -> Iterator[str]:
    """Lines of the file, each fitted number with its value in the place of the old one."""
    section = ""
    for line in rig.source.text.splitlines():
        head, key = _HEAD.match(line), _KEY.match(line)
        section = head[1] if head else section
        named = key[1] if key and (section == "base" or _TOP.match(line)) else ""
        if named in fitted:
            before = verdict.base_before.get(BASE, {}).get(named, rig.numbers[named].value)
            yield _number(named, rig, fitted[named], before, place)
        else:
            yield line


def _number(name: str, rig: Rig, estimate: Estimate, before: float, place: str) -> str:
    number = rig.numbers[name]
    tolerance = f", tolerance = {number.tolerance!r}" if number.tolerance else ""
    tolerance += f", before = {_digits(before)}"
    value = f'{{ value = {_digits(estimate.value)}, unit = "{number.unit}"{tolerance} }}'
    return f"{name} = {value}  # {_origin(estimate, place)}"


def _origin(estimate: Estimate, place: str) -> str:
    return f"95 %: {_plain(interval_words(estimate))}; fitted with {_plain(place)}"


def _without_effects(lines: Iterator[str], names: set[str]) -> Iterator[str]:
    """Lines without the sections of effects that are stated anew."""
    dropped = False
    for line in lines:
        head = _HEAD.match(line)
        if head:
            path = head[1].split(".", 1)
            dropped = path[0] == "effects" and path[-1].strip("\"'") in names
        if not dropped:
            yield line


def _section(
    name: str, verdict: Verdict, parameters: Mapping[str, Estimate], place: str
) -> Iterator[str]:
    yield f'[effects."{_escaped(name)}"]' if not name.isidentifier() else f"[effects.{name}]"
    for parameter, value in verdict.settings.get(name, {}).items():
        estimate = parameters.get(parameter)
        if estimate is None:
            yield f"{parameter} = {_digits(value)}"
        else:
            stated = f'{{ value = {_digits(value)}, unit = "{estimate.unit}" }}'
            yield f"{parameter} = {stated}  # {_origin(estimate, place)}"


def _digits(value: float) -> str:
    """Eight digits: more than any data determine."""
    return repr(float(f"{value:.8g}"))


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _plain(text: str) -> str:
    """Text that may stand in a comment."""
    return "".join(c if c.isprintable() else " " for c in text)
