"""experiment.toml: a machine, sensors and runs, with all the data that it names."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mopro.errors import DataError, Diagnostic, ModelError
from mopro.experiment.read.raw import KINDS
from mopro.instruments.sensor import POSITION, TEMPERATURE, Sensor
from mopro.machine import Machine, builtin_machines, load_machine
from mopro.program import AXES
from mopro.source import Source, Span
from mopro.tomlfile import TomlReader, parse_toml
from mopro.units import parse_quantity

_SENSOR_KEYS = {
    "name", "kind", "quantity", "axis", "column", "rate_hz", "noise_rms", "adc_step",
}  # fmt: skip
_RUN_KEYS = {
    "program", "command", "table", "data", "payload_kg", "payload", "sensor", "partial",
}  # fmt: skip
_FORMS = ("program", "command", "table")
_NUMBERS = ("rate_hz", "noise_rms", "adc_step")
_GRAMMARS = ("attested", "extended")


@dataclass(frozen=True)
class SensorEntry:
    """A `[[sensor]]`; `kind` is None, `lvdt` or `thermocouple`."""

    sensor: Sensor
    kind: str | None

    @property
    def regular(self) -> bool:
        """Whether it samples at one rate; temperatures are taken now and then."""
        return self.sensor.quantity == POSITION


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
class Entries:
    """What experiment.toml says, before any of its data are read."""

    source: Source
    machine: Machine
    grammar: str
    sensors: tuple[SensorEntry, ...]
    runs: tuple[RunEntry, ...]

    @property
    def folder(self) -> Path:
        return Path(self.source.name).parent


def read_entries(path: str | Path) -> Entries:
    """What the file says; ModelError with all findings."""
    try:
        text = Path(path).read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        finding = Diagnostic("unreadable", f"cannot be read: {reason}", Span(1, 1, 1))
        raise ModelError(Source(str(path), ""), [finding]) from error
    source = Source(str(path), text)
    return _Reader(source, parse_toml(source)).entries()


class _Reader(TomlReader):
    def entries(self) -> Entries:
        self._known("", self._data, {"machine", "grammar", "sensor", "run"})
        grammar = self._data.get("grammar", _GRAMMARS[0])
        if grammar not in _GRAMMARS:
            self._report("bad-value", f"expected one of {', '.join(_GRAMMARS)}", "", "grammar")
        sensors = [self._sensor(n, e) for n, e in enumerate(self._tables("sensor"))]
        names = [e.sensor.name for e in sensors if e is not None]
        for n, name in enumerate(names):
            if name in names[:n]:
                self._report(
                    "double-name", f"two sensors are called {name}", "sensor", "name", nth=n
                )
        tables = self._tables("run")
        runs = [self._run(n, e, names) for n, e in enumerate(tables)]
        self._check_distinct_data(tables)
        machine = self._machine()
        self._check()
        assert machine is not None, "a machine that cannot be read is a finding"
        return Entries(
            self._source,
            machine,
            str(grammar),
            tuple(e for e in sensors if e is not None),
            tuple(e for e in runs if e is not None),
        )

    def _tables(self, section: str) -> list[dict[str, Any]]:
        entries = self._data.get(section, [])
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            self._report("bad-value", f"expected entries under [[{section}]]", "", section)
            return []
        if not entries:
            self._report("missing-key", f"expected at least one [[{section}]]", "", section)
        return entries

    def _machine(self) -> Machine | None:
        name = self._data.get("machine")
        if not isinstance(name, str) or not name:
            message = 'expected a machine, such as machine = "chow1992"'
            self._report("missing-key", message, "", "machine")
            return None
        if name in builtin_machines():
            return load_machine(name)
        path = self._file("", "machine", name)
        return load_machine(str(path)) if path else None

    def _file(self, section: str, key: str, name: Any, nth: int = 0) -> Path | None:
        """The path of a file that is there, as seen from the experiment file."""
        if not isinstance(name, str) or not name:
            self._report(
                "bad-value", f"expected the name of a file for {key}", section, key, nth=nth
            )
            return None
        path = Path(self._source.name).parent / name
        if path.is_file():
            return path
        hint = "paths begin at the folder of this file"
        self._report("no-such-file", f"there is no file {path}", section, key, hint, nth)
        return None

    # -- sensors ---------------------------------------------------------------

    def _sensor(self, nth: int, entry: dict[str, Any]) -> SensorEntry | None:
        before = len(self._found)
        self._known("sensor", entry, _SENSOR_KEYS, nth=nth)
        kind = entry.get("kind")
        if kind is not None and kind not in list(KINDS):
            self._wrong("sensor", "kind", f"expected one of {', '.join(KINDS)}", nth)
            return None
        stated = {key: entry[key] for key in _SENSOR_KEYS & entry.keys() if key != "kind"}
        self._sensor_words(stated, nth)
        self._sensor_numbers(stated, nth)
        axis = self._sensor_axis(stated, nth)
        if kind is not None and len(self._found) == before:
            stated = self._with_defaults(kind, axis, stated, nth)
        for key in ("name", "quantity", "column", "rate_hz"):
            if key not in stated and len(self._found) == before:
                self._report("missing-key", f"the sensor has no {key}", "sensor", key, nth=nth)
        if len(self._found) > before:
            return None
        sensor = Sensor(**(stated | {"axis": axis}))
        self._check_sensor(sensor, kind, nth)
        return SensorEntry(sensor, kind)

    def _with_defaults(
        self, kind: str, axis: int, stated: dict[str, Any], nth: int
    ) -> dict[str, Any]:
        try:
            return KINDS[kind].defaults(axis, stated) | stated
        except DataError as error:
            self._wrong("sensor", "column", str(error), nth)
            return stated

    def _sensor_words(self, stated: Mapping[str, Any], nth: int) -> None:
        for key in ("name", "column"):
            if key in stated and (not isinstance(stated[key], str) or not stated[key]):
                self._wrong("sensor", key, f"expected {key}: some text", nth)
        if stated.get("quantity", POSITION) not in (POSITION, TEMPERATURE):
            message = f"expected quantity to be {POSITION} or {TEMPERATURE}"
            self._wrong("sensor", "quantity", message, nth)

    def _sensor_numbers(self, stated: dict[str, Any], nth: int) -> None:
        for key in _NUMBERS:
            if key not in stated:
                continue
            number = _number(stated[key])
            if number is None or number < 0 or (key == "rate_hz" and not number):
                bound = "above 0" if key == "rate_hz" else "of at least 0"
                self._wrong("sensor", key, f"expected {key}: a number {bound}", nth)
            else:
                stated[key] = number

    def _sensor_axis(self, stated: Mapping[str, Any], nth: int) -> int:
        """The axis as stated, or else as the column's name has it."""
        axis = stated.get("axis")
        named = [n for n in AXES if f"_{n}_" in str(stated.get("column", ""))]
        if axis is None:
            return named[0] if named else AXES[0]
        if isinstance(axis, bool) or axis not in AXES:
            self._wrong("sensor", "axis", "expected axis: 1 or 2", nth)
        elif named and axis not in named:
            message = f"the column {stated['column']} is named after axis {named[0]}, not {axis}"
            self._report("wrong-axis", message, "sensor", "axis", "correct one of them", nth)
        return int(axis) if axis in AXES else AXES[0]

    def _check_sensor(self, sensor: Sensor, kind: str | None, nth: int) -> None:
        try:
            _ = sensor.unit_si
        except DataError as error:
            units = "_in, _mm, _um or _m" if sensor.quantity == POSITION else "_C"
            self._report(error.rule, str(error), "sensor", "column", f"expected {units}", nth)
        if not sensor.noise_rms and not sensor.adc_step:
            hint = "without it nothing can be called a disagreement"
            message = f"sensor {sensor.name} has no noise: state noise_rms, or adc_step"
            self._report("missing-key", message, "sensor", "noise_rms", hint, nth)
        if kind is not None and sensor.quantity != KINDS[kind].quantity:
            message = f"a sensor of kind {kind} gives a {KINDS[kind].quantity}"
            self._wrong("sensor", "quantity", message, nth)

    # -- runs ------------------------------------------------------------------

    def _run(self, nth: int, entry: dict[str, Any], sensors: list[str]) -> RunEntry | None:
        before = len(self._found)
        self._known("run", entry, _RUN_KEYS, nth=nth)
        forms = [form for form in _FORMS if form in entry]
        if len(forms) != 1:
            message = f"expected one of {', '.join(_FORMS)}, found {' and '.join(forms) or 'none'}"
            self._wrong("run", forms[1] if forms else "data", message, nth)
            return None
        form = forms[0]
        self._file("run", form, entry[form], nth)
        self._data_of(form, entry, nth)
        payload_kg = self._payload(entry, nth)
        sensor = entry.get("sensor")
        if sensor is not None and sensor not in sensors:
            known = ", ".join(sensors) or "none"
            self._wrong("run", "sensor", f"no sensor is called {sensor}: there are {known}", nth)
        if not isinstance(entry.get("partial", False), bool):
            self._wrong("run", "partial", "expected partial: true or false", nth)
        if len(self._found) > before:
            return None
        return RunEntry(
            form,
            entry[form],
            entry.get("data", entry[form]),
            payload_kg,
            sensor,
            entry.get("partial", False),
            self._place("run", "data" if "data" in entry else form, nth),
        )

    def _data_of(self, form: str, entry: dict[str, Any], nth: int) -> None:
        if form != "table":
            if "data" not in entry:
                self._report("missing-key", "the run has no data", "run", form, nth=nth)
            else:
                self._file("run", "data", entry["data"], nth)
            return
        for key in sorted(entry.keys() & (_RUN_KEYS - {"table"})):
            self._wrong("run", key, f"a table is a run of its own, without {key}", nth)

    def _check_distinct_data(self, runs: list[dict[str, Any]]) -> None:
        seen: dict[str, int] = {}
        for nth, entry in enumerate(runs):
            data = str(entry.get("data", nth))
            if data in seen:
                message = f"{data} is the data of run {seen[data] + 1} already"
                self._report("same-data", message, "run", "data", "each run has its own", nth)
            seen.setdefault(data, nth)

    def _payload(self, entry: dict[str, Any], nth: int) -> float:
        """`payload_kg = 0.5` or `payload = "5lb"`, in kg."""
        if "payload" in entry and "payload_kg" in entry:
            self._wrong("run", "payload", "expected payload or payload_kg, not both", nth)
            return 0.0
        key = "payload" if "payload" in entry else "payload_kg"
        try:
            kg = parse_quantity(str(entry.get(key, 0.0)), "mass", "kg")
        except ValueError as error:
            self._wrong("run", key, str(error), nth)
            return 0.0
        if kg < 0:
            self._wrong("run", key, f"{key} must be at least 0", nth)
        return kg

    def _wrong(self, section: str, key: str, message: str, nth: int) -> None:
        self._report("bad-value", message, section, key, nth=nth)


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
