"""Options and openings that the commands for a controller share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.terminal.complete import dialect_names

if TYPE_CHECKING:
    from mopro.link import Session

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
