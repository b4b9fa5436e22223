"""Reads experiment.toml: machine, sensors, and runs with the names of their data."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mopro.errors import DataError
from mopro.experiment.kept_rows import kept_rows
from mopro.experiment.sawyer.raw import KINDS
from mopro.experiment.sections import file_beside, sections_of
from mopro.instruments.quantity import QUANTITIES
from mopro.instruments.sensor import TOLERANCES, Sensor
from mopro.machine import Machine, builtin_machines, load_machine
from mopro.machine.file import formulas_in
from mopro.program import AXES
from mopro.source import Source, Span
from mopro.tomlfile import Document, Refused, Value, read_named, shown
from mopro.tomlfile.schema import Reader, flag, number, one_of, quantity, text


def _any_of(words: Collection[str]) -> str:
    """`a, b or c`."""
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last


_SENSOR_KEYS: dict[str, Reader[Any]] = {
    "name": text(),
    "quantity": one_of(*QUANTITIES, message=f"expected quantity to be {_any_of(QUANTITIES)}"),
    "axis": one_of(*AXES, message="expected axis: 1 or 2"),
    "column": text(),
    "rate_hz": number(0.0, above=True),
    "noise_rms": number(0.0),
    "adc_step": number(0.0),
    **TOLERANCES,
}
_KIND = one_of(*KINDS, message=f"expected one of {', '.join(KINDS)}")
_RUN_KEYS = {
    "program", "command", "table", "data", "payload_kg", "payload", "sensor", "partial",
}  # fmt: skip
# Of a thermometer in a run that is proposed; a table of steady states has no rate.
_STEADY_HZ = 1 / 15
_FORMS = ("program", "command", "table")
_GRAMMARS = ("attested", "extended")
_NO_MACHINE = 'expected a machine, such as machine = "chow1992"'


@dataclass(frozen=True)
class SensorEntry:
    """A `[[sensor]]`; `kind` is None or the name of an instrument of `raw.KINDS`."""

    sensor: Sensor
    kind: str | None

    @property
    def regular(self) -> bool:
        """True if it samples at a fixed rate; a thermometer need not."""
        return self.sensor.quantity.regular


@dataclass(frozen=True)
class RunEntry:
    """A `[[run]]`: one of `program`, `command` and `table`, and the data if it is no table.

    Paths are those of the file; `sensor` is the one whose raw file `data` is. `span` is
    the place of the data (or the table).
    """

    form: str
    motion: str
    data: str
    payload_kg: float
    sensor: str | None
    partial: bool
    span: Span


@dataclass(frozen=True)
class SawyerEntries:
    """Contents of experiment.toml, before any of its data are read."""

    source: Source
    machine: Machine
    grammar: str
    sensors: tuple[SensorEntry, ...]
    runs: tuple[RunEntry, ...]
    machine_file: Path | None = None

    @property
    def folder(self) -> Path:
        return Path(self.source.name).parent

    @property
    def files(self) -> list[Path]:
        """Every file that the experiment reads, its own first; a built-in machine has none."""
        named = [self.folder / name for run in self.runs for name in (run.motion, run.data)]
        own = [] if self.machine_file is None else [self.machine_file]
        return [Path(self.source.name), *own, *dict.fromkeys(named)]


def read_sawyer(document: Document) -> SawyerEntries:
    """The entries of an experiment's file; ModelError with all findings."""
    return document.read(_Reader(document.source).entries)


def instrument(name_or_path: str, axis: int) -> Sensor:
    """The sensor of an instrument by its name, or by a file with the keys of a `[[sensor]]`.

    Raises ModelError with the findings in the file.
    """
    if name_or_path in KINDS:
        return _of_kind(name_or_path, axis)
    document = Document(read_named("instrument", name_or_path, KINDS))
    return document.read(_instrument).sensor


def _of_kind(name: str, axis: int) -> Sensor:
    kind = KINDS[name]
    return Sensor(**(kind.defaults(axis, {}) | {"axis": axis, "quantity": kind.quantity}))


def _instrument(root: Value) -> SensorEntry:
    entry = _sensor(root)
    if entry is None:
        raise Refused
    return entry


