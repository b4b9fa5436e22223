"""What a person may choose about linting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

LOW_MARGIN = 0.20


@dataclass(frozen=True)
class Settings:
    """Which machine the program is for, and which rules are asked.

    `select` are the rules to ask, or None for those that are on by default; `ignore` are
    left out of either. `start_m` is where an axis stands at the beginning, from the
    middle of its travel, if that is known; `travel_m` the length of an axis' travel where
    something, such as the range of an instrument, makes it shorter than the platen does.
    A field's `key` is its name in a file, where that is another.
    """

    machine: str = "chow1992"
    payload_kg: float = field(default=0.0, metadata={"key": "payload"})
    grammar: str = "attested"
    select: frozenset[str] | None = None
    ignore: frozenset[str] = frozenset()
    low_margin: float = field(default=LOW_MARGIN, metadata={"key": "low-margin"})
    start_m: Mapping[int, float] = field(default_factory=dict, metadata={"key": "start"})
    travel_m: Mapping[int, float] = field(default_factory=dict, metadata={"key": "travel"})
