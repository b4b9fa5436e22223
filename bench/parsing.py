"""Programs of distinct lines: read here and by gcodeparser, compiled, planned and linted.

    pip install gcodeparser
    python bench/parsing.py [--lines 1000,10000,100000] [--write FILE.csv]

CPU time (s), medians of `--times` in one process, taken in turn. The G-code has as many lines, with
as many numbers. `compile` reads too, `plan` is of a compiled program, `all rules` lints a text with
every rule. The last row is how the time of each grows with the number of lines, as an exponent.
"""

from __future__ import annotations

import argparse
import csv
import math
import random
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

from long_runs import commit

import mopro
from mopro.language import parse
from mopro.lint import Settings, lint
from mopro.lint.rules import RULES
from mopro.motion import plan
from mopro.source import Source

COLUMNS = ("gcodeparser", "read", "compile", "plan", "all rules")
MOST_GROWTH = 1.2
# Its move is emulated, which imports the machine's modules.
FIRST = "UU012500/1\nVEL1 40.0\nACC1 1.0\nMRI1 2.0\nWX1\n"


def texts(lines: int) -> tuple[str, str]:
    """A program and G-code of so many lines, none of which is there twice."""
    rng = random.Random(lines)
    ours, theirs = ["UU012500/1", "VEL0 10.0", "ACC0 0.2"], ["G21", "G90", "F600"]
    while len(ours) < lines:
        axis, way, n = rng.randint(1, 2), rng.randint(1, 99_999) / 10_000, len(ours)
        ours += [f"VEL{axis} {1 + way:.4f} ; {n}", f"MRI{axis} {way:.4f} ; {n}", f"WX{axis} ; {n}"]
        theirs += [f"G1 F{60 + way:.4f} ; {n}", f"G1 X{way:.4f} ; {n}", f"G4 P{axis} ; {n}"]
    return "\n".join(ours[:lines]) + "\n", "\n".join(theirs[:lines]) + "\n"


def seconds(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def figures(lines: int, times: int) -> list[float]:
    """Median CPU time (s) of each piece of work on a program of so many lines."""
    from gcodeparser import parse_gcode_lines

    every = Settings(select=frozenset(RULES))
    seen = []
    for n in range(times):
        ours, theirs = texts(lines + n)
        source, program = Source("long.CMD", ours), mopro.compile(ours)
        work: list[Callable[[], object]] = [
            lambda theirs=theirs: list(parse_gcode_lines(theirs, include_comments=True)),
            lambda source=source: parse(source),
            lambda ours=ours: mopro.compile(ours),
            lambda program=program: plan(program),
            lambda source=source: lint(source, every),
        ]
        seen.append([seconds(piece) for piece in work])
    return [statistics.median(column) for column in zip(*seen, strict=True)]


def rows_of(counts: list[int], times: int) -> list[list[float]]:
    """The figures of each number of lines, told as they come."""
    print("".join(f"{name:>12}" for name in ("lines", *COLUMNS)))
    rows = []
    for lines in counts:
        rows.append(figures(lines, times))
        print(f"{lines:>12}" + "".join(f"{value:>12.3f}" for value in rows[-1]), flush=True)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lines", default="1000,10000,100000")
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--write", type=Path, metavar="FILE.csv")
    told = parser.parse_args()
    counts = [int(count) for count in told.lines.split(",")]
    lint(Source("first.CMD", FIRST), Settings(select=frozenset(RULES)))  # what is made once
    rows = rows_of(counts, told.times)
    decades = math.log(counts[-1] / counts[0])
    grown = [math.log(b / a) / decades for a, b in zip(rows[0], rows[-1], strict=True)]
    print(f"{'exponent':>12}" + "".join(f"{value:>12.2f}" for value in grown))
    print(f"read: {rows[-1][0] / rows[-1][1]:.2f} times the speed of gcodeparser")
    if told.write:
        with told.write.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["lines", *COLUMNS, "measured by", "recorded in"])
            by = ["python bench/parsing.py", commit()]
            for lines, row in zip(counts, rows, strict=True):
                writer.writerow([f"{lines:,}", *(f"{value:.3g}" for value in row), *by])
            writer.writerow(["exponent", *(f"{value:.2f}" for value in grown), *by])
    return int(max(grown[1:]) > MOST_GROWTH)


if __name__ == "__main__":
    sys.exit(main())
