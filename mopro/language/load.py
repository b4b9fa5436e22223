"""Files as they come from DOS and from editors of today, to `Source`."""

from __future__ import annotations

import codecs
from dataclasses import replace
from pathlib import Path

from mopro.errors import Diagnostic, SourceError
from mopro.inputs import open_to_read
from mopro.source import Source, Span

MOST_BYTES = 16 * 2**20
MOST_COLUMNS = 4096
# Of these no command takes longer than some 12 s; ten times as many took minutes.
MOST_LINES = 100_000

_DOS_END_OF_FILE = b"\x1a"
# What may stand behind a Ctrl-Z without being a part of the program: DOS fills up with it.
_FILLING = b" \t\f\v\r\n\0" + _DOS_END_OF_FILE
# Shares of zeros in the bytes of a wide character: of the one that tells letters, of the others.
_FEW_ZEROS, _MOST_ZEROS = 0.1, 0.5
_FILE = Span(1, 1, 1)
_SAVE_AS = (
    "save it as UTF-8: in Notepad by Save as, Encoding; in PowerShell by Set-Content -Encoding utf8"
)


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


def until_end_of_file(source: Source) -> Source:
    """The part of a DOS text before its Ctrl-Z; `cut` is the place of that if more follows."""
    text, _, rest = source.text.partition(_DOS_END_OF_FILE.decode("ascii"))
    kept = replace(source, text=text)
    return replace(kept, cut=_cut(kept, rest.strip(_FILLING.decode("ascii")))) if rest else kept


def _cut(source: Source, rest: str | bytes) -> Span | None:
    """The place behind the last character of `source`, if there is a `rest`."""
    if not rest:
        return None
    lines = source.lines_with_ends or [""]
    if lines[-1].endswith(("\r", "\n")):
        return Span(len(lines) + 1, 1, 2)
    return Span(len(lines), len(lines[-1]) + 1, len(lines[-1]) + 2)


def source_from_bytes(data: bytes, name: str) -> Source:
    """Decode `data`, which ends at a Ctrl-Z; UTF-8 where it is that, else code page 437."""
    if len(data) > MOST_BYTES:
        raise _refused(name, "too-long", f"is larger than {MOST_BYTES // 2**20} MiB")
    if _is_wide(data):
        message = "is text in UTF-16 or UTF-32, of two or four bytes a character: expected UTF-8"
        raise _refused(name, "wide-text", message, _SAVE_AS)
    data, rest = split_at_end_of_file(data)
    if b"\0" in data:
        raise _refused(name, "binary-file", "is a binary file: expected the text of a program")
    source = _decode(data, name)
    if len(source.lines) > MOST_LINES:
        message = f"{len(source.lines)} lines: expected at most {MOST_LINES}"
        span = Span(MOST_LINES + 1, 1, 2)
        raise SourceError(source, [Diagnostic("too-long", message, span)])
    source = replace(source, cut=_cut(source, rest.strip(_FILLING)))
    for number, line in enumerate(source.lines, start=1):
        if len(line) > MOST_COLUMNS:
            span = Span(number, MOST_COLUMNS + 1, MOST_COLUMNS + 2)
            message = f"line of {len(line)} characters: expected at most {MOST_COLUMNS}"
            raise SourceError(source, [Diagnostic("too-long", message, span)])
    return source


def _is_wide(data: bytes) -> bool:
    """True for text of two or four bytes a character: it has a mark of that, or zeros as such has.

    Of the letters of a program one byte is hardly ever zero, and the others mostly are.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_BE)):
        return True
    for width in (2, 4):
        parts = [data[place::width] for place in range(width)]
        zeros = sorted(part.count(0) / max(len(part), 1) for part in parts)
        if zeros[0] < _FEW_ZEROS and zeros[1] > _MOST_ZEROS:
            return True
    return False


def _decode(data: bytes, name: str) -> Source:
    try:
        encoding = "utf-8-sig" if data.startswith(b"\xef\xbb\xbf") else "utf-8"
        return Source(name, data.decode(encoding), encoding)
    except UnicodeDecodeError:
        return Source(name, data.decode("cp437"), "cp437")


def _refused(name: str, rule: str, message: str, hint: str | None = None) -> SourceError:
    return SourceError(Source(name, ""), [Diagnostic(rule, message, _FILE, hint=hint)])
