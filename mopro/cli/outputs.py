"""Outputs of a command: inputs are not overwritten, and a failed drawing is only a warning."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.options import STANDARD
from mopro.cli.say import say
from mopro.errors import MoproError

if TYPE_CHECKING:
    from mopro.recording import Sink
    from mopro.recording.record import Columns

# An option (or argument) as the person writes it, and the file that it was given.
Named = tuple[str, str | Path | None]

_NO_FILES = (None, "-", STANDARD)

# What a drawing library raises for a full disk, too little memory or a text it cannot set.
_DRAWING_ERRORS = (
    ArithmeticError, ImportError, LookupError, MemoryError, MoproError, OSError, RuntimeError,
    TypeError, ValueError,
)  # fmt: skip


def keep_inputs(outputs: Iterable[Named], inputs: Iterable[Named]) -> None:
    """Refuse a command that would write over a file it reads, or two outputs over each other.

    Files are compared, not names, so links are followed. Options without a file are None; `-` is
    none either.
    Raises UsageError.
    """
    written = [(option, Path(file)) for option, file in outputs if file not in _NO_FILES]
    read = [(option, Path(file)) for option, file in inputs if file not in _NO_FILES]
    for option, file in written:
        for other, source in read:
            if _same(file, source):
                message = f"{option} would overwrite {source}, which {other} reads"
                raise click.UsageError(f"{message}; choose another name for {option}")
    for (option, file), (other, second) in combinations(written, 2):
        if option != other and _same(file, second):
            raise click.UsageError(f"{option} and {other} would both write {second}")


def machine_file(name: str | None) -> str | None:
    """The file that `--machine` names; None for a machine that is built in."""
    from mopro.machine import builtin_machines

    return None if name is None or name in builtin_machines() else name


def _same(one: Path, other: Path) -> bool:
    """True if both are the same regular file, existing or not; never for pipes and devices."""
    try:
        return stat.S_ISREG(one.stat().st_mode) and os.path.samefile(one, other)
    except FileNotFoundError:
        return os.path.realpath(one) == os.path.realpath(other)
    except OSError:
        return False


@contextmanager
def claimed(*paths: Path | None) -> Iterator[None]:
    """Hold the places of outputs during the work; DataError first for one that takes no file."""
    from mopro.files import claim

    with ExitStack() as held:
        for path in paths:
            if path is not None:
                held.enter_context(claim(path))
        yield


def drawn(path: Path | None, draw: Callable[[str], bytes]) -> bool:
    """Write the figure or page that `draw` makes for a format, such as png; False if that fails.

    A failure is a warning on stderr; other outputs are not affected. True without a `path`.
    """
    if path is None:
        return True
    from mopro.files import write

    try:
        write(path, draw(path.suffix[1:].lower()))
    except _DRAWING_ERRORS as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        reason = reason.removeprefix(f"{path}: ")
        say(f"warning: {path}: not drawn: {reason} [not-drawn]", err=True)
        return False
    return True


class DrawingSink:
    """A sink of a drawing beside a run's recording; its first error costs the run nothing.

    It ends the drawing, and is told when `check` raises it.
    """

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._error: Exception | None = None

    def write(self, columns: Columns) -> None:
        if self._error is None:
            try:
                self._sink.write(columns)
            except _DRAWING_ERRORS as error:
                self._error = error

    def check(self) -> None:
        """Raise what went wrong."""
        if self._error is not None:
            raise self._error


def page_bytes(page: str) -> bytes:
    """A page as UTF-8; what that cannot express (odd file names) is written as an escape."""
    return page.encode("utf-8", "backslashreplace")
