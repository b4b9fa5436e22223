"""Files as they come from DOS and from editors of today, to `Source`."""

from __future__ import annotations

from pathlib import Path

from mopro.errors import Diagnostic, SourceError
from mopro.source import Source, Span

MOST_BYTES = 16 * 2**20
MOST_COLUMNS = 4096

_DOS_END_OF_FILE = b"\x1a"
_FILE = Span(1, 1, 1)


def load(path: str | Path) -> Source:
    """The program text in file `path`; SourceError if it cannot be one."""
    name = str(path)
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise _refused(name, "unreadable", f"cannot be read: {error.strerror}") from error
    return source_from_bytes(data, name)


def source_from_bytes(data: bytes, name: str) -> Source:
    """Decode `data`, which ends at a Ctrl-Z; UTF-8 where it is that, else code page 437."""
    if len(data) > MOST_BYTES:
        raise _refused(name, "too-long", f"is larger than {MOST_BYTES // 2**20} MiB")
    data = data.partition(_DOS_END_OF_FILE)[0]
    if b"\0" in data:
        raise _refused(name, "binary-file", "is a binary file: expected the text of a program")
    source = _decode(data, name)
    for number, line in enumerate(source.lines, start=1):
        if len(line) > MOST_COLUMNS:
            span = Span(number, MOST_COLUMNS + 1, MOST_COLUMNS + 2)
            message = f"line of {len(line)} characters: expected at most {MOST_COLUMNS}"
            raise SourceError(source, [Diagnostic("too-long", message, span)])
    return source


def _decode(data: bytes, name: str) -> Source:
    try:
        encoding = "utf-8-sig" if data.startswith(b"\xef\xbb\xbf") else "utf-8"
        return Source(name, data.decode(encoding), encoding)
    except UnicodeDecodeError:
        return Source(name, data.decode("cp437"), "cp437")


def _refused(name: str, rule: str, message: str) -> SourceError:
    return SourceError(Source(name, ""), [Diagnostic(rule, message, _FILE)])
