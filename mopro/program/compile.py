"""The way from text to a program in one call."""

from __future__ import annotations

from pathlib import Path

from mopro.language import load, parse
from mopro.program import Program, lower
from mopro.source import Source


def compile(text: str, name: str = "<text>", grammar: str = "attested") -> Program:  # noqa: A001
    """The program that `text` is; SourceError with all findings if it is none.

    `name` stands for the file in messages; `grammar` is `attested` or `extended`. TypeError
    for what is no text: `compile_file` takes the path of a file.
    """
    if not isinstance(text, str):
        raise TypeError(
            f"compile expects the text of a program, not {type(text).__name__}: "
            "mopro.compile_file(path) reads a file"
        )
    return lower(parse(Source(name, text), grammar))


def compile_file(path: str | Path, grammar: str = "attested") -> Program:
    """The program in file `path`, as DOS or an editor of today wrote it."""
    return lower(parse(load(path), grammar))
