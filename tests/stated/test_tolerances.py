"""Sensors of other machines that state how exact they are."""

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment

T = np.arange(0, 12, 0.02)
MOVES = 30 * np.sin(0.8 * T) * np.sin(2.1 * T)
NOISE = 0.02 * np.random.default_rng(1).standard_normal(len(T))
# The zero of the sensor, from which its range is told.
ZERO = 3.0
LATER = 30 * np.sin(0.8 * 1.0005 * T) * np.sin(2.1 * 1.0005 * T)
# What is wrong with the sensor, twice the stated width or less, and the key that allows it.
WITHIN = {
    "linearity = 0.5\nrange = 80": MOVES + 0.4 * (MOVES / 40) ** 3,
    "linearity = 0.5\nrange = [-40.0, 40.0]": MOVES - 0.5 * ((MOVES + ZERO) / 40) ** 2,
    "gain_tolerance = 2e-3": MOVES * 1.003,
    "clock_tolerance = 4e-4": LATER,
}


EXPERIMENT = """\
machine = "kinematic"
[inputs]
command = {{ column = "target_mm" }}
[[run]]
data = "run.csv"
[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = {noise}
{keys}
"""


def verdict(folder, measured, keys="", noise="0.02"):
    """Of a machine that goes where it is told, with a sensor of these keys."""
    (folder / "experiment.toml").write_text(EXPERIMENT.format(noise=noise, keys=keys))
    write(folder / "run.csv", {"time_s": T, "target_mm": MOVES, "position_mm": measured})
    return open_experiment(folder / "experiment.toml").conclude().verdict


@pytest.mark.parametrize("keys", WITHIN)
def test_what_a_sensor_may_be_off_by_is_its_calibration(tmp_path, keys):
    answer = verdict(tmp_path, WITHIN[keys] + NOISE + ZERO, keys)
    assert (answer.verdict, answer.effects) == ("none", ())
    (told,) = answer.sensors
    assert (told.name, told.form) == (keys.split()[0], "scale")


@pytest.mark.parametrize("keys", list(WITHIN)[2:])
def test_an_exact_sensor_has_none(tmp_path, keys):
    answer = verdict(tmp_path, WITHIN[keys] + NOISE + ZERO)
    assert answer.verdict != "none"
    assert answer.sensors == ()


def test_a_scale_beyond_the_tolerance_is_named(tmp_path):
    answer = verdict(tmp_path, 1.02 * MOVES + NOISE, "gain_tolerance = 1e-3")
    assert [effect.name for effect in answer.effects] == ["scale"]


@pytest.mark.parametrize("noise", ["0.02", '"unknown"'])
def test_a_play_is_named_beside_a_sensor_that_bends(tmp_path, noise):
    """Also where the noise is unknown, and the widths are told in the noise that is found."""
    x = [float(MOVES[0])]
    for target in MOVES[1:].tolist():
        x.append(min(max(x[-1], target - 0.25), target + 0.25))
    places = np.array(x)
    measured = places + 0.4 * (places / 40) ** 3 + NOISE
    (effect,) = verdict(tmp_path, measured, "linearity = 0.5\nrange = 80", noise).effects
    assert effect.name == "backlash"
    low, high = effect.parameters["w"].ci95
    assert low < 0.5 < high


@pytest.mark.parametrize("keys", WITHIN)
def test_compare_judges_what_is_left_of_the_tolerance(tmp_path, keys):
    """Sizes are those of the residual as it is."""
    verdict_of = {}
    for stated in (keys, ""):
        (tmp_path / "experiment.toml").write_text(EXPERIMENT.format(noise="0.02", keys=stated))
        data = {"time_s": T, "target_mm": MOVES, "position_mm": WITHIN[keys] + NOISE + ZERO}
        write(tmp_path / "run.csv", data)
        found = open_experiment(tmp_path / "experiment.toml").compare(0)
        verdict_of[stated] = (found.verdict, found.series[0].rms)
        told = [(own.sensor, own.name) for own in found.calibration]
        assert told == ([("scale", keys.split()[0])] if stated else [])
    assert verdict_of[keys][0] == "no disagreement"
    assert verdict_of[""] == ("disagreement", verdict_of[keys][1])
