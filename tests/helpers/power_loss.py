"""A loss of power at each moment of a command that writes: what is on the disk then.

The changes of a folder are recorded as they happen (`Recorder`), and replayed up to each
moment. Of those that were not yet flushed, a disk with a journal may have kept any: `states`
are none, all, all but one, one alone, and the first ones in their order; data that were not
flushed may also be there by half.
"""

import os
import pickle
from dataclasses import dataclass
from itertools import count
from pathlib import Path


@dataclass(frozen=True)
class Change:
    """One change of the folder; `path` and `source` are paths below it.

    `kind` is "data" (`content` of file `number`), "entry" (`path` leads to file `number`, and
    `source`, if any, does no longer), "folder", "removed", "flush" (of file `number`),
    "flush folder" (of the entries of `path`) or "told" (success was told here).
    """

    kind: str
    path: str = ""
    source: str = ""
    number: int = 0
    content: bytes = b""


class Recorder:
    """Finds the changes of `folder` by looking at it before each call of the system."""

    def __init__(self, folder):
        self._folder = os.path.realpath(folder)
        self._numbers = count(1)
        self._known = {}  # path -> inode
        self._files = {}  # inode -> number, content
        self._folders = set()
        self.changes = []
        self.look()
        self.start, self.changes = self.changes, []

    def meet(self, call, path):
        """To be called before each call of the system; reading changes nothing."""
        if call in ("open to read", "read", "write"):
            return
        self.look()
        if call != "fsync":
            return
        place = os.path.realpath(f"/proc/self/fd/{path}")
        if place != self._folder and not place.startswith(self._folder + os.sep):
            return
        name = os.path.relpath(place, self._folder)
        if os.path.isdir(place):
            self.changes.append(Change("flush folder", "" if name == "." else name))
        else:
            number, _ = self._files[self._known[name]]
            self.changes.append(Change("flush", name, number=number))

    def told(self):
        """Note that success is told now."""
        self.look()
        self.changes.append(Change("told"))

    def save(self, path, well):
        """Write the start and the changes to `path`; where all went well, that was told last."""
        self.look()
        if well:
            self.changes.append(Change("told"))
        with open(path, "wb") as file:
            pickle.dump((self.start, self.changes), file)

    def look(self):
        """Note what has changed since the last look."""
        folders, entries = self._scan()
        for name in sorted(folders - self._folders):
            self.changes.append(Change("folder", name))
        self._folders = folders
        gone = {name: inode for name, inode in self._known.items() if entries.get(name) != inode}
        for name, inode in sorted(entries.items()):
            if self._known.get(name) != inode:
                self._note_entry(name, inode, gone)
        for name in gone:
            if name not in entries:
                self.changes.append(Change("removed", name))
        self._known = entries
        self._files = {i: self._files[i] for i in entries.values()}
        for name, inode in entries.items():
            self._note_data(name, inode)

    def _note_entry(self, name, inode, gone):
        sources = [old for old, i in gone.items() if i == inode and old != name]
        source = sources[0] if sources else ""
        if source:
            del gone[source]
        else:
            self._files[inode] = (next(self._numbers), b"")
        self.changes.append(Change("entry", name, source, self._files[inode][0]))

    def _note_data(self, name, inode):
        number, before = self._files[inode]
        content = Path(self._folder, name).read_bytes()
        if content != before:
            self._files[inode] = (number, content)
            self.changes.append(Change("data", name, number=number, content=content))

    def _scan(self):
        """The folders, and the files with their inodes, below the folder but for the cache."""
        folders, entries = set(), {}
        for place, inside, names in os.walk(self._folder):
            inside[:] = [n for n in inside if n != "cache"]
            relative = os.path.relpath(place, self._folder)
            base = "" if relative == "." else f"{relative}/"
            folders |= {base + n for n in inside}
            entries |= {base + n: os.stat(os.path.join(place, n)).st_ino for n in names}
        return folders, entries


def read_changes(path):
    """Operations that `Recorder.save` wrote."""
    with open(path, "rb") as file:
        return pickle.load(file)


