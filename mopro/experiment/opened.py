"""The one place where an experiment's kind of machine decides who reads and judges it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from mopro.effects import catalogue_of
from mopro.errors import Diagnostic, ModelError
from mopro.experiment.compare.comparison import Comparison, compare
from mopro.experiment.conclude.conclusion import Conclusion, Examined, conclude
from mopro.experiment.read.rows import KeptRows, rows_of
from mopro.experiment.sawyer.file import read_entries
from mopro.experiment.sawyer.load import load_experiment
from mopro.experiment.sawyer.model import Experiment
from mopro.experiment.stated import compare as rig_compare
from mopro.experiment.stated import conclude as rig_conclude
from mopro.experiment.stated.entries import StatedEntries, read_stated_entries
from mopro.experiment.stated.study import Study, study
from mopro.inputs import no_file
from mopro.machine import load_machine
from mopro.source import Span
from mopro.stated.file import kind_of
from mopro.stated.model import KINDS
from mopro.tomlfile import Document, read_source

Progress = Callable[[str], None]


def quiet(step: str) -> None:
    """No report of the progress."""


class Opened(Protocol):
    """An experiment of any kind of machine, read and checked."""

    @property
    def machine_name(self) -> str:
        """The machine's name."""
        ...

    @property
    def examined(self) -> Examined:
        """The experiment itself."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the data."""
        ...

    @property
    def rows(self) -> KeptRows | None:
        """The ledger of the log's rows; None if no import wrote the experiment."""
        ...

    @property
    def effects(self) -> frozenset[str]:
        """The names of the effects that are candidates."""
        ...

    def compare(self, seed: int = 0) -> Comparison:
        """Compare the data with the machine's model."""
        ...

    def conclude(
        self,
        jobs: int = 1,
        progress: Progress = quiet,
        left_out: Collection[str] = (),
        with_drafts: bool = False,
    ) -> Conclusion:
        """Find what the model lacks, without the effects in `left_out`.

        The machine file has drafts inside the model as well if `with_drafts`.
        """
        ...


@dataclass(frozen=True)
class OfTheMotor:
    """An experiment on a Sawyer motor."""

    experiment: Experiment
    rows: KeptRows | None = None

    @property
    def machine_name(self) -> str:
        return self.experiment.machine.name

    @property
    def examined(self) -> Examined:
        return self.experiment

    @property
    def notes(self) -> tuple[str, ...]:
        return (*_rows_notes(self.rows), *self.experiment.notes)

    @property
    def effects(self) -> frozenset[str]:
        return frozenset(catalogue_of(self.experiment.machine))

    def compare(self, seed: int = 0) -> Comparison:
        return compare(self.experiment, np.random.default_rng(seed))

    def conclude(
        self,
        jobs: int = 1,
        progress: Progress = quiet,
        left_out: Collection[str] = (),
        with_drafts: bool = False,
    ) -> Conclusion:
        return conclude(self.experiment, jobs, progress, left_out, with_drafts)


@dataclass(frozen=True)
class OfStated:
    """An experiment on a machine of another kind."""

    study: Study
    rows: KeptRows | None = None

    @property
    def machine_name(self) -> str:
        return self.study.experiment.machine.name

    @property
    def examined(self) -> Examined:
        return self.study.experiment

    @property
    def notes(self) -> tuple[str, ...]:
        return (*_rows_notes(self.rows), *self.study.experiment.notes)

    @property
    def effects(self) -> frozenset[str]:
        return rig_conclude.names(self.study)

    def compare(self, seed: int = 0) -> Comparison:
        return rig_compare.compare(self.study)

    def conclude(
        self,
        jobs: int = 1,
        progress: Progress = quiet,
        left_out: Collection[str] = (),
        with_drafts: bool = False,
    ) -> Conclusion:
        return rig_conclude.conclude(self.study, jobs, progress, left_out, with_drafts)


def _rows_notes(rows: KeptRows | None) -> tuple[str, ...]:
    return () if rows is None else rows.notes


def is_rig(path: str | Path) -> bool:
    """True if the experiment of file `path` is on a machine of another kind; ModelError."""
    machine = Document(read_source(path)).root.data.get("machine")
    if not isinstance(machine, str):
        return False
    file = Path(path).parent / machine
    return machine in KINDS or (no_file(file, machine) is None and kind_of(file) is not None)


def files_of(path: str | Path) -> list[Path]:
    """Every file that an experiment reads; ModelError."""
    return read_stated_entries(path).files if is_rig(path) else read_entries(path).files


def open_before(path: str | Path, applied: str, allow_python: bool = False) -> Opened:
    """The experiment on the machine that `applied` was before effects were found in it.

    A motor's is that of the experiment; see open_experiment for the errors.
    """
    if not is_rig(path):
        return open_experiment(path)
    own, entries = read_stated_entries(path).machine, _entries(path, applied)
    machine = entries.machine.without_effects(own.active.keys())
    return OfStated(study(replace(entries, machine=machine), allow_python), rows_of(path))


def open_experiment(
    path: str | Path, applied: str | None = None, allow_python: bool = False
) -> Opened:
    """The experiment in file `path`, on the machine `applied` if one is given.

    Raises ModelError, SourceError, MotionError and DataError.
    """
    rows = rows_of(path)
    if is_rig(path):
        return OfStated(study(_entries(path, applied), allow_python), rows)
    machine = None if applied is None else load_machine(applied)
    return OfTheMotor(load_experiment(path, machine), rows)


def _entries(path: str | Path, applied: str | None) -> StatedEntries:
    entries = read_stated_entries(path, applied)
    if applied is not None:
        stated = read_stated_entries(path).machine.kind
        if entries.machine.kind != stated:
            message = f"{applied} is of kind {entries.machine.kind}, and the experiment of {stated}"
            raise ModelError(entries.machine.source, [_kind_fault(message)])
    return entries


def _kind_fault(message: str) -> Diagnostic:
    return Diagnostic("wrong-kind", message, Span(1, 1, 1))
