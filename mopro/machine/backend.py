"""Protocol of a back end: the emulator, or a controller on a serial line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mopro.program import Program
    from mopro.recording import Run, Sink

# How long a program that loops for ever runs unless told otherwise.
DEFAULT_LOOP_S = 60.0


class Backend(Protocol):
    """Runs programs on one machine; only the command line knows which kind it is."""

    def run(self, program: Program, sink: Sink, for_s: float | None = None) -> Run:
        """Run `program` for at most `for_s` seconds, and write the recording to `sink`."""
        ...
