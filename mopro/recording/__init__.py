"""Recordings of runs: columns with units, a header, and a report of each move."""

from mopro.recording.formats import FORMATS, open_sink
from mopro.recording.moves import MoveOutcome, MoveReport, Stall
from mopro.recording.reading import read
from mopro.recording.record import (
    ChosenColumns,
    FileSink,
    Header,
    MemorySink,
    Recording,
    Sink,
    UnknownColumn,
    column_names,
)
from mopro.recording.run import Run

__all__ = [
    "FORMATS",
    "ChosenColumns",
    "FileSink",
    "Header",
    "MemorySink",
    "MoveOutcome",
    "MoveReport",
    "Recording",
    "Run",
    "Sink",
    "Stall",
    "UnknownColumn",
    "column_names",
    "open_sink",
    "read",
]
