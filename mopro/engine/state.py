"""State of a diagnosis between two passes: the question, the fitted sets, the answer so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from mopro.engine.candidate import Candidate
from mopro.engine.fits import Fit, HeldOut
from mopro.engine.residuals import NOTHING_LEFT, Remainder, Residuals
from mopro.engine.search.alternatives import Alternative
from mopro.engine.search.hypotheses import Hypotheses, Progress
from mopro.engine.search.screening import Screening
from mopro.engine.series import Series, Simulate
from mopro.engine.verdict import OddRun, Rejected, Taken


@dataclass(frozen=True)
class Problem:
    """The question: a model, also with other steps, a catalogue, data and free numbers.

    `unlisted`: free-form terms that the model knows. `in_one_run`: the effects as they are on in
    one run alone, by its name. `runs_on`: see `Hypotheses`.
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
    in_one_run: Mapping[str, Sequence[Candidate]] = field(default_factory=dict)
    runs_on: bool = True

    def hypotheses(self) -> Hypotheses:
        first = {c.name: {p.name: p.starts[0] for p in c.parameters} for c in self.base}
        residuals = Residuals(self.simulate, self.data, scaled_at=first, coarse=self.coarse)
        return Hypotheses(
            residuals, self.catalogue, self.base, self.jobs, self.progress, self.runs_on
        )


@dataclass(frozen=True)
class State:
    """State between two passes: the fitted sets, and the answer so far.

    `searched` and `widened`: the catalogue was searched for these data and this model, and with
    free-form terms. `drafted`: the answer with the free-form terms that stand beside it. `terms`:
    the free-form terms that do what a listed effect does, by the key of that. `stand_ins`: the
    effects that turned out to stand for something that nobody listed. `rival`: a set with free-form
    terms that does as well as the answer. `odd`: the run that alone disagrees, and `agreed` the set
    beside which the others agree. `trace`: what each pass did so far.
    """

    problem: Problem
    hypotheses: Hypotheses
    screening: Screening
    fit: Fit
    searched: bool = False
    widened: bool = False
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
    odd: OddRun | None = None
    agreed: Fit | None = None
    trace: tuple[Taken, ...] = ()

    @staticmethod
    def of(problem: Problem) -> State:
        hypotheses = problem.hypotheses()
        return State(problem, hypotheses, Screening(hypotheses), hypotheses.null)

    def begun(self, problem: Problem, notes: tuple[str, ...] | None = None) -> State:
        """The state at the beginning of another problem, with the notes and the trace so far."""
        kept = self.notes if notes is None else notes
        return replace(State.of(problem), notes=kept, trace=self.trace)

    def own(self) -> State:
        """A copy whose fitted sets may change, and these stay."""
        hypotheses = self.hypotheses.copy()
        return replace(self, hypotheses=hypotheses, screening=self.screening.on(hypotheses))

    def traced(self, name: str, before: State) -> State:
        """The state with an entry of the trace: the pass `name` led here from `before`."""
        reasons = [f"{r.name}: {r.reason}" for r in self.rejected if r not in before.rejected]
        reasons += [note for note in self.notes if note not in before.notes]
        if not reasons and self.fit.names != before.fit.names:
            reasons = [f"the lowest of {len(self.hypotheses.ranked())} fitted sets"]
        was, names = (tuple(sorted(state.fit.names)) for state in (before, self))
        taken = Taken(name, was, names, self.hypotheses.ebic(self.fit), "; ".join(reasons))
        return replace(self, trace=(*self.trace, taken))
