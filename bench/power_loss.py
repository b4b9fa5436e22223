"""A loss of power at each moment of each command that writes files.

    python bench/power_loss.py [--command fmt]

The changes of the working folder are recorded as a command makes them: data, names, renames,
removals, and what is flushed to the disk. They are then replayed up to each moment; of those that
were not flushed by then the disk has kept none, all, all but one, one alone, or the first ones,
and data whole or by half. Prints for each command the moments, the states of the disk that were
looked at, and the files that were

- torn in one of them: neither as before nor as the command had finished them,
- lost: not as they were when success was told, by the exit code 0 or, by the virtual controller, by
  its reply to a statement.

The cache is not looked at, nor is the log of `--trace`. Exits with 1 if a file was torn or lost.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.faults import COMMANDS, workplace
from helpers.power_loss import Outcome, outcome


def tried(name: str) -> Outcome:
    """The outcome of a loss of power during one command."""
    with tempfile.TemporaryDirectory() as folder, workplace(name, folder) as place:
        return outcome(*place.changes(), growing=COMMANDS[name].growing)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--command", choices=COMMANDS, action="append")
    chosen = parser.parse_args()
    print(f"{'command':24} {'moments':>8} {'states':>8} {'torn':>6} {'lost':>6}")
    moments = states = failed = 0
    for name in chosen.command or COMMANDS:
        done = tried(name)
        numbers = f"{done.moments:8} {done.states:8} {len(done.torn):6} {len(done.lost):6}"
        print(f"{name:24} {numbers}  {' '.join({*done.torn, *done.lost})}".rstrip(), flush=True)
        moments, states = moments + done.moments, states + done.states
        failed += len({*done.torn, *done.lost})
    print(f"{'all':24} {moments:8} {states:8}, files torn or lost: {failed}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
