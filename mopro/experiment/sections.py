"""Parts of an experiment's file that are read alike for each kind of machine."""

from __future__ import annotations

from pathlib import Path

from mopro.inputs import no_file
from mopro.source import Source
from mopro.tomlfile import Value, shown
from mopro.tomlfile.schema import text


def file_beside(source: Source, value: Value) -> Path:
    """Path of the regular file that a key of the experiment names, relative to its folder."""
    name = text(message=f"expected the name of a file for {value.key}")(value)
    path = Path(source.name).parent / name
    if wrong := no_file(path, shown(path, 400)):
        hint = "paths begin at the folder of this file"
        raise value.refused(wrong, "no-such-file", hint)
    return path


def sections_of(root: Value, key: str) -> list[Value]:
    """The sections `[[key]]`, of which an experiment has one at least."""
    before = root.faults
    entries = root.sections(key)
    if not entries and root.faults == before:
        root.report(f"expected at least one [[{key}]]", "missing-key", at=key)
    return entries
