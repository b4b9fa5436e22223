"""Writing of a grid's cases as experiments, with the answers in a file of their own."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.cases.benchmark_machine import DEFAULT_MACHINE, BenchmarkMachine
from mopro.blind.cases.case import Case, draw_case, program_name
from mopro.blind.cases.grids import Spec, case_specs, spread
from mopro.blind.cases.hidden_sizes import Plant
from mopro.blind.cases.machine_case import machine_case
from mopro.blind.cases.machine_kinds import MachineSpec
from mopro.blind.cases.manifest import ANSWERS, EXPERIMENT, SUFFIXES, Manifest
from mopro.blind.reference.motor import Floats, Generator
from mopro.blind.reference.plant import ProgramRun
from mopro.blind.reference.sensors import Instrument, stored
from mopro.blind.reference.uncatalogued import Foreign
from mopro.inputs import read_bytes
from mopro.process.jobs import in_processes

# The files of an experiment by name.
Contents = dict[str, bytes]


def make(
    seed: int,
    grid: str,
    out: Path,
    only: frozenset[str] = frozenset(),
    jobs: int = 1,
    machine: BenchmarkMachine = DEFAULT_MACHINE,
    sample: int | None = None,
) -> Iterator[str]:
    """Write the grid's cases under `out`; yields each case's number, last the answers' SHA-256.

    `only` limits the work to the cases with these numbers, which do not depend on the others,
    `sample` to so many of them, evenly spread.
    Raises DataError, before anything is written, if files of other origin are in the way.
    """
    specs = case_specs(grid, seed, machine.effects)
    numbered = [(f"{i:03d}", spec) for i, spec in enumerate(specs, start=1)]
    wanted = spread([number for number, _ in numbered if not only or number in only], sample)
    chosen = [(number, spec) for number, spec in numbered if number in wanted]
    made = Manifest.read(out)
    made.refuse_foreign([number for number, _ in chosen])
    answers: dict[str, Any] = {}
    for number, answer, contents in _draw_all(seed, chosen, jobs, machine):
        made.replace(number, contents)
        answers[number] = answer
        yield number
    document = {"seed": seed, "grid": grid, "cases": dict(sorted(answers.items()))}
    text = (json.dumps(document, indent=1) + "\n").encode()
    made.replace("", {ANSWERS: text})
    yield hashlib.sha256(text).hexdigest()


def _draw_all(
    seed: int, chosen: list[tuple[str, Spec]], jobs: int, machine: BenchmarkMachine
) -> Iterable[tuple[str, dict[str, Any], Contents]]:
    """Number, answer and files of each chosen case, from `jobs` processes."""
    tasks = [(seed, number, spec, machine) for number, spec in chosen]
    return in_processes(_task, tasks, jobs)


def _task(
    task: tuple[int, str, Spec, BenchmarkMachine],
) -> tuple[str, dict[str, Any], Contents]:
    seed, number, spec, machine = task
    if isinstance(spec, MachineSpec):
        return number, *machine_case(np.random.default_rng([seed, 2, int(number)]), spec)
    case = draw_case(seed, number, spec, machine.nominal, machine.tolerated, machine.effects)
    contents = experiment(case, np.random.default_rng([seed, 3, int(number)]), machine)
    return number, case.answer(), contents


def experiment(
    case: Case, generator: Generator, machine: BenchmarkMachine = DEFAULT_MACHINE
) -> Contents:
    """The experiment's files: experiment.toml, programs and data, without the hidden truth.

    Their SHA-256 are put into the case.
    """
    contents = {} if machine.text is None else {machine.stated: machine.text}
    plant = case.plant()
    for i, run in enumerate(case.runs, start=1):
        contents[program_name(i)] = run.text.encode("ascii")
        data = measured(plant, run, case.instruments, case.offsets, generator, case.foreign)
        name = data_name(f"run{i}", case.instruments)
        contents[name] = data_file(name, case.instruments, *data)
    contents[EXPERIMENT] = experiment_text(case, machine.stated).encode()
    case.files = {name: hashlib.sha256(contents[name]).hexdigest() for name in sorted(contents)}
    return contents


def write(
    case: Case, folder: Path, generator: Generator, machine: BenchmarkMachine = DEFAULT_MACHINE
) -> None:
    """Write the experiment to `folder`, replacing an earlier one made there."""
    Manifest.read(folder).replace("", experiment(case, generator, machine))


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of the experiment's files in `folder`, by name."""
    files = [p for p in sorted(folder.iterdir()) if p.suffix in SUFFIXES]
    return {p.name: hashlib.sha256(read_bytes(p)).hexdigest() for p in files}


def measured(
    plant: Plant,
    run: ProgramRun,
    sensors: list[Instrument],
    offsets: list[float],
    generator: Generator,
    foreign: Foreign | None = None,
) -> tuple[Floats, list[Floats]]:
    """Time stamps (s, shape (n,)) and each sensor's readings (its unit, shape (n,)), with noise."""
    stamps, clean = plant.readings(run, sensors, generator)
    readings = [
        stored(series + offset, sensor, generator, foreign)
        for series, sensor, offset in zip(clean, sensors, offsets, strict=True)
    ]
    return stamps, readings


def data_name(run: str, sensors: list[Instrument]) -> str:
    """Name of a run's data file: .DAT (the laboratory's raw form) for a thermocouple, else .csv."""
    return f"{run}.{'DAT' if sensors[0].quantity == 'temperature' else 'csv'}"


def data_file(name: str, sensors: list[Instrument], stamps: Floats, series: list[Floats]) -> bytes:
    """Content of a run's data file: .csv with time and each sensor, or raw .DAT, time last."""
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
    """Content of experiment.toml."""
    factor = case.spec.noise_factor
    stated = [replace(i, noise_rms=float(f"{i.noise_rms * factor:.6g}")) for i in case.instruments]
    parts = [f'machine = "{machine}"\n', *map(_sensor_text, stated)]
    for i, run in enumerate(case.runs, start=1):
        parts.append(run_text(f"run{i}", run.payload_kg, case.instruments, case.cut_off))
    parts += [case.stated.text] if case.stated else []
    return "\n".join(parts)


def _sensor_text(s: Instrument) -> str:
    noise = f"noise_rms = {s.noise_rms}\nadc_step = {s.adc_step}\n"
    if s.quantity == "temperature":
        return f'[[sensor]]\nname = "{s.name}"\nkind = "thermocouple"\n{noise}'
    return (
        f'[[sensor]]\nname = "{s.name}"\nquantity = "{s.quantity}"\naxis = {s.axis}\n'
        f'column = "{s.column}"\nrate_hz = {s.rate_hz}\n{noise}'
    )


def run_text(name: str, payload_kg: float, sensors: list[Instrument], partial: bool = False) -> str:
    """The [[run]] table of experiment.toml; `partial` if the recording ends before the program."""
    data = data_name(name, sensors)
    return f'[[run]]\nprogram = "{name}.CMD"\ndata = "{data}"\npayload_kg = {payload_kg}\n' + (
        "partial = true\n" if partial else ""
    )
