"""Output of commands: the only way to standard output and standard error.

Text from files, names and replies is made visible here, so that none of it can steer the
terminal; a standard error that cannot be written is no reason to give up the work. Colours
and the line of progress appear on a terminal only.
"""

from __future__ import annotations

import io
import os
import re
import select
import shutil
import sys
from collections.abc import Iterable, Sequence
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any, TextIO

import click

from mopro.text import visible

if TYPE_CHECKING:
    from rich.console import Console, RenderableType


_FINDING = re.compile(r"(.+?:\d+:\d+: )(warning: |note: )?(.*?)( \[[\w-]+\])?")
_CARET = re.compile(r" +\^~*")
_KIND_COLORS = {"warning: ": "yellow", "note: ": "cyan"}
# Erases to the end of the line.
_ERASE = "\r\x1b[K"
# True while a line of progress stands on the terminal.
_shown = False


def is_terminal(stream: TextIO) -> bool:
    """True if `stream` is a terminal that can rewrite a line."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def has_colours(stream: TextIO) -> bool:
    """True if `stream` is a terminal, and NO_COLOR (https://no-color.org) is not set."""
    return is_terminal(stream) and not os.environ.get("NO_COLOR")


def say(text: str = "", err: bool = False, nl: bool = True) -> None:
    """Write a line (or lines); OSError if standard output cannot take it."""
    end_status()
    if not err:
        click.echo(visible(text), nl=nl)
        return
    with suppress(OSError):
        click.echo(visible(text), err=True, nl=nl)


def say_json(value: Any, **how: Any) -> None:
    """Write a value as JSON to standard output; `how` is for json.dumps."""
    import json

    say(json.dumps(value, indent=1, **how))


def say_if_taken(text: str) -> None:
    """Write a short line to standard error, unless that would have to be waited for."""
    if is_terminal(sys.stderr):
        _written_at_once(f"{_ERASE}{visible(text)}\r\n")
    elif not _can_be_asked(sys.stderr) or select.select([], [sys.stderr], [], 0)[1]:
        say(text, err=True)


def say_findings(text: str, err: bool = False) -> None:
    """Write findings in the form `file:line:col: message [name]`, in colour on a terminal."""
    if not has_colours(sys.stderr if err else sys.stdout):
        say(text, err)
        return
    end_status()
    painted = "\n".join(map(_painted, visible(text).split("\n")))
    with suppress(OSError) if err else nullcontext():
        click.echo(painted, err=err, color=True)


def _painted(line: str) -> str:
    """A line of findings, which is visible text, in colour."""
    found = _FINDING.fullmatch(line)
    if found is None:
        return click.style(line, "green") if _CARET.fullmatch(line) else line
    place, kind, message, rule = found.groups(default="")
    kind = click.style(kind or "error: ", _KIND_COLORS.get(kind, "red"), bold=True)
    return click.style(place, bold=True) + kind + message + click.style(rule, dim=True)


def say_status(text: str) -> None:
    """Show `text` as the line of progress on standard error, in place of the one before.

    Nothing where that is no terminal, or none that takes text now (Ctrl-S): a run that is
    watched must not wait for it.
    """
    global _shown
    if is_terminal(sys.stderr):
        width = shutil.get_terminal_size().columns - 1
        _shown |= _written_at_once(_ERASE + visible(text).replace("\n", " ")[:width])


def end_status() -> None:
    """Take the line of progress away, unless the terminal takes no text now."""
    global _shown
    if _shown and _written_at_once(_ERASE):
        _shown = False


def _written_at_once(text: str) -> bool:
    """Write `text` to the terminal of standard error; False if that would have to be waited for.

    A terminal may be held (Ctrl-S) at any moment, so it is opened once more, as one that never
    blocks: the way it was opened is shared with other processes, and stays as it is.
    """
    if not _can_be_asked(sys.stderr):
        with suppress(OSError):
            sys.stderr.write(text)
            sys.stderr.flush()
        return True
    try:
        name = os.ttyname(sys.stderr.fileno())
        handle = os.open(name, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        os.write(handle, text.encode(sys.stderr.encoding, "backslashreplace"))
    except OSError:
        return False
    finally:
        os.close(handle)
    return True


def _can_be_asked(stream: TextIO) -> bool:
    """True for what this system can tell whether it takes text now: not on Windows."""
    try:
        return hasattr(os, "ttyname") and stream.fileno() >= 0
    except (OSError, ValueError, AttributeError):
        return False


def say_styled(text: str) -> None:
    """Write text that was made visible before, with the styles of a terminal in it."""
    end_status()
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
    _discard(sys.stdout)


def give_up_errors() -> None:
    """Discard what standard error could not take: a failed flush at exit changes the exit code."""
    try:
        sys.stderr.flush()
    except (OSError, ValueError):
        _discard(sys.stderr)


def _discard(stream: TextIO) -> None:
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


# -- tables and Markdown ----------------------------------------------------------------------
# Tables and Markdown on the terminal.

_PIPED_WIDTH = 160
# Columns of a line beside its label, however narrow the terminal is.
_NARROWEST = 24
# Spaces between columns: as many as leave the table within the terminal. Left and right of the
# one that is always there.
_GAPS = ((0, 1), (0, 1, 0, 0), (0, 0))


def print_table(
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    most: int,
    styles: Sequence[str] = (),
    width: int | None = None,
) -> None:
    """Print `rows` under `columns`, at most `most` of them: the first and the last ones.

    `styles` are rich's styles of the rows, shown in colour. The table is at most as wide as
    the terminal, and `width` where there is none; an empty line follows it.
    """
    from rich.measure import Measurement

    rows = list(rows)
    console = _console(width)
    for padding in _GAPS:
        table = _table(columns, rows, most, styles, padding)
        if Measurement.get(console, console.options, table).maximum < console.width:
            break
    _show(console, table)
    say()


def _table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    most: int,
    styles: Sequence[str],
    padding: tuple[int, ...],
) -> RenderableType:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE, show_edge=False, pad_edge=False, padding=padding)  # type: ignore[arg-type]
    for index, column in enumerate(columns):
        # In a narrow terminal figures go on in the next line; names stay whole if they can.
        table.add_column(column, overflow="fold", no_wrap=not index)
    left_out = len(rows) - most
    for index, row in enumerate(rows):
        if left_out > 0 and index == most // 2:
            table.add_row(*[f"... {left_out} more", *[""] * (len(columns) - 1)])
        if left_out <= 0 or index < most // 2 or index >= len(rows) - most // 2:
            style = styles[index] if styles else None
            table.add_row(*(Text(visible(cell)) for cell in row), style=style)
    return table


