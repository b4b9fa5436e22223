"""`mopro measure`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.options import (
    OutputFile,
    duration_type,
    grammar_option,
    instrument_names,
    machine_option,
    payload_option,
    program_argument,
    tell_of_runs,
)
from mopro.cli.outputs import claimed, keep_inputs, machine_file
from mopro.cli.program_files import compiled_program
from mopro.cli.progress import simulated
from mopro.cli.say import say

if TYPE_CHECKING:
    from mopro.emulator import Emulator
    from mopro.instruments.sensor import Sensor
    from mopro.program import Program
    from mopro.recording import Recording

# Instruments of the thesis, with raw files of their own.
_LABORATORY = ("lvdt", "thermocouple")


@click.command()
@program_argument()
@click.option(
    "--instrument",
    default="lvdt",
    metavar="NAME|FILE",
    shell_complete=instrument_names,
    show_default=True,
    help="lvdt, thermocouple, laser, encoder, or a file with the keys of a [[sensor]].",
)
@click.option("--out", type=OutputFile(".dat", ".csv"), required=True, help="A .DAT or .csv file.")
@click.option(
    "--axis", type=click.IntRange(1, 2), default=1, show_default=True, help="The measured axis."
)
@machine_option()
@payload_option()
@click.option("--for", "for_s", type=duration_type(), metavar="DURATION")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the noise.")
@click.option("--no-ripple", is_flag=True, help="An instrument without noise.")
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
    after two minutes, every 15 seconds. A laser, an encoder and an instrument of your own
    sample to the end of the run. `mopro compare` reads what is written, with a [[sensor]] of
    this kind, or with the keys of the file.

    Example: mopro measure programs/LVDT3.CMD --instrument laser --out pass.csv
    """
    from mopro.emulator.instrument_files import lvdt_duration_s, write_readings

    own = None if instrument in _LABORATORY else instrument
    inputs = [("FILE", file), ("--machine", machine_file(machine)), ("--instrument", own)]
    keep_inputs([("--out", out)], inputs)
    sensor = None if own is None else _sensor(own, axis, out)
    program = compiled_program(file, grammar)
    emulator = _emulator(machine, payload, _is_slow(instrument, sensor), seed)
    if instrument == "lvdt" and for_s is None:
        for_s = lvdt_duration_s()
    recording = _recorded(emulator, program, for_s, out)
    noise = None if no_ripple else seed
    count = write_readings(recording, emulator, sensor or instrument, axis, noise, out)
    say(f"{count} readings: {out}")


def _emulator(machine: str, payload: float, slow: bool, seed: int) -> Emulator:
    """The emulator of a machine, which samples as often as a `slow` instrument or another needs."""
    from mopro.emulator import Emulator
    from mopro.machine import load_machine

    plant = load_machine(machine)
    tell_of_runs(plant)
    return Emulator(plant, payload, 10.0 if slow else 4000.0, seed)


def _recorded(emulator: Emulator, program: Program, for_s: float | None, out: Path) -> Recording:
    """The recording of the emulated run, its progress shown; `out` is claimed meanwhile."""
    from mopro.recording import MemorySink

    sink = MemorySink()
    with claimed(out), simulated() as show:
        run = emulator.run(program, sink, for_s, on_progress=show)
    return sink.recording(emulator.header(program), run)


def _sensor(instrument: str, axis: int, out: Path) -> Sensor:
    """The instrument by its name or file; it has no raw format."""
    from mopro.experiment.sawyer.entries import instrument as read_instrument

    sensor = read_instrument(instrument, axis)
    if out.suffix.lower() == ".dat":
        known = " and ".join(_LABORATORY)
        raise click.UsageError(f"only {known} write .DAT files: choose a .csv file for --out")
    return sensor


def _is_slow(instrument: str, sensor: Sensor | None) -> bool:
    """True if the instrument sees heat only, which needs few samples."""
    return instrument == "thermocouple" if sensor is None else sensor.quantity.slow
