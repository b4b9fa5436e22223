"""Settings of the linter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

# Share of the pull-out force below which a margin is reported.
LOW_MARGIN = 0.20


@dataclass(frozen=True)
class Settings:
    """The machine and payload of the program, and the rules to run.

    `select` are the rules to run, or None for the default ones; those in `ignore` are left
    out. `start_m` is the start of an axis from the middle of its travel, if known; `travel_m`
    the length of its travel where an instrument's range, for example, is shorter than the
    platen. A field's `key` is its name in a file, if different.
    """

    machine: str = "chow1992"
    payload_kg: float = field(default=0.0, metadata={"key": "payload"})
    grammar: str = "attested"
    select: frozenset[str] | None = None
    ignore: frozenset[str] = frozenset()
    low_margin: float = field(default=LOW_MARGIN, metadata={"key": "low-margin"})
    start_m: Mapping[int, float] = field(default_factory=dict, metadata={"key": "start"})
    travel_m: Mapping[int, float] = field(default_factory=dict, metadata={"key": "travel"})
