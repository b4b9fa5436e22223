"""`mopro flash`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.link import baud_option, dialect_option, opened_session, trace_option
from mopro.cli.main import EXIT_FAILED
from mopro.cli.programs import compiled_program, refuse_unrunnable
from mopro.cli.terminal.options import Quantity, grammar_option, machine_option, program_argument
from mopro.cli.terminal.outputs import keep_inputs, machine_file
from mopro.cli.terminal.progress import counted
from mopro.cli.terminal.say import say

if TYPE_CHECKING:
    from mopro.link import Session
    from mopro.program import Program


@click.command()
@program_argument()
@click.option("--port", required=True, metavar="URL", help="Where the controller is.")
@dialect_option()
@baud_option()
@click.option("--name", help="Where to store it; the dialect's main program unless given.")
@click.option("--verify-only", is_flag=True, help="Change nothing: compare what is stored.")
@click.option(
    "--list", "as_list", is_flag=True, help="Change nothing: print what is stored, compared."
)
@click.option("--deadline", type=Quantity("time", "s", positive=True), help="Give up after this.")
@trace_option()
@machine_option()
@grammar_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    file: str,
    port: str,
    dialect: str,
    baud: int | None,
    name: str | None,
    verify_only: bool,
    as_list: bool,
    deadline: float | None,
    trace: Path | None,
    machine: str,
    grammar: str,
    as_json: bool,
) -> int:
    """Store a program on a controller: send, read back, compare, only then make it the one.

    Exits with 1 if the controller does not have the program in the end. An interrupted
    flash leaves the old program as it was; do it again.

    Example: mopro flash programs/LVDT3.CMD --port /dev/ttyUSB0
    """
    from mopro.link.flash import allowed_s, check_size

    inputs = [("FILE", file), ("--machine", machine_file(machine)), ("--dialect", dialect)]
    keep_inputs([("--trace", trace)], inputs)
    program = compiled_program(file, grammar)
    refuse_unrunnable(program, machine)
    with opened_session(port, dialect, baud, trace) as session:
        check_size(session, program)
        name = name or session.dialect.names.main
        session.give(deadline or allowed_s(session, program))
        if as_list:
            return _listed(session, program, name, grammar, as_json)
        if verify_only:
            return _verified(session, program, name, as_json)
        return _flashed(session, program, name, as_json)


def _flashed(session: Session, program: Program, name: str, as_json: bool) -> int:
    from mopro.link.flash import flash

    with counted("storing", 0, "statements") as tell:
        done = flash(session, program, name, tell)
    report = {
        "program": program.name,
        "stored_as": done.name,
        "statements": done.statements,
        "sha256": program_hash(program),
        "seconds": done.seconds,
        "retried": done.retried,
    }
    if as_json:
        say(json.dumps(report, indent=1))
    else:
        say(
            f"{program.name}: {done.statements} statements stored as {done.name} and read back "
            f"equal in {done.seconds:.2f} s; {done.retried} lines said again; "
            f"hash {program_hash(program)[:12]}"
        )
    return 0


def _verified(session: Session, program: Program, name: str, as_json: bool) -> int:
    from mopro.link.flash import verify

    verify(session, program, name)
    digest = program_hash(program)
    if as_json:
        report = {"program": program.name, "stored_as": name, "equal": True, "sha256": digest}
        say(json.dumps(report, indent=1))
    else:
        say(f"{name} on the controller is {program.name}; hash {digest[:12]}")
    return 0


def _listed(session: Session, program: Program, name: str, grammar: str, as_json: bool) -> int:
    from mopro.link.flash import differences, stored_program
    from mopro.program.statements import canonical

    stored = stored_program(session, name, grammar)
    found = differences(program, canonical(stored).splitlines())
    if as_json:
        rows = [{"statement": at, "file": ours, "stored": theirs} for at, ours, theirs in found]
        listing = canonical(stored).splitlines()
        report = {"stored_as": name, "sha256": program_hash(stored), "listing": listing}
        say(json.dumps({**report, "differences": rows}, indent=1))
        return EXIT_FAILED if found else 0
    say(canonical(stored), nl=False)
    for at, ours, theirs in found:
        say(f"statement {at}: {program.name} has `{ours}`, {name} has `{theirs}`", err=True)
    if not found:
        say(f"{name} means the same as {program.name}", err=True)
    return EXIT_FAILED if found else 0


def program_hash(program: Program) -> str:
    """The digest of what the program means: its canonical statements."""
    import hashlib

    from mopro.program.statements import canonical

    return hashlib.sha256(canonical(program).encode("ascii")).hexdigest()
