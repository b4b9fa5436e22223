"""Commands for a controller: `mopro flash`, `mopro link-test`, `mopro ports`, and their options."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import (
    Quantity,
    dialect_names,
    grammar_option,
    machine_option,
    program_argument,
)
from mopro.cli.outputs import keep_inputs, machine_file
from mopro.cli.program_files import compiled_program, refuse_unrunnable
from mopro.cli.progress import counted
from mopro.cli.say import say, say_json

if TYPE_CHECKING:
    from mopro.link import Session
    from mopro.program import Program


Decorator = Callable[[Any], Any]


def dialect_option() -> Decorator:
    return click.option(
        "--dialect",
        shell_complete=dialect_names,
        default="checked",
        show_default=True,
        help="What the controller speaks: plain, checked, or a dialect file (docs/link.md).",
    )


def baud_option() -> Decorator:
    return click.option(
        "--baud", type=click.IntRange(50, 4_000_000), help="Line rate, if not the dialect's."
    )


def trace_option() -> Decorator:
    return click.option(
        "--trace",
        type=click.Path(dir_okay=False, path_type=Path),
        help="Write every byte and its time to this file.",
    )


def token() -> str | None:
    """The token in the environment, which both ends of a TCP link state; None without one."""
    from mopro.link.token import VARIABLE, checked

    try:
        return checked(os.environ.get(VARIABLE))
    except ValueError as error:
        raise click.UsageError(str(error)) from error


@contextmanager
def opened_session(
    port: str, dialect: str, baud: int | None, trace: Path | None
) -> Iterator[Session]:
    """A conversation with the controller at `port`, found and begun; LinkError if there is none."""
    from mopro.link.backend import OPENING_S

    with connected_session(port, dialect, baud, trace) as session:
        session.give(OPENING_S)
        session.open()
        yield session


@contextmanager
def connected_session(
    port: str, dialect: str, baud: int | None, trace: Path | None
) -> Iterator[Session]:
    """The open port with nothing said yet."""
    from mopro.files import log
    from mopro.link import SerialPort, Session, load_dialect
    from mopro.link.transport import Port, TracedPort

    language = load_dialect(dialect)
    line: Port = SerialPort(port, language.line, baud, token())
    with ExitStack() as open_things:
        open_things.callback(line.close)
        if trace is not None:
            line = TracedPort(line, log(trace), name=str(trace))
            open_things.pop_all()
            open_things.callback(line.close)
        yield Session(line, language, baud=baud)


# -- mopro link-test --------------------------------------------------------------------------


@click.command()
@click.option("--port", required=True, metavar="URL", help="Where the controller is.")
@dialect_option()
@baud_option()
@click.option(
    "--deadline",
    type=Quantity("time", "s", positive=True),
    default=60.0,
    show_default=True,
    help="Give up after this.",
)
@trace_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def link_test(
    port: str, dialect: str, baud: int | None, deadline: float, trace: Path | None, as_json: bool
) -> int:
    """Walk through a dialect on a live controller and say what matches. Moves nothing.

    Overwrites the controller's scratch program. Exits with 1 if anything does not match.

    Example: mopro link-test --port /dev/ttyUSB0 --dialect mine.toml --trace link.log
    """
    from mopro.link.probe import probe

    keep_inputs([("--trace", trace)], [("--dialect", dialect)])
    steps = []
    with connected_session(port, dialect, baud, trace) as session:
        session.give(deadline)
        for step in probe(session):
            steps.append(step)
            if not as_json:
                say(f"{'matched' if step.matched else 'NOT AS SAID':<12} {step.name}: {step.said}")
    if as_json:
        say_json([asdict(step) for step in steps])
    return 0 if all(step.matched for step in steps) else EXIT_FAILED


# -- mopro ports ------------------------------------------------------------------------------


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def ports(as_json: bool) -> None:
    """List the serial ports of this machine.

    Example: mopro ports --json
    """
    from mopro.link.transport import available_ports

    ports = available_ports()
    if as_json:
        rows = [{"device": device, "description": text} for device, text in ports]
        say_json(rows)
        return
    for device, text in ports:
        say(f"{device}  {text}")
    if not ports:
        say("no serial ports; a virtual controller: mopro serve", err=True)


# -- mopro flash ------------------------------------------------------------------------------


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
def flash(
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
        say_json(report)
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
        say_json(report)
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
        say_json({**report, "differences": rows})
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
