"""Files as they come from DOS and from editors of today, to `Source`."""

from __future__ import annotations

from pathlib import Path

from mopro.errors import Diagnostic, SourceError
from mopro.inputs import open_to_read
from mopro.source import Source, Span

MOST_BYTES = 16 * 2**20
MOST_COLUMNS = 4096
# Of these no command takes longer than some 12 s; ten times as many took minutes.
MOST_LINES = 100_000

_DOS_END_OF_FILE = b"\x1a"
_FILE = Span(1, 1, 1)


def load(path: str | Path) -> Source:
    """The program text in file `path`; SourceError if it cannot be one."""
    return source_from_bytes(load_bytes(path), str(path))


def load_bytes(path: str | Path) -> bytes:
    """The bytes of file `path`, at most one more than a program may have; else SourceError."""
    try:
        with open_to_read(path, stream=True) as file:
            return file.read(MOST_BYTES + 1)
    except OSError as error:
        raise _refused(str(path), "unreadable", f"cannot be read: {error.strerror}") from error


def split_at_end_of_file(data: bytes) -> tuple[bytes, bytes]:
    """The text, and the rest from the Ctrl-Z on that ends a text under DOS."""
    text, mark, rest = data.partition(_DOS_END_OF_FILE)
    return text, mark + rest


def text_before_end_of_file(text: str) -> str:
    """The part of a DOS file before its Ctrl-Z, as an editor shows it."""
    return text.partition(_DOS_END_OF_FILE.decode("ascii"))[0]


def source_from_bytes(data: bytes, name: str) -> Source:
    """Decode `data`, which ends at a Ctrl-Z; UTF-8 where it is that, else code page 437."""
    if len(data) > MOST_BYTES:
        raise _refused(name, "too-long", f"is larger than {MOST_BYTES // 2**20} MiB")
    data, _ = split_at_end_of_file(data)
    if b"\0" in data:
        raise _refused(name, "binary-file", "is a binary file: expected the text of a program")
    source = _decode(data, name)
    if len(source.lines) > MOST_LINES:
        message = f"{len(source.lines)} lines: expected at most {MOST_LINES}"
        span = Span(MOST_LINES + 1, 1, 2)
        raise SourceError(source, [Diagnostic("too-long", message, span)])
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