class Disk:
    """Files by path, after changes have been applied in order."""

    def __init__(self, changes=()):
        self._contents, self._entries, self._folders = {}, {}, {""}
        for change in changes:
            self.apply(change)

    def apply(self, change):
        if change.kind == "data":
            self._contents[change.number] = change.content
        elif change.kind == "folder":
            self._folders.add(change.path)
        elif change.kind == "removed":
            self._entries.pop(change.path, None)
        elif change.kind == "entry":
            self._entries[change.path] = change.number
            if self._entries.get(change.source) == change.number:
                del self._entries[change.source]

    @property
    def files(self):
        """The content of each file that can be reached, by its path."""
        return {
            path: self._contents.get(number, b"")
            for path, number in self._entries.items()
            if all(p.as_posix() in {*self._folders, "."} for p in Path(path).parents)
        }


def _flushes(flush, change):
    if change.kind == "data":
        return flush.kind == "flush" and flush.number == change.number
    return flush.kind == "flush folder" and flush.path == os.path.dirname(change.path)


def pending(changes):
    """The places, in `changes`, of those that nothing has flushed since."""
    flushes = [(i, c) for i, c in enumerate(changes) if c.kind.startswith("flush")]
    return [
        i
        for i, change in enumerate(changes)
        if change.kind in ("data", "entry", "folder", "removed")
        and not any(j > i and _flushes(flush, change) for j, flush in flushes)
    ]


def states(start, changes):
    """The files, by path, that may be on the disk if the power fails after `changes`."""
    free = pending(changes)
    kept = {frozenset(free), frozenset()}
    kept |= {frozenset(free) - {one} for one in free}
    kept |= {frozenset([one]) for one in free}
    kept |= {frozenset(free[:length]) for length in range(len(free))}
    for keep in sorted(kept, key=sorted):
        yield _files_of(start, changes, free, keep)
        for one in keep:
            if changes[one].kind == "data":
                yield _files_of(start, changes, free, keep, half=one)


def _files_of(start, changes, free, keep, half=None):
    disk = Disk(start)
    for i, change in enumerate(changes):
        if i == half:
            disk.apply(Change("data", number=change.number,
                              content=change.content[: len(change.content) // 2]))  # fmt: skip
        elif i not in free or i in keep:
            disk.apply(change)
    return disk.files


@dataclass(frozen=True)
class Outcome:
    """States of the disk that were looked at, and the files in them that must not be so.

    `torn` files are neither as before nor as they were ever renamed to their place; `lost`
    ones are not as they were when success was told.
    """

    moments: int
    states: int
    torn: tuple[str, ...]
    lost: tuple[str, ...]


def outcome(start, changes, growing=()):
    """The outcome of a loss of power after each of the changes; `growing` files are no outputs."""
    versions = _versions(start, changes, growing)
    seen, torn, lost = 0, set(), set()
    told = {}
    for length in range(len(changes) + 1):
        if length and changes[length - 1].kind == "told":
            told = {
                n: c for n, c in Disk([*start, *changes[:length]]).files.items() if n in versions
            }
        for files in states(start, changes[:length]):
            seen += 1
            torn |= {n for n in versions if files.get(n) not in versions[n]}
            lost |= {n for n in told if not _is_newer(versions[n], told[n], files.get(n))}
    return Outcome(len(changes) + 1, seen, tuple(sorted(torn)), tuple(sorted(lost)))


def _is_newer(versions, told, found):
    return found in versions and versions.index(found) >= versions.index(told)


def _versions(start, changes, growing):
    """The contents that each output may have, in order; None where there is no file.

    A version is what a file holds when it comes to its place by a rename. What is written in
    its place is none, but for the last content.
    """
    disk = Disk(start)
    versions = {name: [content] for name, content in disk.files.items()}
    for change in changes:
        disk.apply(change)
        if change.kind == "removed" or (change.kind == "entry" and change.source):
            versions.setdefault(change.path, [None]).append(disk.files.get(change.path))
    for name, content in disk.files.items():
        found = versions.setdefault(name, [None])
        if found[-1] != content:
            found.append(content)
    return {n: v for n, v in versions.items() if ".mopro-" not in n and n not in growing}
