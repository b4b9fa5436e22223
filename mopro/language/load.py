"""Files as they come from DOS and from editors of today, to `Source`."""

from __future__ import annotations

import codecs
from dataclasses import replace
from pathlib import Path

from mopro.errors import Diagnostic, SourceError
from mopro.inputs import open_to_read
from mopro.source import Source, Span
from mopro.text import wide_encoding

MOST_BYTES = 16 * 2**20
MOST_COLUMNS = 4096
# Of these no command takes longer than some 12 s; ten times as many took minutes.
MOST_LINES = 100_000

_DOS_END_OF_FILE = "\x1a"
# What may stand behind a Ctrl-Z without being a part of the program: DOS fills up with it.
_FILLING = " \t\f\v\r\n\0" + _DOS_END_OF_FILE
# Of encodings whose mark tells the order of bytes.
_MARK_BYTES = {"utf-16": 2, "utf-32": 4}
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


def until_end_of_file(source: Source) -> Source:
    """The part of a DOS text before its Ctrl-Z; `cut` is the place of that if more follows."""
    text, _, rest = source.text.partition(_DOS_END_OF_FILE)
    kept = replace(source, text=text)
    return replace(kept, cut=_cut(kept, rest.strip(_FILLING))) if rest else kept


def _cut(source: Source, rest: str) -> Span | None:
    """The place behind the last character of `source`, if there is a `rest`."""
    if not rest:
        return None
    lines = source.lines_with_ends or [""]
    if lines[-1].endswith(("\r", "\n")):
        return Span(len(lines) + 1, 1, 2)
    return Span(len(lines), len(lines[-1]) + 1, len(lines[-1]) + 2)


def source_from_bytes(data: bytes, name: str) -> Source:
    """Decode `data`, which ends at a Ctrl-Z.

    UTF-8, UTF-16 or UTF-32 where it is that, else code page 437; SourceError.
    """
    if len(data) > MOST_BYTES:
        raise _refused(name, "too-long", f"is larger than {MOST_BYTES // 2**20} MiB")
    source = until_end_of_file(_decoded(data, name))
    if "\0" in source.text:
        raise _refused(name, "binary-file", "is a binary file: expected the text of a program")
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


def _decoded(data: bytes, name: str) -> Source:
    if encoding := wide_encoding(data):
        return _decoded_wide(data, encoding, name)
    # What stands behind the end of the text need not be text.
    text, mark, rest = data.partition(_DOS_END_OF_FILE.encode("ascii"))
    end = (mark + rest).decode("cp437")
    try:
        encoding = "utf-8-sig" if data.startswith(codecs.BOM_UTF8) else "utf-8"
        return Source(name, text.decode(encoding) + end, encoding)
    except UnicodeDecodeError:
        return Source(name, text.decode("cp437") + end, "cp437")


def _decoded_wide(data: bytes, encoding: str, name: str) -> Source:
    mark = data[: _MARK_BYTES.get(encoding, 0)]
    if mark:
        encoding += "-be" if mark in (codecs.BOM_UTF16_BE, codecs.BOM_UTF32_BE) else "-le"
    try:
        text = data[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        place = f"byte {len(mark) + error.start + 1}"
        message = f"is text in {encoding.upper()}, and what stands at {place} is no character of it"
        raise _refused(name, "wide-text", message, _SAVE_AS) from error
    return Source(name, text, encoding, mark=mark)


def _refused(name: str, rule: str, message: str, hint: str | None = None) -> SourceError:
    return SourceError(Source(name, ""), [Diagnostic(rule, message, _FILE, hint=hint)])
