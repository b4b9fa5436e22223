"""Nine changes of an experiment that do not change its physics, and where each of them holds."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from helpers.invariance.copied import MOTOR, Copied, Floats, Signal, Table
from mopro.formula import parse
from mopro.formula.evaluate import over_grid
from mopro.stated.model import AXIS, KINEMATIC
from mopro.units import UNITS

Change = Callable[[Copied, np.random.Generator], Copied]
# Share of the noise that the last digit is, at most, and that a line between every second sample of
# a command may miss; share of the range that it may miss of any other input.
_DIGIT, _MISSED, _MISSED_OF_RANGE = 1 / 3, 1 / 3, 0.01
_FEWEST_ROWS = 100
# Units of the same quantity; a column in none of them stays.
_OTHERS = {
    "m": "mm", "mm": "in", "um": "mm", "in": "mm", "rad": "deg", "deg": "rad", "arcsec": "mrad",
    "N": "mN", "A": "mA", "V": "mV", "W": "mW", "1": "%", "%": "1", "s": "ms",
}  # fmt: skip
_SCALED = ("noise_rms", "adc_step", "linearity", "zero", "range")
_MOVE = re.compile(r"^(MRI[12] +)(-?)([\d.]+)", re.MULTILINE)
_OTHER_MOVES = re.compile(r"^(?!MRI)(M[A-Z]{2}|J|H|ZP)", re.MULTILINE)


class Skipped(Exception):
    """The change is none of such an experiment; why."""


def rounded(copied: Copied, rng: np.random.Generator) -> Copied:
    """Readings with digits below their noise cut; the command of the same unit as well."""
    changes: dict[str, Callable[[Floats], Floats]] = {}
    units = {}
    for signal in (s for s in copied.signals if s.of_sensor and s.column):
        noise = _noise(copied, signal)
        if noise > 0:
            digits = -math.floor(math.log10(_DIGIT * noise))
            changes[signal.column] = lambda own, digits=digits: np.round(own, digits)
            units[signal.unit] = changes[signal.column]
    for signal in (s for s in copied.signals if not s.of_sensor and s.name == "command"):
        if signal.unit in units:
            changes[signal.column] = units[signal.unit]
    made = copied.with_columns(changes)
    if all(np.array_equal(made.values(c), copied.values(c)) for c in changes):
        raise Skipped("no digits below the noise")
    return made


def halved(copied: Copied, rng: np.random.Generator) -> Copied:
    """Every second sample, where inputs are what lines (or steps) through those are."""
    noise = {s.unit: _noise(copied, s) for s in copied.signals if s.of_sensor}
    for signal in (s for s in copied.signals if not s.of_sensor):
        for table in copied.tables.values():
            values = table.columns.get(signal.column, np.zeros(1))
            most = _MISSED_OF_RANGE * float(np.ptp(values))
            if signal.name == "command" and signal.unit in noise:
                most = _MISSED * noise[signal.unit]
            if _missed(values, held=bool(signal.entry.get("hold"))) > most:
                raise Skipped(f"{signal.name} changes between the samples that are kept")
    if min(len(t.columns[copied.time]) for t in copied.tables.values()) < 2 * _FEWEST_ROWS:
        raise Skipped("too few samples")
    made = copied.altered().with_tables(lambda table: table.taken(slice(None, None, 2)))
    for entry in made.stated["sensor"]:
        if "rate_hz" in entry:
            entry["rate_hz"] = entry["rate_hz"] / 2
        elif made.kind == MOTOR:
            raise Skipped("the rate is that of an instrument")
    return made


def in_another_unit(copied: Copied, rng: np.random.Generator) -> Copied:
    """Columns in other units, as stated; those of a motor bear the unit in their names."""
    made = copied.altered()
    used = _names_in(copied.formulas)
    changes: dict[str, Callable[[Floats], Floats]] = {}
    names = {}
    for signal in (s for s in made.signals if s.unit in _OTHERS and s.column not in used):
        unit = _OTHERS[signal.unit]
        factor = _factor(signal.unit, unit)
        changes[signal.column] = lambda own, factor=factor: own * factor
        for key in _SCALED:
            if key in signal.entry:
                signal.entry[key] = _times(signal.entry[key], factor)
        if made.kind == MOTOR:
            names[signal.column] = f"{signal.column.removesuffix(f'_{signal.unit}')}_{unit}"
            signal.entry["column"] = names[signal.column]
        else:
            signal.entry["unit"] = unit
    if made.kind != MOTOR and "time" not in made.stated and made.time not in used:
        changes[made.time] = lambda own: own * 1e3
        made.stated["time"] = {"column": made.time, "unit": "ms"}
    if not changes:
        raise Skipped("no column in a unit of which there are others")
    return made.with_columns(changes).with_tables(lambda table: table.renamed(names))


def from_another_time(copied: Copied, rng: np.random.Generator) -> Copied:
    """Times from another zero, where neither a program nor a formula has its own."""
    if any("program" in run for run in copied.runs):
        raise Skipped("time begins with the program")
    if "t" in _names_in(copied.formulas):
        raise Skipped("a formula is of the time")
    length = max(float(np.ptp(t.columns[copied.time])) for t in copied.tables.values())
    moved = rng.uniform(0.2, 0.9) * length
    return copied.with_columns({copied.time: lambda own: own + moved})


def from_another_place(copied: Copied, rng: np.random.Generator) -> Copied:
    """Readings of a place, and its command, from another zero, where the sensors' zeros are free.

    A law of the place is of the true one, so that a free zero makes up for what readings are moved
    by; a command is moved with them where no formula is of it.
    """
    places = [s for s in copied.signals if s.of_sensor and s.of_place]
    commands = [s for s in copied.signals if s.name == "command"]
    if not places:
        raise Skipped("no sensor of a place")
    if any("zero" in s.entry for s in places):
        raise Skipped("the sensor's zero is stated")
    if {s.column for s in places} & _names_in(copied.formulas):
        raise Skipped("a formula is of the readings")
    if copied.kind == KINEMATIC:
        if not commands or _names_in(copied.formulas) & {"x", "command", commands[0].column}:
            raise Skipped("a formula is of the place")
        if {s.unit for s in places} != {s.unit for s in commands}:
            raise Skipped("command and readings in different units")
    moved = rng.uniform(0.2, 0.9) * max(float(np.ptp(copied.values(s.column))) for s in places)
    signals = [*places, *(commands if copied.kind == KINEMATIC else [])]
    made = copied.altered()
    for entry in (s.entry for s in made.signals if s.of_sensor and s.of_place):
        if isinstance(entry.get("range"), list):
            entry["range"] = [end + moved for end in entry["range"]]
    return made.with_columns({s.column: lambda own: own + moved for s in signals})


def reversed_sign(copied: Copied, rng: np.random.Generator) -> Copied:
    """The axis counted the other way: place, forces and commands, where laws are odd in them."""
    if copied.kind == MOTOR:
        return _reversed_motor(copied)
    if copied.kind not in (KINEMATIC, AXIS):
        raise Skipped("no axis")
    inputs = {s.name for s in copied.signals if not s.of_sensor}
    if copied.kind == KINEMATIC and inputs != {"command"}:
        raise Skipped("inputs of no stated sense beside the command")
    if any("formula" in own for s in (copied.stated, *copied.runs) for own in
           s.get("inputs", {}).values() if isinstance(own, dict)):  # fmt: skip
        raise Skipped("a formula of the columns")
    numbers = {name: rng.uniform(0.5, 2.0) for name in copied.machine.get("base", {})}
    stated = {**copied.machine, "sensor": copied.stated["sensor"]}
    if "effect" in copied.stated or "effect" in copied.machine:
        raise Skipped("effects of its own")
    laws = [f for key in ("position", "acceleration") if (f := stated.get(key))]
    laws += [s["reads"] for s in stated["sensor"] if "reads" in s]
    if not all(_is_odd(law, numbers, inputs, rng) for law in laws):
        raise Skipped("a law is not odd")
    made = copied.altered()
    for entry in made.stated["sensor"]:
        for key in ("zero", "range"):
            if key in entry:
                entry[key] = _times(entry[key], -1.0)
    for run in made.runs:
        if "start" in run:
            run["start"] = _times(run["start"], -1.0)
    return made.with_columns({s.column: np.negative for s in made.signals})


def runs_reordered(copied: Copied, rng: np.random.Generator) -> Copied:
    """The runs in reverse order."""
    if len(copied.runs) < 2:
        raise Skipped("one run")
    made = copied.altered()
    made.runs.reverse()
    return made


def run_twice(copied: Copied, rng: np.random.Generator) -> Copied:
    """The first run once more, from a copy of its data."""
    made = copied.altered()
    run = made.runs[0]
    if "data" not in run:
        raise Skipped("a table of steady states")
    again = f"again_{run['data']}"
    named = {"name": f"{run['name']} again"} if "name" in run else {}
    made.runs.append({**run, **named, "data": again})
    return replace(made, tables={**made.tables, again: made.tables[run["data"]]})


def run_cut(copied: Copied, rng: np.random.Generator) -> Copied:
    """The first run as two, cut where its inputs rest nearest to its middle."""
    if copied.kind == MOTOR:
        raise Skipped("a program is one run")
    made = copied.altered()
    run = made.runs[0]
    begin, end = run.get("part", [0.0, 1.0])
    at = _rest(made, made.tables[run["data"]], begin, end)
    name = run.get("name", run["data"])
    made.stated["run"] = [
        {**run, "name": name, "part": [begin, at]},
        {**run, "name": f"{name}, second part", "part": [at, end]},
        *made.runs[1:],
    ]
    return made


CHANGES: dict[str, Change] = {
    "rounded": rounded,
    "halved": halved,
    "unit": in_another_unit,
    "time": from_another_time,
    "place": from_another_place,
    "sign": reversed_sign,
    "order": runs_reordered,
    "twice": run_twice,
    "cut": run_cut,
}


def _noise(copied: Copied, signal: Signal) -> float:
    """Standard deviation of a sensor's readings: stated, or of what neighbours differ by."""
    step = signal.entry.get("adc_step", 0.0)
    stated = signal.entry.get("noise_rms", 0.0)
    values = copied.values(signal.column)
    if not isinstance(stated, str) or not len(values):
        return math.hypot(0.0 if isinstance(stated, str) else stated, step / math.sqrt(12))
    if step:
        return step / math.sqrt(12)
    bends = np.abs(np.diff(values, 2)) / math.sqrt(6)
    own = float(np.median(bends)) / 0.6745
    steps = np.diff(np.unique(values))
    return own or (float(steps.min()) / math.sqrt(12) if len(steps) else 0.0)


