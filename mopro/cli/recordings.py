"""Recordings as `mopro run` writes them: over no other file, or to standard output."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.terminal.options import STANDARD
from mopro.errors import DataError

if TYPE_CHECKING:
    from mopro.link.writer import Writer
    from mopro.recording import FileSink, Header, Run
    from mopro.recording.record import Columns

# Chunks of a recording that may wait: a minute of samples.
_MOST_CHUNKS = 4
# The end of a recording, its durable copy on the disk, takes at most so long (s).
_FINISHED_WITHIN_S = 30.0


def replaces_recording(out: Path, force: bool) -> bool:
    """True if `out` is a recording, which a run would replace.

    UsageError if it is another file with something in it, unless `force` is given.
    """
    if out == STANDARD or not out.is_file() or out.stat().st_size == 0:
        return False
    from mopro.recording.reading import is_recording

    if is_recording(out):
        return True
    if not force:
        message = f"{out} is there and is no recording of mopro"
        raise click.UsageError(f"{message}: choose another name for --out, or add --force")
    return False


@contextmanager
def recording_sink(out: Path, header: Header, apart: bool = False) -> Iterator[FileSink]:
    """A sink for `out`; for `-` the recording is written as CSV when it is whole.

    With `apart` the file is written by a thread of its own, and holds up nobody who writes to it.
    """
    from mopro.recording import open_sink

    opened = _apart if apart else open_sink
    if out != STANDARD:
        with opened(out, header) as sink:
            yield sink
        return
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "run.csv"
        with opened(whole, header) as sink:
            yield sink
        with open(whole, "rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)
        sys.stdout.flush()


class _Apart:
    """A FileSink behind a writer."""

    def __init__(self, writer: Writer[FileSink], header: Header) -> None:
        self._writer = writer
        self.header = header
        self.run: Run | None = None

    def write(self, columns: Columns) -> None:
        self._writer.put(lambda sink: sink.write(columns))

    def finish(self, sink: FileSink) -> None:
        sink.header, sink.run = self.header, self.run


class _Abandoned(DataError):
    """The recording shall not be kept."""


@contextmanager
def _apart(out: Path, header: Header) -> Iterator[FileSink]:
    """As open_sink, in a thread of its own."""
    from mopro.link.writer import Writer
    from mopro.recording import open_sink

    writer = Writer("the recording", open_sink(out, header), _MOST_CHUNKS)
    apart = _Apart(writer, header)
    try:
        yield apart
    except BaseException:
        with suppress(DataError):
            writer.put(_abandon)
            writer.close()
        raise
    writer.put(apart.finish)
    writer.close(_FINISHED_WITHIN_S)


def _abandon(sink: FileSink) -> None:
    raise _Abandoned("the run has not begun")
