"""`mopro optimize`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import (
    OutputFile,
    drawn_machines,
    draws_option,
    for_option,
    grammar_option,
    machine_option,
    payload_option,
    program_argument,
    share_type,
    tell_of_runs,
    varied_pair,
    vary_option,
)
from mopro.cli.outputs import claimed, keep_inputs, machine_file
from mopro.cli.program_files import compiled_program
from mopro.cli.progress import counted
from mopro.cli.say import print_table, say, say_json
from mopro.errors import DataError
from mopro.files import write

if TYPE_CHECKING:
    from mopro.machine import Machine
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
@draws_option()
@click.option(
    "--risk",
    type=share_type(positive=True, most=0.5),
    default="0.3%",
    show_default=True,
    help="Largest share of drawn machines that may stall or miss a bound.",
)
@click.option("--out", type=OutputFile(".cmd"), help="The best program, a .CMD file.")
@click.option("--even-so", is_flag=True, help="Even if the machine's verdict is `unexplained`.")
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
    draws: int | None,
    risk: float,
    out: Path | None,
    even_so: bool,
    payload: float,
    for_s: float | None,
    grammar: str,
    as_json: bool,
) -> int:
    """Find the settings at which a program is soonest, or has most margin, within bounds.

    --vary names what may change, as for `mopro sweep`: ranges, START:STOP, or values to choose
    from. Runs that stall, trip or are refused do not count. With --draws the bounds must hold on
    all drawn machines but a share, --risk, which fresh draws then verify. Exits with 1, and writes
    no --out, if no run keeps all bounds, or the fresh draws do not show it.

    Example: mopro optimize programs/LVDT3.CMD --vary VEL1=10:60 --minimize time --keep 'margin>0.2'
    """
    from mopro.machine import load_machine
    from mopro.sweeps.best_program import program_text
    from mopro.sweeps.drawn import uncertain
    from mopro.sweeps.optimum import Bound, Goal, column_of, optimum
    from mopro.sweeps.targets import Variant
    from mopro.sweeps.tasks import Subject
    from mopro.sweeps.varied import all_varied

    if (minimize is None) == (maximize is None):
        raise click.UsageError("say what is best: --minimize or --maximize, one of them")
    keep_inputs([("--out", out)], [("FILE", file), ("--machine", machine_file(machine))])
    bounds = tuple(map(Bound.read, keep))
    goal = Goal(column_of(minimize or maximize or ""), minimize is None, bounds, risk)
    base = Variant(compiled_program(file, grammar), load_machine(machine), payload)
    if not even_so:
        _check_verdict(base.machine)
    tell_of_runs(base.machine)
    varied = all_varied(map(varied_pair, vary), base.program, base.machine)
    drawn = drawn_machines(draws, seed)
    subject = Subject(base, varied, for_s, () if drawn is None else uncertain(base, varied))
    with claimed(out), counted("searching", runs, "runs") as tell:
        found = optimum(subject, goal, runs, seed, tell, drawn)
    if out is not None and found.kept:
        write(out, program_text(subject, goal, found, drawn))
    if as_json:
        say_json(_as_json(found))
    else:
        _tell(subject, goal, found)
        if out is not None:
            say(f"Program: {out}" if found.kept else f"{out} is not written")
    return 0 if found.kept else EXIT_FAILED


def _check_verdict(machine: Machine) -> None:
    """DataError for a machine of which something is left unexplained."""
    if machine.verdict == "unexplained":
        raise DataError(
            f"the verdict of {machine.name} is `unexplained`: data disagree with it in a way that "
            "no listed effect accounts for, so that its limits may be others; reconcile it with "
            "more runs or effects, or optimize it --even-so",
            "unexplained",
        )


def _as_json(found: Optimum) -> dict[str, Any]:
    told: dict[str, Any] = {"kept": found.kept, "runs": found.runs, "best": found.row}
    if found.verified is not None:
        missing = found.verified.missing
        told["verified"] = {
            "draws": missing.total, "missing": missing.count, "at_most": found.verified.at_most,
            "tried": found.verified.tried,
        }  # fmt: skip
    return told


def _tell(subject: Subject, goal: Goal, found: Optimum) -> None:
    """Print the best settings, and the figures there."""
    program, machine, _ = subject.base
    row = found.row
    what = "points, each on drawn machines too" if subject.uncertain else "runs"
    say(f"{program.name} on {machine.name}: {found.runs} {what}")
    if found.verified is not None:
        missing = found.verified.missing
        shown = "" if found.kept else f", which does not show the {goal.risk:.3%} asked for"
        say(
            f"Verified on {missing.total} fresh machines: {missing.count} stall or miss a bound, "
            f"at most {found.verified.at_most:.3%} with 95 % confidence{shown}"
        )
    elif not found.kept:
        bounds = ", ".join(bound.text for bound in goal.bounds)
        on = f" on all drawn machines but {goal.risk:.3%}" if subject.uncertain else ""
        say(f"No run is without a stall and keeps {bounds or 'a figure'}{on}; the nearest:")
    settings = [(each.name, f"{row[each.column]}", each.unit) for each in subject.varied]
    figures = [
        (name, f"{value:.6g}" if isinstance(value, float) else str(value), "")
        for name, value in list(row.items())[2 + len(settings) :]
        if value is not None
    ]
    print_table(("best", "value", "unit"), [*settings, *figures], 100)
