"""Output files: there whole or not at all, and durable once a command says that it is done.

`output` writes beside the target, flushes the draft and the folder to the disk and renames.
Mode, owner (where the system permits) and extended attributes of the target stay. A symbolic
link is followed: its target is replaced. Refused are a read-only file, a file with further
hard links (replacing it would part it from them, writing it in place could tear it), a
folder, a block device and a socket. A pipe or a character device takes the finished bytes.
`docs/files.md` says the same to users.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

from mopro.errors import DataError

if sys.platform != "win32":
    import fcntl

# A draft of `out.csv` is `.out.csv.mopro-` and 20 digits, the last 8 of which check the others.
_DRAFT = re.compile(r"\..*\.mopro-([0-9a-f]{12})([0-9a-f]{8})", re.DOTALL)
# Of the target's name, in bytes: some file systems take no more than 143 for all of it.
_MOST_NAME = 100
_MOST_LINKS = 40
# An open file of this process under the name that the system gives it, as /dev/stdout leads to.
_DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/fd/(\d+)")


@contextmanager
def output(path: Path) -> Iterator[Path]:
    """A draft to write to, which becomes `path` if the block ends well and is removed if not.

    Drafts that dead processes have left in the folder are removed first. Raises DataError
    where `path` cannot be written: before the block if that can be known.
    """
    try:
        target = _Target.of(path)
        with _drafted(target) as (draft, claim):
            yield draft
            if target.stream:
                _pour(draft, target.path)
            else:
                _replace(draft, claim, target.path)
    except OSError as error:
        raise _unwritable(path, error) from error


def write(path: Path, data: bytes) -> None:
    """All of `data` as the file `path`; DataError where it cannot be written."""
    with output(path) as draft:
        draft.write_bytes(data)


@contextmanager
def claim(path: Path) -> Iterator[None]:
    """An empty draft in the place of `path`, held while its content is worked out.

    Raises the DataError that `output` would raise before its block.
    """
    with ExitStack() as held:
        try:
            held.enter_context(_drafted(_Target.of(path)))
        except OSError as error:
            raise _unwritable(path, error) from error
        yield


@contextmanager
def log(path: Path) -> Iterator[TextIO]:
    """A text file that grows as things happen and survives the process, so without a draft.

    What it held is gone. Raises DataError where `path` cannot be opened, as a pipe that nobody
    reads. Whoever writes has to flush, and is told of a full disk then: closing it does not raise
    that again.
    """
    try:
        file = open(_Target.of(path).path, "w", encoding="utf-8", opener=_read_by_someone)  # noqa: SIM115 (closed below)
    except OSError as error:
        raise _unwritable(path, error) from error
    with ExitStack() as closing:
        closing.callback(_closed, file)
        yield file


def _closed(file: TextIO) -> None:
    with suppress(OSError):
        file.close()


def make_folder(folder: Path) -> None:
    """The folder and those above it, made durably where they are not; DataError if it cannot be."""
    try:
        _make_folder(folder)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(f"{folder}: cannot be made: {reason}", "unwritable-output") from error


def _make_folder(folder: Path) -> None:
    if folder.is_dir():
        return
    _make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    flush_folder(folder.parent)


@dataclass(frozen=True)
class _Target:
    """Target of an output: `path` with all links resolved, `before` the file that is there."""

    path: Path
    before: os.stat_result | None
    stream: bool = False

    @classmethod
    def of(cls, path: Path) -> _Target:
        """Raises OSError, with words for a person, for what must not be written."""
        place = _followed(path)
        if _DESCRIPTOR.fullmatch(str(place)):
            return cls(place, None, stream=True)
        try:
            before = os.stat(place)
        except FileNotFoundError:
            return cls(place, None)
        if refusal := _refusal(place, before):
            raise refusal
        return cls(place, before, stream=not stat.S_ISREG(before.st_mode))

    @property
    def drafts(self) -> Path:
        """The folder of its drafts."""
        return Path(tempfile.gettempdir()) if self.stream else self.path.parent


def _refusal(place: Path, found: os.stat_result) -> OSError | None:
    if stat.S_ISDIR(found.st_mode):
        return IsADirectoryError(errno.EISDIR, "it is a folder")
    if stat.S_ISBLK(found.st_mode) or stat.S_ISSOCK(found.st_mode):
        kind = "block device" if stat.S_ISBLK(found.st_mode) else "socket"
        return OSError(errno.EINVAL, f"it is a {kind}: expected a file, a pipe or a terminal")
    # The administrator may write to read-only files too, but hardly means to.
    if not os.access(place, os.W_OK) or not found.st_mode & 0o222:
        how = "make it writable or choose another name"
        return PermissionError(errno.EACCES, f"it is read-only; {how}")
    if stat.S_ISREG(found.st_mode) and found.st_nlink > 1:
        names = f"it has {found.st_nlink} names (hard links), which would no longer be one file"
        return OSError(errno.EMLINK, f"{names}; copy it first or choose another name")
    return None


def _followed(path: Path) -> Path:
    """`path` with the links that its last part leads through followed, there or not."""
    for _ in range(_MOST_LINKS):
        if _DESCRIPTOR.fullmatch(str(path)) or not path.is_symlink():
            return path
        path = path.parent / path.readlink()
    raise OSError(errno.ELOOP, "its symbolic links lead in a circle")


def _opener(path: str, flags: int) -> int:
    """Opens a descriptor's name as that descriptor: a file behind it is not truncated."""
    own = _DESCRIPTOR.fullmatch(path)
    return os.dup(int(own[1])) if own else os.open(path, flags, 0o666)


