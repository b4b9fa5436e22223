"""`mopro reconcile`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.options import OutputFile, allow_python_option, effect_names
from mopro.cli.outputs import claimed, drawn, keep_inputs, page_bytes
from mopro.cli.say import print_rows, print_table, say, say_json
from mopro.errors import DataError
from mopro.files import write
from mopro.units import residual_unit

if TYPE_CHECKING:
    from mopro.engine.verdict import Verdict
    from mopro.experiment.comparison import Place
    from mopro.experiment.conclusion import Conclusion

_MOST_ROWS = 40
_MOST_CANDIDATES = 200
_PASSES = ("pass", "effects", "EBIC", "why")
_TRIED = ("candidate", "status", "σ in all", "reason")
_EFFECTS = ("effect", "σ in all", "log10 Bayes", "held out")


@click.command()
@click.argument("experiment", type=click.Path())
@click.option("--out", type=OutputFile(".toml"), help="The machine file with the effects added.")
@click.option("--report", type=OutputFile(".html"), help="An HTML page with the evidence.")
@click.option(
    "--next",
    "next_run",
    type=OutputFile(".cmd", ".csv"),
    help="The run that would tell alternatives apart: a program of the motor, a command in CSV.",
)
@click.option("--jobs", type=click.IntRange(1, 64), help="Simulations at once (as many as cores).")
@click.option(
    "--without",
    metavar="EFFECT",
    multiple=True,
    help="Leave this effect out.",
    shell_complete=effect_names,
)
@click.option(
    "--only",
    metavar="EFFECT",
    multiple=True,
    help="Try this effect, no others.",
    shell_complete=effect_names,
)
@click.option(
    "--with-drafts", is_flag=True, help="Write terms that nobody listed into --out as well."
)
@allow_python_option()
@click.option(
    "--explain", is_flag=True, help="Print how the answer came about: passes, candidates."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    experiment: str,
    out: Path | None,
    report: Path | None,
    next_run: Path | None,
    jobs: int | None,
    without: tuple[str, ...],
    only: tuple[str, ...],
    with_drafts: bool,
    allow_python: bool,
    explain: bool,
    as_json: bool,
) -> int:
    """Find the effects that the machine's model lacks, add them, and show the gap shrink.

    --without and --only may be given several times, and together. With
    --with-drafts the machine file has the free-form terms inside the model as
    well, as [[effect]] marked unconfirmed.
    Exits with 1 if a significant residual remains that no effect of the catalogue explains.

    Example: mopro reconcile experiment.toml --out machine.toml --report why.html
    """
    from mopro.experiment.opened import experiment_file

    outputs = [("--out", out), ("--report", report), ("--next", next_run)]
    keep_inputs(outputs, [("EXPERIMENT", experiment)])
    stated = experiment_file(experiment)
    keep_inputs(outputs, [("EXPERIMENT", file) for file in stated.files])
    loaded = stated.opened(allow_python=allow_python)
    left_out = _left_out(without, only, loaded.effects)
    for note in loaded.notes:
        say(note, err=True)
    with claimed(out, report, next_run), _progress() as progress:
        conclusion = loaded.conclude(jobs or os.cpu_count() or 1, progress, left_out, with_drafts)
    code = max(_written(conclusion, out, report), _next_written(conclusion, next_run))
    if as_json:
        answer = {"experiment": experiment, "machine": loaded.machine_name, **conclusion.as_json()}
        if loaded.rows is not None:
            answer["rows"] = loaded.rows.rows.as_json()
        say_json(answer, default=float, allow_nan=False)
    else:
        _tell(conclusion)
        if explain:
            _explain(conclusion.verdict)
        _tell_next(conclusion)
        _tell_glance(conclusion)
    return max(code, EXIT_FAILED if conclusion.verdict.verdict == "unexplained" else 0)


def _left_out(
    without: tuple[str, ...], only: tuple[str, ...], effects: frozenset[str]
) -> frozenset[str]:
    """Those of `effects` that are no candidates; UsageError if that leaves none, or for a name."""
    from mopro.effects.resolve import suggestion

    for option, name in [("--without", n) for n in without] + [("--only", n) for n in only]:
        if name not in effects:
            near = suggestion(name, effects)
            raise click.BadParameter(f"there is no effect called '{name}'; {near}",
                                     param_hint=f"'{option}'")  # fmt: skip
    candidates = frozenset(only or effects) - frozenset(without)
    if not candidates:
        raise click.UsageError("--without leaves no effect to try: it names each of --only")
    return effects - candidates


def _written(conclusion: Conclusion, out: Path | None, report: Path | None) -> int:
    """Write the machine file, then draw the page; the exit code if one of them fails.

    The verdict is printed afterwards even if the disk is full.
    """
    code = 0
    if out:
        try:
            if conclusion.repaired.fault is not None:
                raise conclusion.repaired.fault
            write(out, conclusion.text_in(out.parent).encode("utf-8"))
        except DataError as error:
            say(error.render(), err=True)
            code = EXIT_BAD_INPUT

    def page(form: str) -> bytes:
        from mopro.viewer.conclusion import conclusion_page

        return page_bytes(conclusion_page(conclusion))

    return code if drawn(report, page) else max(code, EXIT_FAILED)


def _next_written(conclusion: Conclusion, path: Path | None) -> int:
    """Write the next experiment, if there is one; the exit code."""
    proposal = conclusion.next_experiment
    if path is None:
        return 0
    if proposal is None:
        say(f"{path} is not written: no run is proposed for this verdict", err=True)
        return 0
    if path.suffix.lower() != proposal.suffix.lower():
        say(f"error: {path} is not written: --next is a file {proposal.suffix} here", err=True)
        return EXIT_BAD_INPUT
    try:
        write(path, proposal.text.encode("utf-8"))
    except DataError as error:
        say(error.render(), err=True)
        return EXIT_BAD_INPUT
    return 0


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """Show the current step on a terminal; yields the function that sets it."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _: None
        return
    with console.status("simulating") as status:
        yield status.update


