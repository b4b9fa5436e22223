"""`mopro blind`: the benchmark of `mopro reconcile` on experiments with hidden effects."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import OutputFile, Quantity, allow_python_option, machine_option
from mopro.cli.outputs import claimed, drawn, keep_inputs, page_bytes
from mopro.cli.progress import each_counted
from mopro.cli.say import print_markdown, say, say_json
from mopro.errors import DataError

if TYPE_CHECKING:
    from mopro.blind.scoring.scored_cases import CaseFolder
    from mopro.blind.scoring.verdict_source import VerdictSource

_GRIDS = (
    "smoke", "small", "full", "deleted", "foreign", "short", "constants", "noise", "base",
    "machines",
)  # fmt: skip
_MOST_SEED = 2**63 - 1


@click.group()
def command() -> None:
    """Make experiments whose answers are hidden, and score `mopro reconcile` on them.

    Example: mopro blind make --seed 1 --grid smoke --out cases
    """


@command.command()
@click.option(
    "--seed", type=click.IntRange(0, _MOST_SEED), required=True, help="Seed of all random draws."
)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), required=True)
@click.option("--grid", type=click.Choice(_GRIDS), default="small", show_default=True)
@click.option("--cases", metavar="A,B", help="Only the cases of these numbers.")
@click.option("--sample", type=click.IntRange(1), help="Only so many cases, evenly spread.")
@machine_option()
@click.option(
    "--effects",
    metavar="FILE.toml",
    help="A file with [[effect]] sections: candidates in all cases, and hidden in some.",
)
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True)
def make(
    seed: int,
    out: Path,
    grid: str,
    cases: str | None,
    sample: int | None,
    machine: str,
    effects: str | None,
    jobs: int,
) -> None:
    """Write a grid of experiments under --out, and their answers apart.

    Each case is a folder with experiment.toml, programs and data. answers.json holds
    what is hidden in them; its SHA-256 is printed, so that it can be published beforehand.
    Effects are hidden in the machine that --machine states. Those of --effects state a range
    for each of their parameters.

    Example: mopro blind make --seed 1 --grid small --out cases
    """
    from mopro.blind.cases.benchmark_machine import read_machine
    from mopro.blind.cases.grids import TOLERANCES, case_specs
    from mopro.blind.cases.make import make as write_cases
    from mopro.blind.cases.manifest import ANSWERS

    if grid == "machines" and (effects or machine != "chow1992"):
        raise click.UsageError("the grid machines draws its own machines and effects")
    only, stated = _case_numbers(cases), read_machine(machine, TOLERANCES.get(grid, 0.0), effects)
    if Path(machine).is_file() and out.resolve() in Path(machine).resolve().parents:
        raise click.UsageError(f"--machine {machine} lies in the folder that --out would fill")
    count = len(case_specs(grid, seed, stated.effects))
    if beyond := sorted(c for c in only if not 1 <= int(c) <= count):
        raise click.BadParameter(
            f"{beyond[0]}: the grid {grid} has cases 1 to {count}", param_hint="--cases"
        )
    steps = write_cases(seed, grid, out, only, jobs, stated, sample)
    expected = min(len(only) or count, sample or count)
    *made, seal = each_counted(steps, expected + 1, "making", "cases")
    say(f"{len(made)} cases in {out}")
    say(f"{out / ANSWERS} sha256 {seal}")


def _case_numbers(cases: str | None) -> frozenset[str]:
    """The numbers of `--cases`, three digits each as in the names of the folders."""
    parts = [part.strip() for part in (cases or "").split(",") if part.strip()]
    if wrong := [part for part in parts if not part.isdecimal()]:
        raise click.BadParameter(f"'{wrong[0]}' is no case's number", param_hint="--cases")
    return frozenset(f"{int(part):03d}" for part in parts)


@command.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--jobs", type=click.IntRange(1), default=2, show_default=True, help="Processes.")
@click.option("--cases", metavar="A,B", help="Only the cases of these numbers.")
@click.option("--sample", type=click.IntRange(1), help="Only so many cases, evenly spread.")
@click.option("--again", is_flag=True, help="Ask again even if a verdict is kept.")
@click.option("--follow/--no-follow", default=True, help="Run the experiments proposed.")
@click.option(
    "--patience",
    type=Quantity("time", "s", positive=True),
    default="10min",
    show_default=True,
    help="How long one case may take.",
)
@allow_python_option()
@click.option("--answers-from", type=click.Path(path_type=Path, file_okay=False), hidden=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--report", type=OutputFile(".md"), help="Write the tables to a Markdown file.")
def score(
    folder: Path,
    jobs: int,
    cases: str | None,
    sample: int | None,
    follow: bool,
    as_json: bool,
    report: Path | None,
    **asking: Any,
) -> int:
    """Ask `mopro reconcile` about each case of FOLDER and compare with the answers.

    Verdicts are kept as verdict.json beside each experiment, so that an interrupted score
    continues where it was. An ambiguous verdict is followed up: the experiment that it
    proposes is run on the hidden plant and reconcile is asked again.

    Example: mopro blind score cases --report score.md
    """
    from mopro.blind.scoring.score import Score, page
    from mopro.blind.scoring.scored_cases import CaseFolder, follow_up_cases, judge_cases

    found = CaseFolder.read(folder, _case_numbers(cases), sample)
    keep_inputs([("--report", report)], [("FOLDER", file) for file in found.files])
    if follow:
        found.refuse_foreign_follow_ups()
    source = _source(found, jobs, **asking)
    with claimed(report):
        asked = judge_cases(found, source, jobs)
        judged = each_counted(asked, len(found.cases), "asking", "cases")
        follow_ups = follow_up_cases(found, source, judged, jobs) if follow else ()
        followed = each_counted(follow_ups, 0, "following up", "cases")
    result = Score(tuple(judged), tuple(followed), found.grid)
    all_drawn = drawn(report, lambda _: page_bytes(page(result)))
    if as_json:
        say_json(result.as_json())
    else:
        print_markdown(page(result))
    return 0 if all_drawn else EXIT_FAILED


def _source(
    cases: CaseFolder,
    jobs: int,
    again: bool,
    patience: float,
    allow_python: bool,
    answers_from: Path | None,
) -> VerdictSource:
    """The source of the verdicts, of which `jobs` are asked for at once.

    DataError for programs that are not allowed to run.
    """
    from mopro.blind.scoring.verdict_source import VerdictSource

    if not (allow_python or answers_from) and (programs := cases.programs):
        raise DataError(
            f"{programs[0]}: a program, which is run only with --allow-python: look at it first, "
            "if you did not make these cases",
            "not-allowed",
        )
    # The processes share the cores: more threads than those would only wait for each other.
    simulations = max((os.cpu_count() or 1) // jobs, 1)
    return VerdictSource(again, patience, allow_python, answers_from, simulations)
