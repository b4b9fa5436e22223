"""Program texts that a command changes: read and written byte for byte."""

from __future__ import annotations

import sys
from pathlib import Path

from mopro.cli.terminal.say import say, say_bytes
from mopro.language.load import MOST_BYTES, load_bytes, source_from_bytes
from mopro.source import Source


def read_text(file: str) -> tuple[Source, bytes]:
    """The text in `file` (`-`: standard input), and the bytes from its Ctrl-Z on."""
    if file == "-":
        data, name = sys.stdin.buffer.read(MOST_BYTES + 1), "<stdin>"
    else:
        data, name = load_bytes(file), file
    source = source_from_bytes(data, name)
    return source, data[len(source.encoded) :]


def write_text(file: str, source: Source, tail: bytes) -> None:
    """Write `source` in its own encoding with `tail` behind it; `-` is standard output."""
    data = source.encoded + tail
    if file == "-":
        say_bytes(data)
        return
    from mopro.files import write

    write(Path(file), data)


def show_difference(before: Source, after: Source) -> None:
    from difflib import unified_diff

    ends = (before.lines_with_ends, after.lines_with_ends)
    old, new = ([line.rstrip("\r\n") for line in lines] for lines in ends)
    for line in unified_diff(old, new, before.name, f"{before.name} (fixed)", lineterm=""):
        say(line)
