"""Free-form terms added to the predictions of a model."""

import subprocess
import sys

import numpy as np

from mopro.engine import Series
from mopro.engine.freeform import WithLaws, measurement_laws

_SUM = """
import numpy as np
from mopro.engine import Series
from mopro.engine.freeform import WithLaws, measurement_laws

t = np.linspace(0.1, 0.9, 50)
x, v = np.sin(3 * t), 3 * np.cos(3 * t)
labels = {"position": x, "velocity": v, "acceleration": -9 * x}
series = [Series("run", "force", "N", np.exp(t), 1.0, t, labels=labels)]
laws = [c for c in measurement_laws(series) if len(c.parameters) == 1]
model = WithLaws(lambda settings: [np.zeros(len(t))], series, laws)
settings = {c.name: {c.parameters[0].name: 0.1 + i / 7} for i, c in enumerate(laws)}
print(len(laws), [float.hex(value) for value in model(settings)[0].tolist()])
"""


def test_a_sum_of_terms_is_the_same_in_every_process():
    """Python numbers strings anew in each process, which decided the order of the sum."""
    said = {
        subprocess.run(
            [sys.executable, "-c", _SUM], env={"PYTHONHASHSEED": seed}, capture_output=True,
            text=True, check=True, timeout=60,
        ).stdout
        for seed in ("0", "1", "2", "3")
    }  # fmt: skip
    assert len(said) == 1
    assert int(said.pop().split()[0]) > 4


def test_settings_in_another_order_are_not_simulated_again():
    asked = []
    t = np.linspace(0.0, 1.0, 20)
    series = [Series("run", "force", "N", np.exp(t), 1.0, t)]

    def simulate(settings):
        asked.append(settings)
        return [np.zeros(len(t))]

    model = WithLaws(simulate, series, measurement_laws(series))
    model({"drag": {"b": 1.0, "c": 2.0}, "spring": {"k": 3.0}})
    model({"spring": {"k": 3.0}, "drag": {"c": 2.0, "b": 1.0}})
    assert len(asked) == 1
