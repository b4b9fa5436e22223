"""Physics and faults of instruments that no catalogue of effects has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Foreign:
    """One foreign matter: its kind and its numbers, in SI."""

    name: str
    numbers: Mapping[str, float]
