"""State of a diagnosis between two passes: the question, the fitted sets, the answer so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mopro.engine.candidate import Candidate
from mopro.engine.fits import Fit, HeldOut
from mopro.engine.residuals import NOTHING_LEFT, Remainder, Residuals
from mopro.engine.search.alternatives import Alternative
from mopro.engine.search.hypotheses import Hypotheses, Progress
from mopro.engine.search.screening import Screening
from mopro.engine.series import Series, Simulate
from mopro.engine.verdict import Rejected


@dataclass(frozen=True)
class Problem:
    """The question: a model, also with other steps, a catalogue, data and free numbers.

    `unlisted`: free-form terms that the model knows.
    """

    simulate: Simulate
    finer: Simulate | None
    coarse: Simulate | None
    catalogue: tuple[Candidate, ...]
    unlisted: tuple[Candidate, ...]
    base: tuple[Candidate, ...]
    data: tuple[Series, ...]
    jobs: int
    progress: Progress

    def sets(self) -> Hypotheses:
        first = {c.name: {p.name: p.starts[0] for p in c.parameters} for c in self.base}
        residuals = Residuals(self.simulate, self.data, scaled_at=first, coarse=self.coarse)
        return Hypotheses(residuals, self.catalogue, self.base, self.jobs, self.progress)


@dataclass(frozen=True)
class State:
    """State between two passes: the fitted sets, and the answer so far.

    `drafted`: the answer with the free-form terms that stand beside it. `terms`: the free-form
    terms that do what a listed effect does, by the key of that. `stand_ins`: the effects that
    turned out to stand for something that nobody listed. `rival`: a set with free-form terms that
    does as well as the answer.
    """

    problem: Problem
    sets: Hypotheses
    screening: Screening
    fit: Fit
    drafted: Fit | None = None
    terms: Mapping[tuple[str, str], Candidate] = field(default_factory=dict)
    held: HeldOut | None = None
    drafted_held: HeldOut | None = None
    remainder: Remainder = NOTHING_LEFT
    alternatives: tuple[Alternative, ...] = ()
    rival: Fit | None = None
    rejected: tuple[Rejected, ...] = ()
    stand_ins: frozenset[str] = frozenset()
    notes: tuple[str, ...] = ()

    @staticmethod
    def of(problem: Problem) -> State:
        sets = problem.sets()
        return State(problem, sets, Screening(sets), sets.null)