class _Reader:
    """Reads the entries of an experiment file; paths in it begin at its folder."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._machine_file: Path | None = None

    def entries(self, root: Value) -> SawyerEntries:
        root.only({"machine", "grammar", "sensor", "run", "effect", "rows"})
        root.get("rows", kept_rows, None)
        grammar = root.get("grammar", one_of(*_GRAMMARS), _GRAMMARS[0])
        tables = sections_of(root, "run")
        sampled = any("table" not in entry for entry in tables)
        sensors = self._sensors(root, sampled)
        sensor_name = _name_among(sensors)
        runs = [self._run(entry, sensor_name) for entry in tables]
        _check_distinct_data(tables)
        machine = root.need("machine", self._machine, _NO_MACHINE)
        formulas = formulas_in(root)
        if machine is None:
            raise Refused
        return SawyerEntries(
            self._source,
            machine.beside(formulas),
            grammar,
            tuple(sensors.values()),
            tuple(e for e in runs if e is not None),
            self._machine_file,
        )

    def _machine(self, value: Value) -> Machine:
        name = text(message=_NO_MACHINE, rule="missing-key")(value)
        if name in builtin_machines():
            return load_machine(name)
        self._machine_file = self._file(value)
        return load_machine(str(self._machine_file))

    def _file(self, value: Value) -> Path:
        return file_beside(self._source, value)

    def _sensors(self, root: Value, sampled: bool) -> dict[str, SensorEntry]:
        """The sensors that can be used, by name; without `sampled` data they need no rate."""
        sensors: dict[str, SensorEntry] = {}
        for entry in sections_of(root, "sensor"):
            if made := _sensor(entry, sampled):
                name = made.sensor.name
                if name in sensors:
                    entry.report(f"two sensors are called {shown(name)}", "double-name", at="name")
                sensors[name] = made
        return sensors

    # -- runs ------------------------------------------------------------------

    def _run(self, entry: Value, sensor_name: Reader[str]) -> RunEntry | None:
        before = entry.faults
        entry.only(_RUN_KEYS)
        forms = [form for form in _FORMS if form in entry]
        if len(forms) != 1:
            message = f"expected one of {', '.join(_FORMS)}, found {' and '.join(forms) or 'none'}"
            entry.report(message, at=forms[1] if forms else "data")
            return None
        form = forms[0]
        entry.get(form, self._file, None)
        self._check_data(form, entry)
        payload_kg = _payload(entry)
        sensor = entry.get("sensor", sensor_name, None)
        partial = entry.get("partial", flag, False)
        if entry.faults > before:
            return None
        data = entry["data" if "data" in entry else form]
        return RunEntry(form, entry.data[form], data.data, payload_kg, sensor, partial, data.span)

    def _check_data(self, form: str, entry: Value) -> None:
        if form == "table":
            for key in sorted(entry.data.keys() & (_RUN_KEYS - {"table"})):
                entry.report(f"a table is a run of its own, without {key}", at=key)
        elif "data" in entry:
            entry.get("data", self._file, None)
        else:
            entry.report("the run has no data", "missing-key", at=form)


def _check_distinct_data(runs: list[Value]) -> None:
    seen: dict[str, int] = {}
    for nth, entry in enumerate(runs, start=1):
        data = entry.data.get("data")
        if isinstance(data, str) and seen.setdefault(data, nth) != nth:
            message = f"{shown(data)} is the data of run {seen[data]} already"
            entry["data"].report(message, "same-data", "each run has its own")


def _payload(entry: Value) -> float:
    """`payload_kg = 0.5` or `payload = "5lb"`, in kg."""
    if "payload" in entry and "payload_kg" in entry:
        entry.report("expected payload or payload_kg, not both", at="payload")
        return 0.0
    return entry.get("payload" if "payload" in entry else "payload_kg", quantity("mass", "kg"), 0.0)


def _name_among(sensors: Mapping[str, Any]) -> Reader[str]:
    names = set(sensors)
    known = shown(", ".join(sensors) or "none", 200)

    def read(value: Value) -> str:
        if not isinstance(value.data, str) or value.data not in names:
            raise value.refused(f"no sensor is called {shown(value.data)}: there are {known}")
        return value.data

    return read


# -- sensors -----------------------------------------------------------------------


def _sensor(entry: Value, sampled: bool = True) -> SensorEntry | None:
    before = entry.faults
    entry.only({"kind", *_SENSOR_KEYS})
    kind = entry.get("kind", _KIND, None)
    stated: dict[str, Any] = {
        key: entry.get(key, read, None) for key, read in _SENSOR_KEYS.items() if key in entry
    }
    axis = _axis(entry, stated)
    if kind is not None and entry.faults == before:
        stated = _with_defaults(entry, kind, axis, stated)
    if not sampled:
        stated.setdefault("rate_hz", _STEADY_HZ)
    if entry.faults == before:
        for key in ("name", "quantity", "column", "rate_hz"):
            if key not in stated:
                entry.report(f"the sensor has no {key}", "missing-key", at=key)
    if entry.faults > before:
        return None
    named = {"axis": axis, "quantity": QUANTITIES[stated["quantity"]]}
    sensor = Sensor(**(stated | named))
    _check_sensor(entry, sensor, kind)
    return SensorEntry(sensor, kind)


def _axis(entry: Value, stated: Mapping[str, Any]) -> int:
    """The axis as stated, or else as the column's name has it."""
    column = stated.get("column") or ""
    named = [n for n in AXES if f"_{n}_" in column]
    axis = stated.get("axis") or (named or AXES)[0]
    if named and axis not in named:
        message = f"the column {shown(column)} is named after axis {named[0]}, not {axis}"
        entry.report(message, "wrong-axis", "correct one of them", at="axis")
    return int(axis)


def _with_defaults(entry: Value, kind: str, axis: int, stated: dict[str, Any]) -> dict[str, Any]:
    try:
        return KINDS[kind].defaults(axis, stated) | stated
    except DataError as error:
        entry.report(shown(error, 200), at="column")
        return stated


def _check_sensor(entry: Value, sensor: Sensor, kind: str | None) -> None:
    try:
        _ = sensor.unit_si
    except DataError as error:
        units = _any_of([f"_{unit}" for unit in sensor.quantity.suffixes])
        entry.report(shown(error, 200), error.rule, f"expected {units}", at="column")
    if not sensor.noise_rms and not sensor.adc_step:
        hint = "without it nothing can be called a disagreement"
        message = f"sensor {shown(sensor.name)} has no noise: state noise_rms, or adc_step"
        entry.report(message, "missing-key", hint, at="noise_rms")
    if kind is not None and sensor.quantity != KINDS[kind].quantity:
        entry.report(f"a sensor of kind {kind} gives a {KINDS[kind].quantity}", at="quantity")
