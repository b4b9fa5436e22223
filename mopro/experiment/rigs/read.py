"""Reads an experiment on a machine of another kind: its signals, sensors, runs and data."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from mopro.errors import DataFileError, Diagnostic
from mopro.experiment.read.data import DataFile, read_data
from mopro.experiment.rigs.command import command_of
from mopro.formula import Formula, FormulaError, UnitError, dimension_of_unit, factor_of, parse
from mopro.formula.evaluate import Floats, evaluate
from mopro.formula.language import check_names
from mopro.instruments.quantity import MEASURABLES, Measurable, unit_of_column
from mopro.rig.data import Reading, RigExperiment, Run, Sensor
from mopro.rig.file import check_name, load_rig
from mopro.rig.model import AMBIENT, AXIS, KINDS, KINEMATIC, PYTHON, THERMAL, Rig, Written
from mopro.source import Source
from mopro.tomlfile import Document, Refused, Value, read_source, shown
from mopro.tomlfile.schema import flag, number, number_in, one_of, table_in, text

T = TypeVar("T")
_TOP_KEYS = {"machine", "time", "inputs", "sensor", "run"}
_SENSOR_KEYS = {
    "name", "quantity", "column", "unit", "noise_rms", "adc_step", "zero", "drift", "scale",
    "sign", "reads", "rate_hz",
}  # fmt: skip
_RUN_KEYS = {"data", "name", "part", "use", "columns", "inputs", "start", "without", "program"}
_INPUT_KEYS = {"column", "formula", "unit", "hold", "feedback"}
_FREE, _UNKNOWN = "free", "unknown"
_COMMAND = "command"
_FEWEST_SAMPLES = 8
_MOST_FAULTY = 40


@dataclass(frozen=True)
class _Input:
    """A signal of the machine: a formula of the data's columns, in `unit`."""

    formula: Formula
    unit: str
    held: bool
    feedback: bool
    value: Value


@dataclass(frozen=True)
class _Clock:
    """The column of times and its unit in seconds."""

    column: str
    factor: float


@dataclass(frozen=True)
class _RunEntry:
    """A `[[run]]` as it is written."""

    data: Path
    shown: str
    name: str
    part: tuple[float, float]
    use: Written | None
    columns: Mapping[str, str]
    inputs: Mapping[str, _Input]
    start: Mapping[str, float | None]
    without: frozenset[str]
    program: Path | None
    value: Value


@dataclass(frozen=True)
class RigEntries:
    """Contents of the experiment file, before any of its data are read."""

    source: Source
    machine: Rig
    clock: _Clock
    sensors: tuple[Sensor, ...]
    runs: tuple[_RunEntry, ...]
    machine_file: Path | None

    @property
    def folder(self) -> Path:
        return Path(self.source.name).parent

    @property
    def files(self) -> list[Path]:
        """Every file that the experiment reads, its own first."""
        own = [] if self.machine_file is None else [self.machine_file]
        named = [run.data for run in self.runs]
        programs = [run.program for run in self.runs if run.program is not None]
        foreign = [self.foreign] if self.foreign is not None else []
        return [Path(self.source.name), *own, *foreign, *dict.fromkeys(named + programs)]

    @property
    def foreign(self) -> Path | None:
        """The file of a model that is a program."""
        if self.machine.python is None:
            return None
        folder = self.folder if self.machine_file is None else self.machine_file.parent
        return folder / self.machine.python[0]


def read_rig_entries(path: str | Path, applied: str | Path | None = None) -> RigEntries:
    """The file's entries; `applied` is a machine to take instead. ModelError with all findings."""
    document = Document(read_source(path))
    return document.read(_Reader(document.source, applied).entries)