def print_rows(rows: Iterable[tuple[str, Sequence[str]]]) -> None:
    """Print lines beside the label of each row; on a terminal they end where it ends.

    Elsewhere a line is as long as it is, so that a program finds it whole.
    """
    from rich.text import Text

    rows, on_terminal = list(rows), sys.stdout.isatty()
    console = _console(None)
    indent = 4 + max(len(label) for label, _ in rows)
    for label, lines in rows:
        head = f"  {label}".ljust(indent)
        for line in map(visible, lines):
            width = max(console.width - indent, _NARROWEST) if on_terminal else sys.maxsize
            for part in Text(line).wrap(console, width):
                say(f"{head}{part.plain.rstrip()}")
                head = " " * indent


def print_markdown(text: str) -> None:
    """Print Markdown with its tables laid out on a terminal, elsewhere as it is."""
    if not is_terminal(sys.stdout):
        say(text, nl=False)
        return
    from rich.markdown import Markdown

    _show(_console(None), Markdown(visible(text)))


def _console(width: int | None) -> Console:
    from rich.console import Console

    if sys.stdout.isatty():
        return Console(force_terminal=has_colours(sys.stdout))
    return Console(width=width or _PIPED_WIDTH)


def _show(console: Console, drawn: RenderableType) -> None:
    with console.capture() as shown:
        console.print(drawn)
    say_styled(shown.get())
