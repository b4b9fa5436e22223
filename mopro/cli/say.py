"""Output of commands: the only way to standard output and standard error.

Text from files, names and replies is made visible here, so that none of it can steer the
terminal; a standard error that cannot be written is no reason to give up the work.
"""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress

import click

from mopro.text import visible


def say(text: str = "", err: bool = False, nl: bool = True) -> None:
    """Write a line (or lines); OSError if standard output cannot take it."""
    if not err:
        click.echo(visible(text), nl=nl)
        return
    with suppress(OSError):
        click.echo(visible(text), err=True, nl=nl)


def say_styled(text: str) -> None:
    """Write text that was made visible before, with the styles of a terminal in it."""
    click.echo(text, nl=False)


def say_bytes(data: bytes) -> None:
    """Write a file's bytes to standard output as they are."""
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


def prepare_streams() -> None:
    """Make the standard streams usable, whatever the process was started with.

    A closed one reads and writes nothing: its number must not become that of a data file.
    What the encoding of a stream lacks is written as an escape.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            with suppress(OSError):
                os.fstat(number)
                continue
            mode = "r" if number == 0 else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def discard_output() -> None:
    """Let what is still to be flushed to standard output go nowhere, so that exit is quiet."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
