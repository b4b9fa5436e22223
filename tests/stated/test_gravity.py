"""An arm under given torques: its gravity is listed, and is one effect whoever offers it."""

import math

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment

ARM = """\
kind = "axis"
name = "arm"
unit = "rad"

[base]
inertia = { value = 0.02, unit = "kg m2" }
viscous = { value = 0.03, unit = "N m s/rad", free = true, range = [0, 0.5] }
"""
PUSHED = """\
machine = "machine.toml"

[inputs]
torque = { column = "torque_Nm", hold = true }

[[sensor]]
name = "encoder"
quantity = "angle"
column = "angle_rad"
noise_rms = 0.001
zero = 0

[[run]]
data = "run.csv"
start = { x = 0, v = 0 }
"""
OFFERED = """
[[effect]]
name = "weight"
enters = "force"
formula = "- ws*sin( x ) - wc * cos(x)"
ws = { unit = "N m" }
wc = { unit = "N m" }
"""


def pushed(folder, *, sine=0.0, cosine=0.0, machine=ARM, seed=1):
    """The verdict on an arm of this gravity (N m), integrated by the midpoint rule."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 6.0, 0.01)
    torque = 0.25 * np.sin(2.3 * t + rng.uniform(0, 6)) + 0.2 * np.sin(7.1 * t)
    x = v = 0.0
    places, h = [], 1e-3

    def rate(x, v, push):
        return (push - 0.05 * v - sine * math.sin(x) - cosine * math.cos(x)) / 0.02

    for push in torque.tolist():
        places.append(x)
        for _ in range(10):
            middle = v + h / 2 * rate(x, v, push)
            v, x = v + h * rate(x + h / 2 * v, middle, push), x + h * middle
    angle = np.array(places) + 0.001 * rng.standard_normal(len(t))
    write(folder / "run.csv", {"time_s": t, "torque_Nm": torque, "angle_rad": angle})
    (folder / "machine.toml").write_text(machine, encoding="utf-8")
    (folder / "experiment.toml").write_text(PUSHED, encoding="utf-8")
    return open_experiment(folder / "experiment.toml").conclude().verdict


def test_the_gravity_of_an_arm_is_named_with_its_sizes(tmp_path):
    verdict = pushed(tmp_path, sine=0.3, cosine=0.12)
    (found,) = verdict.effects
    assert (verdict.verdict, found.name) == ("named", "gravity")
    assert found.parameters["gs"].value == pytest.approx(0.3, rel=0.02)
    assert found.parameters["gc"].value == pytest.approx(0.12, rel=0.02)


def test_an_effect_that_is_offered_takes_the_place_of_the_listed_one(tmp_path):
    verdict = pushed(tmp_path, sine=0.3, cosine=0.12, machine=ARM + OFFERED)
    assert verdict.verdict == "named"
    assert [effect.name for effect in verdict.effects] == ["weight"]


@pytest.mark.parametrize("seed", range(4, 7))
def test_an_arm_without_gravity_has_none(tmp_path, seed):
    verdict = pushed(tmp_path, seed=seed)
    assert (verdict.verdict, verdict.effects) == ("none", ())