def _missed(values: Floats, held: bool) -> float:
    """By how much steps or lines between every second value miss the others, at most."""
    kept, dropped = values[::2], values[1::2]
    after = kept[1 : len(dropped) + 1]
    before = kept[: len(after)]
    told = before if held else (before + after) / 2
    return float(np.nanmax(np.abs(dropped[: len(told)] - told), initial=0.0))


def _names_in(formulas: list[str]) -> set[str]:
    return {name for text in formulas for name in re.findall(r"[A-Za-z_]\w*", text)}


def _factor(unit: str, other: str) -> float:
    return float(UNITS[unit][1] / UNITS[other][1])


def _times(value: Any, factor: float) -> Any:
    """A number, the numbers of a list or of a table times a factor; ends stay in order."""
    if isinstance(value, list):
        return sorted(own * factor for own in value)
    if isinstance(value, dict):
        return {name: _times(own, factor) for name, own in value.items()}
    return value if isinstance(value, str) else value * factor


def _is_odd(
    law: str, numbers: dict[str, float], inputs: set[str], rng: np.random.Generator
) -> bool:
    """True if a formula of states and inputs changes its sign with theirs."""
    formula = parse(law)
    states = {name: rng.uniform(0.1, 1.0, 20) for name in formula.names - numbers.keys()}
    if states.keys() - {"x", "v", "a", *inputs}:
        return False
    turned = {name: -own for name, own in states.items()}
    values = [over_grid(formula, {**numbers, **own}) for own in (states, turned)]
    return bool(np.allclose(values[0], -np.asarray(values[1])))


