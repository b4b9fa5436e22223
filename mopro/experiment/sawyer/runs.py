"""The runs of an experiment file: their programs, logged commands, tables and data."""

from __future__ import annotations

import re
from collections.abc import Hashable
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from mopro.errors import render_all
from mopro.experiment.data_file import TIME, DataFile, other_unit, read_data, refused
from mopro.experiment.repeated import first_of_each
from mopro.experiment.sawyer.entries import RunEntry, SawyerEntries, SensorEntry
from mopro.experiment.sawyer.raw import KINDS, RAW_KINDS, RAW_SUFFIX
from mopro.experiment.sawyer.readings import clock, reading
from mopro.experiment.sawyer.trials import (
    Experiment,
    Floats,
    LoggedCommand,
    Reading,
    SteadyTable,
    Trial,
)
from mopro.instruments.sensor import Sensor
from mopro.machine.run_effects import data_of
from mopro.program import AXES, Program
from mopro.program.compile import compile_file
from mopro.units import INCH_M, UNITS

_INCH = float(INCH_M)
# column of a steady-state table -> its unit in SI
_TABLE = {
    "velocity_in_s": _INCH,
    "acceleration_in_s2": _INCH,
    "x_in": _INCH,
    "y_in": _INCH,
    "temperature_rise_C": 1.0,
}
_NAME_CUTOFF = 0.8
_OTHERS = re.compile(
    r"(command|position|velocity|phase_[ab]|force|voltage_[ab])_[12]_\w+|temperature_C|line|\w+_rad"
)


def read_runs(entries: SawyerEntries) -> Experiment:
    """The experiment, with all the data that its file names.

    Raises SourceError for a program, DataError for data. The data are not checked against their
    programs; `loaded` does that.
    """
    reader = _Runs(entries)
    trials = [reader.trial(run) for run in entries.runs if run.form != "table"]
    tables = tuple(reader.table(run) for run in entries.runs if run.form == "table")
    kept, repeats = first_of_each(trials, _measured)
    return Experiment(
        entries.source, entries.machine, tuple(trials[nth] for nth in kept), tables,
        (*reader.notes, *repeats),
    )  # fmt: skip


def _measured(trial: Trial) -> Hashable:
    """All that a run tells: its readings, its command and its payload."""
    command, program = trial.command, trial.program
    logged = command and tuple(own.tobytes() for _, own in sorted(command.position_m.items()))
    readings = [(r.sensor.name, r.time_s.tobytes(), r.values.tobytes()) for r in trial.readings]
    return tuple(readings), logged, program and program.source.text, trial.payload_kg


