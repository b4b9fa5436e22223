"""`mopro serve`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.link import baud_option, dialect_option, token
from mopro.cli.live import controller_panel
from mopro.cli.options import Quantity, grammar_option, machine_option, payload_option, tell_of_runs
from mopro.cli.outputs import keep_inputs, machine_file
from mopro.cli.say import say

if TYPE_CHECKING:
    from mopro.controller import FolderStore, MemoryStore, Station
    from mopro.emulator import Emulator
    from mopro.machine import Machine

# Largest factor of time at which the kernel is fast enough in plain Python, which starts sooner.
_PLAIN_SPEED = 1.0


@click.command()
@click.option(
    "--listen",
    default="pty",
    show_default=True,
    help="pty, or socket://ADDRESS:PORT with port 0 for any free one.",
)
@click.option(
    "--allow-remote",
    is_flag=True,
    help="Permit an address that other machines reach; clients state the token MOPRO_TOKEN.",
)
@click.option(
    "--idle",
    type=Quantity("time", "s", positive=True),
    default="60s",
    show_default=True,
    help="How long a TCP client may be silent while another one waits.",
)
@dialect_option()
@baud_option()
@machine_option()
@payload_option()
@click.option(
    "--speed",
    type=click.FloatRange(0, 1000, min_open=True),
    default=1.0,
    show_default=True,
    help="Factor of time for controller, motor and serial line.",
)
@click.option(
    "--store",
    type=click.Path(file_okay=False, path_type=Path),
    help="Keep stored programs in this folder; otherwise they are lost at the end.",
)
@click.option(
    "--faults", type=click.Path(dir_okay=False), help="A scenario file with faults to simulate."
)
@click.option("--seed", type=int, help="Replaces the scenario's seed.")
@click.option("--web", is_flag=True, help="Show platen and program in a browser; faults by click.")
@grammar_option()
def command(
    listen: str, allow_remote: bool, idle: float, baud: int | None, speed: float, web: bool,
    **simulated: Any,
) -> None:  # fmt: skip
    """Run a virtual controller on the emulated machine.

    The first line printed is the address for --port of the other commands. Stop it with
    Ctrl-C.

    Example: mopro serve --listen socket://127.0.0.1:0 --store programs.d
    """
    from mopro.controller.serve import open_end, serve

    station, plant, line_baud = _station(baud, speed, **simulated)
    end = open_end(listen, line_baud, allow_remote, token(), idle)
    try:
        say(end.address)
        if not web:
            serve(station, end, speed)
            return
        with controller_panel(station, plant) as panel:
            serve(station, end, speed, tick=panel.tick)
    except KeyboardInterrupt:
        return
    finally:
        end.close()


def _station(
    baud: int | None,
    speed: float,
    dialect: str,
    machine: str,
    payload: float,
    store: Path | None,
    faults: str | None,
    seed: int | None,
    grammar: str,
) -> tuple[Station, Machine, int]:
    """The virtual controller of these options, its machine, and the rate of its line (baud).

    Its kernel is loaded where time runs fast.
    """
    from mopro.controller import Scenario, Station, load_scenario
    from mopro.emulator import Emulator
    from mopro.link import load_dialect
    from mopro.machine import load_machine

    stored = [("--store", file) for file in store.glob("*.CMD")] if store else []
    keep_inputs(
        stored, [("--faults", faults), ("--dialect", dialect), ("--machine", machine_file(machine))]
    )
    scenario = load_scenario(faults) if faults else Scenario()
    if seed is not None:
        scenario = replace(scenario, seed=seed)
    language = load_dialect(dialect)
    plant = load_machine(machine)
    tell_of_runs(plant)
    emulator = Emulator(plant, payload, compiled=speed > _PLAIN_SPEED)
    if emulator.compiled:
        _warm(emulator)
    station = Station(language, emulator, _programs(store), scenario, baud, grammar)
    return station, plant, baud or language.line.baud


def _programs(folder: Path | None) -> FolderStore | MemoryStore:
    """Store of programs, in `folder` or in memory; DataError if it cannot keep any."""
    from mopro.controller import FolderStore, MemoryStore
    from mopro.errors import DataError

    try:
        return FolderStore(folder) if folder else MemoryStore()
    except DataError as error:
        error.add_note("the controller cannot keep programs there: choose another --store")
        raise


def _warm(emulator: Emulator) -> None:
    """Load the compiled kernel by a first use, so that no client waits for it."""
    from mopro.controller.running import Motion
    from mopro.program.compile import compile as compile_text

    program = compile_text("UU012500/1\nVEL0 1.0\nACC0 1.0\nMRI1 0.001\nWX1\n")
    motion = Motion(emulator, program, emulator.machine.travel_u())
    motion.advance(motion.end_s)
