"""Modules of SciPy that a diagnosis imports."""

import subprocess
import sys

import numpy as np

from helpers.stated import follows, write

SCRIPT = """\
import sys
from mopro.experiment.opened import open_experiment
print(open_experiment(sys.argv[1]).conclude().verdict.verdict)
print(*({"scipy.stats", "scipy.signal"} & sys.modules.keys()))
"""


def test_a_diagnosis_does_not_load_what_takes_a_third_of_a_second(tmp_path):
    t = np.arange(0, 10, 0.1)
    x = 5 * np.sin(t)
    noise = 0.01 * np.random.default_rng(3).standard_normal(len(t))
    write(tmp_path / "run.csv", {"time_s": t, "target_mm": x, "position_mm": x + noise})
    (tmp_path / "experiment.toml").write_text(follows(0.01, "run.csv"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path / "experiment.toml")],
        capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert done.stdout.split() == ["none"]
