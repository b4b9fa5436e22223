"""The thesis's laboratory: the LVDT of chapter 4.2, the thermocouple of 3.2, their data files.

The LVDT is a Lucas Schaevitz DCE2000: ±10 V for ±10 in, 25 mV RMS of ripple, linear within
0.25 % of the full range, read 960 times at 800 Hz (5 MHz / 6250; the listing's comment says
200 Hz) over ±10 V in 4096 steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from mopro.errors import DataError
from mopro.files import output
from mopro.units import INCH_M

Floats = NDArray[np.float64]

FULL_SCALE_V = 10.0
CODES = 4096
AVERAGED = 40


@dataclass(frozen=True)
class Lvdt:
    """One LVDT, its middle at `middle_m` of the axis' own coordinate.

    `linearity` is the deviation at the ends of the range as a share of the full range; it
    grows with the third power of the distance from the middle (appendix D.1).
    """

    middle_m: float = 0.0
    half_range_m: float = 10 * float(INCH_M)
    ripple_V: float = 0.025
    linearity: float = 0.0025
    rate_hz: float = 800.0
    samples: int = 960

    @property
    def step_V(self) -> float:
        """One step of the converter, 4.883 mV."""
        return 2 * FULL_SCALE_V / CODES

    def times_s(self) -> Floats:
        return np.arange(self.samples) / self.rate_hz

    def volts(self, position_m: Floats, generator: np.random.Generator | None = None) -> Floats:
        """Stored voltages for the core at `position_m`; without `generator`, no ripple.

        Beyond its range the converter stays at its last code.
        """
        u = (position_m - self.middle_m) / self.half_range_m
        volts = FULL_SCALE_V * (u + 2 * self.linearity * u**3)
        if generator is not None:
            volts = volts + generator.normal(0.0, self.ripple_V, len(volts))
        codes = np.clip(np.rint(volts / self.step_V), -CODES // 2, CODES // 2 - 1)
        stored: Floats = codes * self.step_V
        return stored

    def position_m(self, volts: Floats) -> Floats:
        """The position for stored volts, taking the transducer to be linear."""
        return self.middle_m + volts / FULL_SCALE_V * self.half_range_m


def block_velocity(
    position_m: Floats, rate_hz: float, averaged: int = AVERAGED
) -> tuple[Floats, Floats]:
    """Times (s) and velocity (m/s) as the thesis derives them (chapter 4.2.2).

    Positions are averaged in blocks of `averaged`, and the averages differenced.
    """
    blocks = len(position_m) // averaged
    means = position_m[: blocks * averaged].reshape(blocks, averaged).mean(axis=1)
    interval_s = averaged / rate_hz
    times = (np.arange(1, blocks) - 0.5 / averaged) * interval_s
    velocity: Floats = np.diff(means) / interval_s
    return np.asarray(times, dtype=np.float64), velocity


# -- the thermocouple -------------------------------------------------------------------------
# The thermocouple chain of chapter 3.2: 0 to 200 °C on 0 to 5 V, C = counts/10.24.
#
# One reading a second for the first two minutes, then one every 15 s, up to 1921 of them.

COUNTS_PER_C = 10.24


@dataclass(frozen=True)
class Thermocouple:
    fast_readings: int = 120
    fast_s: float = 1.0
    slow_s: float = 15.0
    readings: int = 1921
    highest_C: float = 200.0

    def times_s(self, duration_s: float) -> Floats:
        """Times (s) of the readings in a run of this duration."""
        fast = np.arange(self.fast_readings) * self.fast_s
        slow = np.arange(self.readings - self.fast_readings) * self.slow_s
        times = np.concatenate((fast, self.fast_readings * self.fast_s + slow))
        return times[times <= duration_s + 1e-9]

    def stored_C(self, temperature_C: Floats) -> Floats:
        """Stored temperatures (°C): whole counts within the range."""
        most = round(self.highest_C * COUNTS_PER_C)
        counts = np.clip(np.rint(temperature_C * COUNTS_PER_C), 0, most)
        stored: Floats = counts / COUNTS_PER_C
        return stored


# -- data files -------------------------------------------------------------------------------
# The laboratory's data files, as the BASIC programs of appendices B.2 and E.2 wrote them.
#
# `LVDT20.DAT`: a voltage a line. `TEST12.DAT`: temperature (°C) and seconds since the start
# a line. BASIC puts a blank for the sign before a number and another one behind it. Files
# are read line by line, up to a limit.

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
