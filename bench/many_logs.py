"""Logs as people write them, made from twenty machines by random mixtures of kinds, and judged.

    python bench/many_logs.py --logs 300 --seed 1

Each seed draws a machine, one to four kinds of log (a clock that wraps, two recordings, decimal
commas, a cell that cannot be read, ...) and knows what is right to read: rows, runs, values in SI,
what a CHECK must say, or with which rule the log must be refused, and at which line. `mopro import`
and `mopro compare` read it. Outcomes:

- right: everything is as it must be, and what must be told is told,
- refused rightly: with the right rule, at the right line,
- refused wrongly: a log that can be read, or with another reason,
- wrong, told: other data, and a CHECK names the doubt,
- compare refuses: what import wrote does not run,
- silently wrong: values, units, order, rows or runs differ, and no CHECK speaks of it.

Exits with 1 if any log is silently wrong, or fewer than 99 % are right or refused rightly.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.many_logs.judge import OUTCOMES, REFUSED, RIGHT, SILENT, Judged, judged
from helpers.many_logs.mixture import KINDS, drawn

LEAST_RIGHT = 0.99
# Of the processor: a fit of an axis takes half of it.
LONGEST_S = 60


class TooLong(Exception):
    """A log that has taken its time."""


def _too_long(*_: object) -> None:
    raise TooLong


def one(seed: int) -> Judged:
    """A log that takes longer than LONGEST_S is a failure of its own."""
    signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        with TemporaryDirectory() as folder:
            return judged(seed, Path(folder))
    except TooLong:
        sheet, kinds, _ = drawn(seed)
        return Judged(seed, sheet.name, tuple(kinds), SILENT, f"not done in {LONGEST_S} s")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def row(title: str, logs: list[Judged]) -> str:
    """One row of the table."""
    counts = Counter(j.outcome for j in logs)
    return f"{title:20} {len(logs):5}" + "".join(f"{counts[o]:>17}" for o in OUTCOMES)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1, help="the first one")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    chosen = parser.parse_args()
    started_s = time.perf_counter()
    seeds = range(chosen.seed, chosen.seed + chosen.logs)
    with ProcessPoolExecutor(chosen.jobs) as pool:
        done = list(pool.map(one, seeds, chunksize=1))
    print(f"{'kind of log':20} {'logs':>5}" + "".join(f"{o:>17}" for o in OUTCOMES))
    for kind in KINDS:
        print(row(kind, [j for j in done if kind in j.kinds]))
    print(row("all", done))
    for j in done:
        if j.outcome not in (RIGHT, REFUSED):
            print(
                f"\n{j.outcome.upper()}: seed {j.seed}, {j.machine}, {', '.join(j.kinds)}\n{j.why}"
            )
    good = sum(j.outcome in (RIGHT, REFUSED) for j in done)
    silent = sum(j.outcome == SILENT for j in done)
    took_s = time.perf_counter() - started_s
    share = f"{good} of {len(done)} right ({100 * good / len(done):.1f} %)"
    print(f"\nseeds {seeds[0]} to {seeds[-1]}: {share}, {silent} silently wrong, {took_s:.0f} s")
    return int(silent > 0 or good < LEAST_RIGHT * len(done))


if __name__ == "__main__":
    sys.exit(main())
