"""Inputs that no formula uses: a share of one in a reading is named, a copy of a used one never."""

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, DRIVEN, driven, write
from mopro.engine.play import follow
from mopro.experiment.opened import open_experiment

RNG = np.random.default_rng
STAGE = """\
machine = "kinematic"
[inputs]
command = { column = "target_mm" }
other = { column = "other_mm" }
[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = 0.002
[[run]]
data = "run.csv"
"""


def moves(seed):
    """Places (mm) between a dozen stops, and their times (s)."""
    t = np.arange(0, 60, 0.05)
    return t, np.interp(t, np.linspace(0, 60, 13), RNG(seed).uniform(-50, 50, 13))


def stage(folder, share=0.0, play=0.0, logged=None, text=STAGE, seed=1):
    """A stage whose reading has a `share` of the other axis and play (mm); the experiment's file.

    `logged` makes the column of the other axis of target, true place and reading.
    """
    (t, x), (_, other) = moves(seed), moves(seed + 100)
    true = follow(x, play / 2, 0.0) + share * other
    read = true + 0.002 * RNG(seed).standard_normal(len(t))
    own = other if logged is None else logged(x, true, read)
    write(folder / "run.csv", {"time_s": t, "target_mm": x, "other_mm": own, "position_mm": read})
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return folder / "experiment.toml"


def named(place):
    verdict = open_experiment(place).conclude().verdict
    return verdict.verdict, {effect.name: effect for effect in verdict.effects}


@pytest.mark.parametrize(("share", "seed"), [(7e-5, 1), (-4e-5, 2), (0.2, 3)])
def test_a_share_of_the_other_axis_is_named_with_its_size(tmp_path, share, seed):
    word, effects = named(stage(tmp_path, share, seed=seed))
    assert (word, [*effects]) == ("named", ["crosstalk of other in scale"])
    size = effects["crosstalk of other in scale"].parameters["c"]
    assert size.unit == "1"
    assert size.ci95[0] < share < size.ci95[1]


def test_it_is_named_where_the_noise_is_unknown_and_beside_another_effect(tmp_path):
    text = STAGE.replace("0.002", '"unknown"')
    _, effects = named(stage(tmp_path, 7e-5, play=0.04, text=text))
    assert effects.keys() == {"backlash", "crosstalk of other in scale"}


COPIES = {
    "a copy": lambda x, true, read: 2 * x + 3,
    "nearly a copy": lambda x, true, read: x + 2 * RNG(9).standard_normal(len(x)),
    "constant": lambda x, true, read: np.full(len(x), 24.0),
    "the time": lambda x, true, read: 3.0 * np.arange(len(x)),
    "the speed": lambda x, true, read: np.gradient(x),
    "the reading": lambda x, true, read: read,
    "the following error": lambda x, true, read: x - read,
    "another encoder": lambda x, true, read: true + 1e-3 * RNG(9).standard_normal(len(x)),
}


@pytest.mark.parametrize("noise", ["0.002", '"unknown"'])
@pytest.mark.parametrize("play", [0.0, 0.04])
@pytest.mark.parametrize("copy", COPIES)
def test_what_tells_nothing_of_its_own_is_never_named(tmp_path, copy, play, noise):
    text = STAGE.replace("0.002", noise)
    _, effects = named(stage(tmp_path, play=play, logged=COPIES[copy], text=text))
    assert [*effects] == (["backlash"] if play else [])


@pytest.mark.parametrize("seed", range(4))
def test_an_unused_input_without_a_share_is_not_named(tmp_path, seed):
    assert named(stage(tmp_path, seed=seed)) == ("none", {})


def test_the_repaired_file_predicts_an_unseen_run(tmp_path):
    (tmp_path / "unseen").mkdir()
    stage(tmp_path, 7e-5)
    stage(tmp_path / "unseen", 7e-5, seed=5)
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--out", "repaired.toml")
    assert done.returncode == 0, done.stderr
    assert '[effects."crosstalk of other in scale"]' in (tmp_path / "repaired.toml").read_text(
        "utf-8"
    )
    unseen = "unseen/experiment.toml"
    before = run_here(tmp_path, "compare", unseen)
    after = run_here(tmp_path, "compare", unseen, "--apply", "repaired.toml")
    assert (before.returncode, after.returncode) == (1, 0), after.stderr


