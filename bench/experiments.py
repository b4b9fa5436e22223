"""Valid small experiments of every kind of machine, drawn by the thousand, reconciled and judged.

    python bench/experiments.py --cases 400 --seed 1 --jobs 1 --keep failing

Each case is an experiment that the files allow: of the motor, an axis, a machine that goes where it
is told, an effort over a known motion, thermal nodes or a function of Python, with the whole
language of the files (`tests/helpers/many_experiments`). `mopro reconcile --json --out` answers it,
and `mopro compare --apply` opens what was written. A case fails by

- an exception, an exit code beside 0, 1 and 2, or more than LONGEST_S of the processor,
- words of a library in what is said, or numbers in the JSON that are not finite,
- a refusal without `file:line:col: message [name]`, or a machine file that does not open again.

Prints a table by kind of machine, the refusals by name and each failure; a case is drawn again by
`--seed` and `--first`. Exits with 1 if any case fails, or MOST_REFUSED are refused, as those do not
reach the search.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.many_experiments.judge import FAILED, KINDS, REFUSED, Judged, TooLong, judged

LONGEST_S = 60
MOST_REFUSED = 0.15
OUTCOMES = ("none", "named", "ambiguous", "unexplained", REFUSED, FAILED)


def _too_long(*_: object) -> None:
    raise TooLong


def one(seed: tuple[int, int], keep: Path | None) -> Judged:
    """Judge a case; a failing one is kept with the reason."""
    signal.signal(signal.SIGPROF, _too_long)
    with TemporaryDirectory() as folder:
        signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
        try:
            found = judged(seed, Path(folder))
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        if keep is not None and found.outcome == FAILED:
            kept = keep / f"{seed[0]}-{seed[1]}"
            shutil.copytree(folder, kept, dirs_exist_ok=True)
            (kept / "why.txt").write_text(f"{found.kind}: {found.word}\n{found.why}", "utf-8")
    return found


def row(title: str, cases: list[Judged]) -> str:
    """One row of the table."""
    counts, took = Counter(j.outcome for j in cases), sorted(j.took_s for j in cases)
    seconds = f"{took[len(took) // 2]:10.2f}{took[-1]:10.1f}" if took else ""
    return f"{title:12}{len(cases):7}" + "".join(f"{counts[o]:13}" for o in OUTCOMES) + seconds


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="the first case of the seed")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=600.0, help="then no more cases")
    parser.add_argument("--keep", type=Path, help="folder for the failing cases")
    chosen = parser.parse_args()
    begun_s = time.perf_counter()
    seeds = [(chosen.seed, n) for n in range(chosen.first, chosen.first + chosen.cases)]
    done: list[Judged] = []
    with ProcessPoolExecutor(chosen.jobs) as pool:
        for found in pool.map(partial(one, keep=chosen.keep), seeds):
            done.append(found)
            if found.outcome == FAILED:
                last = (found.why.strip().splitlines() or [""])[-1][:300]
                print(f"FAILED {found.seed} {found.kind}: {found.word}: {last}", flush=True)
            if time.perf_counter() - begun_s > 60 * chosen.minutes:
                pool.shutdown(cancel_futures=True)
                break
    heads = "".join(f"{o:>13}" for o in OUTCOMES)
    print(f"\n{'kind':12}{'cases':>7}{heads}{'median s':>10}{'most s':>10}")
    for kind in KINDS:
        print(row(kind, [j for j in done if j.kind == kind]))
    print(row("all", done))
    refused = Counter(j.word for j in done if j.outcome == REFUSED)
    print("refused: " + (", ".join(f"{n} {name}" for name, n in refused.most_common()) or "none"))
    failed = Counter(j.word for j in done if j.outcome == FAILED)
    print("failed: " + (", ".join(f"{n} {name}" for name, n in failed.most_common()) or "none"))
    print(f"seed {chosen.seed}, {len(done)} cases, {time.perf_counter() - begun_s:.0f} s")
    return int(bool(failed) or refused.total() > MOST_REFUSED * len(done))


if __name__ == "__main__":
    sys.exit(main())
