"""`mopro import`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from mopro.cli.logs import asked_of, log_options
from mopro.cli.terminal.say import say

_KINDS = ("kinematic", "axis", "thermal", "sawyer")


@click.command()
@click.argument("logs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--as", "folder", type=click.Path(path_type=Path), required=True, help="A folder to write."
)
@click.option("--kind", type=click.Choice(_KINDS), help="Kind of machine, if the log does not say.")
@click.option("--command", "commands", multiple=True, metavar="COLUMN", help="What it was told.")
@click.option("--measured", multiple=True, metavar="COLUMN", help="Use only these as sensors.")
@click.option("--unit", "units", multiple=True, metavar="COLUMN=UNIT", help="A column's unit.")
@log_options()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    logs: tuple[Path, ...],
    folder: Path,
    kind: str | None,
    commands: tuple[str, ...],
    measured: tuple[str, ...],
    units: tuple[str, ...],
    time: str | None,
    time_unit: str | None,
    rate: float | None,
    missing: tuple[str, ...],
    as_json: bool,
) -> None:
    """Make an experiment of a log: its data, a machine file and an experiment file.

    Several logs have several clocks; their offset is estimated where a command in one and a
    measurement in the other can be compared. Every decision is a line of the experiment file
    with its reason; lines with CHECK are to be read first. No file is overwritten.

    Example: mopro import servo.csv --as servo/ && mopro compare servo/experiment.toml
    """
    from mopro.importing import Wishes, import_logs

    wishes = Wishes(kind, commands, measured, dict(map(_column_and_unit, units)))
    done = import_logs(logs, folder, wishes, asked_of(time, time_unit, rate, missing))
    checks = _checks(done.files[0])
    if as_json:
        answer = {
            "kind": done.proposal.kind,
            "files": [str(file) for file in done.files],
            "command": done.proposal.command and done.proposal.command.raw,
            "inputs": [s.raw for s in done.proposal.inputs],
            "sensors": [s.raw for s in done.proposal.sensors],
            "unused": {s.raw: s.reason for s in done.proposal.unused},
            "decisions": [
                {"subject": d.subject, "taken_as": d.taken_as, "reason": d.reason, "check": d.check}
                for d in done.decisions
            ],
            "check": checks,
            "rows": done.rows.as_json(),
        }
        say(json.dumps(answer, indent=1))
        return
    for decision in done.decisions:
        say(str(decision))
    for signal in done.proposal.signals:
        role = "not used" if signal.role == "unused" else signal.role
        say(f"column {signal.raw}: {role} ({signal.reason})")
    for words in checks:
        say(f"CHECK: {words}")
    say(f"written: {', '.join(map(str, done.files))}")
    say(f"next: mopro compare {done.files[0]}")


def _column_and_unit(text: str) -> tuple[str, str]:
    """The column and the unit of `pos=mm`; a column's name may have a sign of equality."""
    column, _, unit = text.rpartition("=")
    if not column:
        raise click.BadParameter(f"expected COLUMN=UNIT, such as pos=mm, found {text}", None, None,
                                 "--unit")  # fmt: skip
    return column, unit


def _checks(experiment: Path) -> list[str]:
    """The lines of the files that ask for a check, in their order."""
    found = []
    for file in (experiment, experiment.with_name("machine.toml")):
        if file.exists():
            lines = file.read_text("utf-8").splitlines()
            found += [line.removeprefix("# CHECK: ") for line in lines if "# CHECK: " in line[:9]]
    return found
