"""200 clients at once against `mopro serve` and its page, hostile in every way; prints a table.

    python bench/clients.py --clients 200 --seconds 10

One client that means well is connected first and goes on asking for the status; at the end it
sends a stop. A row for each kind of hostility:

- what the server did with the clients: refused, told so (`busy`, or an HTTP error), dropped, or
  left waiting;
- answers that the one got, its slowest one and that to the stop (ms);
- file descriptors of the server that are still open once all have left, megabytes that it grew
  by, and the share of a processor that it took.

Exits with 1 if the one was not served, an answer took over 5 s, a descriptor was left open or
the server grew by more than 50 MB.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.clients import (
    HTTP,
    KINDS,
    Outcome,
    place_taken_from_a_silent_one,
    serving,
    stormed,
)

_MOST_MB = 50.0
_IDLE_S = 3.0
_FATES = ("refused", "told so", "dropped", "waits")
_TITLES = (*_FATES, "answers", "slowest ms", "stop ms", "files", "MB", "CPU")


def row(found: Outcome) -> str:
    """One row of the table."""
    cells = [found.fates[fate] for fate in _FATES]
    cells += [found.answers, f"{1e3 * found.slowest_s:.0f}", f"{1e3 * found.stop_s:.0f}"]
    cells += [found.files_more, f"{found.mb_more:.1f}", f"{found.cpu:.0%}"]
    return f"{found.kind:18}" + "".join(f"{cell!s:>11}" for cell in cells)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--clients", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=10.0, help="for each kind")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    print(f"{'kind of client':18}" + "".join(f"{title:>11}" for title in _TITLES), flush=True)
    failed = False
    for web in (False, True):
        with serving("--idle", f"{_IDLE_S:g}s", web=web) as server:
            for kind in HTTP if web else [k for k in KINDS if k not in HTTP]:
                found = stormed(server, kind, chosen.clients, chosen.seconds, chosen.seed)
                print(row(found), *found.failures, flush=True)
                failed |= bool(found.failures) or found.mb_more > _MOST_MB
            if not web:
                taken_s = place_taken_from_a_silent_one(server, 10 * _IDLE_S)
                print(f"the place of a silent client is had after {taken_s:.1f} s (--idle 3s)")
                failed |= taken_s >= 10 * _IDLE_S
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