class _Reader:
    """Reads the entries; paths in the file begin at its folder."""

    def __init__(self, source: Source, applied: str | Path | None) -> None:
        self._source, self._applied = source, applied
        self._machine_file: Path | None = None

    def entries(self, root: Value) -> RigEntries:
        before = root.faults
        root.only(_TOP_KEYS)
        machine = root.need("machine", self._machine, "expected a machine")
        if machine is None:
            raise Refused
        clock = root.get("time", _clock, _Clock("time_s", 1.0))
        inputs = root.get("inputs", _inputs(machine.kind), {})
        sensors = [s for entry in root.sections("sensor") if (s := _sensor(entry, machine))]
        runs = [self._run(entry, inputs, machine) for entry in root.sections("run")]
        for key, found in (("sensor", sensors), ("run", runs)):
            if not found and root.faults == before:
                root.report(f"expected at least one [[{key}]]", "missing-key", at=key)
        _check_names(root, "sensor", [s.name for s in sensors])
        _check_names(root, "run", [run.name for run in runs if run])
        if root.faults > before:
            raise Refused
        made = tuple(run for run in runs if run)
        return RigEntries(
            self._source, _with_unit(machine, sensors), clock, tuple(sensors), made,
            self._machine_file,
        )  # fmt: skip

    def _machine(self, value: Value) -> Rig:
        name = text()(value)
        if self._applied is not None:
            self._machine_file = None if str(self._applied) in KINDS else Path(self._applied)
            return load_rig(self._applied)
        if name in KINDS:
            return load_rig(name)
        self._machine_file = self._file(value)
        return load_rig(str(self._machine_file))

    def _file(self, value: Value) -> Path:
        name = text(message=f"expected the name of a file for {value.key}")(value)
        path = Path(self._source.name).parent / name
        if os.path.isfile(path):
            return path
        hint = "paths begin at the folder of this file"
        raise value.refused(f"there is no file {shown(path, 400)}", "no-such-file", hint)

    def _run(self, entry: Value, inputs: Mapping[str, _Input], machine: Rig) -> _RunEntry | None:
        before = entry.faults
        entry.only(_RUN_KEYS)
        data = entry.need("data", self._file, "the run has no data")
        stated = str(entry.data.get("data", ""))
        program = entry.get("program", self._file, None)
        if program is not None and machine.kind != KINEMATIC:
            entry.report("a program is of a machine that goes where it is told", at="program")
        made = _RunEntry(
            data=data or Path(),
            shown=stated,
            name=entry.get("name", text(), stated),
            part=entry.get("part", _part, (0.0, 1.0)),
            use=entry.get("use", _formula, None),
            columns=entry.get("columns", _texts, {}),
            inputs={**inputs, **entry.get("inputs", _inputs(machine.kind), {})},
            start=entry.get("start", _starts(machine), {}),
            without=entry.get("without", _names, frozenset()),
            program=program,
            value=entry,
        )
        return made if entry.faults == before else None


def _with_unit(machine: Rig, sensors: list[Sensor]) -> Rig:
    """The machine, in the unit of the first sensor of a place if it states none."""
    placed = next((s for s in sensors if s.quantity.tells_place), None)
    if machine.unit or machine.kind in (THERMAL, PYTHON):
        return machine
    return replace(machine, unit=placed.unit if placed else "1")


def _check_names(root: Value, key: str, names: list[str]) -> None:
    for nth, name in enumerate(names):
        if name in names[:nth]:
            hint = "state a name for each" if key == "run" else None
            root.report(f"two of [[{key}]] are called {shown(name)}", "double-name", hint, at=key)


def _part(value: Value) -> tuple[float, float]:
    ends = [number_in(end) for end in value.data] if isinstance(value.data, list) else []
    match ends:
        case [float() as low, float() as high] if 0 <= low < high <= 1:
            return low, high
    raise value.refused("expected part = [0.0, 0.6]: shares of the time, from 0 to 1")


def _formula(value: Value) -> Written:
    stated = text(message=f"expected {value.key}: a formula of the data's columns")(value)
    try:
        return Written(parse(stated), value)
    except FormulaError as error:
        found = value.error_inside(str(error), error.start, error.end, "bad-formula")
        raise value.include(found) from error


def _texts(value: Value) -> dict[str, str]:
    return {entry.key: text()(entry) for entry in table_in(value).values()}


def _names(value: Value) -> frozenset[str]:
    if not isinstance(value.data, list) or not all(isinstance(n, str) for n in value.data):
        raise value.refused(f'expected {value.key} = ["effect"]')
    return frozenset(value.data)


