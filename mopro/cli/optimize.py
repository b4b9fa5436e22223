"""`mopro optimize`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import (
    for_option,
    grammar_option,
    machine_option,
    payload_option,
    program_argument,
    tell_of_runs,
    varied_pair,
    vary_option,
)
from mopro.cli.program_files import compiled_program
from mopro.cli.progress import counted
from mopro.cli.say import print_table, say, say_json

if TYPE_CHECKING:
    from mopro.sweeps.optimum import Goal, Optimum
    from mopro.sweeps.tasks import Subject

_FIGURES = ("time", "margin", "lag", "settling", "energy", "temperature")


@click.command()
@program_argument()
@machine_option()
@vary_option()
@click.option("--minimize", type=click.Choice(_FIGURES), help="The figure to make small.")
@click.option("--maximize", type=click.Choice(_FIGURES), help="The figure to make large.")
@click.option(
    "--keep", multiple=True, metavar="BOUND", help="A bound to keep: margin>0.2, lag<50um."
)
@click.option(
    "--runs", type=click.IntRange(1, 100_000), default=2000, show_default=True, help="At most."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the search.")
@payload_option()
@for_option()
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    file: str,
    machine: str,
    vary: tuple[str, ...],
    minimize: str | None,
    maximize: str | None,
    keep: tuple[str, ...],
    runs: int,
    seed: int,
    payload: float,
    for_s: float | None,
    grammar: str,
    as_json: bool,
) -> int:
    """Find the settings at which a program is soonest, or has most margin, within bounds.

    --vary names what may change, as for `mopro sweep`: ranges, START:STOP, or values to choose
    from. Runs that stall, trip or are refused do not count. Exits with 1 if no run keeps all
    bounds.

    Example: mopro optimize programs/LVDT3.CMD --vary VEL1=10:60 --minimize time --keep 'margin>0.2'
    """
    from mopro.machine import load_machine
    from mopro.sweeps.optimum import Bound, Goal, column_of, optimum
    from mopro.sweeps.targets import Variant
    from mopro.sweeps.tasks import Subject
    from mopro.sweeps.varied import all_varied

    if (minimize is None) == (maximize is None):
        raise click.UsageError("say what is best: --minimize or --maximize, one of them")
    goal = Goal(
        column_of(minimize or maximize or ""), minimize is None, tuple(map(Bound.read, keep))
    )
    base = Variant(compiled_program(file, grammar), load_machine(machine), payload)
    tell_of_runs(base.machine)
    varied = all_varied(map(varied_pair, vary), base.program, base.machine)
    subject = Subject(base, varied, for_s)
    with counted("searching", runs, "runs") as tell:
        found = optimum(subject, goal, runs, seed, tell)
    if as_json:
        say_json({"kept": found.kept, "runs": found.runs, "best": found.row})
    else:
        _tell(subject, goal, found)
    return 0 if found.kept else EXIT_FAILED


def _tell(subject: Subject, goal: Goal, found: Optimum) -> None:
    """Print the best settings, and the figures there."""
    program, machine, _ = subject.base
    row = found.row
    say(f"{program.name} on {machine.name}: {found.runs} runs")
    if not found.kept:
        bounds = ", ".join(bound.text for bound in goal.bounds)
        say(f"No run is without a stall and keeps {bounds or 'a figure'}; the nearest:")
    settings = [(each.name, f"{row[each.column]}", each.unit) for each in subject.varied]
    figures = [
        (name, f"{value:.6g}" if isinstance(value, float) else str(value), "")
        for name, value in list(row.items())[2 + len(settings) :]
        if value is not None
    ]
    print_table(("best", "value", "unit"), [*settings, *figures], 100)
