"""Conclusion of a diagnosis: machine file, gap with it, places and the next experiment."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from mopro import markup
from mopro.effects import catalogue_of
from mopro.effects.unlisted import written_terms
from mopro.engine.residuals import Residuals, without_wild
from mopro.engine.series import Floats, Series
from mopro.engine.verdict import Verdict, rms
from mopro.errors import DataError
from mopro.experiment.compare.comparison import Place, compare
from mopro.experiment.conclude.drafts import filed
from mopro.experiment.conclude.machine_file import machine_text, machine_with, of_runs, quoted
from mopro.experiment.conclude.wording import (
    advice,
    file_words,
    reservations,
    unconfirmed_words,
)
from mopro.experiment.sawyer.diagnosis import Model, diagnose
from mopro.experiment.sawyer.experiment_design import Proposal, propose
from mopro.experiment.sawyer.model import Experiment
from mopro.machine.formulas import read_formulas
from mopro.source import Source
from mopro.tomlfile import Document

_MOST_PLACES = 40
# Of the generator that draws the position of a reading within a coarse converter's step.
_SEED = 0


class _Named(Protocol):
    @property
    def name(self) -> str:
        """The name of a machine or a run."""
        ...


class Examined(Protocol):
    """An experiment of any kind of machine, as far as a conclusion tells of it."""

    @property
    def source(self) -> Source:
        """The experiment's file."""
        ...

    @property
    def machine(self) -> _Named:
        """Its machine."""
        ...

    @property
    def trials(self) -> Sequence[_Named]:
        """Its runs that have time series."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on its data."""
        ...


@dataclass(frozen=True)
class Conclusion:
    """A verdict and what follows from it.

    `rerun_rms` is the RMS residual of each series, in its unit, when the experiment is
    simulated again on the machine that `machine_text` describes, None where that cannot be read.
    `machine_fault`: why that text must not be written. `of_runs`: the effects in it that belong to
    the runs of this experiment. `left_out` are the effects that were no candidates, `tried` those
    that were.
    `program`: the model, if the machine is a program. `filed`: the verdict as the file has it, if
    it has drafts.
    `advice`: what else to do if the verdict is ambiguous and no next experiment is proposed.
    """

    experiment: Examined
    series: tuple[Series, ...]
    verdict: Verdict
    where: tuple[Place, ...]
    machine_text: str
    rerun_rms: tuple[float | None, ...]
    next_experiment: Proposal | None
    advice: str
    machine_fault: DataError | None = None
    of_runs: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    tried: tuple[str, ...] = ()
    program: Path | None = None
    filed: Verdict | None = None

    def text_in(self, folder: Path) -> str:
        """The machine's file for a folder: it finds a model that is a program from there."""
        if self.program is None:
            return self.machine_text
        stated = Document(Source("", self.machine_text)).root["python"]
        found = os.path.relpath(self.program.resolve(), folder.resolve())
        named = f"{Path(found).as_posix()}:{stated.data.rpartition(':')[2]}"
        lines, row = self.machine_text.split("\n"), stated.span.line - 1
        # The span is that of the key.
        lines[row] = lines[row].replace(stated.data, quoted(named)[1:-1], 1)
        return "\n".join(lines)

    @property
    def runs(self) -> tuple[str, ...]:
        """The names of the runs that have time series."""
        return tuple(trial.name for trial in self.experiment.trials)

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
        yield from reservations(self.verdict, self.runs)
        yield from file_words(self.filed or self.verdict, self.of_runs, self.rerun_rms, self.series)
        if self.filed is not None:
            yield from unconfirmed_words(self.verdict, self.filed)

    def as_json(self) -> dict[str, Any]:
        answer = self.verdict.as_json()
        answer["left_out"] = list(self.left_out)
        answer["where"] = [asdict(place) for place in self.where]
        answer["reservations"] = list(self.reservations())
        answer["gap"]["runs"] = [
            {**run, "rerun_rms": rerun}
            for run, rerun in zip(answer["gap"]["runs"], self.rerun_rms, strict=True)
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
    experiment: Experiment,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda _: None,
    left_out: Collection[str] = (),
    with_drafts: bool = False,
) -> Conclusion:
    """Diagnose `experiment`, without the effects in `left_out`, and derive what follows.

    The machine file has those drafts as well that it can state as formulas if `with_drafts`.
    Raises MotionError, ModelError.
    """
    progress("comparing")
    places = compare(experiment, np.random.default_rng(_SEED)).where
    diagnosis = diagnose(experiment, jobs, progress, left_out)
    verdict, series = diagnosis.verdict, diagnosis.series
    progress("simulating the experiment again with the effects found")
    stated, found = drafted(experiment, verdict) if with_drafts else (experiment, verdict)
    machine = machine_with(stated, found)
    again = Model(replace(diagnosis.experiment, machine=machine), resolved=diagnosis.resolved)
    rerun = Residuals(again, series).calibrated_at({}).of_exact_sensors({})
    proposal = None
    # No program tells what was in a run that is over.
    if verdict.verdict == "ambiguous" and not any(effect.run for effect in verdict.effects):
        progress("designing an experiment that distinguishes the alternatives")
        proposal = propose(experiment, verdict)
    return Conclusion(
        experiment=experiment,
        series=series,
        verdict=verdict,
        where=tuple(place for place in places if place.significant)[:_MOST_PLACES],
        machine_text=machine_text(stated, found),
        of_runs=tuple(of_runs(stated, found)),
        rerun_rms=tuple(_rms(s, own) for s, own in zip(series, rerun, strict=True)),
        next_experiment=proposal,
        advice=advice(verdict),
        left_out=tuple(sorted(left_out)),
        tried=tuple(name for name in catalogue_of(experiment.machine) if name not in left_out),
        filed=None if found is verdict else found,
    )


def drafted(experiment: Experiment, verdict: Verdict) -> tuple[Experiment, Verdict]:
    """The experiment and the verdict with those drafts that a motor's file can state as formulas.

    They are forces of the place and the speed in which nothing but their size was fitted.
    """
    found = filed(verdict, written_terms())
    if found is None:
        return experiment, verdict
    text, wider = found
    machine = experiment.machine.beside(Document(text).read(read_formulas))
    return replace(experiment, machine=machine), wider


def _rms(series: Series, residual: Floats) -> float:
    """RMS of a residual (in the unit of the series) without its offset and wild samples."""
    counting, _ = without_wild(series, series.without_nuisances(residual))
    return rms(counting.without_nuisances(residual)[counting.counted])


def _strict(value: Any) -> Any:
    """`value` with NaN and infinities replaced by None, as JSON has neither."""
    if isinstance(value, dict):
        return {key: _strict(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
