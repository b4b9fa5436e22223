"""A sweep as a whole: from what is varied to the table of its results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from mopro.emulator import Emulator
from mopro.errors import DataError, MoproError
from mopro.machine import Machine, load_machine
from mopro.plant import MAX_STEP_S, compiling_pays
from mopro.program import Program
from mopro.sweeps.designs import GRID, Design
from mopro.sweeps.drawn import Draws, uncertain
from mopro.sweeps.executors import Executor, by_scheduler, local
from mopro.sweeps.figures import SETTLE_S
from mopro.sweeps.results import (
    SUFFIXES,
    journal,
    read_table,
    schema_of,
    table_of,
    write_table,
)
from mopro.sweeps.summary import COLUMNS, name_of, summary
from mopro.sweeps.targets import Value, Variant, VaryError
from mopro.sweeps.tasks import Chunk, Row, Subject, Task, rows_of
from mopro.sweeps.varied import MOST_POINTS, all_varied

if TYPE_CHECKING:
    import pyarrow as pa

# Runs in a chunk: few enough for all workers to have some, and to lose little with one.
_MOST_IN_CHUNK = 64
_LEAST_CHUNKS = 64

T = TypeVar("T")
Vary = Mapping[str, str | Sequence[object]]
# Told how many runs are done by now, and how many there are to do.
Told = Callable[[int, int], None]


def _nobody(done: int, total: int) -> None:
    """Tells nobody."""


@dataclass(frozen=True)
class Sweep:
    """Runs of one subject at the points of a design; no more than that has been worked out.

    With `draws`, the runs of a point are on the machine as stated and on each one drawn.
    """

    subject: Subject
    design: Design
    draws: Draws | None = None

    @classmethod
    def of(
        cls,
        base: Variant,
        vary: Iterable[tuple[str, str | Sequence[object]]],
        design: Design,
        for_s: float | None = None,
        draws: Draws | None = None,
    ) -> Sweep:
        """Raises VaryError for what cannot be varied, and for no points or too many.

        DataError where there is nothing to draw.
        """
        varied = all_varied(vary, base.program, base.machine)
        numbers = () if draws is None else uncertain(base, varied)
        made = cls(Subject(base, varied, for_s, numbers), design, draws)
        _ = made.tasks
        return made

    @cached_property
    def tasks(self) -> list[Task]:
        """The tasks of each point, in their order."""
        points, machines = self.design.points(self.subject.varied), self._machines
        if (runs := len(points) * len(machines)) > MOST_POINTS:
            raise VaryError(
                f"{len(points)} points with {len(machines)} machines are {runs} runs: expected at "
                f"most {MOST_POINTS}; take fewer of either"
            )
        return self.subject.tasks([(*point, *own) for point in points for own in machines])

    @cached_property
    def _machines(self) -> list[tuple[Value, ...]]:
        return [()] if self.draws is None else self.draws.machines(self.subject.uncertain)

    def _of_points(self, runs: Sequence[T]) -> Iterator[Sequence[T]]:
        """The runs of each point, of those of all."""
        size = len(self._machines)
        return (runs[first : first + size] for first in range(0, len(runs), size))

    @property
    def _names(self) -> list[str]:
        """The name of each point's row."""
        names = [task.name for task in self.tasks]
        if self.draws is None:
            return names
        return [name_of(own, self.draws) for own in self._of_points(names)]

    def _table(self, rows: Mapping[int, Row]) -> pa.Table:
        cells = [self.subject.cells(rows[task.point]) for task in self.tasks]
        if self.draws is None:
            return table_of(self._schema, cells)
        several = enumerate(self._of_points(cells))
        summaries = [{**summary(own, self.draws), "point": n} for n, own in several]
        return table_of(self._schema, summaries)

    @property
    def _schema(self) -> pa.Schema:
        return schema_of(self.subject.varied, {} if self.draws is None else COLUMNS)

    def run(
        self, executor: Executor, jobs: int = 1, out: Path | None = None, told: Told = _nobody
    ) -> pa.Table:
        """The table of the results, which is also written to `out`.

        Rows that an earlier run left beside `out` are not worked out again; `jobs` tells in how
        many processes the executor works. Raises DataError for a file of something else, and
        where it cannot be written.
        """
        known = None if out is None else read_table(out, self._schema, self._names)
        if known is not None:
            return known
        with journal(out, self.subject, self.tasks) as kept:
            to_do = [task for task in self.tasks if task.point not in kept.rows]
            before = len(kept.rows)
            chunks = self._chunks(to_do, jobs)
            try:
                for rows in executor(rows_of, chunks) if to_do else ():
                    kept.add(rows)
                    told(len(kept.rows) - before, len(to_do))
            except (KeyboardInterrupt, DataError) as error:
                if out is not None and kept.rows:
                    error.add_note(
                        f"{len(kept.rows)} of {len(self.tasks)} runs are done and kept: the same "
                        "command goes on from there"
                    )
                raise
            table = self._table(kept.rows)
            if out is not None:
                write_table(out, table)
        return table

    def _chunks(self, tasks: Sequence[Task], jobs: int) -> Iterator[Chunk]:
        size = min(max(len(tasks) // (_LEAST_CHUNKS * jobs), 1), _MOST_IN_CHUNK)
        compiled = True if self._compiling_pays(len(tasks) / jobs) else None
        waiting = iter(tasks)
        while several := tuple(islice(waiting, size)):
            yield Chunk(self.subject, several, compiled)

    def _compiling_pays(self, runs: float) -> bool:
        """True if so many runs together, in one process, save more than compiling takes."""
        program, machine, payload_kg = self.subject.base
        emulator = Emulator(machine, payload_kg)
        try:
            simulation, _ = emulator.prepared(program, self.subject.for_s, SETTLE_S)
        except MoproError:
            return False
        one_step_s = MAX_STEP_S / max(runs, 1.0)
        return compiling_pays(simulation.schedule, one_step_s, bool(emulator.active))


def sweep(
    program: Program,
    machine: str | Machine = "chow1992",
    *,
    vary: Vary,
    design: str = GRID,
    points: int | None = None,
    seed: int = 0,
    draws: int | None = None,
    band: float = 0.9,
    payload_kg: float = 0.0,
    for_s: float | None = None,
    out: str | Path | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
) -> pa.Table:
    """Run `program` at all points of a design; a row a run, as a pyarrow table.

    `vary` names what is varied, with its values as text (`{"VEL1": "10:60:2"}`, as for
    `mopro sweep`) or as a sequence. `machine`, `payload_kg` and `for_s` are those of `emulate`;
    `points` belongs to the designs `random` and `sobol`, for which `seed` draws as it does for
    `draws`: so many machines at each point, from the intervals of the machine file. A row then has
    their stalls and the central `band` of their figures (see `sweeps.summary`). With `out`
    (.parquet or .csv) the rows are kept as they come, and a call that was interrupted goes on.
    `jobs` processes work, or the workers of a Dask `scheduler`. The columns are those of `Figures`,
    after the varied ones. Raises VaryError, ModelError and DataError.
    """
    if not isinstance(program, Program):
        raise TypeError(
            f"sweep expects a Program, not {type(program).__name__}: mopro.compile(text) makes "
            "one of a text, mopro.compile_file(path) one of a file"
        )
    path = None if out is None else Path(out)
    if path is not None and path.suffix.lower() not in SUFFIXES:
        raise DataError(f"{path}: expected one of {', '.join(SUFFIXES)}", "unknown-format")
    loaded = load_machine(machine) if isinstance(machine, str) else machine
    base = Variant(program, loaded, payload_kg)
    drawn = None if draws is None else Draws(draws, seed, band)
    made = Sweep.of(base, vary.items(), Design(design, points, seed), for_s, drawn)
    executor = local(jobs) if scheduler is None else by_scheduler(scheduler)
    return made.run(executor, jobs, path)
