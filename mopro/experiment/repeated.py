"""Runs that are the same measurement: the second one tells nothing that the first did not."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Protocol, TypeVar

_TOLD = "{}: its readings are those of {}, which count once: leave one of the runs out"


class _Run(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Run)


def first_of_each(
    runs: Sequence[R], measured: Callable[[R], Hashable]
) -> tuple[list[int], list[str]]:
    """The numbers of the runs that repeat none before, and a note on each of the others.

    `measured`: all readings of a run, and how it was driven. Noise is never the same twice, and a
    converter without noise tells the same however often it is asked.
    """
    seen: dict[Hashable, str] = {}
    kept, notes = [], []
    for nth, run in enumerate(runs):
        first = seen.setdefault(measured(run), run.name)
        if first == run.name:
            kept.append(nth)
        else:
            notes.append(_TOLD.format(run.name, first))
    return kept, notes
