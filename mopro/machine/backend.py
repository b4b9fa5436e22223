"""Protocol of a back end: the emulator, or a controller on a serial line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mopro.program import Program
    from mopro.recording import Run, Sink

# How long a program that loops for ever runs unless told otherwise.
DEFAULT_LOOP_S = 60.0


@dataclass(frozen=True)
class Progress:
    """Progress of a run: `time_s` of `total_s` seconds, in source line `line`.

    `position_m` are the positions of the axes as last seen, or else as commanded.
    """

    time_s: float
    total_s: float
    line: int
    position_m: Mapping[int, float]


OnProgress = Callable[[Progress], None]


def no_one(progress: Progress) -> None:
    """Tells nobody."""


class Backend(Protocol):
    """Runs programs on one machine; only the command line knows which kind it is."""

    def run(
        self,
        program: Program,
        sink: Sink,
        for_s: float | None = None,
        settle_s: float = 0.0,
        on_progress: OnProgress = no_one,
    ) -> Run:
        """Run `program` for at most `for_s` seconds, and write the recording to `sink`.

        The recording of a program that ends goes on until `settle_s` seconds after its last
        move. `on_progress` hears now and then how far the run has got.
        """
        ...
