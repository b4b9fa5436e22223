"""The ledger of a log's rows: how many were read and used, and why the others were left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

# Rows that may be left out without a check: this many, and this share of all.
_FEW = 5
_SMALL_SHARE = 0.01


@dataclass(frozen=True)
class Rows:
    """Rows that were `read`, and how many of them were left out, by reason; the rest is used.

    Raises ValueError if more are left out than were read.
    """

    read: int
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.used < 0 or any(count <= 0 for count in self.left_out.values()):
            raise ValueError(f"{self.read} rows cannot be without {dict(self.left_out)}")

    @property
    def lost(self) -> int:
        return sum(self.left_out.values())

    @property
    def used(self) -> int:
        return self.read - self.lost

    @property
    def to_check(self) -> bool:
        """True if more than a few rows, or more than 1 %, are left out."""
        return self.lost > min(_FEW, _SMALL_SHARE * self.read)

    def without(self, why: str, count: int) -> Rows:
        """The ledger after `count` further rows were left out."""
        if not count:
            return self
        return Rows(self.read, {**self.left_out, why: self.left_out.get(why, 0) + count})

    def __add__(self, other: Rows) -> Rows:
        """The ledger of both; reasons are counted together."""
        reasons = dict.fromkeys((*self.left_out, *other.left_out))
        both = {w: self.left_out.get(w, 0) + other.left_out.get(w, 0) for w in reasons}
        return Rows(self.read + other.read, both)

    def as_json(self) -> dict[str, Any]:
        left_out = [{"why": why, "count": count} for why, count in self.left_out.items()]
        return {"read": self.read, "used": self.used, "left_out": left_out}

    def __str__(self) -> str:
        reasons = ", ".join(f"{count} {why}" for why, count in self.left_out.items())
        told = f"{self.read} read, {self.used} used"
        return f"{told}, {self.lost} left out: {reasons}" if reasons else f"{told}"