def _read_by_someone(path: str, flags: int) -> int:
    """As `_opener`, but for a pipe that nobody reads, which would be waited for without end."""
    try:
        handle = _opener(path, flags | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        if error.errno == errno.ENXIO:
            error.strerror = "nobody reads this pipe: begin with its reader"
        raise
    os.set_blocking(handle, True)
    return handle


@contextmanager
def _drafted(target: _Target) -> Iterator[tuple[Path, BinaryIO]]:
    """A draft for `target` under its future name and rights, and what claims it."""
    folder = target.drafts
    _remove_dead_drafts(folder)
    mode = 0o600 if target.before or target.stream else 0o666
    with _claimed(folder, target.path.name, mode) as (draft, claim):
        if target.before and not target.stream:
            _take_after(draft, target.path, target.before)
        yield draft, claim


@contextmanager
def _claimed(folder: Path, name: str, mode: int) -> Iterator[tuple[Path, BinaryIO]]:
    """A new draft that is locked as long as this process works on it."""
    # Known before it is there: whenever a signal comes, it is found and removed.
    draft = folder / _draft_name(name)
    try:
        with open(draft, "xb", opener=lambda p, flags: os.open(p, flags, mode)) as claim:
            if locked(claim):
                yield draft, claim
                return
            # Another process saw it before it was locked and took it for a dead one's.
            with _claimed(folder, name, mode) as other:
                yield other
    finally:
        draft.unlink(missing_ok=True)


def locked(claim: BinaryIO) -> bool:
    """True if the file is locked by this process, or locks are not available, and not removed."""
    if sys.platform != "win32":
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return True
    return os.fstat(claim.fileno()).st_nlink > 0


def _draft_name(name: str) -> str:
    while len(os.fsencode(name)) > _MOST_NAME:
        name = name[:-1]
    token = os.urandom(6).hex()
    return f".{name}.mopro-{token}{_check_digits(token)}"


def _check_digits(token: str) -> str:
    return f"{zlib.crc32(b'draft of mopro ' + token.encode()):08x}"


def _is_draft_name(name: str) -> bool:
    """True if mopro created the name, by its check digits."""
    match = _DRAFT.fullmatch(name)
    return match is not None and _check_digits(match[1]) == match[2]


def _remove_dead_drafts(folder: Path) -> None:
    """Remove the drafts in `folder` that no living process works on, where that is allowed."""
    try:
        with os.scandir(folder) as entries:
            drafts = [Path(entry.path) for entry in entries if _is_draft_name(entry.name)]
    except OSError:
        return  # what is wrong with the folder, the draft will tell
    for draft in drafts:
        with suppress(OSError):
            _remove_if_dead(draft)


def _remove_if_dead(draft: Path) -> None:
    if not stat.S_ISREG(draft.lstat().st_mode):
        return
    with open(draft, "rb") as file:
        if sys.platform != "win32":
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            draft.unlink()
    if sys.platform == "win32":
        draft.unlink()  # refused while a process has it open


def _take_after(draft: Path, target: Path, before: os.stat_result) -> None:
    """Give the draft the owner, mode and attributes of its target, as far as permitted."""
    if sys.platform != "win32":
        for owner in (before.st_uid, -1):
            with suppress(PermissionError):
                os.chown(draft, owner, before.st_gid)
                break
    shutil.copystat(target, draft)
    os.utime(draft)


def _replace(draft: Path, claim: BinaryIO, target: Path) -> None:
    os.fsync(claim.fileno())
    if sys.platform == "win32":
        claim.close()  # an open file cannot be renamed there
    draft.replace(target)
    flush_folder(target.parent)


def flush_folder(folder: Path) -> None:
    """A rename is on the disk only when the folder is, which not all systems can be asked for."""
    if sys.platform == "win32":
        return
    with suppress(PermissionError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):
                raise
        finally:
            os.close(handle)


def _pour(draft: Path, stream: Path) -> None:
    with open(draft, "rb") as source, open(stream, "wb", opener=_opener) as sink:
        shutil.copyfileobj(source, sink)


def _unwritable(path: Path, error: OSError) -> DataError:
    """The error in a person's words; a file other than `path` and its draft is named."""
    reason, about = error.strerror or str(error), error.filename
    own = about == str(path) or _is_draft_name(os.path.basename(str(about)))
    if isinstance(about, str) and not own:
        reason = f"{about}: {reason}"
    return DataError(f"{path}: cannot be written: {reason}", "unwritable-output")
