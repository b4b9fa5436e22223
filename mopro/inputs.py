"""Files opened to be read: what is no file, or a pipe that nobody writes to, holds nobody up."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

_KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
# What can be read once, from its beginning to its end, as a program text is.
_STREAMS = (stat.S_IFIFO, stat.S_IFCHR)


def no_file(path: str | Path, name: str) -> str | None:
    """Why what stands at `path` is no regular file, called `name`; None if it is one.

    Links are followed.
    """
    try:
        wrong = _instead(os.stat(path).st_mode)
    except (OSError, ValueError):  # too long a name, or a zero byte in it
        return f"there is no file {name}"
    return wrong and f"{name} {wrong}"


def open_to_read(path: str | Path, stream: bool = False) -> BinaryIO:
    """The regular file at `path`, open for its bytes; with `stream` also a pipe or a device.

    Raises OSError for anything else, and for a pipe from which nothing comes.
    """
    file = open(path, "rb", opener=_open_at_once)  # noqa: SIM115 (the caller closes it)
    try:
        mode = os.fstat(file.fileno()).st_mode
        if (wrong := _instead(mode)) and not (stream and stat.S_IFMT(mode) in _STREAMS):
            raise OSError(errno.EINVAL, f"it {wrong}")
        if stat.S_ISFIFO(mode):
            os.set_blocking(file.fileno(), True)
            if not file.peek(1):
                raise OSError(errno.EINVAL, "it is a pipe to which nobody writes")
    except BaseException:
        file.close()
        raise
    return file


def read_bytes(path: Path) -> bytes:
    """The bytes of the regular file at `path`; OSError."""
    with open_to_read(path) as file:
        return file.read()


def _instead(mode: int) -> str | None:
    kind = _KINDS.get(stat.S_IFMT(mode))
    return kind and f"is {kind}, expected a regular file"


def _open_at_once(path: str, flags: int) -> int:
    """Open without waiting for one who writes."""
    try:
        return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise OSError(errno.EINVAL, no_file(path, "it")) from error
        raise
