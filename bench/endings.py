"""Runs on the virtual controller ended at random moments by sixteen kinds of trouble.

    python bench/endings.py --runs 500 --words 5

In simulated time, with a real signal where the trouble is one. Each trial has a seed of its
own, from which its program, its dialect and the moment come. Stops are counted at the
controller. Prints a row for each kind: tries, endings, the longest time from the trouble to
the arrival of the stop (of a deadline: to the stop before it), and failures:

- no stop received, though the line lived,
- motion after a reported stop,
- a report that says nothing of the stop,
- a controller without a host that has not braked by its heartbeat,
- a run that goes on as if nothing had been.

With `--words N` a controller of a few lines (tests/helpers/model_of_controller.py) then says each
sequence of up to N of the nine states, and the truth from there on: both dialects, with a whole
program and with one that is cut by the controller or by the host. Failures are motion at the end of
the host's run, and a run told as whole that was not.

Exits with 1 if there is any failure.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers import model_of_controller as model
from helpers.endings import FAILURES, Ending, Trial, trial
from mopro.link import builtin_dialects, load_dialect
from mopro.link.dialect import STATES

OUTCOMES = (
    "stop confirmed", "stop not confirmed", "before the start", "after the end", "braked by itself",
)  # fmt: skip


def trials(runs: int, first: int, jobs: int) -> dict[str, list[Trial]]:
    """`runs` trials, spread evenly over the kinds; seeds from `first` on."""
    kinds = list(Ending.KINDS)
    chosen = [(kinds[i % len(kinds)], first + i // len(kinds)) for i in range(runs)]
    with ProcessPoolExecutor(jobs) as pool:
        done = list(pool.map(trial, *zip(*chosen, strict=True), chunksize=4))
    return {kind: [t for t in done if t.kind == kind] for kind in kinds}


def row(title: str, tries: list[Trial]) -> str:
    """One row of the table."""
    endings = Counter(t.ending for t in tries)
    failed = Counter(f for t in tries for f in t.failures)
    delays = [t.stop_after_s for t in tries if t.stop_after_s is not None]
    longest = f"{max(delays):.3f}" if delays else "-"
    counts = [endings[o] for o in OUTCOMES] + [failed[f] for f in FAILURES]
    return f"{title:24} {len(tries):5} {longest:>9}" + "".join(f"{n:>9}" for n in counts)


def sequences_of(arguments: tuple[str, bool, bool, str, int]) -> list[int]:
    """Runs, runs told as whole, left in motion, and told as whole but not, with a first word."""
    dialect, cuts, looping, first, most = arguments
    language = load_dialect(dialect)
    if not cuts:
        known = {key: s for key, s in language.statements.items() if key != "run_for"}
        language = replace(language, statements=known)
    counts = [0, 0, 0, 0]
    for _, ended in model.sequences(most, language, looping, begin=(first,)):
        whole = ended.trouble is None
        found = (True, whole, ended.still_moves, whole and not ended.is_complete)
        counts = [n + more for n, more in zip(counts, found, strict=True)]
    return counts


def words(most: int, jobs: int) -> int:
    """Print a row for each way to run; gives the failures."""
    print(f"\nsequences of up to {most} states, then the truth")
    titles = ("runs", "told as whole", "left in motion", "whole, but not")
    print(f"{'dialect, what ends the run':34}" + "".join(f"{title:>16}" for title in titles))
    failures = 0
    ways = [
        (True, False, "its program"),
        (True, True, "run_for"),
        (False, True, "a stop of the host"),
    ]
    with ProcessPoolExecutor(jobs) as pool:
        for dialect in builtin_dialects():
            for cuts, looping, title in ways:
                every = [(dialect, cuts, looping, first, most) for first in STATES]
                counts = [
                    sum(column) for column in zip(*pool.map(sequences_of, every), strict=True)
                ]
                failures += counts[2] + counts[3]
                cells = "".join(f"{count:>16,}" for count in counts)
                print(f"{dialect + ', ' + title:34}{cells}", flush=True)
    return failures


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0, help="the first one of each kind")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--words", type=int, default=0, help="status words in a sequence")
    chosen = parser.parse_args()
    started_s = time.perf_counter()
    by_kind = trials(chosen.runs, chosen.seed, chosen.jobs)
    everything = [t for tries in by_kind.values() for t in tries]
    for number, text in enumerate((*OUTCOMES, *FAILURES), start=1):
        print(f"  {number:2} {text}{' (a failure)' if text in FAILURES else ''}")
    numbers = "".join(f"{n:>9}" for n in range(1, len(OUTCOMES) + len(FAILURES) + 1))
    print(f"{'kind of trouble':24} {'tries':>5} {'longest s':>9}{numbers}")
    for kind, tries in by_kind.items():
        print(row(kind, tries))
    print(row("all", everything))
    failed = [t for t in everything if t.failures]
    for t in failed[:12]:
        print(f"\nFAILED {t.kind}, seed {t.seed}: {', '.join(t.failures)}\n{t.told}")
    print(f"\n{len(failed)} failures in {time.perf_counter() - started_s:.0f} s")
    wrong = words(chosen.words, chosen.jobs) if chosen.words else 0
    return int(bool(failed or wrong))


if __name__ == "__main__":
    sys.exit(main())
