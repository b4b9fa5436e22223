"""Drafts taken into a machine file, as effects that nobody has confirmed yet."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from mopro.engine.verdict import Draft, Named, Verdict
from mopro.experiment.system import System
from mopro.formula.written import WrittenEffect
from mopro.source import Source
from mopro.tomlfile.edit import quoted


def with_drafts(system: System, verdict: Verdict) -> tuple[System, Verdict] | None:
    """The machine with the drafts of a verdict in its equations, and the verdict with them named.

    They are those of all runs that stand beside the answer and are among the system's terms; all
    sizes are those beside them. Others, such as a step in the readings of one run, are none of the
    machine. None where there are none: a set that would do as well as the answer is not beside it.
    """
    terms = system.terms
    taken = [draft for draft in verdict.drafts if draft.run is None and draft.name in terms]
    if not taken or verdict.without_drafts is None:
        return None
    lines = [line for draft in taken for line in _section(draft, terms[draft.name])]
    added = {
        _file_name(draft): {name: e.value for name, e in draft.parameters.items()}
        for draft in taken
    }
    wider = replace(
        verdict,
        effects=(*verdict.effects, *map(_named, taken)),
        settings={**verdict.settings, **added},
        drafts=tuple(draft for draft in verdict.drafts if draft not in taken),
        without_drafts=None,
    )
    return system.beside(Source("drafts", "\n".join(lines))), wider


def _file_name(draft: Draft) -> str:
    """The name that a file gives to a draft: another one than that of the free-form term."""
    return f"{draft.name}, unconfirmed"


def _section(draft: Draft, effect: WrittenEffect) -> Iterator[str]:
    """Lines of the `[[effect]]` that states the term `effect` of a draft."""
    yield "[[effect]]"
    yield f"name = {quoted(_file_name(draft))}"
    yield f"enters = {quoted(f'{effect.enters} {effect.target}'.strip())}"
    yield f"formula = {quoted(effect.term.formula.text)}"
    yield "unconfirmed = true"
    for p in effect.parameters:
        yield f"{p.name} = {{ unit = {quoted(p.unit)}, role = {quoted(p.role)} }}"


def _named(draft: Draft) -> Named:
    return Named(
        name=_file_name(draft),
        form="",
        parameters=dict(draft.parameters),
        indistinguishable_from=[],
        rivals={},
        alternatives={},
        log10_bayes_factor=math.nan,
        sigmas=draft.sigmas,
        held_out=draft.held_out,
    )
