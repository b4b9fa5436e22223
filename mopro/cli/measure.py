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
from mopro.units import INCH_M

if TYPE_CHECKING:
    from mopro.emulator import Emulator
    from mopro.experiment.sawyer.trials import Floats
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
    own = None if instrument in _LABORATORY else instrument
    inputs = [("FILE", file), ("--machine", machine_file(machine)), ("--instrument", own)]
    keep_inputs([("--out", out)], inputs)
    sensor = None if own is None else _sensor(own, axis, out)
    program = compiled_program(file, grammar)
    emulator = _emulator(machine, payload, _is_slow(instrument, sensor), seed)
    if instrument == "lvdt" and for_s is None:
        for_s = _lvdt_duration_s()
    recording = _recorded(emulator, program, for_s, out)
    noise = None if no_ripple else seed
    if sensor is not None:
        count = _sampled(recording, emulator, sensor, noise, out)
    elif instrument == "lvdt":
        count = _lvdt(recording, emulator, axis, noise, out)
    else:
        count = _thermocouple(recording, emulator, out)
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


def _sampled(
    recording: Recording, emulator: Emulator, sensor: Sensor, seed: int | None, out: Path
) -> int:
    import numpy as np

    from mopro.plant import measure

    generator = None if seed is None else np.random.default_rng(seed)
    stamps, seen = measure(recording, sensor, emulator.machine, emulator.active, generator)
    _write_csv(out, sensor.column, stamps, seen)
    return len(seen)


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
