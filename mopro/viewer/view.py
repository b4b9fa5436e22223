"""Content of a view: traces in panels, the program beside them, marks, the platen; as one block."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mopro.recording.envelope import Buckets, Envelope, Floats
from mopro.text import visible
from mopro.units import UNITS

# -- packed arrays ----------------------------------------------------------------------------
# Arrays of numbers in a page: one block of bytes, deflated, as base64.


# Offsets are multiples of the longest number's size, as typed arrays of a browser demand.
_ALIGNED = 8
_TYPES: dict[str, np.dtype[Any]] = {
    "f32": np.dtype("<f4"), "f64": np.dtype("<f8"), "i32": np.dtype("<i4"),
}  # fmt: skip
# Relative deviation from an even spacing below which times are told by start and step.
_EVEN = 1e-9

Reference = dict[str, Any]


class Pack:
    """Collects arrays; a reference tells where each is in the block."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, values: NDArray[Any], kind: str = "f32") -> Reference:
        """The reference of `values`, stored as `kind` (f32, f64, i32)."""
        data = np.ascontiguousarray(values, _TYPES[kind]).tobytes()
        reference = {"at": self._size, "count": len(values), "type": kind}
        padded = data + bytes(-len(data) % _ALIGNED)
        self._parts.append(padded)
        self._size += len(padded)
        return reference

    def put_times(self, time_s: NDArray[np.float64]) -> Reference:
        """The reference of ascending times: start, step and count where they are even."""
        count = len(time_s)
        if count > 1:
            step = float(time_s[-1] - time_s[0]) / (count - 1)
            even = time_s[0] + step * np.arange(count)
            if np.max(np.abs(time_s - even)) <= _EVEN * max(abs(float(time_s[-1])), step):
                return {"start": float(time_s[0]), "step": step, "count": count}
        return self.put(time_s, "f64")

    def text(self) -> str:
        """The block as base64 of its zlib stream."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode("ascii")


# -- content of a view ------------------------------------------------------------------------
# Content of a view: traces in panels, the program beside them, marks, the platen.
#
# Names of fields in the JSON of a view are those that the scripts in `static/` read.

# Dimensions of which a person chooses the unit by the switch; the rest keep their own.
_SWITCHED = {"length": "m", "velocity": "m/s", "force": "N"}


@dataclass(frozen=True)
class Scale:
    """Unit of a panel: `dimension` is empty for a unit that is shown as it is."""

    unit: str
    dimension: str = ""
    factor: float = 1.0

    @staticmethod
    def of(unit: str) -> Scale:
        """The scale of numbers in `unit`; `factor` makes them SI where the unit can be chosen."""
        dimension, factor = UNITS.get(unit, ("", 1))
        if dimension not in _SWITCHED:
            return Scale("°C" if unit == "C" else unit)
        return Scale(_SWITCHED[dimension], dimension, float(factor))


@dataclass(frozen=True)
class Trace:
    """One line of a panel: its channel, what it is called, and how it is drawn.

    `color` is an index into the page's palette; `style` is line, command (broad and
    pale), dashed, points or bars.
    """

    channel: str
    label: str
    color: int = 0
    style: str = "line"
    shown: bool = True

    def as_json(self) -> dict[str, Any]:
        return {
            "channel": self.channel,
            "label": visible(self.label),
            "color": self.color,
            "style": self.style,
            "shown": self.shown,
        }


@dataclass(frozen=True)
class Panel:
    """Traces of one track that share an axis; `band` is a half width of noise around zero."""

    title: str
    track: str
    scale: Scale
    traces: Sequence[Trace]
    band: float | None = None
    note: str = ""

    def as_json(self) -> dict[str, Any]:
        return {
            "title": visible(self.title),
            "track": self.track,
            "unit": visible(self.scale.unit),
            "dimension": self.scale.dimension,
            "band": None if self.band is None else self.band * self.scale.factor,
            "note": visible(self.note),
            "traces": [trace.as_json() for trace in self.traces],
        }


@dataclass(frozen=True)
class Track:
    """Channels of one time base (s), or of the rows of a table.

    `windows` are stretches of the overview that are there in full.
    """

    names: Sequence[str]
    overview: Buckets
    windows: Sequence[Buckets] = ()

    @staticmethod
    def of(time: Floats, channels: Mapping[str, Floats], most: int) -> Track:
        """The track of whole channels, in at most `most` buckets."""
        envelope = Envelope(most)
        envelope.add(time, np.vstack(list(channels.values())).astype(np.float32))
        return Track(list(channels), envelope.buckets())

    def as_json(self, pack: Pack) -> dict[str, Any]:
        return {"parts": [self._part(b, pack) for b in (self.overview, *self.windows)]}

    def _part(self, buckets: Buckets, pack: Pack) -> dict[str, Any]:
        several = buckets.size > 1
        channels = {
            name: {"first": pack.put(first), "second": pack.put(second) if several else None}
            for name, first, second in zip(self.names, buckets.first, buckets.second, strict=True)
        }
        return {
            "size": buckets.size,
            "start": pack.put_times(buckets.start),
            "end": pack.put_times(buckets.end) if several else None,
            "channels": channels,
        }


@dataclass(frozen=True)
class Lines:
    """Source line that runs from each time (s) on; lines below 1 are none."""

    time_s: Floats
    line: NDArray[np.int32]

    @staticmethod
    def of(time_s: Floats, line: NDArray[Any]) -> Lines:
        """The changes among the lines of all samples."""
        first = np.flatnonzero(np.diff(line, prepend=line[0] - 1))
        return Lines(time_s[first], line[first].astype(np.int32))


@dataclass(frozen=True)
class Mark:
    """A moment to be seen: `kind` is stall, trip or lint; without a time, whenever `line` runs."""

    kind: str
    text: str
    line: int = 0
    time_s: float | None = None

    def as_json(self) -> dict[str, Any]:
        return {
            "kind": self.kind, "text": visible(self.text), "line": self.line, "time": self.time_s,
        }  # fmt: skip


@dataclass(frozen=True)
class View:
    """One run or one experiment's run, with everything that is seen of it.

    `rows`: the horizontal axis counts rows of a table. `program` are its source lines.
    `platen`, `phases` and `moves` are JSON as the scripts read it (mopro.viewer.run).
    """

    name: str
    panels: Sequence[Panel]
    tracks: Mapping[str, Track]
    rows: bool = False
    program: Sequence[str] = ()
    lines: Lines | None = None
    marks: Sequence[Mark] = ()
    moves: Sequence[dict[str, Any]] = ()
    platen: dict[str, Any] | None = None
    phases: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def as_json(self, pack: Pack) -> dict[str, Any]:
        lines = None
        if self.lines is not None and len(self.lines.line):
            lines = {
                "time": pack.put(self.lines.time_s, "f64"),
                "line": pack.put(self.lines.line, "i32"),
            }
        return {
            "name": visible(self.name),
            "rows": self.rows,
            "panels": [panel.as_json() for panel in self.panels],
            "tracks": {name: track.as_json(pack) for name, track in self.tracks.items()},
            "program": [visible(line) for line in self.program],
            "lines": lines,
            "marks": [mark.as_json() for mark in self.marks],
            "moves": list(self.moves),
            "platen": self.platen,
            "phases": {axis: list(names) for axis, names in self.phases.items()},
        }
