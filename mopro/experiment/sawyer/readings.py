"""Extracts a sensor's reading from a data file and checks its clock, rate and gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mopro.experiment.data_file import TIME, DataFile
from mopro.experiment.sawyer.trials import Floats, Reading
from mopro.instruments.sensor import Sensor

# Share of all samples, and samples in a row, that may be missing.
MOST_MISSING = 0.01
LONGEST_GAP = 10
_RATE_TOLERANCE = 0.02
_FEWEST_SAMPLES = 2
_MS_PER_S = 1000.0
_LATEST_START_S = 1.0


def clock(file: DataFile) -> Floats:
    """The file's time column (s); DataFileError unless it ascends."""
    time_s = file.require(TIME)
    blank = np.flatnonzero(np.isnan(time_s))
    if len(blank):
        hint = "only readings may be left out"
        file.refuse("clock", "the row has no time", int(blank[0]), TIME, hint)
    wrong = np.flatnonzero(np.diff(time_s) <= 0)
    if len(wrong):
        row = int(wrong[0]) + 1
        before, after = float(time_s[row - 1]), float(time_s[row])
        what = "stands still" if after == before else "runs backwards"
        more = f", and {len(wrong) - 1} more times" if len(wrong) > 1 else ""
        message = f"the clock {what}: {after:.9g} s after {before:.9g} s{more}"
        hint = "expected times that ascend from row to row"
        file.refuse("clock", message, row, TIME, hint)
    start_s, length_s = float(time_s[0]), float(time_s[-1] - time_s[0])
    if start_s > max(length_s, _LATEST_START_S):
        message = f"the clock begins at {start_s:.9g} s, and t = 0 is the first statement"
        file.refuse("clock", message, 0, TIME, "subtract the time at which the program was started")
    return time_s


def reading(file: DataFile, sensor: Sensor, regular: bool = True) -> tuple[Reading, list[str]]:
    """The samples of `sensor`, and notes on those that are missing.

    The rate and gaps of a sensor that is not `regular` are not checked. Raises DataFileError.
    """
    time_s, values = clock(file), file.require(sensor.column)
    notes: list[str] = []
    early = int(np.count_nonzero(time_s < 0))
    if early:
        notes.append(f"{file.source.name}: {early} samples before t = 0 are left out")
    present = np.flatnonzero(~np.isnan(values) & (time_s >= 0))
    if len(present) < _FEWEST_SAMPLES:
        message = f"{sensor.column} has {len(present)} samples, expected at least two"
        file.refuse_header("empty-column", message)
    file.check_noise(sensor.column, sensor.sigma)
    if regular:
        _check_rate(file, sensor, time_s, present)
        notes += _gaps(file, sensor, time_s, present)
    return Reading(sensor, time_s[present], values[present]), notes


def _check_rate(file: DataFile, sensor: Sensor, time_s: Floats, present: NDArray[np.intp]) -> None:
    found_hz = 1 / float(np.median(np.diff(time_s[present])))
    share = found_hz / sensor.rate_hz
    if abs(share - 1) <= _RATE_TOLERANCE:
        return
    message = f"{sensor.column} has {found_hz:.6g} samples a second, and sensor {sensor.name}"
    hint = "correct rate_hz, or the time column"
    if abs(share * _MS_PER_S - 1) <= _RATE_TOLERANCE:
        hint = f"is the column {TIME} in milliseconds? It must be in seconds"
    stated = f"{message} is said to give {sensor.rate_hz:g}"
    file.refuse("wrong-rate", stated, int(present[1]), TIME, hint)


def _gaps(file: DataFile, sensor: Sensor, time_s: Floats, present: NDArray[np.intp]) -> list[str]:
    """Notes on samples that are missing; DataFileError if they are many, or many in a row."""
    missing = np.rint(np.diff(time_s[present]) * sensor.rate_hz).astype(np.int64) - 1
    gaps = np.flatnonzero(missing > 0)
    if not len(gaps):
        return []
    total, worst = int(missing[gaps].sum()), int(gaps[np.argmax(missing[gaps])])
    share = total / (total + len(present))
    start_s, end_s = (float(t) for t in time_s[present[worst : worst + 2]])
    where = f"{int(missing[worst])} in a row after {start_s:.6g} s ({end_s - start_s:.4g} s long)"
    count = f"{total} samples of {sensor.column} are missing ({share:.2%}), up to {where}"
    if share > MOST_MISSING or missing[worst] > LONGEST_GAP:
        hint = (
            f"at most {MOST_MISSING:.0%} of the samples, and {LONGEST_GAP} in a row, may be"
            " missing: leave the run out, or record it again"
        )
        row = min(int(present[worst]) + 1, len(file.lines) - 1)
        file.refuse("gap", count, row, sensor.column, hint)
    return [f"{file.source.name}: {count}; they are left out"]
