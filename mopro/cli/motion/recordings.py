"""Recordings as `mopro run` writes them: over no other file, or to standard output."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mopro.cli.terminal.options import STANDARD

if TYPE_CHECKING:
    from mopro.recording import FileSink, Header


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
def recording_sink(out: Path, header: Header) -> Iterator[FileSink]:
    """A sink for `out`; for `-` the recording is written as CSV when it is whole."""
    from mopro.recording import open_sink

    if out != STANDARD:
        with open_sink(out, header) as sink:
            yield sink
        return
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "run.csv"
        with open_sink(whole, header) as sink:
            yield sink
        with open(whole, "rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)
        sys.stdout.flush()