class _Runs:
    def __init__(self, entries: SawyerEntries) -> None:
        self._entries = entries
        self.notes: list[str] = []

    def trial(self, run: RunEntry) -> Trial:
        folder = self._entries.folder
        program = command = None
        if run.form == "program":
            program = self._program(folder / run.motion)
        else:
            command = read_command(folder / run.motion)
        readings = self._readings(run, folder / run.data)
        # An LVDT's file holds 960 samples, however long the program is.
        raw = Path(run.data).suffix.lower() == RAW_SUFFIX
        partial = run.partial or raw or any(map(self._is_full, readings))
        data = data_of(folder / run.data, run.data)
        return Trial(
            run.data, program, command, run.payload_kg, readings, run.span, partial, data
        )  # fmt: skip

    def _is_full(self, reading: Reading) -> bool:
        """True if the memory of the instrument was full: the run may have gone on."""
        kinds = {e.sensor.name: e.kind for e in self._entries.sensors}
        kind = kinds.get(reading.sensor.name)
        return kind is not None and len(reading.values) == KINDS[kind].full

    def _program(self, path: Path) -> Program:
        program = compile_file(path, self._entries.grammar)
        if program.warnings:
            self.notes.append(render_all(program.warnings, program.source))
        return program

    def _readings(self, run: RunEntry, path: Path) -> tuple[Reading, ...]:
        if path.suffix.lower() == RAW_SUFFIX:
            return (self._raw(run, path),)
        wanted = [entry.sensor.column for entry in self._entries.sensors]
        file = read_data(path, str(path), {TIME, *wanted})
        clock(file)
        readings = []
        for entry in self._entries.sensors:
            if self._there(file, entry.sensor):
                of_sensor, notes = reading(file, entry.sensor, entry.regular)
                readings.append(of_sensor)
                self.notes += notes
        if not readings:
            message = "the file has no column of any sensor"
            hint = f"expected {', '.join(wanted)}; the file has {', '.join(file.names)}"
            file.refuse_header("missing-column", message, hint)
        return tuple(readings)

    def _there(self, file: DataFile, sensor: Sensor) -> bool:
        """True if the file has the sensor's column; raises for a misspelling or other unit."""
        if sensor.column in file.columns:
            return True
        known = {entry.sensor.column for entry in self._entries.sensors}
        unknown = [name for name in file.names if name not in known and not _usual(name)]
        near = get_close_matches(sensor.column, unknown, n=1, cutoff=_NAME_CUTOFF)
        if near or other_unit(sensor.column, file.names) not in (None, *known):
            file.require(sensor.column)
        where = file.source.name
        self.notes.append(f"{where}: has no column {sensor.column} of sensor {sensor.name}")
        return False

    def _raw(self, run: RunEntry, path: Path) -> Reading:
        entry = self._raw_sensor(run, path)
        read = KINDS[entry.kind or ""].read
        assert read is not None, "only an instrument of the thesis has a raw file"
        return read(path, entry.sensor)

    def _raw_sensor(self, run: RunEntry, path: Path) -> SensorEntry:
        """The sensor that the run names, or the only one with such files."""
        raw = [entry for entry in self._entries.sensors if entry.kind in RAW_KINDS]
        named = [entry for entry in raw if run.sensor in (None, entry.sensor.name)]
        if len(named) == 1:
            return named[0]
        names = ", ".join(entry.sensor.name for entry in raw) or "none"
        kinds = " or ".join(f'"{kind}"' for kind in RAW_KINDS)
        message = f"a {RAW_SUFFIX.upper()} file is of one sensor of kind {kinds}: there are {names}"
        hint = 'say which in the run, such as sensor = "lvdt"'
        source = self._entries.source
        raise refused(source, "which-sensor", f"{path}: {message}", hint, run.span)

    def table(self, run: RunEntry) -> SteadyTable:
        path = self._entries.folder / run.motion
        file = read_data(path, str(path), _TABLE)
        columns = {name: file.require(name) * unit for name, unit in _TABLE.items()}
        for name, values in columns.items():
            wrong = np.flatnonzero(~(values >= 0))
            if len(wrong):
                file.refuse("bad-value", f"expected {name}: at least 0", int(wrong[0]), name)
        warm = [e.sensor for e in self._entries.sensors if e.sensor.quantity.slow]
        noise = warm[0].sigma * warm[0].unit_si if warm else None
        gain = warm[0].gain_tolerance if warm else 0.0
        velocity, acceleration, x, y, rise = columns.values()
        return SteadyTable(run.motion, velocity, acceleration, x, y, rise, noise, gain)


def read_command(path: Path) -> LoggedCommand:
    """A logged command: time_s and `position_1_in`, `position_2_mm`, ...; DataError."""
    names = {f"position_{n}_{unit}": (n, unit) for n in AXES for unit in _lengths()}
    file = read_data(path, str(path), {TIME, *names})
    time_s = clock(file)
    positions: dict[int, Floats] = {}
    for name, values in file.columns.items():
        if name == TIME:
            continue
        axis, unit = names[name]
        if axis in positions:
            file.refuse_header("double-column", f"there are two positions of axis {axis}")
        blank = np.flatnonzero(np.isnan(values))
        if len(blank):
            file.refuse("gap", "expected a command without gaps", int(blank[0]), name)
        positions[axis] = values * float(UNITS[unit][1])
    if not positions:
        hint = f"expected position_1_in or the like; the file has {', '.join(file.names)}"
        file.refuse_header("missing-column", "there is no commanded position", hint)
    return LoggedCommand(time_s, positions)


def _lengths() -> list[str]:
    return [unit for unit, (dimension, _) in UNITS.items() if dimension == "length"]


def _usual(name: str) -> bool:
    """True for a column name that files may have beside those of sensors."""
    return _OTHERS.fullmatch(name) is not None
