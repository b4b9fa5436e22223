"""Tasks of a sweep: small, pure, and named by all that their result depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from functools import cached_property
from importlib.metadata import version
from typing import Any, NamedTuple

from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.errors import DataError
from mopro.formula.written import toml_lines
from mopro.program.statements import as_json
from mopro.sweeps.drawn import Uncertain
from mopro.sweeps.figures import Figures, figures_of
from mopro.sweeps.targets import Value, Variant
from mopro.sweeps.varied import Varied

# A row of the table: the point, the task's name, the values, the figures.
Row = tuple[Any, ...]
_NAME_CHARACTERS = 24


class Task(NamedTuple):
    """One run: its number, its name, and a value for each that is varied or drawn."""

    point: int
    name: str
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Subject:
    """Program and machine of a sweep, and what is varied; with the version it decides the results.

    `uncertain`: numbers of the machine that are drawn at each point of what is varied.
    """

    base: Variant
    varied: tuple[Varied, ...]
    for_s: float | None = None
    uncertain: tuple[Uncertain, ...] = ()
    version: str = version("mopro")

    @property
    def all_varied(self) -> tuple[Varied, ...]:
        """Quantities that a task has a value of: those varied, then those drawn."""
        return (*self.varied, *(number.varied for number in self.uncertain))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the IR, the machine and the rest."""
        program, machine, payload_kg = self.base
        active = active_effects(machine, catalogue_of(machine))
        parts = (machine.axis, machine.drive, machine.platen, machine.heat)
        content = {
            "mopro": self.version,
            "ops": as_json(program)["ops"],
            "machine": [repr(part) for part in (*parts, machine.forcers, machine.limits)],
            "formulas": [toml_lines(effect) for effect in machine.formulas],
            "effects": [a.as_json() for a in active],
            "payload_kg": payload_kg,
            "for_s": self.for_s,
            "varied": [[each.name, each.unit] for each in self.all_varied],
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def tasks(self, points: Sequence[tuple[Value, ...]]) -> list[Task]:
        """The task of each of `points`."""
        start = hashlib.sha256(self.digest.encode())
        tasks = []
        for number, values in enumerate(points):
            name = start.copy()
            name.update("|".join(map(str, values)).encode())
            tasks.append(Task(number, name.hexdigest()[:_NAME_CHARACTERS], values))
        return tasks

    def variant(self, values: Sequence[Value]) -> Variant:
        """What the run of a point is done with."""
        variant = self.base
        for each, value in zip(self.all_varied, values, strict=True):
            variant = each.changed(variant, value)
        return variant

    def cells(self, row: Row) -> dict[str, Any]:
        """The cells of a row by their columns."""
        return dict(zip(self.columns, row, strict=True))

    @property
    def columns(self) -> list[str]:
        """The names of a row's cells."""
        return [
            "point", "task", *(each.column for each in self.all_varied),
            *(figure.name for figure in fields(Figures)),
        ]  # fmt: skip


@dataclass(frozen=True)
class Chunk:
    """Tasks that are done in one go; `compiled` as for the Emulator."""

    subject: Subject
    tasks: tuple[Task, ...]
    compiled: bool | None

    @property
    def name(self) -> str:
        names = "".join(task.name for task in self.tasks)
        return hashlib.sha256(names.encode()).hexdigest()[:_NAME_CHARACTERS]


def rows_of(chunk: Chunk) -> list[Row]:
    """The rows of a chunk; DataError where another version of mopro would work them out."""
    here = version("mopro")
    if chunk.subject.version != here:
        raise DataError(
            f"a worker has mopro {here}, and the sweep is by {chunk.subject.version}: install the "
            "same version everywhere",
            "other-version",
        )
    return [_row(chunk, task) for task in chunk.tasks]


def _row(chunk: Chunk, task: Task) -> Row:
    subject = chunk.subject
    figures = figures_of(subject.variant(task.values), subject.for_s, chunk.compiled)
    values = [value if isinstance(value, str) else float(value) for value in task.values]
    return (task.point, task.name, *values, *astuple(figures))