def test_a_file_with_it_serves_an_experiment_without_that_input(tmp_path):
    text = STAGE.replace('other = { column = "other_mm" }\n', "")
    stage(tmp_path, text=text)
    (tmp_path / "repaired.toml").write_text(
        'kind = "kinematic"\nname = "stage"\n[effects."crosstalk of other in scale"]\nc = 7e-5\n',
        "utf-8",
    )
    done = run_here(tmp_path, "compare", "experiment.toml", "--apply", "repaired.toml")
    assert done.returncode == 0, done.stderr
    assert "crosstalk of other in scale of stage is left out" in done.stderr


def test_an_input_may_be_called_as_the_size_of_the_share(tmp_path):
    text = STAGE.replace("other =", "c =")
    assert named(stage(tmp_path, 7e-5, text=text))[1].keys() == {"crosstalk of c in scale"}


def test_each_sensor_has_a_share_of_its_own(tmp_path):
    sensor = STAGE[STAGE.index("[[sensor]]") : STAGE.index("[[run]]")]
    second = sensor.replace('"scale"', '"laser"').replace("position_mm", "laser_um")
    text = STAGE.replace(sensor, sensor + second.replace("0.002", "1.0"))
    stage(tmp_path, 7e-5, text=text)
    t, x = moves(1)
    columns = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    laser = 1e3 * x + 1.0 * RNG(7).standard_normal(len(t))
    write(tmp_path / "run.csv", {n: columns[n] for n in columns.dtype.names} | {"laser_um": laser})
    word, effects = named(tmp_path / "experiment.toml")
    assert (word, [*effects]) == ("named", ["crosstalk of other in scale"])


def test_an_axis_under_forces_is_read_with_a_share_of_another_signal(tmp_path):
    t = driven()["time_s"]
    supply = 24 + 0.5 * np.sin(5.3 * t) + 0.2 * RNG(3).standard_normal(len(t))
    columns = driven()
    columns |= {"supply_V": supply, "position_mm": columns["position_mm"] + 2.0 * supply}
    write(tmp_path / "run.csv", columns)
    told = DRIVEN.replace("[inputs]", '[inputs]\nsupply = { column = "supply_V" }')
    (tmp_path / "experiment.toml").write_text(told, encoding="utf-8")
    (tmp_path / "machine.toml").write_text(DRIVE, encoding="utf-8")
    word, effects = named(tmp_path / "experiment.toml")
    assert (word, [*effects]) == ("named", ["crosstalk of supply in scale"])
    size = effects["crosstalk of supply in scale"].parameters["c"]
    assert (size.unit, size.value) == ("mm/V", pytest.approx(2.0, rel=0.05))


OVEN = """\
kind = "thermal"
name = "oven"
[nodes]
oven = "a * duty - U * (T - ambient)"
[base]
a = { value = 0.8, unit = "K/s", free = true, range = [0.05, 5] }
U = { value = 0.005, unit = "1/s", free = true, range = [0.0005, 0.05] }
"""
HEATED = """\
machine = "machine.toml"
[inputs]
duty = { column = "duty_percent", hold = true }
lamp = { column = "lamp_A", hold = true }
[[sensor]]
name = "oven"
quantity = "temperature"
column = "oven_C"
noise_rms = 0.05
[[run]]
data = "run.csv"
"""


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_thermometer_that_a_current_disturbs(tmp_path, share):
    t, rng = np.arange(0, 3000, 5.0), RNG(6)
    duty, lamp = (np.repeat(rng.uniform(0, 100, 20), 30) for _ in range(2))
    lamp /= 50
    inside, found = 21.0, []
    for power in duty.tolist():
        found.append(inside)
        for _ in range(20):
            inside += 0.25 * (0.008 * power - 0.006 * (inside - 21.0))
    read = np.array(found) + share * lamp + 0.05 * rng.standard_normal(len(t))
    write(tmp_path / "run.csv", {"time_s": t, "duty_percent": duty, "lamp_A": lamp, "oven_C": read})
    (tmp_path / "experiment.toml").write_text(HEATED, encoding="utf-8")
    (tmp_path / "machine.toml").write_text(OVEN, encoding="utf-8")
    word, effects = named(tmp_path / "experiment.toml")
    assert (word, [*effects]) == (
        ("named", ["crosstalk of lamp in oven"]) if share else ("none", [])
    )