def _starts(machine: Rig) -> Callable[[Value], dict[str, float | None]]:
    states = ("x", "v") if machine.kind == AXIS else machine.nodes

    def read(value: Value) -> dict[str, float | None]:
        table = table_in(value)
        table.only(states)
        return {entry.key: _free_or_number(entry) for entry in table.values()}

    return read


def _free_or_number(value: Value) -> float | None:
    if value.data == _FREE:
        return None
    found = number_in(value.data)
    if found is None:
        raise value.refused(f'expected {value.key}: a number, or "free"')
    return found


def _clock(value: Value) -> _Clock:
    if isinstance(value.data, str):
        column, unit = value.data, unit_of_column(value.data)
    else:
        table = table_in(value)
        table.only({"column", "unit"})
        column = table.need("column", text(), "expected the column of times") or ""
        unit = table.get("unit", text(), unit_of_column(column))
    if unit is None or dimension_of_unit_or_none(unit) != dimension_of_unit("s"):
        hint = 'write time = { column = "stamp", unit = "ms" }'
        raise value.refused("expected a unit of time", "wrong-unit", hint)
    return _Clock(column, factor_of(unit))


def dimension_of_unit_or_none(unit: str) -> object:
    try:
        return dimension_of_unit(unit)
    except UnitError:
        return None


def _inputs(kind: str) -> Callable[[Value], dict[str, _Input]]:
    def read(section: Value) -> dict[str, _Input]:
        found = {}
        for entry in table_in(section).values():
            if entry.key != AMBIENT:
                check_name(entry, kind)
            found[entry.key] = section.get(entry.key, _input, None)
        return {name: made for name, made in found.items() if made is not None}

    return read


def _input(value: Value) -> _Input:
    table = table_in(value)
    table.only(_INPUT_KEYS)
    if ("column" in table) == ("formula" in table):
        raise value.refused(f"expected {value.key}: a column, or a formula of columns, and a unit")
    if "formula" in table:
        written = table.get("formula", _formula, None)
        formula, column = (written.formula if written else parse("0")), None
    else:
        column = text()(table["column"])
        # The name of a column need not be one of a formula.
        formula = Formula(column, parse("c").tree, frozenset([column]))
    unit = table.get("unit", text(), unit_of_column(column) if column else None)
    if unit is None or dimension_of_unit_or_none(unit) is None:
        raise value.refused(f'expected the unit of {value.key}, such as unit = "N"', "wrong-unit")
    held, feedback = (table.get(key, flag, False) for key in ("hold", "feedback"))
    return _Input(formula, unit, held, feedback, value)


# -- sensors -----------------------------------------------------------------------------


def _sensor(entry: Value, machine: Rig) -> Sensor | None:
    before = entry.faults
    entry.only(_SENSOR_KEYS)
    name = entry.need("name", text(), "the sensor has no name")
    stated = entry.need("quantity", one_of(*MEASURABLES), f"{shown(name)} has no quantity")
    column = entry.need("column", text(), f"{shown(name)} has no column")
    unit = entry.get("unit", text(), unit_of_column(column or ""))
    noise = entry.need(
        "noise_rms", _noise, f'{shown(name)} has no noise_rms: a number, or "unknown"'
    )
    step = entry.get("adc_step", number(0.0), 0.0)
    entry.get("rate_hz", number(0.0, above=True), 0.0)
    zero = entry.get("zero", _free_or_number, None)
    drift = entry.get("drift", _drift, None)
    scale = entry.get("scale", _free_or_number, 1.0)
    sign = entry.get("sign", _sign, 1)
    reads = entry.get("reads", _formula, None)
    if entry.faults > before or stated is None or name is None:
        return None
    quantity = MEASURABLES[stated]
    if unit is None:
        entry.report(f"{column} ends in no unit: state unit", "wrong-unit", at="column")
        return None
    if dimension_of_unit_or_none(unit) not in [dimension_of_unit(u) for u in quantity.units]:
        entry.report(f"{unit} is no unit of {quantity.name}", "wrong-unit", at="unit")
        return None
    if scale == 0:
        entry.report("a scale of 0 reads nothing", at="scale")
        return None
    several = machine.kind == THERMAL and len(machine.nodes) > 1
    if reads is None and several and quantity.of_node and name not in machine.nodes:
        listed = ", ".join(machine.nodes)
        message = f"state what it reads, one of {listed}: it is not called as a node"
        entry.report(message, "missing-key", at="name")
        return None
    known = noise if noise is None or noise == math.inf else math.hypot(noise, step / math.sqrt(12))
    if known == 0:
        entry.report('a sensor has noise: state noise_rms, or "unknown"', at="noise_rms")
        return None
    return Sensor(
        name, quantity, column or "", unit, factor_of(unit), dimension_of_unit(unit),
        None if known == math.inf else known, reads or _default_reads(quantity, name, machine),
        zero, drift, scale, sign, entry,
    )  # fmt: skip


