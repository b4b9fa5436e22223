"""Attacks that once broke something, tried again: a row for each with tries and failures.

    python bench/attacks.py

Each try is a test of `tests/` with another module name, signal, stream, number or file. The rows
are those of docs/untrusted.md. Exits with 1 if one fails, or if an attack has no try.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.attacks import ATTACKS, files_of
from helpers.paths import ROOT


class Tally:
    """Counts of tries and failures of each attack, as pytest reports them."""

    def __init__(self) -> None:
        self.tries: Counter[str] = Counter()
        self.failures: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when != "call" and not report.failed:
            return
        for attack, tests in ATTACKS.items():
            if report.nodeid.removeprefix("tests/").startswith(tests):
                self.tries[attack] += 1
                self.failures[attack] += report.failed


def main() -> int:
    tally = Tally()
    files = dict.fromkeys(
        str(ROOT / "tests" / file) for attack in ATTACKS for file in files_of(attack)
    )
    pytest.main(["-q", *files], [tally])
    print("\n| attack | tests | tries | failures |\n|---|---|---|---|")
    for attack in ATTACKS:
        tests = ", ".join(f"`{file}`" for file in files_of(attack))
        print(f"| {attack} | {tests} | {tally.tries[attack]} | {tally.failures[attack]} |")
    return int(any(tally.failures[a] or not tally.tries[a] for a in ATTACKS))


if __name__ == "__main__":
    sys.exit(main())
