"""A sensor's free zero where the free start of a run does the same."""

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment

CART = """\
kind = "axis"
name = "cart"
unit = "m"

[base]
mass = {{ value = 2.0, unit = "kg" }}
viscous = {{ value = 6.0, unit = "N s/m", free = true, range = [0, 50] }}
{spring}
"""
PUSHED = """\
machine = "machine.toml"

[inputs]
force = { column = "force_N", hold = true }

[[sensor]]
name = "scale"
quantity = "position"
column = "place_m"
noise_rms = 0.0005
{zero}

[[effect]]
name = "humps"
enters = "force"
formula = "s * sin(2 * pi * x / P) + c * cos(2 * pi * x / P)"
s = { unit = "N", range = [-9, 9] }
c = { unit = "N", range = [-9, 9] }
P = { unit = "m", range = [0.1, 0.3] }
"""


def pushed(folder, *, humps, spring=0.0, zero="", runs=2):
    """The experiment on a cart pushed over humps of 0.2 m, by the midpoint rule."""
    text = PUSHED.replace("{zero}", zero)
    stated = f'spring = {{ value = {spring}, unit = "N/m" }}' if spring else ""
    (folder / "machine.toml").write_text(CART.format(spring=stated), encoding="utf-8")
    rng, t, h = np.random.default_rng(5), np.arange(0.0, 3.0, 0.01), 1e-3
    for run in range(runs):
        force = 12 * np.sin(1.7 * t + run) + 5 * np.sin(4.1 * t)
        x, v, places = 0.1 * run, 0.0, []

        def rate(x, v, push):
            hump = humps * np.sin(2 * np.pi * x / 0.2)
            return (push - 5.0 * v - spring * x + hump) / 2.0

        for push in force.tolist():
            places.append(x)
            for _ in range(10):
                mid = v + h / 2 * rate(x, v, push)
                x, v = x + h * mid, v + h * rate(x + h / 2 * v, mid, push)
        seen = np.array(places) + 0.0005 * rng.standard_normal(len(t))
        write(folder / f"run{run}.csv", {"time_s": t, "force_N": force, "place_m": seen})
        text += f'\n[[run]]\ndata = "run{run}.csv"\nstart = {{ v = 0 }}\n'
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return open_experiment(folder / "experiment.toml")


def test_a_zero_that_the_start_makes_up_for_is_at_0_and_told(tmp_path):
    opened = pushed(tmp_path, humps=0.0)
    assert any("are one number to these data" in note for note in opened.notes)
    verdict = opened.conclude().verdict
    assert verdict.verdict == "none"
    for run, place in ((0, 0.0), (1, 0.1)):
        own = verdict.base[f"start of run{run}.csv, x"]
        assert own.value == pytest.approx(place, abs=0.001)
        assert own.ci95[1] - own.ci95[0] < 0.001


def test_an_effect_of_the_place_is_found_where_the_sensor_shows_it(tmp_path):
    opened = pushed(tmp_path, humps=3.0)
    verdict = opened.conclude(left_out=opened.effects - {"humps", "bias_force"}).verdict
    (found,) = verdict.effects
    assert found.parameters["s"].value == pytest.approx(3.0, rel=0.02)
    assert abs(found.parameters["c"].value) < 0.1
    assert found.parameters["P"].value == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize(("zero", "spring"), [("zero = 0", 0.0), ("", 40.0)])
def test_a_zero_that_is_stated_or_told_by_the_law_stays_as_it_is(tmp_path, zero, spring):
    """A spring tells how far it is bent, so the zero of the scale is a number of its own."""
    opened = pushed(tmp_path, humps=0.0, zero=zero, spring=spring, runs=1)
    assert not any("are one number" in note for note in opened.notes)
    low, high = opened.conclude().verdict.base["start of run0.csv, x"].ci95
    assert -0.002 < low < 0 < high < 0.002
