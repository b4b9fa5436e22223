"""The program memory of a controller; a write is whole or leaves what was there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Protocol

from mopro.files import make_folder, write

# Letters, digits and underscores only: a name can never become a path.
_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}", re.ASCII)
MOST_PROGRAMS = 32


def is_name(name: str) -> bool:
    return _NAME.fullmatch(name) is not None


class Store(Protocol):
    """Programs by name, each a list of statements."""

    def read(self, name: str) -> list[str] | None: ...

    def write(self, name: str, lines: list[str]) -> None:
        """Store a program durably, so that it outlasts a crash. Raises DataError."""

    def names(self) -> list[str]: ...


class MemoryStore:
    """Programs that last as long as the process."""

    def __init__(self) -> None:
        self._programs: dict[str, list[str]] = {}

    def read(self, name: str) -> list[str] | None:
        return self._programs.get(name)

    def write(self, name: str, lines: list[str]) -> None:
        self._programs[name] = list(lines)

    def names(self) -> list[str]:
        return sorted(self._programs)


class FolderStore:
    """Programs as `NAME.CMD` files of one folder, on the disk when `write` returns."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        make_folder(folder)

    def read(self, name: str) -> list[str] | None:
        path = self._path(name)
        return path.read_text("ascii").splitlines() if path.is_file() else None

    def write(self, name: str, lines: list[str]) -> None:
        write(self._path(name), "".join(f"{line}\n" for line in lines).encode("ascii"))

    def names(self) -> list[str]:
        return sorted(p.stem for p in self._folder.glob("*.CMD") if is_name(p.stem))

    def _path(self, name: str) -> Path:
        if not is_name(name):
            raise ValueError(f"{name!r} is no name of a program")
        return self._folder / f"{name}.CMD"
