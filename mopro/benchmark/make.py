"""Draw the cases of a grid and write them as experiments, the answers sealed apart."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mopro.benchmark.case import Case, Generator, drawn
from mopro.benchmark.grid import Spec, specs
from mopro.benchmark.reference.experiment import Plant, Trial
from mopro.benchmark.reference.motion import Floats
from mopro.benchmark.reference.nominal import THESIS, Nominal
from mopro.benchmark.reference.sensors import Instrument, stored

ANSWERS = "answers.json"
_MACHINE = "machine.toml"
_SUFFIXES = (".toml", ".CMD", ".csv", ".DAT")


@dataclass(frozen=True)
class Machine:
    """The machine of all cases: its numbers, and its name as experiments state it, or its file."""

    nominal: Nominal = THESIS
    stated: str | Path = "chow1992"

    def put_into(self, folder: Path) -> str:
        """A copy of its file into the folder of an experiment, which is to state this name."""
        if isinstance(self.stated, str):
            return self.stated
        shutil.copyfile(self.stated, folder / _MACHINE)
        return _MACHINE


def make(
    seed: int,
    grid: str,
    out: Path,
    only: frozenset[str] = frozenset(),
    jobs: int = 1,
    machine: Machine = Machine(),
) -> Iterator[str]:
    """Write the grid's cases under `out`; yields each case's number, last the seal's hash.

    `only` limits the work to cases of these numbers, which are the same as in the whole
    grid.
    """
    numbered = [(f"{i:03d}", spec) for i, spec in enumerate(specs(grid, seed), start=1)]
    chosen = [(number, spec) for number, spec in numbered if not only or number in only]
    answers: dict[str, Any] = {}
    for number, answer in _written(seed, chosen, out, jobs, machine):
        answers[number] = answer
        yield number
    document = {"seed": seed, "grid": grid, "cases": dict(sorted(answers.items()))}
    text = json.dumps(document, indent=1) + "\n"
    out.mkdir(parents=True, exist_ok=True)
    (out / ANSWERS).write_text(text, encoding="utf-8")
    yield hashlib.sha256(text.encode()).hexdigest()


def _written(
    seed: int, chosen: list[tuple[str, Spec]], out: Path, jobs: int, machine: Machine
) -> Iterable[tuple[str, dict[str, Any]]]:
    tasks = [(seed, number, spec, out, machine) for number, spec in chosen]
    if jobs == 1:
        yield from map(_task, tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(_task, tasks)


def _task(task: tuple[int, str, Spec, Path, Machine]) -> tuple[str, dict[str, Any]]:
    seed, number, spec, out, machine = task
    case = drawn(seed, number, spec, machine.nominal)
    write(case, out / number, np.random.default_rng([seed, 3, int(number)]), machine)
    return number, case.answer()


def write(case: Case, folder: Path, generator: Generator, machine: Machine = Machine()) -> None:
    """The experiment: its file, programs and data; nothing of what is hidden."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in hashes(folder):
        (folder / name).unlink()
    name = machine.put_into(folder)
    plant = Plant(case.effects, case.strange, case.nominal)
    for i, trial in enumerate(case.trials, start=1):
        (folder / f"run{i}.CMD").write_text(trial.text, encoding="ascii")
        data = measured(plant, trial, case.instruments, case.offsets, generator)
        write_data(folder / data_name(f"run{i}", case.instruments), case.instruments, *data)
    (folder / "experiment.toml").write_text(experiment_text(case, name), encoding="utf-8")
    case.files = hashes(folder)


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of the experiment's files by name."""
    files = [p for p in sorted(folder.iterdir()) if p.suffix in _SUFFIXES]
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def measured(
    plant: Plant,
    trial: Trial,
    sensors: list[Instrument],
    offsets: list[float],
    generator: Generator,
) -> tuple[Floats, list[Floats]]:
    """Time stamps, and the stored readings of each sensor."""
    stamps, clean = plant.readings(trial, sensors, generator)
    readings = [
        stored(series + offset, sensor, generator)
        for series, sensor, offset in zip(clean, sensors, offsets, strict=True)
    ]
    return stamps, readings


def data_name(run: str, sensors: list[Instrument]) -> str:
    """The data file of a run: a thermocouple's is raw, as the laboratory stored it."""
    return f"{run}.{'DAT' if sensors[0].quantity == 'temperature' else 'csv'}"


def write_data(path: Path, sensors: list[Instrument], stamps: Floats, series: list[Floats]) -> None:
    """A run's data: time and a column for each sensor; raw, temperature and time a line."""
    if path.suffix == ".DAT":
        raw = np.column_stack([*series, stamps])
        np.savetxt(path, raw, fmt=" %.7g ", delimiter="", newline="\r\n")
        return
    header = ",".join(["time_s", *(s.column for s in sensors)])
    table = np.column_stack([stamps, *series])
    formats = ["%.7g"] + ["%.7f"] * len(sensors)
    np.savetxt(path, table, fmt=formats, delimiter=",", header=header, comments="")


def experiment_text(case: Case, machine: str) -> str:
    """experiment.toml."""
    parts = [f'machine = "{machine}"\n', *map(_sensor_text, case.instruments)]
    for i, trial in enumerate(case.trials, start=1):
        parts.append(run_text(f"run{i}", trial.payload_kg, case.instruments))
    return "\n".join(parts)


def _sensor_text(s: Instrument) -> str:
    noise = f"noise_rms = {s.noise_rms}\nadc_step = {s.adc_step}\n"
    if s.quantity == "temperature":
        return f'[[sensor]]\nname = "{s.name}"\nkind = "thermocouple"\n{noise}'
    return (
        f'[[sensor]]\nname = "{s.name}"\nquantity = "{s.quantity}"\naxis = {s.axis}\n'
        f'column = "{s.column}"\nrate_hz = {s.rate_hz}\n{noise}'
    )


def run_text(name: str, payload_kg: float, sensors: list[Instrument]) -> str:
    """One run of experiment.toml."""
    data = data_name(name, sensors)
    return f'[[run]]\nprogram = "{name}.CMD"\ndata = "{data}"\npayload_kg = {payload_kg}\n'
