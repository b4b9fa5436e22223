"""Manifest of the files that `mopro blind` made in a folder; only those are ever replaced."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mopro.errors import DataError
from mopro.files import make_folder, write
from mopro.inputs import read_bytes

MADE = "made.json"
ANSWERS = "answers.json"
EXPERIMENT = "experiment.toml"
# A machine's model that is a program.
MODEL = "model.py"
# Suffixes of an experiment's files; other files beside them (notes, verdicts) are left alone.
SUFFIXES = (".toml", ".CMD", ".csv", ".DAT", ".py")
# Names that cannot lead out of the folder of their case.
_NUMBER = re.compile(r"[0-9]{3,6}")
_NAME = re.compile(r"[A-Za-z0-9_]{1,64}\.(?:toml|CMD|csv|DAT|py)")
_FORM = "files that mopro blind made, with their SHA-256"


def is_case_number(number: object) -> bool:
    """True for the number of a case: three to six digits."""
    return isinstance(number, str) and _NUMBER.fullmatch(number) is not None


def is_file_name(name: object) -> bool:
    """True for a valid name of an experiment's file, without a folder."""
    return isinstance(name, str) and _NAME.fullmatch(name) is not None


@dataclass
class Manifest:
    """SHA-256 of each file made in `folder`, by its path there.

    made.json is written before the files that it lists, so that a process that is killed in
    between leaves no file unlisted. While files are replaced it lists the digests of the old
    and of the new ones, separated by a space.
    """

    folder: Path
    files: dict[str, str]

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """The manifest of `folder`, empty if there is none; DataError if it is damaged."""
        path = folder / MADE
        try:
            document = json.loads(read_bytes(path))
        except FileNotFoundError:
            return cls(folder, {})
        except OSError as error:
            raise DataError(f"{path}: cannot be read: {error.strerror}", "unreadable") from error
        except (ValueError, RecursionError) as error:
            raise _bad_manifest(path) from error
        files = document.get(_FORM) if isinstance(document, dict) else None
        texts = isinstance(files, dict) and all(isinstance(d, str) for d in files.values())
        if not isinstance(files, dict) or not texts or not all(map(_is_path, files)):
            raise _bad_manifest(path)
        return cls(folder, files)

    def refuse_foreign(self, numbers: Iterable[str]) -> None:
        """Raise DataError for the first file of these cases or answers.json that is not as made."""
        for number in numbers:
            folder = self.folder / number
            found = sorted(folder.iterdir()) if folder.is_dir() else []
            for path in found:
                if path.suffix in SUFFIXES:
                    self._check(_path_of(number, path.name))
        self._check(ANSWERS)

    def replace(self, number: str, contents: Mapping[str, bytes]) -> None:
        """Replace the files made for the case `number` by `contents`, given by name.

        "" stands for the folder itself. Raises DataError if a file is not as it was made.
        """
        old = [path for path in self.files if path.rpartition("/")[0] == number]
        new = {
            _path_of(number, name): hashlib.sha256(contents[name]).hexdigest() for name in contents
        }
        for path in {*old, *new}:
            self._check(path)
        self.files |= {path: f"{self.files.get(path, '')} {new[path]}".lstrip() for path in new}
        self._save(self.folder / number)
        for path in old:
            if path not in new:
                (self.folder / path).unlink(missing_ok=True)
                del self.files[path]
        for name, data in contents.items():
            write(self.folder / number / name, data)  # flushes the folder of what was removed, too
        self.files |= new
        self._save(self.folder / number)

    def _check(self, path: str) -> None:
        """Raise DataError if the file at `path` is not the one that was made."""
        file = self.folder / path
        try:
            digests = self.files.get(path, "").split()
            as_made = not file.is_symlink() and _sha256(read_bytes(file)) in digests
        except FileNotFoundError:
            return
        except OSError as error:
            raise DataError(f"{file}: cannot be read: {error.strerror}", "unreadable") from error
        if not as_made:
            message = f"{file}: not as `mopro blind` made it, so it is not replaced"
            raise DataError(f"{message}; move it away or name another folder", "not-made-here")

    def _save(self, folder: Path) -> None:
        make_folder(folder)
        document = {_FORM: dict(sorted(self.files.items()))}
        write(self.folder / MADE, (json.dumps(document, indent=1) + "\n").encode())


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _path_of(number: str, name: str) -> str:
    return f"{number}/{name}" if number else name


def _is_path(path: str) -> bool:
    """True for a path that a manifest may list: answers.json, or a file of the folder or a case."""
    number, slash, name = path.rpartition("/")
    return path == ANSWERS or (is_file_name(name) and (is_case_number(number) or not slash))


def _bad_manifest(path: Path) -> DataError:
    message = f"{path}: not the list that `mopro blind` writes; name another folder"
    return DataError(message, "not-made-here")
