"""A user's effect in a machine file: found where it is hidden, absent where it is not.

python bench/user_effect.py [CASES]: draws CASES drives with a friction that depends on place and
as many without, of which half have a plain dry friction; counts what `mopro reconcile` names.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.rigs import DRIVE, FRICTION_OF_PLACE, drive_folder
from mopro.experiment.opened import open_experiment

CASES = 20
NAME = "friction of place"


def named(seed: int, **hidden: float) -> set[str]:
    """The effects that are named where `hidden` is."""
    with tempfile.TemporaryDirectory() as folder:
        path = drive_folder(Path(folder), DRIVE + FRICTION_OF_PLACE, seed=seed, **hidden)
        verdict = open_experiment(path).conclude(1, lambda _: None, ()).verdict
    return {effect.name for effect in verdict.effects}


def main(cases: int) -> None:
    rng = np.random.default_rng(19)
    counts: Counter[str] = Counter()
    for seed in range(100, 100 + cases):
        size = float(rng.uniform(4.0, 20.0))
        found = named(seed, of_place=size)
        counts["found alone" if found == {NAME} else "found" if NAME in found else "missed"] += 1
        hidden = {"dry": float(rng.uniform(0.2, 0.6))} if seed % 2 else {}
        absent = named(seed, **hidden)
        right = absent == ({"dry_friction"} if hidden else set())
        counts["falsely named" if NAME in absent else "absent" if right else "other wrong"] += 1
        print(seed, f"{size:.3g} N/m:", found, "| without:", hidden, absent, flush=True)
    print(dict(counts))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else CASES)