def _noise(value: Value) -> float:
    """The stated noise; infinity for one that is unknown."""
    return math.inf if value.data == _UNKNOWN else number(0.0)(value)


def _sign(value: Value) -> int | None:
    return None if value.data == _FREE else one_of(1, -1)(value)


def _drift(value: Value) -> float | None:
    if value.data == _FREE:
        return 0.0
    if value.data is False:
        return None
    table = table_in(value)
    table.only({"every_s"})
    return table.need("every_s", number(0.0, above=True), "expected { every_s = 100 }")


def _default_reads(quantity: Measurable, name: str, machine: Rig) -> Written:
    if quantity.of_node and machine.kind == THERMAL:
        return Written.of(name if name in machine.nodes else machine.nodes[0])
    return Written.of(quantity.reads or quantity.name)


# -- data --------------------------------------------------------------------------------


def read_rig_experiment(entries: RigEntries) -> RigExperiment:
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
    return RigExperiment(
        entries.source, entries.machine, tuple(runs), units, tuple(notes), tuple(columns)
    )


class _Data:
    """The data of one run."""

    def __init__(self, entries: RigEntries, entry: _RunEntry) -> None:
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
            entry.value,
        )  # fmt: skip
        return run, known, self._notes

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
        # A date or the time since a computer was started: the run begins at 0.
        late = abs(time_s[0]) > max(time_s[-1] - time_s[0], 1.0)
        return time_s - time_s[0] if late else time_s

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
        if not np.ptp(values) and sensor.noise_rms is None:
            message = f"{column} is {values[0]:g} in all rows: it tells nothing"
            self._file.refuse_header("empty-column", message)
        return Reading(sensor, rows, values)

    def _start(self, readings: list[Reading], time_s: Floats) -> dict[str, float | None]:
        machine, stated = self._entries.machine, self._entry.start
        factor = factor_of(machine.unit or "1")
        if machine.kind == AXIS:
            placed = any(r.sensor.quantity.tells_place for r in readings)
            moving = placed or any(r.sensor.quantity.tells_speed for r in readings)
            default_x, default_v = None if placed else 0.0, None if moving else 0.0
            found = {"x": default_x, "v": default_v}
            return found | {n: None if v is None else v * factor for n, v in stated.items()}
        if machine.kind == THERMAL:
            first = {n: _first(readings, n) for n in machine.nodes}
            return {**first, **stated}
        return {}


def _from_first(
    time_s: Floats, inputs: Mapping[str, Floats], readings: list[Reading]
) -> tuple[Floats, dict[str, Floats], list[Reading]]:
    """The rows from the first that is compared: where a start is free, it is there."""
    first = min(int(r.rows[0]) for r in readings)
    moved = [replace(r, rows=r.rows - first) for r in readings]
    cut = {name: np.ascontiguousarray(own[first:]) for name, own in inputs.items()}
    return time_s[first:], cut, moved


def _first(readings: list[Reading], node: str) -> float:
    """The first reading of a node's sensor, or of any."""
    own = [r for r in readings if node in r.sensor.reads.formula.names] or readings
    return float(own[0].values[0])


__all__ = [
    "DataFile",
    "DataFileError",
    "Diagnostic",
    "RigEntries",
    "read_rig_entries",
    "read_rig_experiment",
]
