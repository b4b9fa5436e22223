"""`mopro measure`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.options import (
    OutputFile,
    duration_type,
    grammar_option,
    payload_type,
    program_argument,
)
from mopro.cli.outputs import claimed, keep_inputs, machine_file
from mopro.cli.programs import compiled_program
from mopro.cli.say import say
from mopro.units import INCH_M

if TYPE_CHECKING:
    from mopro.emulator import Emulator
    from mopro.experiment.model import Floats
    from mopro.recording import Recording


@click.command()
@program_argument()
@click.option(
    "--instrument",
    type=click.Choice(["lvdt", "thermocouple"]),
    default="lvdt",
    show_default=True,
    help="What is connected to the converter.",
)
@click.option("--out", type=OutputFile(".dat", ".csv"), required=True, help="A .DAT or .csv file.")
@click.option(
    "--axis", type=click.IntRange(1, 2), default=1, show_default=True, help="LVDT's axis."
)
@click.option("--machine", default="chow1992", show_default=True, help="Built-in name or file.")
@click.option("--payload", type=payload_type(), default=0.0, metavar="MASS")
@click.option("--for", "for_s", type=duration_type(), metavar="DURATION")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the LVDT's ripple.")
@click.option("--no-ripple", is_flag=True, help="An LVDT without ripple.")
@grammar_option()
def command(
    file: str,
    instrument: str,
    out: Path,
    axis: int,
    machine: str,
    payload: float,
    for_s: float | None,
    seed: int,
    no_ripple: bool,
    grammar: str,
) -> None:
    """Write what the laboratory's instruments would have stored of an emulated run.

    The LVDT gives 960 voltages at 800 Hz, the thermocouple a temperature a second and,
    after two minutes, every 15 seconds.

    Example: mopro measure programs/LVDT3.CMD --out LVDT20.DAT
    """
    from mopro.emulator import Emulator
    from mopro.machine import load_machine
    from mopro.recording import MemorySink

    keep_inputs([("--out", out)], [("FILE", file), ("--machine", machine_file(machine))])
    program = compiled_program(file, grammar)
    rate_hz = 4000.0 if instrument == "lvdt" else 10.0
    emulator = Emulator(load_machine(machine), payload, rate_hz, seed)
    if instrument == "lvdt" and for_s is None:
        for_s = _lvdt_duration_s()
    sink = MemorySink()
    with claimed(out):
        run = emulator.run(program, sink, for_s)
    recording = sink.recording(emulator.header(program), run)
    if instrument == "lvdt":
        count = _lvdt(recording, emulator, axis, None if no_ripple else seed, out)
    else:
        count = _thermocouple(recording, emulator, out)
    say(f"{count} readings: {out}")


def _lvdt_duration_s() -> float:
    from mopro.instruments import Lvdt

    lvdt = Lvdt()
    return lvdt.samples / lvdt.rate_hz + 0.1


def _lvdt(recording: Recording, emulator: Emulator, axis: int, seed: int | None, out: Path) -> int:
    """The transducer is placed where the stroke's middle is its own."""
    import numpy as np

    from mopro.instruments import Lvdt, write_lvdt
    from mopro.instruments.quantity import POSITION
    from mopro.instruments.sensor import Sensor
    from mopro.plant import measure

    command_m = recording[f"command_{axis}_m"]
    lvdt = Lvdt(middle_m=float(command_m.max() + command_m.min()) / 2)
    sensor = Sensor("lvdt", POSITION, f"position_{axis}_m", lvdt.rate_hz, axis)
    _, seen = measure(recording, sensor, emulator.machine, emulator.active)
    stood = np.full(max(0, lvdt.samples - len(seen)), seen[-1])
    seen = np.concatenate((seen, stood))[: lvdt.samples]
    generator = None if seed is None else np.random.default_rng(seed)
    volts = lvdt.volts(seen, generator)
    if out.suffix.lower() == ".dat":
        write_lvdt(out, volts)
    else:
        _write_csv(
            out, f"position_{axis}_in", lvdt.times_s(), lvdt.position_m(volts) / float(INCH_M)
        )
    return len(volts)


def _thermocouple(recording: Recording, emulator: Emulator, out: Path) -> int:
    from mopro.instruments import Thermocouple, write_thermocouple
    from mopro.instruments.quantity import TEMPERATURE
    from mopro.instruments.sensor import Sensor
    from mopro.plant import interpolated, measure

    chain = Thermocouple()
    sensor = Sensor("thermocouple", TEMPERATURE, "temperature_C", recording.header.rate_hz)
    stamps, seen = measure(recording, sensor, emulator.machine, emulator.active)
    times = chain.times_s(float(stamps[-1]))
    stored = chain.stored_C(interpolated(stamps, seen, times))
    if out.suffix.lower() == ".dat":
        write_thermocouple(out, stored, times)
    else:
        _write_csv(out, "temperature_C", times, stored)
    return len(stored)


def _write_csv(out: Path, column: str, times: Floats, values: Floats) -> None:
    import numpy as np

    from mopro.files import output

    with output(out) as draft:
        table = np.column_stack([times, values])
        np.savetxt(draft, table, "%.9g", ",", header=f"time_s,{column}", comments="")
