"""A system: a machine of any kind with the runs that were measured on it.

A comparison, a diagnosis and a conclusion see a `System` alone. A new kind of machine is one class
with these methods, and a line in `opened`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from mopro.engine.candidate import Candidate, Parameter
from mopro.engine.series import Floats, Series, Simulate
from mopro.engine.verdict import Verdict
from mopro.errors import DataError
from mopro.formula.written import WrittenEffect
from mopro.source import Source


@dataclass(frozen=True)
class Spot:
    """Samples of a series that are judged together: their `rows`, and where in the run they are.

    `line`: of the program, or the row of a table; 0 where there is none. `axis`: None where the
    quantity is of none. `direction`: the sign of the motion, 0 without one.
    """

    rows: NDArray[np.intp]
    phase: str
    line: int = 0
    axis: int | None = None
    direction: int = 0


@dataclass(frozen=True)
class Predicted:
    """A series beside its prediction, as a comparison judges it.

    `values` (n,): as the model predicts the series, in its unit. `spots`: those of a series, of the
    samples that count. `aligned`: a residual of a series
    without what is fitted to each run, such as an offset. `scaled`: a residual in standard
    deviations of the noise, in its unit where that is unknown.
    """

    series: Series
    values: Floats
    spots: Callable[[Series], Iterable[Spot]]
    aligned: Callable[[Series, Floats], Floats]
    scaled: Callable[[Floats], Floats]

    @property
    def residual(self) -> Floats:
        """Measured less predicted (n,), aligned."""
        return self.aligned(self.series, self.series.values - self.values)


@dataclass(frozen=True)
class Question:
    """The arguments of `mopro.engine.reconcile` for one system, by their names there.

    `simulate` predicts the series of `data`.
    """

    simulate: Simulate
    effects: Sequence[Candidate]
    data: Sequence[Series]
    unlisted: Sequence[Candidate] = ()
    base: Sequence[Parameter] = ()
    in_one_run: Mapping[str, Sequence[Candidate]] = field(default_factory=dict)
    finer: Simulate | None = None
    coarse: Simulate | None = None
    runs_on: bool = True


@dataclass(frozen=True)
class Repaired:
    """A machine file with what was fitted, and the experiment simulated again from it.

    `of_runs`: its effects that belong to the runs of this experiment. `rms`: the RMS residual of
    each series, in its unit, None where the file cannot be read. `fault`: why it must not be
    written: it does not predict what the verdict says.
    """

    text: str
    of_runs: tuple[str, ...]
    rms: tuple[float | None, ...]
    fault: DataError | None = None


@dataclass(frozen=True)
class Proposal:
    """A program to run, or a command to play, and by how many σ it separates a family's effects.

    `text`: of a file that ends in `suffix`. `payload_kg`: of a program. `separations` are those of
    each alternative from the named effect, `pairs` those of every two of the family, as any of them
    may be the true one. `partings`: in words, what tells an alternative from the effect best.
    """

    text: str
    summary: str
    payload_kg: float | None
    separations: dict[str, float]
    pairs: dict[tuple[str, str], float]
    suffix: str = ".CMD"
    partings: Mapping[tuple[str, str], str] = field(default_factory=dict)


class _Named(Protocol):
    @property
    def name(self) -> str: ...


class _Experiment(Protocol):
    @property
    def machine(self) -> _Named: ...

    @property
    def trials(self) -> Sequence[_Named]: ...

    @property
    def source(self) -> Source: ...

    @property
    def notes(self) -> tuple[str, ...]: ...


class System(ABC):
    """A machine with the runs that were measured on it, read and checked."""

    if TYPE_CHECKING:  # a dataclass would take a property for the default of its field

        @property
        def experiment(self) -> _Experiment:
            """The experiment's file, machine, runs that have time series, and notes."""

        @property
        def series(self) -> Sequence[Series]:
            """The readings, in the order of the predictions."""

    @property
    def name(self) -> str:
        """The machine's name."""
        return self.experiment.machine.name

    @property
    def source(self) -> Source:
        """The experiment's file."""
        return self.experiment.source

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the data that are no errors."""
        return self.experiment.notes

    @property
    def runs(self) -> tuple[str, ...]:
        """The names of the runs that have time series."""
        return tuple(run.name for run in self.experiment.trials)

    @property
    @abstractmethod
    def effects(self) -> frozenset[str]:
        """The names that effects may be left out by."""

    @property
    @abstractmethod
    def terms(self) -> Mapping[str, WrittenEffect]:
        """The free-form terms that a machine file can state as formulas, by name."""

    @property
    @abstractmethod
    def program(self) -> Path | None:
        """The file of a model that is a program; None for any other."""

    @property
    @abstractmethod
    def filed(self) -> Mapping[str, Mapping[str, float]]:
        """The effects that the machine's file has on in these runs, with their parameters."""

    @abstractmethod
    def predicted(self, generator: np.random.Generator) -> Iterable[Predicted]:
        """Each series as the machine's file has it, its free numbers fitted without effects.

        `generator` draws the position of a reading within a coarse converter's step.
        """

    @abstractmethod
    def question(self, left_out: Collection[str]) -> Question:
        """The arguments of a diagnosis without the effects in `left_out`."""

    @abstractmethod
    def tried(self, left_out: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The names of the effects that are candidates without `left_out`, and of those left out.

        The latter would be candidates without that.
        """

    @abstractmethod
    def judged(
        self, asked: Callable[[System], Verdict], left_out: Collection[str]
    ) -> tuple[System, Verdict]:
        """The verdict that `asked` gives, and the variant of this system that it is of.

        Of several variants, such as one with the microsteps of its drive, the one that the data
        call for.
        """

    @abstractmethod
    def beside(self, stated: Source) -> System:
        """This system with the effects of a text of `[[effect]]` sections; ModelError."""

    @abstractmethod
    def repaired(self, verdict: Verdict) -> Repaired:
        """The machine's file with what the verdict names; ModelError."""

    @abstractmethod
    def next_experiment(self, verdict: Verdict) -> Proposal | None:
        """The run that best tells the alternatives of the verdict apart; None without any."""

    @abstractmethod
    def advice(self, verdict: Verdict) -> str:
        """Advice on an ambiguous verdict, where no next experiment is proposed."""
