"""An effect that the free numbers make up for has no signature beside them, and is found by a fit.

Two nodes on one board, of which one is heated: readings in steps of 0.32 K and of unknown noise.
The loss to the surroundings makes up for most of what radiation does.
"""

import numpy as np

from helpers.stated import write
from mopro.blind.reference.stepped_machines import PLANTS
from mopro.experiment.opened import open_experiment

STEP_C = 0.32
BOARD = """\
kind = "thermal"
name = "board"

[nodes]
block1 = "a * duty - U * (T - ambient)"
block2 = "-U * (T - ambient)"

[base]
a = { value = 0.01, unit = "K/s", free = true, range = [0, 0.1] }
U = { value = 0.006, unit = "1/s", free = true, range = [0, 0.05] }
"""
SEEN = """\
machine = "machine.toml"

[inputs]
duty = { column = "duty", unit = "1", hold = true }

[[run]]
data = "run.csv"
"""
SENSOR = """
[[sensor]]
name = "{node}"
quantity = "temperature"
column = "{node}_C"
noise_rms = "unknown"
zero = 0
"""


def test_several_effects_are_found_that_the_free_numbers_make_up_for(tmp_path):
    rng = np.random.default_rng(1)
    t = np.arange(0, 900, 3.0)
    duty = np.where((t >= 10) & (t < 620), 50.0, 0.0)
    gain, k, tau, r, s = np.array([0.0107, 0.0021, 16, 0.0035, 0.0008]) * rng.uniform(0.8, 1.2, 5)
    hidden = {
        "coupling": {"k": k},
        "sensor_lag": {"tau": tau},
        "radiation": {"r": r},
        "sensor_drift": {"s": s},
    }
    numbers = {"nodes": 2, "begin": 22.8, "a1": gain, "U1": 0.0013, "a2": 0.0, "U2": 0.0013}
    seen = PLANTS["thermal"]({"time_s": t, "duty1": duty, "duty2": 0 * t}, numbers, hidden)
    seen = np.round((seen + 0.08 * rng.standard_normal(seen.shape)) / STEP_C) * STEP_C
    columns = {"time_s": t, "duty": duty, "block1_C": seen[0], "block2_C": seen[1]}
    write(tmp_path / "run.csv", columns)
    (tmp_path / "machine.toml").write_text(BOARD, encoding="utf-8")
    text = SEEN + "".join(SENSOR.format(node=n) for n in ("block1", "block2"))
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    verdict = open_experiment(tmp_path / "experiment.toml").conclude().verdict
    told = {e.name: {e.name, *e.indistinguishable_from} for e in verdict.effects}
    assert verdict.verdict in ("named", "ambiguous")
    assert len(told) == len(hidden)
    assert all(any(name in family for family in told.values()) for name in hidden)