def _tell(conclusion: Conclusion) -> None:
    """Say the evidence: that of each effect, the gap by run, its largest place and remarks."""
    from mopro.experiment.wording import AFTER, BEFORE, note_words

    verdict = conclusion.verdict
    if verdict.fitted:
        print_table(_EFFECTS, list(_effect_rows(verdict)), _MOST_ROWS)
    columns = ("run", "sensor", BEFORE, AFTER, "held out", "machine file", "noise")
    print_table(columns, _gap_rows(conclusion), _MOST_ROWS)
    worst = map(_place_words, conclusion.where[:1])
    if remarks := [*worst, *note_words(verdict), *conclusion.reservations()]:
        say("\n".join(remarks) + "\n")


def _place_words(worst: Place) -> str:
    from mopro.experiment.wording import BEFORE, place_words

    size = f"{worst.rms:.3g} {residual_unit(worst.unit)}"
    size += f", {worst.sigma:.3g} σ" if worst.sigma else ""
    return f"Largest disagreement {BEFORE}: {worst.run}, {place_words(worst)}: {size}."


def _explain(verdict: Verdict) -> None:
    from mopro.experiment.wording import candidate_rows, trace_rows

    say("How the answer came about, by the passes that decided something:")
    print_table(_PASSES, list(trace_rows(verdict)), _MOST_ROWS)
    say("All candidates:")
    print_table(_TRIED, candidate_rows(verdict), _MOST_CANDIDATES)


def _tell_next(conclusion: Conclusion) -> None:
    from mopro.experiment.glance import NEXT_EXPERIMENT

    if conclusion.next_experiment:
        say(f"{NEXT_EXPERIMENT}\n")
        lines = conclusion.next_experiment.text.splitlines(keepends=True)
        say("".join(lines[:_MOST_ROWS]))
        if len(lines) > _MOST_ROWS:
            say(f"... and {len(lines) - _MOST_ROWS} more lines: --next writes all\n")


def _tell_glance(conclusion: Conclusion) -> None:
    """Say the answer at a glance, as the last lines."""
    glance = conclusion.glance
    say(glance.sentence)
    print_rows((label, list(map(str, lines))) for label, lines in glance.rows())


def _effect_rows(verdict: Verdict) -> Iterator[list[str]]:
    from mopro.experiment.wording import effect_words, held_out_words

    for effect in verdict.fitted:
        yield [
            effect_words(effect, verdict),
            f"{effect.sigmas:.3g}",
            f"{effect.log10_bayes_factor:.3g}",
            held_out_words(effect, verdict),
        ]


def _gap_rows(conclusion: Conclusion) -> Iterator[list[str]]:
    for run, rerun in zip(conclusion.verdict.gap.runs, conclusion.repaired.rms, strict=True):
        figures = (run.before_rms, run.after_rms, run.held_out_rms, rerun, run.noise_rms)
        unit = residual_unit(run.unit)
        yield [run.run, run.sensor, *("-" if f is None else f"{f:.3g} {unit}" for f in figures)]
