"""A fault of the system at each call of each command that writes files.

    python bench/faults.py [--most 40] [--command "run, csv"] [--call memory]

The first, second, ... call of a kind fails: opening to write or to read, read, write, fsync,
rename, mkdir, unlink, change of mode. Calls are those of Python on files below the working
folder, the cache included. What libraries write that are not Python meets a disk that is full at
one to seven eighths of the largest output (but not below 4 KiB). The last kind is a limit of
memory, at one to 63 sixty-fourths of what the command takes beyond its start. Prints for each
command and kind the tries and the failures, and exits with 1 if there is any:

- an output that is neither what it was before nor complete, or an input that is gone,
- an exit that reports success with an output missing,
- a traceback,
- a draft that is left behind (unless its removal was what failed).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.faults import COMMANDS, FAILURES, KINDS, Trial, workplace


def trials(name: str, most: int, kinds: Sequence[str]) -> Iterator[Trial]:
    """The trials of one command: up to `most` calls of each of `kinds`."""
    with tempfile.TemporaryDirectory() as folder, workplace(name, folder) as place:
        for call in kinds:
            for number in range(1, most + 1):
                done = place.trial(call, number)
                if done is None:
                    break
                yield done


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--most", type=int, default=40, help="calls of each kind")
    parser.add_argument("--command", choices=COMMANDS, action="append")
    parser.add_argument("--call", choices=KINDS, action="append")
    chosen = parser.parse_args()
    started_s = time.perf_counter()
    head = "".join(f"{title:>24}" for title in FAILURES)
    print(f"{'command':24} {'call':15} {'tries':>5} {'exit 0':>6}{head}")
    failed = []
    total = 0
    for name in chosen.command or COMMANDS:
        tried = trials(name, chosen.most, chosen.call or KINDS)
        for call, of_kind in groupby(tried, key=lambda t: t.call):
            some = list(of_kind)
            counts = Counter(f for t in some for f in t.failures)
            told = "".join(f"{counts[f]:>24}" for f in FAILURES)
            good = sum(t.code == 0 for t in some)
            print(f"{name:24} {call:15} {len(some):5} {good:6}{told}", flush=True)
            total += len(some)
            failed += [t for t in some if t.failures]
    for t in failed[:12]:
        print(f"\nFAILED {t.command}, {t.call} {t.number}: {', '.join(t.failures)}")
        print(f"exit {t.code}:", *t.said.strip().splitlines()[-3:], sep="\n  ")
    print(f"\n{len(failed)} failures in {total} tries, {time.perf_counter() - started_s:.0f} s")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
