"""On random programs: what lint calls a stall, and what it passes, against the emulator.

Prints how often each outcome came about and the rate of disagreement among those programs
that are called a stall or passed with a margin of at least 5 %.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from helpers.lint_agreement import agreement

LIMIT = 0.01


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1992)
    chosen = parser.parse_args()
    outcomes, wrong = agreement(chosen.count, chosen.seed)
    judged = outcomes.total() - outcomes["margin below 5 %"]
    for outcome, count in outcomes.most_common():
        print(f"{count:>5}  {outcome}")
    for verdict in wrong:
        print(f"\n{verdict.outcome}, payload {verdict.payload_kg} kg:\n{verdict.text}")
    rate = len(wrong) / judged
    print(f"disagreement: {len(wrong)} of {judged}, {rate:.2%}")
    return int(rate > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
