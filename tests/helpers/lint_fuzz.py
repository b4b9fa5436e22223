"""Random and damaged programs for the parser and the linter, and the check that all must pass."""

from __future__ import annotations

import random

from mopro.errors import SourceError
from mopro.language import ast, source_from_bytes
from mopro.lint import Settings, lint
from mopro.lint.rule import Stage
from mopro.lint.rules import RULES
from mopro.source import Source, Span

# Every statement of the language as a person writes it, and what a person gets wrong.
_WORDS = (
    *(kind.form for kind in ast.STATEMENTS.values()),
    "UU1", "VELO 15", "ACC0 .25", "ACC2 1.9", "PARA2-", "MRI2 -0.0001", "MRI0 2", "MR2 -8.0",
    "WX0", "WT10", "WT0", ":b1", ":X", "JUMP X", "JUMP Y", "MC1 5.0", "HM2",
    "; mopro: allow stall", "; 250 in/s^2", "VLE1 4", "MRI 1 2", "WT99999999999", "VEL1 -1",
)  # fmt: skip
_ENDS = ("\n", "\n", "\n", "\r\n", "\r", "", " ", "\x1a", "\t;")
# Without physics an input is cheap; every so many one is asked about that too.
_PHYSICS_EVERY = 200
_MOTION = Settings(
    grammar="extended",
    select=frozenset(n for n, rule in RULES.items() if rule.stage is not Stage.PHYSICS),
)


def fuzz_input(random: random.Random) -> bytes:
    """A program made of the language's own words, such a one with damage, or random bytes."""
    kind = random.random()
    if kind < 0.2:
        return random.randbytes(random.randrange(60))
    words = (random.choice(_WORDS) + random.choice(_ENDS) for _ in range(random.randrange(1, 14)))
    data = bytearray("".join(words).encode())
    if kind < 0.6:
        for _ in range(random.randrange(1, 5)):
            place = random.randrange(len(data) + 1)
            data[place : place + random.randrange(3)] = random.randbytes(random.randrange(3))
    return bytes(data)


def check_input(data: bytes, number: int = 0) -> None:
    """Parse and lint `data`; AssertionError if a finding is outside of it.

    The stages that execute the program are asked as well, the machine now and then.
    """
    try:
        source = source_from_bytes(data, "fuzz.CMD")
    except SourceError as error:
        for diagnostic in error.diagnostics:
            _check_place(error.source, diagnostic.span)
        return
    settings = Settings(grammar="extended") if number % _PHYSICS_EVERY == 0 else _MOTION
    for finding in lint(source, settings):
        _check_place(source, finding.span)


def _check_place(source: Source, span: Span) -> None:
    lines = max(1, len(source.lines))
    inside = 1 <= span.line <= lines and 1 <= span.column <= len(source.line(span.line)) + 1
    # The Ctrl-Z that ends a text stands in its file, just behind what is read of it.
    inside |= span == source.cut
    if not inside or span.end_column < span.column:
        raise AssertionError(f"{span} is not in the text {source.text!r}")
