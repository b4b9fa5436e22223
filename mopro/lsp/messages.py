"""The messages of an editor, cut out of its bytes within bounds.

A message is a header with its length, and so many bytes. After a header that states none, or
an absurd one, nothing says where the next message begins: the input ends there, with a reason.
"""

from __future__ import annotations

import logging
import re
from collections import deque
from collections.abc import Callable
from io import BufferedIOBase
from typing import BinaryIO

MOST_BYTES = 32 << 20
_MOST_LINES = 32
_MOST_LINE = 1024
_MOST_TOLD = 300
_LENGTH = re.compile(rb"content-length[ \t]*:[ \t]*([0-9]{1,10})[ \t]*", re.IGNORECASE)


class Messages(BufferedIOBase):
    """An input whose headers are checked; `fault` is why it has ended early, None if it has not."""

    def __init__(self, source: BinaryIO) -> None:
        self._source = source
        self._header: deque[bytes] = deque()
        self.fault: str | None = None

    def readline(self, size: int | None = -1) -> bytes:
        """The next line of a header, of which only the length is left; empty at the end."""
        if not self._header and self.fault is None:
            self._header += self._next_header()
        return self._header.popleft() if self._header else b""

    def read(self, size: int | None = -1) -> bytes:
        """The body of a message; empty if the input ends within it."""
        assert size is not None, "a body is read by its length"
        body = self._source.read(size)
        return body if len(body) == size else b""

    def _next_header(self) -> list[bytes]:
        length = None
        for _ in range(_MOST_LINES):
            line = self._source.readline(_MOST_LINE)
            if not line:
                return []
            if not line.strip() and length is not None:
                return self._checked(length)
            if match := _LENGTH.fullmatch(line.rstrip(b"\r\n")):
                length = int(match[1])
            elif not line.endswith(b"\n") or line.lower().startswith(b"content-length"):
                return self._refused(f"a header that cannot be read: {line[:40]!r}")
        return self._refused("a header without a length")

    def _checked(self, length: int) -> list[bytes]:
        if not 0 < length <= MOST_BYTES:
            return self._refused(f"a message of {length} bytes, expected 1 to {MOST_BYTES}")
        return [b"Content-Length: %d\r\n" % length, b"\r\n"]

    def _refused(self, fault: str) -> list[bytes]:
        self.fault = fault
        return []


class Told(logging.Handler):
    """Hands warnings of the protocol's library to `tell`, a line each and without tracebacks."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        words = record.getMessage().partition("\n")[0]
        error = record.exc_info[1] if record.exc_info else None
        reason = f": {type(error).__name__}: {error}".partition("\n")[0] if error else ""
        self._tell(f"mopro: {words[:_MOST_TOLD]}{reason[:_MOST_TOLD]}")
