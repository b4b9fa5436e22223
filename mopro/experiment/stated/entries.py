"""Reads the file of an experiment on a stated machine: signals, sensors and runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from mopro.experiment.kept_rows import kept_rows
from mopro.experiment.sections import file_beside, sections_of
from mopro.experiment.stated.from_kind import skeleton
from mopro.formula import Formula, UnitError, dimension_of_unit, factor_of, parse
from mopro.formula.entry import check_name, read_effects, read_formula
from mopro.formula.written import Written
from mopro.instruments.quantity import MEASURABLES, PLACE_UNITS, Measurable, unit_of_column
from mopro.instruments.sensor import TOLERANCES, read_tolerances
from mopro.source import Source
from mopro.stated.data import Sensor
from mopro.stated.file import HOSTS, load_stated
from mopro.stated.model import AMBIENT, AXIS, KINDS, KINEMATIC, PYTHON, THERMAL, StatedMachine
from mopro.tomlfile import Document, Refused, Value, shown
from mopro.tomlfile.schema import flag, number, number_in, one_of, table_in, text

T = TypeVar("T")
_TOP_KEYS = {"machine", "time", "inputs", "sensor", "run", "effect", "rows"}
_SENSOR_KEYS = {
    "name", "quantity", "column", "unit", "noise_rms", "adc_step", "zero", "drift", "scale",
    "sign", "reads", "rate_hz", *TOLERANCES,
}  # fmt: skip
_RUN_KEYS = {"data", "name", "part", "use", "columns", "inputs", "start", "without", "program"}
_INPUT_KEYS = {"column", "formula", "unit", "hold", "feedback", "noise_rms"}
_FREE, _UNKNOWN = "free", "unknown"


@dataclass(frozen=True)
class _Input:
    """A signal of the machine: a formula of the data's columns, in `unit`.

    `noise_rms`: of its measurement, in `unit`; None where it is not stated.
    """

    formula: Formula
    unit: str
    held: bool
    feedback: bool
    noise_rms: float | None
    value: Value


@dataclass(frozen=True)
class _Clock:
    """The column of times and its unit in seconds."""

    column: str
    factor: float


@dataclass(frozen=True)
class RunEntry:
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
class StatedEntries:
    """Contents of the experiment file, before any of its data are read."""

    source: Source
    machine: StatedMachine
    clock: _Clock
    sensors: tuple[Sensor, ...]
    runs: tuple[RunEntry, ...]
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


def read_stated_entries(document: Document, applied: str | Path | None = None) -> StatedEntries:
    """The file's entries; `applied` is a machine to take instead. ModelError with all findings."""
    return document.read(_Reader(document.source, applied).entries)


class _Reader:
    """Reads the entries; paths in the file begin at its folder."""

    def __init__(self, source: Source, applied: str | Path | None) -> None:
        self._source, self._applied = source, applied
        self._machine_file: Path | None = None
        self._temperatures: tuple[str, ...] = ()

    def entries(self, root: Value) -> StatedEntries:
        before = root.faults
        root.only(_TOP_KEYS)
        root.get("rows", kept_rows, None)
        self._temperatures = _temperatures(root)
        machine = root.need("machine", self._machine, "expected a machine")
        if machine is None:
            raise Refused
        machine = machine.beside(read_effects(root, HOSTS[machine.kind]))
        clock = root.get("time", _clock, _Clock("time_s", 1.0))
        inputs = root.get("inputs", _inputs(machine.kind), {})
        sensors = [s for entry in sections_of(root, "sensor") if (s := _sensor(entry, machine))]
        runs = [self._run(entry, inputs, machine) for entry in sections_of(root, "run")]
        _check_names(root, "sensor", [s.name for s in sensors])
        _check_names(root, "run", [run.name for run in runs if run])
        if root.faults > before:
            raise Refused
        made = tuple(run for run in runs if run)
        return StatedEntries(
            self._source, _with_unit(machine, sensors, made), clock, tuple(sensors), made,
            self._machine_file,
        )  # fmt: skip

    def _machine(self, value: Value) -> StatedMachine:
        name = text()(value)
        if self._applied is not None:
            self._machine_file = None if str(self._applied) in KINDS else Path(self._applied)
            return load_stated(self._applied)
        if name in (AXIS, THERMAL):
            return skeleton(name, self._temperatures)
        if name in KINDS:
            return load_stated(name)
        self._machine_file = self._file(value)
        return load_stated(str(self._machine_file))

    def _file(self, value: Value) -> Path:
        return file_beside(self._source, value)

    def _run(
        self, entry: Value, inputs: Mapping[str, _Input], machine: StatedMachine
    ) -> RunEntry | None:
        before = entry.faults
        entry.only(_RUN_KEYS)
        data = entry.need("data", self._file, "the run has no data")
        stated = str(entry.data.get("data", ""))
        program = entry.get("program", self._file, None)
        if program is not None and machine.kind != KINEMATIC:
            entry.report("a program is of a machine that goes where it is told", at="program")
        made = RunEntry(
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


def _temperatures(root: Value) -> tuple[str, ...]:
    """The names of the sensors of a temperature, as far as they can be read."""
    stated = root.data.get("sensor")
    entries = [e for e in stated if isinstance(e, dict)] if isinstance(stated, list) else []
    names = [e.get("name") for e in entries if e.get("quantity") == "temperature"]
    return tuple(name for name in names if isinstance(name, str) and name.isidentifier())


def _with_unit(
    machine: StatedMachine, sensors: Sequence[Sensor], runs: Sequence[RunEntry]
) -> StatedMachine:
    """The machine, in the unit of the first sensor of a place if it states none.

    Without such a sensor a kinematic machine has the unit of its command.
    """
    if machine.unit or machine.kind in (THERMAL, PYTHON):
        return machine
    place_units = [s.unit for s in sensors if s.quantity.tells_place]
    if machine.kind == KINEMATIC:
        commands = [run.inputs["command"].unit for run in runs if "command" in run.inputs]
        dimensions = [dimension_of_unit(unit) for unit in PLACE_UNITS]
        place_units += [unit for unit in commands if dimension_of_unit(unit) in dimensions]
    return replace(machine, unit=place_units[0] if place_units else "1")


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
    return read_formula(value, "a formula of the data's columns")


def _texts(value: Value) -> dict[str, str]:
    return {entry.key: text()(entry) for entry in table_in(value).values()}


def _names(value: Value) -> frozenset[str]:
    if not isinstance(value.data, list) or not all(isinstance(n, str) for n in value.data):
        raise value.refused(f'expected {value.key} = ["effect"]')
    return frozenset(value.data)


def _starts(machine: StatedMachine) -> Callable[[Value], dict[str, float | None]]:
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
                check_name(entry, HOSTS[kind].reserved)
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
    noise_rms = table.get("noise_rms", number(0.0), None)
    return _Input(formula, unit, held, feedback, noise_rms, value)


# -- sensors -----------------------------------------------------------------------------


def _sensor(entry: Value, machine: StatedMachine) -> Sensor | None:
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
    tolerances = read_tolerances(entry)
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
        zero, drift, scale, sign, step, entry,
        tolerances,
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


def _default_reads(quantity: Measurable, name: str, machine: StatedMachine) -> Written:
    if quantity.of_node and machine.kind == THERMAL:
        return Written.of(name if name in machine.nodes else machine.nodes[0])
    return Written.of(quantity.reads or quantity.name)
