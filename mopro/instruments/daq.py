"""The laboratory's data files, as the BASIC programs of appendices B.2 and E.2 wrote them.

`LVDT20.DAT`: a voltage a line. `TEST12.DAT`: temperature (°C) and seconds since the start
a line. BASIC puts a blank for the sign before a number and another one behind it. Files
are read line by line, up to a limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError
from mopro.files import output
from mopro.instruments.lvdt import FULL_SCALE_V, Lvdt
from mopro.instruments.thermocouple import Thermocouple

Floats = NDArray[np.float64]

MOST_LINES = 10_000_000
_MOST_CHARACTERS = 200
_END_OF_FILE = "\x1a"


def write_lvdt(path: Path, volts: Floats) -> None:
    """A voltage a line."""
    _write(path, (_basic(v) for v in volts.tolist()))


def write_thermocouple(path: Path, temperature_C: Floats, time_s: Floats) -> None:
    """Temperature and time a line."""
    pairs = zip(temperature_C.tolist(), time_s.tolist(), strict=True)
    _write(path, (_basic(c) + _basic(t) for c, t in pairs))


def read_lvdt(path: str | Path, samples: int | None = Lvdt().samples) -> Floats:
    """The stored voltages; `samples` None takes as many as there are.

    Raises DataError, with the line, for what is no such file.
    """
    rows = _rows(Path(path), 1, samples, _check_volts)
    return np.array(rows)[:, 0]


def read_thermocouple(path: str | Path) -> tuple[Floats, Floats]:
    """Temperatures (°C) and times (s); DataError, with the line, for another file."""
    rows = np.array(_rows(Path(path), 2, None, _check_temperature))
    late = np.flatnonzero(np.diff(rows[:, 1]) <= 0)
    if len(late):
        raise _bad(Path(path), int(late[0]) + 2, "the time does not go on")
    return rows[:, 0], rows[:, 1]


def _basic(number: float) -> str:
    """As PRINT # writes a single-precision number: seven digits, a sign or a blank."""
    text = f"{number:.7g}"
    text = text.replace("0.", ".", 1) if text.lstrip("-").startswith("0.") else text
    return f"{text} " if number < 0 else f" {text} "


def _write(path: Path, lines: Iterator[str]) -> None:
    with output(path) as draft, open(draft, "w", encoding="ascii", newline="") as file:
        file.writelines(f"{line}\r\n" for line in lines)


def _rows(
    path: Path, columns: int, samples: int | None, check: Callable[[list[float]], str | None]
) -> list[list[float]]:
    rows: list[list[float]] = []
    most = MOST_LINES if samples is None else samples
    try:
        with open(path, encoding="ascii", errors="replace", newline=None) as file:
            for number, line in _lines(path, file):
                if len(rows) == most:
                    raise _bad(path, number, f"more than {most} samples")
                rows.append(_row(path, number, line, columns, check))
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}", "unreadable") from error
    if not rows or (samples is not None and len(rows) < samples):
        wanted = "at least one" if samples is None else str(samples)
        raise DataError(f"{path}: truncated: {len(rows)} samples, expected {wanted}", "truncated")
    return rows


def _lines(path: Path, file: TextIO) -> Iterator[tuple[int, str]]:
    """Numbered lines that are not blank, up to DOS's end of file."""
    number = 0
    while line := file.readline(_MOST_CHARACTERS):
        number += 1
        if len(line) == _MOST_CHARACTERS:
            raise _bad(path, number, f"a line of more than {_MOST_CHARACTERS - 1} characters")
        text, end, _ = line.partition(_END_OF_FILE)
        if text.strip():
            yield number, text
        if end:
            return


def _row(
    path: Path,
    number: int,
    line: str,
    columns: int,
    check: Callable[[list[float]], str | None],
) -> list[float]:
    words = line.replace(",", " ").split()
    if len(words) != columns:
        raise _bad(path, number, f"{len(words)} columns, expected {columns}")
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise _bad(path, number, f"'{line.strip()[:40]}' is no number") from error
    if not all(map(math.isfinite, values)):
        raise _bad(path, number, "not a finite number")
    if fault := check(values):
        raise _bad(path, number, fault)
    return values


def _check_volts(values: list[float]) -> str | None:
    if abs(values[0]) > FULL_SCALE_V:
        return f"{values[0]:g} V is out of range: the converter gives -10 to 10 V"
    return None


def _check_temperature(values: list[float]) -> str | None:
    highest = Thermocouple().highest_C
    if not 0 <= values[0] <= highest:
        return f"{values[0]:g} °C is out of range: the chain gives 0 to {highest:g} °C"
    return None


def _bad(path: Path, line: int, message: str) -> DataError:
    return DataError(f"{path}:{line}:1: {message}")
