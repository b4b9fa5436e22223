"""Traps built into the measured sets of the examples: what `mopro compare` says of each.

python bench/traps.py FOLDER: FOLDER has the CSV files of the sets (examples/README.md). Each trap
changes one column of one set; the words that are printed are those that tell or refuse it.
"""

from __future__ import annotations

import csv
import math
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

EXAMPLES = Path(__file__).parents[1] / "examples"
Values = np.ndarray
Trap = Callable[[Values, Values], Values]
_WORDS = ("readings of", "if that", "wrong-", "hold")


def times(factor: float) -> Trap:
    return lambda time_s, values: factor * values


def late(seconds: float) -> Trap:
    return lambda time_s, values: np.interp(time_s - seconds, time_s, values)


def on_change(time_s: Values, values: Values) -> Values:
    """Only the first of equal neighbours; NaN is a blank cell."""
    return np.where(np.diff(values, prepend=math.nan) == 0, math.nan, values)


TRAPS: tuple[tuple[str, str, str, tuple[tuple[str, Trap], ...]], ...] = (
    ("heater", "tclab_step_test.csv", "sensor1_temperature_C", (
        ("ten times", times(10)), ("five times", times(5)), ("other sign", times(-1)),
        ("Fahrenheit", lambda t, v: 1.8 * v + 32),
    )),
    ("heater", "tclab_sine_test_5min_period.csv", "heater1_command_percent", (
        ("60 s late", late(60)), ("60 s early", late(-60)), ("on changes", on_change),
    )),
    ("pendulum", "large_swing_55s_100Hz.csv", "angle_from_hanging_rad", (
        ("degrees", times(180 / math.pi)), ("five times", times(5)), ("a tenth", times(0.1)),
    )),
    ("servo", "single_sts3215.csv", "dut_position_count", (
        ("ten times", times(10)), ("other sign", times(-1)), ("on changes", on_change),
    )),
)  # fmt: skip


def changed(source: Path, column: str, trap: Trap, target: Path) -> None:
    """The CSV file with one column changed."""
    with source.open(encoding="utf-8", newline="") as lines:
        names, *rows = csv.reader(lines)
    at, clock = names.index(column), names.index("time_s")
    time_s = np.array([float(row[clock]) for row in rows])
    values = np.array([float(row[at] or "nan") for row in rows])
    known = np.isfinite(values)
    found = trap(time_s, np.interp(time_s, time_s[known], values[known]))
    for row, value in zip(rows, found.tolist(), strict=True):
        row[at] = "" if math.isnan(value) else f"{value:.7g}"
    with target.open("w", encoding="utf-8", newline="") as lines:
        csv.writer(lines).writerows([names, *rows])


def said(folder: Path, verb: str) -> str:
    """Lines of a command's output on the experiment in a folder that are about a trap."""
    command = [str(Path(sys.executable).parent / "mopro"), verb, "experiment.toml"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    lines = (done.stdout + done.stderr).splitlines()
    told = [line.strip() for line in lines if any(word in line for word in _WORDS)]
    return f"exit {done.returncode}: " + (" | ".join(told) or "nothing told")


def main(sets: Path) -> None:
    for example, name, column, traps in TRAPS:
        source = next(sets.rglob(name))
        for words, trap in traps:
            with tempfile.TemporaryDirectory() as place:
                folder = Path(place)
                for file in (EXAMPLES / example).glob("*.toml"):
                    shutil.copy(file, folder)
                text = (folder / "experiment.toml").read_text("utf-8")
                text = re.sub(r'data = "[^"]*"', f'data = "{name}"', text)
                (folder / "experiment.toml").write_text(text, encoding="utf-8")
                changed(source, column, trap, folder / name)
                print(f"{example}, {column} {words}: {said(folder, 'compare')}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
