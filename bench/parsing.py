"""Programs of distinct lines: read here and by gcodeparser, side by side, and what lint takes.

    pip install gcodeparser && python bench/parsing.py [--lines 1000,10000,100000]

CPU time (s), medians of `--times` in one process, taken in turn. The G-code has as many lines, with
as many numbers. `in all` compiles, `text rules` lints without motion. The last line is how the time
of all grows with the number of lines, as an exponent.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import sys
import time
from collections.abc import Callable

import mopro
from mopro.language import parse
from mopro.lint import Settings, lint
from mopro.source import Source

TEXT_RULES = frozenset({"unused-label", "unreachable", "unused-allow", "letter-o-axis"})


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

    seen = []
    for n in range(times):
        ours, theirs = texts(lines + n)
        source = Source("long.CMD", ours)
        seen.append(
            [
                seconds(
                    lambda theirs=theirs: list(parse_gcode_lines(theirs, include_comments=True))
                ),
                seconds(lambda source=source: parse(source)),
                seconds(lambda ours=ours: mopro.compile(ours)),
                seconds(lambda source=source: lint(source, Settings(select=TEXT_RULES))),
            ]
        )
    return [statistics.median(column) for column in zip(*seen, strict=True)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lines", default="1000,10000,100000")
    parser.add_argument("--times", type=int, default=3)
    told = parser.parse_args()
    counts = [int(count) for count in told.lines.split(",")]
    print(f"{'lines':>8} {'gcodeparser':>12} {'read':>8} {'in all':>8} {'text rules':>11}")
    mopro.compile(texts(10)[0])
    rows = []
    for lines in counts:
        rows.append(figures(lines, told.times))
        theirs, read, whole, rules = rows[-1]
        print(f"{lines:>8} {theirs:>12.3f} {read:>8.3f} {whole:>8.3f} {rules:>11.3f}", flush=True)
    grown = math.log(rows[-1][2] / rows[0][2]) / math.log(counts[-1] / counts[0])
    print(f"the time of all grows with the number of lines to the power of {grown:.2f}")
    return int(grown > 1.2)


if __name__ == "__main__":
    sys.exit(main())
