"""Drafts taken into a machine file, as effects that nobody has confirmed yet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

from mopro.engine.verdict import Draft, Named, Verdict
from mopro.experiment.conclude.machine_file import quoted
from mopro.formula.written import WrittenEffect


def file_name(draft: Draft) -> str:
    """The name that a file gives to a draft: another one than that of the free-form term."""
    return f"{draft.name}, unconfirmed"


def section(draft: Draft, effect: WrittenEffect) -> Iterator[str]:
    """Lines of the `[[effect]]` that states the term `effect` of a draft."""
    yield "[[effect]]"
    yield f"name = {quoted(file_name(draft))}"
    yield f"enters = {quoted(f'{effect.enters} {effect.target}'.strip())}"
    yield f"formula = {quoted(effect.term.formula.text)}"
    yield "unconfirmed = true"
    for p in effect.parameters:
        yield f"{p.name} = {{ unit = {quoted(p.unit)}, role = {quoted(p.role)} }}"


def with_drafts(verdict: Verdict, effects: Mapping[str, WrittenEffect]) -> Verdict:
    """The verdict with the drafts of these names among its effects, and all sizes beside drafts."""
    taken = [draft for draft in verdict.drafts if draft.name in effects]
    if not taken:
        return verdict
    added = {
        file_name(draft): {name: e.value for name, e in draft.parameters.items()} for draft in taken
    }
    return replace(
        verdict,
        effects=(*verdict.effects, *map(_named, taken)),
        settings={**verdict.settings, **added},
        drafts=tuple(draft for draft in verdict.drafts if draft.name not in effects),
        without_drafts=None,
    )


def _named(draft: Draft) -> Named:
    return Named(
        name=file_name(draft),
        form="",
        parameters=dict(draft.parameters),
        indistinguishable_from=[],
        rivals={},
        alternatives={},
        log10_bayes_factor=math.nan,
        sigmas=draft.sigmas,
        held_out=draft.held_out,
    )
