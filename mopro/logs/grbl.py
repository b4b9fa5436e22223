"""Status reports of GRBL, `<Run|MPos:1.0,2.0,0.0|FS:500,0>`, with whatever stamp is before them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from mopro.errors import DataError
from mopro.logs.cell_kinds import as_number
from mopro.logs.log import MOST_CHARACTERS, MOST_ROWS, Decision, LogSource, Table

OTHER = "other lines than status reports"
_REPORT = re.compile(r"^([^<]{0,80})<([A-Za-z]+(?::\d)?)\|([^<>]*)>")
_PLACES = ("MPos", "WPos", "WCO")
_AXES = "xyzabc"
_NAMES = {"FS": ("feed", "spindle"), "F": ("feed",), "Bf": ("planner", "buffer"), "Ln": ("line",)}
_STAMP_EDGES = " \t[](){},;|>:-"


def is_grbl(head: bytes) -> bool:
    """True for a text in which most lines with `<` are status reports of GRBL."""
    found = [line for line in head.decode("latin-1").splitlines() if "<" in line]
    reports = [line for line in found if _REPORT.match(line) and "Pos:" in line]
    return bool(reports) and 2 * len(reports) > len(found)


def read_grbl(path: Path, name: str) -> Table:
    """A row for each report: its stamp as `time`, places in mm, feed and spindle; DataError."""
    rows: list[dict[str, float]] = []
    stamps: list[str] = []
    numbers: list[int] = []
    others = 0
    with open(path, encoding="utf-8", errors="replace", newline=None) as file:
        for number, line in enumerate(file, start=1):
            match = _REPORT.match(line[:MOST_CHARACTERS])
            if match is None:
                others += bool(line.strip())
                continue
            rows.append(_fields(match[3]))
            stamps.append(match[1].strip(_STAMP_EDGES))
            numbers.append(number)
    if len(rows) > MOST_ROWS:
        raise DataError(f"{path}: more than {MOST_ROWS} rows", "too-long")
    keys = dict.fromkeys(key for row in rows for key in row)
    columns: dict[str, Any] = _stamp_column(stamps)
    columns |= {key: np.array([row.get(key, np.nan) for row in rows]) for key in keys}
    reason = "GRBL reports mm unless its setting $13 is 1"
    decisions = (Decision("places", "in mm", reason, check=True),)
    return Table(
        LogSource(name, "", path=path), columns, {}, decisions, 1, numbers[0] if numbers else 1,
        np.array(numbers, np.int64), ",", {OTHER: others} if others else {},
    )  # fmt: skip


def _fields(text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for field in text.split("|"):
        key, _, cells = field.partition(":")
        values = [as_number(cell) for cell in cells.split(",")]
        if key in _PLACES:
            labels = tuple(f"{key}_{axis}_mm" for axis in _AXES)
        else:
            labels = _NAMES.get(key, ())
        found |= {k: v for k, v in zip(labels, values, strict=False) if v is not None}
    return found


def _stamp_column(stamps: list[str]) -> dict[str, Any]:
    """The column `time` of what is before the reports; none if nothing is."""
    import pyarrow as pa

    if not any(stamps):
        return {}
    seconds = [as_number(stamp) for stamp in stamps]
    if all(s is not None for s in seconds):
        return {"time": np.array(seconds, float)}
    return {"time": pa.array([stamp or None for stamp in stamps], pa.string())}
