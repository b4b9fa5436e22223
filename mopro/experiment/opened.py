"""An experiment from its file: the one place where its kind of machine decides who reads it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from mopro.errors import Diagnostic, ModelError
from mopro.experiment.carried import Carried, carried
from mopro.experiment.comparison import Comparison, compare
from mopro.experiment.conclusion import Conclusion, conclude
from mopro.experiment.kept_rows import KeptRows, kept_rows
from mopro.experiment.sawyer.entries import SawyerEntries, read_sawyer
from mopro.experiment.sawyer.system import Sawyer, loaded
from mopro.experiment.stated.entries import StatedEntries, read_stated_entries
from mopro.experiment.stated.system import stated_system
from mopro.experiment.system import System
from mopro.inputs import no_file
from mopro.machine import load_machine
from mopro.source import Source, Span
from mopro.stated.file import kind_of
from mopro.stated.model import KINDS
from mopro.tomlfile import Document, read_source

Progress = Callable[[str], None]


def quiet(step: str) -> None:
    """No report of the progress."""


@dataclass(frozen=True)
class Opened:
    """An experiment, read and checked: a machine of any kind with its runs.

    `rows`: the ledger of the log's rows; None if no import wrote the experiment.
    """

    system: System
    rows: KeptRows | None = None

    @property
    def machine_name(self) -> str:
        """The machine's name."""
        return self.system.name

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the data."""
        return (*(() if self.rows is None else self.rows.notes), *self.system.notes)

    @property
    def effects(self) -> frozenset[str]:
        """The names of the effects that are candidates."""
        return self.system.effects

    def compare(self, seed: int = 0) -> Comparison:
        """Compare the data with the machine's model."""
        return compare(self.system, seed)

    def carried(self) -> tuple[Carried, ...]:
        """Each number of the machine file's effects, and as these data have it."""
        return carried(self.system)

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
        return conclude(self.system, jobs, progress, left_out, with_drafts)


@dataclass(frozen=True)
class ExperimentFile:
    """An experiment's file, parsed once; its data are read when it is opened."""

    document: Document

    @cached_property
    def entries(self) -> SawyerEntries | StatedEntries:
        """The entries of the file, as the reader of its machine's kind gives them; ModelError."""
        return read_stated_entries(self.document) if self._of_stated else read_sawyer(self.document)

    @property
    def files(self) -> list[Path]:
        """Every file that the experiment reads; ModelError."""
        return self.entries.files

    def opened(self, applied: str | None = None, allow_python: bool = False) -> Opened:
        """The experiment on its machine, or on `applied` if one is given.

        Raises ModelError, SourceError, MotionError and DataError.
        """
        if isinstance(self.entries, SawyerEntries):
            machine = None if applied is None else load_machine(applied)
            return Opened(Sawyer(loaded(self.entries, machine)), self._rows)
        return Opened(stated_system(self._on(applied), allow_python), self._rows)

    def before(self, applied: str, allow_python: bool = False) -> Opened:
        """The experiment on the machine that `applied` was before effects were found in it.

        A motor's is that of the experiment; see `opened` for the errors.
        """
        if isinstance(self.entries, SawyerEntries):
            return self.opened()
        own, entries = self.entries.machine, self._on(applied)
        machine = entries.machine.without_effects(own.active.keys())
        return Opened(stated_system(replace(entries, machine=machine), allow_python), self._rows)

    @property
    def _of_stated(self) -> bool:
        machine = self.document.root.data.get("machine")
        if not isinstance(machine, str):
            return False
        file = Path(self.document.source.name).parent / machine
        return machine in KINDS or (no_file(file, machine) is None and kind_of(file) is not None)

    @cached_property
    def _rows(self) -> KeptRows | None:
        return self.document.root.get("rows", kept_rows, None)

    def _on(self, applied: str | None) -> StatedEntries:
        """The entries on another machine of the same kind; ModelError."""
        assert isinstance(self.entries, StatedEntries), "a machine is of one kind"
        if applied is None:
            return self.entries
        entries = read_stated_entries(self.document, applied)
        if entries.machine.kind != self.entries.machine.kind:
            kinds = f"{entries.machine.kind}, and the experiment of {self.entries.machine.kind}"
            raise _wrong_kind(entries.machine.source, f"{applied} is of kind {kinds}")
        return entries


def experiment_file(path: str | Path) -> ExperimentFile:
    """The experiment's file at `path`; ModelError."""
    return ExperimentFile(Document(read_source(path)))


def open_experiment(
    path: str | Path, applied: str | None = None, allow_python: bool = False
) -> Opened:
    """The experiment in file `path`, on the machine `applied` if one is given.

    Raises ModelError, SourceError, MotionError and DataError.
    """
    return experiment_file(path).opened(applied, allow_python)


def _wrong_kind(source: Source, message: str) -> ModelError:
    return ModelError(source, [Diagnostic("wrong-kind", message, Span(1, 1, 1))])
