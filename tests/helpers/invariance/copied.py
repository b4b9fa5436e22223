"""An experiment with its data as tables that can be changed, and written as another experiment."""

from __future__ import annotations

import csv
import shutil
import tomllib
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.experiment.opened import experiment_file
from mopro.experiment.stated.entries import StatedEntries
from mopro.instruments.quantity import unit_of_column
from mopro.tomlfile.edit import quoted

Floats = NDArray[np.float64]
MOTOR = "motor"


@dataclass(frozen=True)
class Table:
    """A CSV file with a header: its columns by name; a blank cell is nan."""

    columns: Mapping[str, Floats]

    @classmethod
    def read(cls, path: Path) -> Table:
        with path.open(encoding="utf-8", newline="") as lines:
            header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
        cells = np.array([[float(cell or "nan") for cell in row] for row in rows])
        return cls(dict(zip(header, cells.T, strict=True)))

    def write(self, path: Path) -> None:
        rows = zip(*(column.tolist() for column in self.columns.values()), strict=True)
        with path.open("w", encoding="utf-8", newline="") as lines:
            writer = csv.writer(lines)
            writer.writerow(self.columns)
            writer.writerows(["" if cell != cell else repr(cell) for cell in row] for row in rows)

    def with_column(self, name: str, changed: Callable[[Floats], Floats]) -> Table:
        return Table({n: changed(c) if n == name else c for n, c in self.columns.items()})

    def renamed(self, names: Mapping[str, str]) -> Table:
        return Table({names.get(n, n): c for n, c in self.columns.items()})

    def taken(self, rows: slice) -> Table:
        return Table({n: c[rows] for n, c in self.columns.items()})


@dataclass(frozen=True)
class Signal:
    """A column of the data that is a sensor's or an input's, with the section that states it."""

    column: str
    unit: str | None
    entry: dict[str, Any]
    name: str
    of_sensor: bool

    @property
    def of_place(self) -> bool:
        return self.entry.get("quantity") in ("position", "angle")


@dataclass(frozen=True)
class Copied:
    """An experiment as its files state it: the experiment, the machine's file, tables by file.

    `kind`: that of a stated machine, or MOTOR. `folder`: where its other files are. `texts`: those
    of them that are changed.
    """

    stated: dict[str, Any]
    machine: dict[str, Any]
    kind: str
    tables: Mapping[str, Table]
    folder: Path
    texts: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path) -> Copied:
        """The experiment in file `path`, all of whose files are in its folder."""
        stated = tomllib.loads(path.read_text("utf-8"))
        entries = experiment_file(path).entries
        kind = entries.machine.kind if isinstance(entries, StatedEntries) else MOTOR
        own = path.parent / str(stated["machine"])
        machine = tomllib.loads(own.read_text("utf-8")) if own.is_file() else {}
        names = {run[key] for run in stated["run"] for key in ("data", "command") if key in run}
        tables = {name: Table.read(path.parent / name) for name in sorted(names)}
        return cls(stated, machine, kind, tables, path.parent)

    def write(self, folder: Path) -> Path:
        """The experiment in a new `folder`; its file."""
        shutil.copytree(self.folder, folder)
        for name, table in self.tables.items():
            table.write(folder / name)
        for name, text in self.texts.items():
            (folder / name).write_text(text, "utf-8")
        path = folder / "experiment.toml"
        path.write_text("\n".join(_toml(self.stated)), "utf-8")
        return path

    def altered(self) -> Copied:
        """A copy whose `stated` can be changed in place."""
        return replace(self, stated=deepcopy(self.stated))

    def with_tables(self, changed: Callable[[Table], Table]) -> Copied:
        return replace(self, tables={n: changed(t) for n, t in self.tables.items()})

    def with_columns(self, changes: Mapping[str, Callable[[Floats], Floats]]) -> Copied:
        """The copy with columns changed, in each table that has them."""

        def changed(table: Table) -> Table:
            for name, change in changes.items():
                table = table.with_column(name, change)
            return table

        return self.with_tables(changed)

    @property
    def runs(self) -> list[dict[str, Any]]:
        return self.stated["run"]

    @property
    def time(self) -> str:
        """The column of times."""
        clock = self.stated.get("time", "time_s")
        return clock if isinstance(clock, str) else clock["column"]

    @property
    def signals(self) -> list[Signal]:
        """The columns of sensors and inputs; an input that is a formula is none."""
        return [*_sensors(self.stated), *_inputs(self.stated)]

    @property
    def formulas(self) -> list[str]:
        """All formulas that the experiment's and the machine's file state."""
        return [*_formulas(self.stated), *_formulas(self.machine)]

    def values(self, column: str) -> Floats:
        """The numbers of a column in all tables."""
        own = [t.columns[column] for t in self.tables.values() if column in t.columns]
        every = np.concatenate(own) if own else np.zeros(0)
        return every[np.isfinite(every)]


def _sensors(stated: Mapping[str, Any]) -> Iterator[Signal]:
    for entry in stated.get("sensor", []):
        column = entry.get("column", "")
        unit = entry.get("unit", unit_of_column(column))
        names = {run.get("columns", {}).get(entry.get("name"), column) for run in stated["run"]}
        for name in sorted(names):
            yield Signal(name, unit, entry, entry.get("name", ""), True)


def _inputs(stated: Mapping[str, Any]) -> Iterator[Signal]:
    for section in (stated, *stated["run"]):
        for name, entry in section.get("inputs", {}).items():
            if "column" in entry:
                unit = entry.get("unit", unit_of_column(entry["column"]))
                yield Signal(entry["column"], unit, entry, name, False)


def _formulas(value: Any, key: str = "") -> Iterator[str]:
    if isinstance(value, dict):
        for name, own in value.items():
            within = "formula" if key in ("nodes",) else name
            yield from _formulas(own, within)
    elif isinstance(value, list):
        for own in value:
            yield from _formulas(own, key)
    elif key in ("formula", "use", "reads", "position", "acceleration") and isinstance(value, str):
        yield value


def _toml(root: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a TOML file: plain keys, then sections."""
    for key, value in root.items():
        if not isinstance(value, dict | list):
            yield f"{key} = {_value(value)}"
    for key, value in root.items():
        for own in value if isinstance(value, list) else [value]:
            if isinstance(own, dict):
                yield f"[[{key}]]" if isinstance(value, list) else f"[{key}]"
                yield from (f"{quoted(n)} = {_value(v)}" for n, v in own.items())


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{quoted(n)} = {_value(v)}" for n, v in value.items()) + " }"
    return repr(value)
