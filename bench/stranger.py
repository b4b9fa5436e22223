"""A log that nobody has seen before, from the file to a verdict and a cross-test, by commands.

python bench/stranger.py: writes two logs of a lead screw as a controller would (semicolons, decimal
commas, a row of units, the command on changes only), with a play of 0.06 mm, an error of 0.02 mm at
each turn of 5 mm and a scale of 1.0004 in them; runs the steps of docs/tutorial-log.md in an empty
folder, and prints what they say and how long they take.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.stated import screw_log

STEPS = (
    ("import", "screw.csv", "--as", "screw"),
    ("compare", "screw/experiment.toml"),
    ("reconcile", "screw/experiment.toml", "--out", "repaired.toml"),
    ("import", "unseen.csv", "--as", "unseen"),
    ("compare", "unseen/experiment.toml", "--apply", "repaired.toml"),
)
_SHOWN = 14


def main() -> None:
    command = [str(Path(sys.executable).parent / "mopro")]
    with tempfile.TemporaryDirectory() as folder:
        places = np.random.default_rng(3).uniform(-20, 20, 16).tolist()
        Path(folder, "screw.csv").write_text(screw_log(places[:10], 8.0, 0.8, seed=1), "utf-8")
        Path(folder, "unseen.csv").write_text(screw_log(places[10:], 5.0, 0.5, seed=2), "utf-8")
        environment = os.environ | {"XDG_CACHE_HOME": folder}
        begun = time.monotonic()
        for step in STEPS:
            done = subprocess.run(
                [*command, *step], cwd=folder, env=environment, capture_output=True, text=True
            )
            print(f"== {time.monotonic() - begun:.1f} s: mopro {' '.join(step)}")
            print("\n".join((done.stdout + done.stderr).splitlines()[-_SHOWN:]))


if __name__ == "__main__":
    main()
