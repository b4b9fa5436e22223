"""Runs measured by mopro's own instruments: what is the instrument's is no effect."""

import json

import pytest

from helpers.commands import run_here
from helpers.measured import Measured
from mopro.experiment.wording import calibration_words, sentence

BENT = {"c3": 0.0125, "mid": 0.1905}


@pytest.mark.parametrize(
    "case",
    [
        Measured("lvdt", "LVDT1.CMD", 1),
        Measured("lvdt", "LVDT3.CMD", 2),
        Measured("lvdt", "experiments/EXP04.CMD", 3),
        Measured("encoder", "LVDT3.CMD", 1),
        Measured("laser", "LVDT2.CMD", 1),
        Measured("thermocouple", "TEMP1.CMD", cut_s=1230.0),
    ],
    ids=lambda case: f"{case.instrument} {case.program}",
)
def test_nothing_is_told_where_nothing_is_hidden(case, tmp_path):
    assert case.verdict(tmp_path).verdict == "none"


def test_the_bend_of_an_lvdt_is_told_as_a_calibration(tmp_path):
    verdict = Measured("lvdt", "LVDT3.CMD", 1).verdict(tmp_path)
    (own,) = verdict.sensors
    low, high = own.parameters["bend"].ci95
    assert low < 0.05 < high
    assert sentence(verdict).startswith("None: with the linearity of lvdt calibrated")
    (words,) = calibration_words(verdict)
    assert words.startswith("Calibrated, linearity of lvdt: arc = ")
    (told,) = verdict.as_json()["calibration"]
    assert (told["name"], told["sensor"]) == ("linearity", "lvdt")
    assert set(told["parameters"]) == {"arc", "bend"}


@pytest.mark.parametrize("cut", ["linearity = 0.0", "linearity = 1e-9"])
def test_a_bend_beyond_what_is_stated_is_an_effect(cut, tmp_path):
    """As every bend was before sensors stated any."""
    assert Measured("lvdt", "LVDT3.CMD", 1, keys=cut).verdict(tmp_path).verdict != "none"


@pytest.mark.parametrize(
    ("instrument", "effect", "size", "keys"),
    [
        ("encoder", "sensor_gain", {"g": 1e-3}, "gain_tolerance = 1e-3"),
        ("encoder", "sample_clock", {"e": 3e-4}, "clock_tolerance = 3e-4"),
        ("encoder", "sensor_nonlinearity", BENT | {"c3": 1e-4}, "linearity = 0.05\nrange = 508"),
    ],
)
def test_what_is_within_the_tolerance_is_a_calibration(instrument, effect, size, keys, tmp_path):
    verdict = Measured(instrument, "LVDT3.CMD", 4, hidden={effect: size}, keys=keys).verdict(
        tmp_path
    )
    assert (verdict.verdict, verdict.effects) == ("none", ())
    told = {own.name for own in (*verdict.sensors, *verdict.calibration)}
    assert told <= {keys.split()[0], effect}
    assert told


@pytest.mark.parametrize(
    ("instrument", "effect", "size", "keys"),
    [
        ("lvdt", "sensor_nonlinearity", BENT, ""),
        ("lvdt", "acceleration_scale", {"e": 0.1}, ""),
        ("encoder", "viscous_drag", {"b": 9.0}, "gain_tolerance = 1e-5\nclock_tolerance = 5e-5"),
        ("encoder", "sensor_gain", {"g": 1e-2}, "gain_tolerance = 1e-3"),
        ("encoder", "sample_clock", {"e": 5e-4}, "clock_tolerance = 5e-5"),
    ],
)
def test_what_is_beyond_it_is_named(instrument, effect, size, keys, tmp_path):
    verdict = Measured(instrument, "LVDT3.CMD", 4, hidden={effect: size}, keys=keys).verdict(
        tmp_path
    )
    (own,) = verdict.effects
    assert effect in {own.name, *own.indistinguishable_from}


@pytest.mark.parametrize(
    ("keys", "code"),
    [("", 0), ("linearity = 0.05", 0), ("linearity = 1e-9", 1), ("linearity = 0.003", 1)],
)
def test_compare_judges_what_is_left_of_the_stated_linearity(keys, code, tmp_path):
    """The bend of the LVDT comes to 0.05 in; sizes are those of the residual as it is."""
    path = Measured("lvdt", "LVDT3.CMD", 1, keys=keys).write(tmp_path)
    done = run_here(tmp_path, "compare", path, "--json")
    answer = json.loads(done.stdout)
    assert done.returncode == code, answer["verdict"]
    assert answer["series"][0]["rms"] == pytest.approx(0.02786, rel=1e-3)
    if code == 0:
        (own,) = answer["calibration"]
        assert (own["sensor"], own["name"]) == ("lvdt", "linearity")
        said = run_here(tmp_path, "compare", path).stdout
        assert "Within the stated linearity of lvdt: arc = " in said


@pytest.mark.parametrize("off", [1.0, 30.0])
def test_a_gain_that_is_off_within_its_tolerance_is_no_disagreement(off, tmp_path):
    hidden = {"sensor_gain": {"g": off * 1e-3}}
    case = Measured("encoder", "LVDT3.CMD", 4, hidden=hidden, keys="gain_tolerance = 1e-3")
    done = run_here(tmp_path, "compare", case.write(tmp_path))
    assert done.returncode == (off > 20)
