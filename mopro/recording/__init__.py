"""Recordings of runs: columns with units, a header, and a report of each move."""

from mopro.recording.formats import FORMATS, open_sink
from mopro.recording.moves import MoveOutcome, MoveReport
from mopro.recording.reading import read
from mopro.recording.record import Header, MemorySink, Recording, Sink, column_names
from mopro.recording.run import Run

__all__ = [
    "FORMATS",
    "Header",
    "MemorySink",
    "MoveOutcome",
    "MoveReport",
    "Recording",
    "Run",
    "Sink",
    "column_names",
    "open_sink",
    "read",
]
