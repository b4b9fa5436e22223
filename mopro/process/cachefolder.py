"""The cache folder, for data that take long to compute.

Its files are trusted like the program itself, so the folder is used only if it is the
user's alone.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from pathlib import Path

from platformdirs import user_cache_path

_DIGEST_BYTES = hashlib.sha256().digest_size


def cache_folder(*parts: str) -> Path | None:
    """The folder `mopro`, or one within, in the user's cache; made if need be.

    None where it cannot be made, belongs to another user, may be written by others, or where
    the system does not say which folder is the user's.
    """
    try:
        folder = user_cache_path("mopro", appauthor=False)
        if not folder.is_absolute():
            return None
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        for place in (folder, *(folder.joinpath(*parts[: i + 1]) for i in range(len(parts)))):
            place.mkdir(mode=0o700, exist_ok=True)
            if not _is_mine(place.stat()):
                return None
        return folder.joinpath(*parts)
    except (OSError, RuntimeError, ValueError):  # no home, a home that is no folder, a NUL in it
        return None


def read_kept(path: Path) -> bytes | None:
    """Content that `with_digest` wrote, from a file of this user; None if it is damaged."""
    try:
        with open(path, "rb") as file:
            if not _is_mine(os.fstat(file.fileno())):
                return None
            digest, data = file.read(_DIGEST_BYTES), file.read()
    except OSError:
        return None
    return data if hashlib.sha256(data).digest() == digest else None


def with_digest(data: bytes) -> bytes:
    """`data` as it is kept, so that `read_kept` can tell whether it is still the same."""
    return hashlib.sha256(data).digest() + data


def _is_mine(found: os.stat_result) -> bool:
    """True if it belongs to this user and nobody else may write to it."""
    if sys.platform == "win32":
        return True  # the profile's folder is the user's by its access list
    others = stat.S_IWGRP | stat.S_IWOTH
    return found.st_uid == os.geteuid() and not found.st_mode & others
