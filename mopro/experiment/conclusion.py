"""Conclusion of a diagnosis: machine file, gap with it, places and the next experiment."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from mopro import markup
from mopro.engine import reconcile
from mopro.engine.verdict import Draft, Named, RunGap, Verdict
from mopro.errors import DataError
from mopro.experiment.comparison import Place, compare, worst
from mopro.experiment.glance import Glance, glance_of
from mopro.experiment.system import Proposal, Repaired, System
from mopro.experiment.wording import (
    file_words,
    harm_words,
    harmed,
    reservations,
    unconfirmed_words,
)
from mopro.formula.written import WrittenEffect
from mopro.source import Source
from mopro.tomlfile import Document
from mopro.tomlfile.edit import Text, quoted

_MOST_PLACES = 40
# What a library says of such numbers tells nobody what to do.
_NOT_FINITE = (
    "{}: with some effects the model comes to numbers that cannot be worked with: look at the "
    "signs of its law and at the ranges of its free numbers, or leave effects out with --without"
)


@dataclass(frozen=True)
class Conclusion:
    """A verdict and what follows from it.

    `system`: that the verdict is of. `left_out` are the effects that were no candidates, `tried`
    those that were. `advice`: what else to do if the verdict is ambiguous and no next experiment is
    proposed. `filed`: the verdict as the machine file has it, if that has drafts. `harmed`: a run
    for which nothing that was fitted is in that file.
    """

    system: System
    verdict: Verdict
    where: tuple[Place, ...]
    repaired: Repaired
    next_experiment: Proposal | None
    advice: str
    left_out: tuple[str, ...] = ()
    tried: tuple[str, ...] = ()
    filed: Verdict | None = None
    harmed: RunGap | None = None

    @property
    def machine_text(self) -> str:
        """The machine's file with what was found."""
        return self.repaired.text

    def text_in(self, folder: Path) -> str:
        """The machine's file for a folder: it finds a model that is a program from there."""
        text, program = self.repaired.text, self.system.program
        if program is None:
            return text
        source = Source("", text)
        function = Document(source).root["python"].data.rpartition(":")[2]
        found = os.path.relpath(program.resolve(), folder.resolve())
        named = quoted(f"{Path(found).as_posix()}:{function}")
        return f"{Text.of(source).with_value(('python',), named)}\n"

    @property
    def glance(self) -> Glance:
        """The answer at a glance: verdict, effects, gap, what is undecided, and the next step."""
        return glance_of(
            self.verdict, self.system, self.repaired, self.next_experiment, self.advice,
            self.left_out, self.tried,
        )  # fmt: skip

    def _repr_html_(self) -> str:
        """The verdict, and the program that would distinguish its alternatives."""
        shown = self.verdict._repr_html_()
        if self.next_experiment is None:
            return shown
        title = f"The next experiment: {self.next_experiment.summary}"
        return shown + markup.fragment(
            title, [markup.listing(self.next_experiment.text, markup.MOST_LINES)]
        )

    def reservations(self) -> Iterator[str]:
        """Lines on what the machine file leaves out, has for certain runs, or predicts worse."""
        yield from reservations(self.verdict, self.system.runs)
        if self.harmed is not None:
            yield harm_words(self.harmed, self.verdict)
            return
        filed, repaired = self.filed or self.verdict, self.repaired
        yield from file_words(filed, repaired.of_runs, repaired.rms, self.system.series)
        if self.filed is not None:
            yield from unconfirmed_words(self.verdict, self.filed)

    def as_json(self) -> dict[str, Any]:
        answer = self.verdict.as_json()
        answer["glance"] = self.glance.as_json()
        answer["left_out"] = list(self.left_out)
        answer["where"] = [asdict(place) for place in self.where]
        answer["reservations"] = list(self.reservations())
        answer["gap"]["runs"] = [
            {**run, "rerun_rms": rerun}
            for run, rerun in zip(answer["gap"]["runs"], self.repaired.rms, strict=True)
        ]
        if self.next_experiment:
            answer["next_experiment"] = self.next_experiment.text
            answer["next_experiment_separations"] = self.next_experiment.separations
            answer["next_experiment_pairs"] = [
                {"effects": list(names), "sigma": sigma}
                for names, sigma in self.next_experiment.pairs.items()
            ]
            answer["next_experiment_payload_kg"] = self.next_experiment.payload_kg
        return {key: _strict(value) for key, value in answer.items()}


def conclude(
    system: System,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
    left_out: Collection[str] = (),
    with_drafts: bool = False,
) -> Conclusion:
    """Find what the model of `system` lacks, without the effects in `left_out`, and what follows.

    The machine file has those drafts as well that it can state as formulas if `with_drafts`.
    Raises MotionError for a program that cannot be run, ModelError and DataError.
    """
    progress("comparing")
    where = worst(compare(system).where, _MOST_PLACES)
    judged, verdict = diagnose(system, jobs, progress, left_out)
    progress("simulating the experiment again with the effects found")
    drafted = drafted_in(judged, verdict) if with_drafts else None
    runs = [] if drafted else harmed(verdict, judged.series)
    stated, named = drafted or (judged, verdict.unrepaired if runs else verdict)
    repaired, proposal = stated.repaired(named), None
    if verdict.verdict == "ambiguous":
        progress("designing an experiment that distinguishes the alternatives")
        proposal = system.next_experiment(verdict)
    tried, omitted = system.tried(left_out)
    return Conclusion(
        system=judged,
        verdict=verdict,
        where=where,
        repaired=repaired,
        next_experiment=proposal,
        advice=system.advice(verdict),
        left_out=omitted,
        tried=tried,
        filed=drafted and named,
        harmed=runs[0] if runs else None,
    )


def diagnose(
    system: System,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
    left_out: Collection[str] = (),
) -> tuple[System, Verdict]:
    """The verdict on `system`, and the variant of it that the data call for.

    Effects whose names are in `left_out` are no candidates and no alternatives.
    """

    def asked(own: System) -> Verdict:
        question = own.question(left_out)
        try:
            return reconcile(**vars(question), jobs=jobs, progress=progress)
        except ValueError as error:
            message = _NOT_FINITE.format(system.source.name)
            raise DataError(message, "not-finite") from error

    return system.judged(asked, left_out)


def _strict(value: Any) -> Any:
    """`value` with NaN and infinities replaced by None, as JSON has neither."""
    if isinstance(value, dict):
        return {key: _strict(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def drafted_in(system: System, verdict: Verdict) -> tuple[System, Verdict] | None:
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
