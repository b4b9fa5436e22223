"""Throw inputs at the parser and the linter: no traceback, no hang, every place in the file.

`--count 1000000` takes a while on one core; `--jobs` shares it. Prints how many inputs
were tried and the slowest of them; an input that fails is printed with its number.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.lint_fuzz import check_input, fuzz_input

_CHUNK = 2000
_HANG_S = 20.0


def chunk(task: tuple[int, int]) -> tuple[float, bytes, list[str]]:
    """One chunk's slowest time and input, and its failures."""
    seed, count = task
    source = random.Random(seed)
    slowest, slow, failures = 0.0, b"", []
    for number in range(count):
        data = fuzz_input(source)
        start = time.perf_counter()
        try:
            check_input(data, number)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is what is looked for
            failures.append(f"seed {seed}, input {number}: {data!r}: {error!r}")
        taken = time.perf_counter() - start
        if taken > slowest:
            slowest, slow = taken, data
    return slowest, slow, failures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1992)
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args()
    tasks = [
        (chosen.seed * 1_000_003 + first, min(_CHUNK, chosen.count - first))
        for first in range(0, chosen.count, _CHUNK)
    ]
    start = time.perf_counter()
    with ProcessPoolExecutor(chosen.jobs) as pool:
        results = list(pool.map(chunk, tasks))
    failures = [text for _, _, texts in results for text in texts]
    slowest, slow, _ = max(results)
    print("\n".join(failures[:20]))
    print(
        f"{chosen.count} inputs in {time.perf_counter() - start:.0f} s: {len(failures)} failures; "
        f"the slowest took {slowest:.2f} s: {slow!r}"
    )
    return int(bool(failures) or slowest > _HANG_S)


if __name__ == "__main__":
    sys.exit(main())
