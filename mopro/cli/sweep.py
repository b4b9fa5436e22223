"""`mopro sweep`."""

from __future__ import annotations

import os
from collections.abc import Sequence
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
from mopro.cli.outputs import claimed, drawn, keep_inputs, machine_file
from mopro.cli.program_files import compiled_program
from mopro.cli.progress import counted
from mopro.cli.say import print_table, say, say_json

if TYPE_CHECKING:
    import pyarrow as pa

    from mopro.sweeps import Sweep
    from mopro.sweeps.varied import Varied


@click.command()
@program_argument()
@machine_option()
@vary_option()
@click.option(
    "--design",
    type=click.Choice(["grid", "random", "sobol"]),
    default="grid",
    show_default=True,
    help="All combinations, or points drawn one by one, or evenly.",
)
@click.option("--points", type=click.IntRange(1), help="How many are drawn.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the draws.")
@draws_option()
@click.option(
    "--band",
    type=share_type(),
    default="90%",
    show_default=True,
    help="The middle share of the drawn machines that a figure's _low and _high enclose.",
)
@payload_option()
@for_option()
@click.option(
    "--out",
    type=OutputFile(".parquet", ".csv"),
    default="sweep.parquet",
    show_default=True,
    help="The results, .parquet or .csv.",
)
@click.option("--picture", type=OutputFile(".png", ".svg", ".pdf"), help="A map of the results.")
@click.option(
    "--jobs", type=click.IntRange(1), help="Processes; one for each processor unless given."
)
@click.option(
    "--scheduler", metavar="URL", help="Work on a Dask scheduler's workers (tcp://HOST:8786)."
)
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    file: str,
    machine: str,
    vary: tuple[str, ...],
    design: str,
    points: int | None,
    seed: int,
    draws: int | None,
    band: float,
    payload: float,
    for_s: float | None,
    out: Path,
    picture: Path | None,
    jobs: int | None,
    scheduler: str | None,
    grammar: str,
    as_json: bool,
) -> int:
    """Run a program many times, with settings and the machine varied; a row a run.

    --vary names VEL, ACC or PARA of an axis (VEL1; VEL1@14 is the one in line 14), payload, a key
    of the machine file (axis.moving_mass) or of an effect (effects.NAME.PARAMETER). VALUES are
    START:STOP:STEP or numbers with commas, with the unit behind; START:STOP to draw from.
    With --draws each point is run on so many machines, drawn from the intervals that the machine
    file states, and its row tells how many of them stalled.

    A command that was interrupted goes on from there when it is given again. Exits with 1 if all
    runs are refused.

    Example: mopro sweep programs/LVDT3.CMD --vary VEL1=10:60:2 --vary payload=0:5:1lb
    """
    from mopro.machine import load_machine
    from mopro.sweeps import Sweep
    from mopro.sweeps.designs import Design
    from mopro.sweeps.results import rows_file
    from mopro.sweeps.targets import Variant

    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs are processes here, and --scheduler has its own: state one")
    outputs = [("--out", out), ("--out", rows_file(out)), ("--picture", picture)]
    keep_inputs(outputs, [("FILE", file), ("--machine", machine_file(machine))])
    base = Variant(compiled_program(file, grammar), load_machine(machine), payload)
    tell_of_runs(base.machine)
    sweep = Sweep.of(
        base,
        map(varied_pair, vary),
        Design(design, points, seed),
        for_s,
        drawn_machines(draws, seed, band),
    )
    with claimed(picture):
        table = _run(sweep, jobs or os.cpu_count() or 1, scheduler, out)
    all_drawn = drawn(picture, lambda form: _figure(sweep, table, form))
    counts = _counts(table)
    if as_json:
        say_json({"outcomes": counts, "soonest": _soonest(table), "results": str(out)})
    else:
        _tell(sweep, table, out)
    return 0 if all_drawn and counts.keys() != {"refused"} else EXIT_FAILED


def _run(sweep: Sweep, jobs: int, scheduler: str | None, out: Path) -> pa.Table:
    """The results, by processes here or a scheduler's workers, with a line of progress."""
    from mopro.sweeps.executors import by_scheduler, local

    executor = local(jobs) if scheduler is None else by_scheduler(scheduler)
    with counted("sweeping", len(sweep.tasks), "runs") as tell:
        return sweep.run(executor, jobs, out, tell)


def _figure(sweep: Sweep, table: pa.Table, form: str) -> bytes:
    """The picture of the results, as a file of this form (png, svg, pdf)."""
    from mopro.plot import figure_bytes
    from mopro.plot.sweep import plot_sweep

    return figure_bytes(plot_sweep(sweep, table, _title(sweep)), form)


def _title(sweep: Sweep) -> str:
    program, machine, _ = sweep.subject.base
    numbers = ", ".join(number.varied.name for number in sweep.subject.uncertain)
    drawn = f", each point on machines drawn by {numbers}" if numbers else ""
    return f"{program.name} on {machine.name}: {len(sweep.tasks)} runs{drawn}"


def _counts(table: pa.Table) -> dict[str, int]:
    """Number of runs by outcome."""
    return {row["values"]: row["counts"] for row in table["outcome"].value_counts().to_pylist()}


def _soonest(table: pa.Table) -> dict[str, Any] | None:
    """The row of the soonest run, of equal ones that with most margin; None if none is ok."""
    ok = [row for row in table.to_pylist() if row["outcome"] == "ok"]
    return min(ok, key=lambda row: (row["time_s"], -(row["force_margin"] or 0.0)), default=None)


def _tell(sweep: Sweep, table: pa.Table, out: Path) -> None:
    """Print what was varied, how the runs went, and which of them is the soonest."""
    say(_title(sweep))
    print_table(
        ("varied", "values", "from", "to", "unit"),
        [_of_varied(each) for each in sweep.subject.varied],
        100,
    )
    say(", ".join(f"{count} {outcome}" for outcome, count in _counts(table).items()))
    refused = next((row for row in table.to_pylist() if row["outcome"] == "refused"), None)
    if refused is not None:
        say(f"Refused first, point {refused['point']}: {refused['why']}")
    if (best := _soonest(table)) is not None:
        at = ", ".join(f"{each.name} {best[each.column]}" for each in sweep.subject.varied)
        margin = best["force_margin"]
        spare = "" if margin is None else f", force margin {margin:.1%}"
        say(f"Soonest without a stall: {best['time_s']:.4f} s{spare}, at {at}")
        if sweep.draws is not None:
            say(
                f"  there {best['stalled_draws']} of {best['draws']} machines stall: at most "
                f"{best['stall_at_most']:.2%} with 95 % confidence"
            )
    say(f"Results: {out}")


def _of_varied(each: Varied) -> Sequence[str]:
    ends = (each.levels[0], each.levels[-1])
    first, last = (end if isinstance(end, str) else f"{float(end):g}" for end in ends)
    return each.name, "drawn" if each.drawn else str(len(each.levels)), first, last, each.unit