def _reversed_motor(copied: Copied) -> Copied:
    programs = {str(run.get("program", "")) for run in copied.runs}
    texts = {name: (copied.folder / name).read_text("utf-8") for name in programs if name}
    if "" in programs or any(_OTHER_MOVES.search(text) for text in texts.values()):
        raise Skipped("moves that are not by relative distances")
    signs = {"": "-", "-": ""}
    turned = {
        name: _MOVE.sub(lambda m: f"{m[1]}{signs[m[2]]}{m[3]}", text)
        for name, text in texts.items()
    }
    columns = {s.column: np.negative for s in copied.signals if s.entry.get("quantity") !=
               "temperature"}  # fmt: skip
    return replace(copied.altered().with_columns(columns), texts=turned)


def _rest(copied: Copied, table: Table, begin: float, end: float) -> float:
    """The share of a run's time, within `begin` and `end`, at which it is cut."""
    time = table.columns[copied.time]
    shares = (time - time[0]) / (time[-1] - time[0])
    inside = np.flatnonzero((shares > 0.75 * begin + 0.25 * end) &
                            (shares < 0.25 * begin + 0.75 * end))  # fmt: skip
    moving = np.zeros(len(time), dtype=bool)
    for signal in (s for s in copied.signals if not s.of_sensor and s.column in table.columns):
        moving[1:] |= np.diff(table.columns[signal.column]) != 0
    still = [row for row in inside if not moving[row - 2 : row + 3].any()]
    middle = (begin + end) / 2
    return float(min(shares[still or inside], key=lambda share: abs(share - middle)))
