"""Draw the cases of a grid and write them as experiments, the answers sealed apart."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mopro.benchmark.case import Case, Generator, drawn
from mopro.benchmark.grid import Spec, specs
from mopro.benchmark.made import ANSWERS, SUFFIXES, Made
from mopro.benchmark.reference.experiment import Plant, Trial
from mopro.benchmark.reference.motion import Floats
from mopro.benchmark.reference.nominal import THESIS, Nominal
from mopro.benchmark.reference.sensors import Instrument, stored

_MACHINE = "machine.toml"

# The files of an experiment by name.
Contents = dict[str, bytes]


@dataclass(frozen=True)
class Machine:
    """The machine of all cases: its numbers, and its name as experiments state it.

    `text` is its file, which goes with each experiment; None for a machine that is built in.
    """

    nominal: Nominal = THESIS
    stated: str = "chow1992"
    text: bytes | None = None

    @classmethod
    def of_file(cls, nominal: Nominal, text: bytes) -> Machine:
        return cls(nominal, _MACHINE, text)


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
    grid. Raises DataError if an experiment's files of other origin are where these should be;
    nothing has been written then.
    """
    numbered = [(f"{i:03d}", spec) for i, spec in enumerate(specs(grid, seed), start=1)]
    chosen = [(number, spec) for number, spec in numbered if not only or number in only]
    made = Made.read(out)
    made.refuse_others([number for number, _ in chosen])
    answers: dict[str, Any] = {}
    for number, answer, contents in _drawn(seed, chosen, jobs, machine):
        made.replace(number, contents)
        answers[number] = answer
        yield number
    document = {"seed": seed, "grid": grid, "cases": dict(sorted(answers.items()))}
    text = (json.dumps(document, indent=1) + "\n").encode()
    made.replace("", {ANSWERS: text})
    yield hashlib.sha256(text).hexdigest()


def _drawn(
    seed: int, chosen: list[tuple[str, Spec]], jobs: int, machine: Machine
) -> Iterable[tuple[str, dict[str, Any], Contents]]:
    tasks = [(seed, number, spec, machine) for number, spec in chosen]
    if jobs == 1:
        yield from map(_task, tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(_task, tasks)


def _task(task: tuple[int, str, Spec, Machine]) -> tuple[str, dict[str, Any], Contents]:
    seed, number, spec, machine = task
    case = drawn(seed, number, spec, machine.nominal)
    contents = experiment(case, np.random.default_rng([seed, 3, int(number)]), machine)
    return number, case.answer(), contents


def experiment(case: Case, generator: Generator, machine: Machine = Machine()) -> Contents:
    """The experiment: its file, programs and data; nothing of what is hidden.

    Their digests are put into the case.
    """
    contents = {} if machine.text is None else {machine.stated: machine.text}
    plant = Plant(case.effects, case.strange, case.nominal)
    for i, trial in enumerate(case.trials, start=1):
        contents[f"run{i}.CMD"] = trial.text.encode("ascii")
        data = measured(plant, trial, case.instruments, case.offsets, generator)
        name = data_name(f"run{i}", case.instruments)
        contents[name] = data_file(name, case.instruments, *data)
    contents["experiment.toml"] = experiment_text(case, machine.stated).encode()
    case.files = {name: hashlib.sha256(contents[name]).hexdigest() for name in sorted(contents)}
    return contents


def write(case: Case, folder: Path, generator: Generator, machine: Machine = Machine()) -> None:
    """The experiment as files of `folder`, in place of what was made there before."""
    Made.read(folder).replace("", experiment(case, generator, machine))


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of the experiment's files by name."""
    files = [p for p in sorted(folder.iterdir()) if p.suffix in SUFFIXES]
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


def data_file(name: str, sensors: list[Instrument], stamps: Floats, series: list[Floats]) -> bytes:
    """A run's data: time and a column for each sensor; raw, temperature and time a line."""
    file = io.BytesIO()
    if name.endswith(".DAT"):
        raw = np.column_stack([*series, stamps])
        np.savetxt(file, raw, fmt=" %.7g ", delimiter="", newline="\r\n")
        return file.getvalue()
    header = ",".join(["time_s", *(s.column for s in sensors)])
    table = np.column_stack([stamps, *series])
    formats = ["%.7g"] + ["%.7f"] * len(sensors)
    np.savetxt(file, table, fmt=formats, delimiter=",", header=header, comments="")
    return file.getvalue()


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
