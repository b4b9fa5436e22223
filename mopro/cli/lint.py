"""`mopro lint`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import click

from mopro.cli.main import EXIT_BAD_INPUT, EXIT_FAILED
from mopro.cli.options import machine_names, payload_type, rule_names, tell_of_runs
from mopro.cli.program_files import read_text, show_difference, write_text
from mopro.cli.progress import counted
from mopro.cli.say import is_terminal, say, say_findings
from mopro.errors import ModelError, MoproError, Severity
from mopro.language.parse import GRAMMARS
from mopro.lint.config import check_rule_names, find_settings, lengths
from mopro.lint.output import FORMATS, Report, explain, page, summary
from mopro.lint.rule import Settings

_EXPLAIN_ALL = "all"
# Parts of the work on one file that the line of progress counts.
_STEPS = 20


@click.command()
@click.argument("files", nargs=-1, metavar="FILE...")
@click.option(
    "--format", "form", type=click.Choice(list(FORMATS)), default="text", show_default=True
)
@click.option("--fix", is_flag=True, help="Put in the fixes that are safe.")
@click.option("--diff", is_flag=True, help="Show what --fix would change, and change nothing.")
@click.option(
    "--explain",
    metavar="RULE",
    help="Explain a rule (`all`: every rule), and end.",
    shell_complete=rule_names,
)
@click.option(
    "--machine", help="Built-in name or file [default: chow1992].", shell_complete=machine_names
)
@click.option("--payload", type=payload_type(), metavar="MASS", help="Such as 5lb or 2kg.")
@click.option(
    "--start", metavar="AXIS=PLACE", multiple=True, help="Start, from mid-travel, such as 1=-5in."
)
@click.option("--grammar", type=click.Choice(list(GRAMMARS)), help="Which statements exist.")
@click.option(
    "--select",
    metavar="RULES",
    help="Ask only these rules (comma between them).",
    shell_complete=rule_names,
)
@click.option(
    "--ignore", metavar="RULES", help="Do not ask these rules.", shell_complete=rule_names
)
@click.option("--strict", is_flag=True, help="Exit with 1 for notes too.")
def command(
    files: tuple[str, ...], form: str, fix: bool, diff: bool, explain: str | None, strict: bool,
    **chosen: Any,
) -> int:  # fmt: skip
    """Tell what is wrong or dangerous in programs, before a machine moves.

    FILE may be - for standard input. Options win over `mopro.toml` and `[tool.mopro]` of
    `pyproject.toml`. Exits with 1 if there is an error or a warning (with --strict also for
    a note), 2 if a file cannot be read.

    Example: mopro lint programs/LVDT3.CMD --payload 5lb
    """
    if explain is not None:
        return _explain(explain)
    if not files:
        raise click.UsageError("name a file, or - for standard input")
    if fix:
        _keep_machine(files, chosen["machine"])
    # Files of one folder have the same.
    settings_in = cache(partial(_settings, chosen))
    tell_of = cache(_tell_of_runs)
    reports: list[Report] = []
    code = 0
    with counted("lint", len(files) * _STEPS, "steps") as tell:
        for number, file in enumerate(files):
            tell(number * _STEPS)

            def on_share(share: float, number: int = number) -> None:
                tell(round((number + share) * _STEPS))

            try:
                report, changed = _lint_file(file, settings_in, tell_of, on_share, fix, diff)
            except MoproError as error:
                say_findings(error.render(), err=True)
                code = EXIT_BAD_INPUT
                continue
            reports.append(report)
            code = max(code, EXIT_FAILED if changed or _fails(report, strict) else 0)
    if not diff:
        _tell(reports, form, fix and "-" in files)
    return code


def _keep_machine(files: tuple[str, ...], machine: str | None) -> None:
    """UsageError if --fix would write the machine's file."""
    from mopro.cli.outputs import keep_inputs, machine_file

    keep_inputs([("--fix", file) for file in files], [("--machine", machine_file(machine))])


def _fails(report: Report, strict: bool) -> bool:
    return any(strict or f.severity is not Severity.NOTE for f in report.findings)


def _tell(reports: list[Report], form: str, err: bool) -> None:
    """Print the findings; as text with a closing line, on a terminal also if there is none."""
    text = FORMATS[form](reports)
    if form != "text":
        if text:
            say(text, err)
        return
    if text:
        say_findings(text, err)
    if text or (reports and is_terminal(sys.stdout)):
        say(summary(reports), err)


def _lint_file(
    file: str,
    settings_in: Callable[[Path], Settings],
    tell_of: Callable[[str], None],
    on_share: Callable[[float], None],
    fix: bool,
    diff: bool,
) -> tuple[Report, bool]:
    """The report on one file, and whether --diff showed a change of it."""
    from mopro.lint.check import lint

    source, tail = read_text(file)
    settings = settings_in(Path.cwd() if file == "-" else Path(file).resolve().parent)
    changed = False
    if fix or diff:
        from mopro.lint.check import fixed

        better = fixed(source, settings)
        changed = diff and better != source
        if diff:
            show_difference(source, better)
        elif better != source or file == "-":
            write_text(file, better, tail)
        source = source if diff else better
    report = Report(source, lint(source, settings, on_share))
    tell_of(settings.machine)
    return report, changed


def _tell_of_runs(machine: str) -> None:
    """Tell which effects are off; a machine that cannot be read is told where a rule needs it."""
    if machine == Settings.machine:
        return  # built in, and most rules need no machine
    from mopro.machine import load_machine

    with suppress(ModelError):
        tell_of_runs(load_machine(machine))


def _settings(chosen: dict[str, Any], folder: Path) -> Settings:
    """The configuration of `folder`, and what the command line says otherwise."""
    fields: dict[str, Any] = {
        "machine": chosen["machine"],
        "payload_kg": chosen["payload"],
        "grammar": chosen["grammar"],
        "select": _names(chosen["select"]),
        "ignore": _names(chosen["ignore"]),
        "start_m": _starts(chosen["start"]) if chosen["start"] else None,
    }
    given = {name: value for name, value in fields.items() if value is not None}
    return replace(find_settings(folder), **given)


def _names(text: str | None) -> frozenset[str] | None:
    if text is None:
        return None
    try:
        return check_rule_names([name.strip() for name in text.split(",") if name.strip()])
    except ValueError as error:
        raise click.UsageError(str(error)) from error


def _starts(places: tuple[str, ...]) -> dict[int, float]:
    try:
        return lengths(dict(text.split("=", 1) for text in places))
    except ValueError as error:
        raise click.UsageError(f"--start: {error}") from error


def _explain(name: str) -> int:
    from mopro.lint.rules import RULES

    if name == _EXPLAIN_ALL:
        say(page(), nl=False)
        return 0
    (known,) = _names(name) or (None,)
    if known is None:
        raise click.UsageError("name one rule")
    say(explain(RULES[known]), nl=False)
    return 0
