"""Logs that the law which import writes does not fit: `compare` runs all the same."""

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.many_logs.machines import lagged, pushes


def written(path, columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{value:.8g}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def compared(folder, *options):
    done = run_here(folder, "import", "log.csv", "--as", "out", *options)
    assert done.returncode == 0, done.stderr
    return run_here(folder, "compare", "out/experiment.toml")


@pytest.mark.parametrize(("warm_K", "nodes"), [(60, 1), (60, 2), (-15, 1), (200, 1)])
def test_a_thermal_log_may_begin_warm_or_cold(tmp_path, warm_K, nodes):
    rng, time_s = np.random.default_rng(3), 0.05 * np.arange(600)
    share = 0.1 + np.abs(pushes(rng, time_s))
    left = np.exp(-time_s / 4)
    rise = 30 * (lagged(share, time_s, 4.0) - share[0] * left) + warm_K * left
    columns = {"time_s": time_s, "heater_W": 40 * share}
    for name in ("block_temp_degC", "case_temp_degC")[:nodes]:
        columns[name] = 20 + rise + 0.02 * rng.normal(size=len(time_s))
        rise = 0.6 * lagged(rise, time_s, 2.0)
    written(tmp_path / "log.csv", columns)
    done = compared(tmp_path)
    assert done.returncode in (0, 1), done.stderr


@pytest.mark.parametrize(
    ("reach", "damping", "turns"), [(2.8, 0.05, 6.3), (0.05, 0.3, 4.0), (1.2, 0.02, 9.0)]
)
def test_a_second_swing_may_have_other_numbers(tmp_path, reach, damping, turns):
    rng, time_s = np.random.default_rng(4), 0.02 * np.arange(800)
    first = 0.2 * np.exp(-0.1 * time_s) * np.cos(6.3 * time_s)
    second = reach * np.exp(-damping * time_s) * np.cos(turns * time_s)
    angle = np.concatenate((first, second)) + 1e-3 * rng.normal(size=1600)
    written(tmp_path / "log.csv", {"time_s": np.tile(time_s, 2), "angle_rad": angle})
    done = compared(tmp_path, "--kind", "axis")
    assert done.returncode in (0, 1), done.stderr
