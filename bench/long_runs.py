"""An hour of a loop: time, memory and size on disk, against a minute and against the plain way.

    python bench/long_runs.py [--write FILE.csv]

With --write the table is kept with the commit that it was measured at.

Each run is `mopro run programs/TEMP2.CMD --emulate` in a process of its own, CPU time (user and
system, s) and peak memory (MB) as the system counts them, the median of `--times` of each taken in
turn. `simulated` runs repeat nothing. Exits with 1 where an hour takes more than a third of the
time of the simulated one, more than 30 MB on disk, or more memory than 1.1 times that of a minute.
"""

from __future__ import annotations

import argparse
import csv
import os
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# name -> duration, whether loops are repeated, further arguments
RUNS = {
    "a minute": ("1min", True, ()),
    "ten minutes": ("10min", True, ()),
    "an hour": ("1h", True, ()),
    "an hour, position and temperature": ("1h", True, ("--columns", "position_*,temperature_C")),
    "an hour, simulated": ("1h", False, ()),
}
CHILD = """
import sys
import mopro.emulator.loop
from mopro.cli.main import main
if sys.argv.pop(1) == "simulated":
    mopro.emulator.loop.WORTH_S = float("inf")
main()
"""
MOST_SHARE, MOST_MB, MOST_GROWTH = 1 / 3, 30.0, 1.1

Figures = tuple[float, float, float]


def figures(lasting: str, repeated: bool, more: tuple[str, ...]) -> Figures:
    """CPU time (s), peak memory (MB) and size on disk (MB) of one run."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run.parquet"
        child = subprocess.Popen(
            [
                sys.executable, "-c", CHILD, "repeated" if repeated else "simulated", "run",
                str(ROOT / "programs" / "TEMP2.CMD"), "--emulate", "--for", lasting,
                "--out", str(out), *more,
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise SystemExit(f"the run of {lasting} failed: exit {child.returncode}")
        return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, out.stat().st_size / 1e6


def commit() -> str:
    asked = ["git", "rev-parse", "--short=7", "HEAD"]
    return subprocess.run(asked, cwd=ROOT, capture_output=True, text=True).stdout.strip()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--write", type=Path, metavar="FILE.csv")
    told = parser.parse_args()
    seen: dict[str, list[Figures]] = defaultdict(list)
    for _ in range(told.times):
        for name, run in RUNS.items():
            seen[name].append(figures(*run))
    middle = {n: tuple(map(statistics.median, zip(*s, strict=True))) for n, s in seen.items()}
    rows = [("run at 2 kHz", "CPU s", "peak MB", "MB on disk")]
    rows += [(name, *(f"{figure:.1f}" for figure in found)) for name, found in middle.items()]
    for name, *cells in rows:
        print(f"{name:36}", *(f"{cell:>10}" for cell in cells))
    if told.write:
        with open(told.write, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*rows[0], "measured by", "recorded in"])
            writer.writerows([*row, "python bench/long_runs.py", commit()] for row in rows[1:])
    hour, minute, plain = middle["an hour"], middle["a minute"], middle["an hour, simulated"]
    return int(
        hour[0] > MOST_SHARE * plain[0] or hour[1] > MOST_GROWTH * minute[1] or hour[2] > MOST_MB
    )


if __name__ == "__main__":
    sys.exit(main())
