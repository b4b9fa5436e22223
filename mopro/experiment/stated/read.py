"""The runs of an experiment on a stated machine: its entries, with their data."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.experiment.data_file import read_data
from mopro.experiment.repeated import first_of_each
from mopro.experiment.stated.entries import RunEntry, StatedEntries
from mopro.formula import Formula, FormulaError, factor_of
from mopro.formula.evaluate import Floats, evaluate
from mopro.formula.expressions import check_names
from mopro.machine import load_machine
from mopro.machine.run_effects import data_of
from mopro.plant import CommandTable, plan_with_effects
from mopro.program import AXES
from mopro.program.compile import compile_file
from mopro.stated.data import Reading, Run, Sensor, StatedExperiment
from mopro.stated.model import AXIS, THERMAL
from mopro.tomlfile import Value

_CONTROLLER = "chow1992"


def command_of(path: Path, time_s: Floats) -> Floats:
    """Commanded position (m) of axis 1 at `time_s`, as the controller of 1992 plans a program.

    Raises SourceError and MotionError for the program.
    """
    machine, first = load_machine(_CONTROLLER), AXES[0]
    active = active_effects(machine, catalogue_of(machine))
    schedule = plan_with_effects(compile_file(path, "attested"), machine, active)
    place_u = CommandTable(schedule.tracks[first]).position_u(np.maximum(time_s, 0.0))
    return machine.microstep_m * place_u


_COMMAND = "command"
_FEWEST_SAMPLES = 8


def read_stated_experiment(entries: StatedEntries) -> StatedExperiment:
    """The experiment with its data; DataFileError and ModelError."""
    units: dict[str, str] = {}
    runs, columns, notes = [], [], []
    for entry in entries.runs:
        for name, made in entry.inputs.items():
            if units.setdefault(name, made.unit) != made.unit:
                raise made.value.error(f"{name} is in {units[name]} in another run", "wrong-unit")
        run, own, said = _Data(entries, entry).run()
        runs.append(run)
        columns.append(own)
        notes += said
        if entry.program is not None:
            units.setdefault(_COMMAND, "m")
    kept, repeats = first_of_each(runs, _measured)
    return StatedExperiment(
        entries.source, entries.machine, tuple(runs[nth] for nth in kept), units,
        (*notes, *repeats), tuple(columns[nth] for nth in kept),
    )  # fmt: skip


def _measured(run: Run) -> Hashable:
    """All that a run tells: its readings, its inputs, and what is known of it beforehand."""
    readings = [(r.sensor.name, r.rows.tobytes(), r.values.tobytes()) for r in run.readings]
    inputs = [(name, values.tobytes()) for name, values in sorted(run.inputs.items())]
    known = (*sorted(run.start.items()), *sorted(run.without))
    return run.time_s.tobytes(), tuple(readings), tuple(inputs), known


class _Data:
    """The data of one run."""

    def __init__(self, entries: StatedEntries, entry: RunEntry) -> None:
        self._entries, self._entry = entries, entry
        self._notes: list[str] = []
        self._columns = {s.name: entry.columns.get(s.name, s.column) for s in entries.sensors}
        names = {entries.clock.column, *self._columns.values()}
        for made in entry.inputs.values():
            names |= made.formula.names
        names |= entry.use.formula.names if entry.use else frozenset()
        self._file = read_data(entry.data, str(entry.data), names)

    def run(self) -> tuple[Run, dict[str, Floats], list[str]]:
        entry, time_s = self._entry, self._time()
        last = self._until(time_s)
        time_s = time_s[:last]
        known = {name: values[:last] for name, values in self._file.columns.items()}
        inputs = {name: self._input(name, known, time_s) for name in entry.inputs}
        if entry.program is not None:
            inputs[_COMMAND] = command_of(entry.program, time_s)
        used = self._used(known, time_s)
        readings = [
            made for s in self._entries.sensors if (made := self._reading(s, known, used, time_s))
        ]
        if not readings:
            message = "the file has no column of any sensor"
            self._file.refuse_header(
                "missing-column", message, f"expected {', '.join(self._columns.values())}"
            )
        start = self._start(readings, time_s)
        if self._entries.machine.kind == AXIS and None in start.values():
            time_s, inputs, readings = _from_first(time_s, inputs, readings)
        held = frozenset(name for name, made in entry.inputs.items() if made.held)
        feedback = any(made.feedback for made in entry.inputs.values())
        run = Run(
            entry.name, time_s, inputs, held, tuple(readings), start, entry.without, feedback,
            {n: own.noise_rms * factor_of(own.unit) for n, own in entry.inputs.items()
             if own.noise_rms is not None},
            data_of(entry.data, entry.shown), self._headings(), entry.value,
        )  # fmt: skip
        return run, known, self._notes

    def _headings(self) -> dict[str, tuple[str, float]]:
        """The columns of time and of those inputs that are columns, with their units in SI."""
        clock = self._entries.clock
        inputs = {
            name: (made.formula.text, factor_of(made.unit))
            for name, made in self._entry.inputs.items()
            if made.formula.text in made.formula.names
        }
        return {"t": (clock.column, clock.factor), **inputs}

    def _time(self) -> Floats:
        clock, file = self._entries.clock, self._file
        stamps = file.require(clock.column)
        blank = np.flatnonzero(np.isnan(stamps))
        if len(blank):
            file.refuse("clock", "the row has no time", int(blank[0]), clock.column)
        wrong = np.flatnonzero(np.diff(stamps) <= 0)
        if len(wrong):
            row = int(wrong[0]) + 1
            hint = "mopro import sorts a log and drops stamps that come twice"
            message = f"the clock does not go on: {stamps[row]:.9g} after {stamps[row - 1]:.9g}"
            file.refuse("clock", message, row, clock.column, hint)
        time_s: Floats = stamps * clock.factor
        # A clock may begin anywhere, the run begins at 0: a program at the clock's.
        return time_s if self._entry.program is not None else time_s - time_s[0]

    def _until(self, time_s: Floats) -> int:
        """Number of rows up to the end of the part that is compared."""
        end = time_s[0] + self._entry.part[1] * (time_s[-1] - time_s[0])
        return int(np.searchsorted(time_s, end, side="right"))

    def _input(self, name: str, known: Mapping[str, Floats], time_s: Floats) -> Floats:
        made = self._entry.inputs[name]
        values = self._evaluated(made.formula, known, time_s, made.value)
        finite = np.isfinite(values)
        if not finite.any():
            raise made.value.error(f"{name} has no number in {self._entry.shown}", "empty-column")
        if not finite.all():
            missing = int(np.count_nonzero(~finite))
            self._notes.append(
                f"{self._entry.shown}: {missing} values of {name} are missing, and are taken from "
                "their neighbours"
            )
            if made.held:
                last = np.maximum.accumulate(np.where(finite, np.arange(len(values)), -1))
                values = values[np.where(last >= 0, last, np.argmax(finite))]
            else:
                values = np.interp(time_s, time_s[finite], values[finite])
        return np.ascontiguousarray(values * factor_of(made.unit))

    def _evaluated(
        self, formula: Formula, known: Mapping[str, Floats], time_s: Floats, value: Value
    ) -> Floats:
        missing = sorted(formula.names - known.keys() - {"t"})
        if missing and "column" in value.data if isinstance(value.data, dict) else False:
            self._file.require(missing[0])
        if missing:
            written = value["formula"] if isinstance(value.data, dict) else value
            names = [name for name in self._file.names if name.isidentifier()]
            try:
                check_names(formula, {*names, "t"})
            except FormulaError as error:
                raise written.error_inside(
                    str(error), error.start, error.end, "unknown-name"
                ) from error
        if formula.text in known and formula.text in formula.names:
            return known[formula.text]
        return evaluate(formula, {"t": time_s, **known}, time_s)

    def _used(self, known: Mapping[str, Floats], time_s: Floats) -> Floats:
        """True for each row that is compared."""
        entry = self._entry
        begin = time_s[0] + entry.part[0] * (time_s[-1] - time_s[0]) / entry.part[1]
        used = time_s >= begin
        if entry.use is not None and entry.use.value is not None:
            used &= (
                np.nan_to_num(self._evaluated(entry.use.formula, known, time_s, entry.use.value))
                != 0
            )
        if not used.any():
            raise entry.value.error(f"no row of {entry.shown} is used", "empty-file")
        return np.asarray(used, dtype=float)

    def _reading(
        self, sensor: Sensor, known: Mapping[str, Floats], used: Floats, time_s: Floats
    ) -> Reading | None:
        column = self._columns[sensor.name]
        if column not in known:
            if len(self._entries.sensors) == 1 or sensor.name in self._entry.columns:
                self._file.require(column)
            self._notes.append(f"{self._entry.shown}: has no column {column} of {sensor.name}")
            return None
        rows = np.flatnonzero(np.isfinite(known[column]) & (used != 0))
        if len(rows) < _FEWEST_SAMPLES:
            message = f"{column} has {len(rows)} samples, expected {_FEWEST_SAMPLES} at least"
            self._file.refuse_header("empty-column", message)
        values = known[column][rows] - (sensor.zero or 0.0)
        if not np.ptp(values) and not sensor.step:
            message = f"{column} is {values[0]:g} in all rows: it tells nothing"
            hint = "state adc_step if that is the step of its converter"
            self._file.refuse_header("empty-column", message, hint)
        self._file.check_noise(column, sensor.noise_rms)
        return Reading(sensor, rows, values)

    def _start(self, readings: list[Reading], time_s: Floats) -> dict[str, float | None]:
        machine, stated = self._entries.machine, self._entry.start
        if machine.kind == AXIS:
            placed = any(r.sensor.quantity.tells_place for r in readings)
            moving = placed or any(r.sensor.quantity.tells_speed for r in readings)
            default_x, default_v = None if placed else 0.0, None if moving else 0.0
            found = {"x": default_x, "v": default_v}
            return found | {n: None if v is None else v * machine.factor for n, v in stated.items()}
        if machine.kind == THERMAL:
            return {**self._first_temperatures(readings), **stated}
        return {}

    def _first_temperatures(self, readings: list[Reading]) -> dict[str, float | None]:
        """The start of each node that a sensor reads: free, as the first reading has its noise.

        With a free zero it is the first reading, where the surroundings are as warm as the nodes
        are then: the zero and the start are one number.
        """
        found: dict[str, float | None] = {}
        for node in self._entries.machine.nodes:
            own = [r for r in readings if node in r.sensor.reads.formula.names]
            if own:
                sensor = own[0].sensor
                free = sensor.zero is not None or "ambient" in self._entry.inputs
                found[node] = None if free else own[0].first
        return found or dict.fromkeys(self._entries.machine.nodes, readings[0].first)


def _from_first(
    time_s: Floats, inputs: Mapping[str, Floats], readings: list[Reading]
) -> tuple[Floats, dict[str, Floats], list[Reading]]:
    """The rows from the first that is compared: where a start is free, it is there."""
    first = min(int(r.rows[0]) for r in readings)
    moved = [replace(r, rows=r.rows - first) for r in readings]
    cut = {name: np.ascontiguousarray(own[first:]) for name, own in inputs.items()}
    return time_s[first:], cut, moved
