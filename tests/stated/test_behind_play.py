"""Play between the motor and the encoder at its load, of an axis that is read by one or by both."""

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, DRIVEN, driven, write
from mopro.engine.play import follow
from mopro.experiment.opened import open_experiment

RNG = np.random.default_rng
SENSOR = DRIVEN[DRIVEN.index("[[sensor]]") : DRIVEN.index("[[run]]")]


def drive(folder, plays, dry=0.0, seed=1):
    """A drive with a sensor behind each of `plays` (mm, by name); its experiment's file."""
    columns, rng = driven(seed=seed, dry=dry, noise=0.0), RNG(seed + 50)
    place = columns.pop("position_mm")
    for name, width in plays.items():
        noise = 0.2 * rng.standard_normal(len(place))
        columns[f"{name}_mm"] = follow(place, width / 2, 0.0) + noise
    write(folder / "run.csv", columns)
    sensors = (
        SENSOR.replace('"scale"', f'"{name}"').replace("position_mm", f"{name}_mm")
        for name in plays
    )
    (folder / "machine.toml").write_text(DRIVE, encoding="utf-8")
    text = DRIVEN.replace(SENSOR, "".join(sensors))
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return folder / "experiment.toml"


@pytest.mark.parametrize(
    ("plays", "dry"),
    [
        ({"motor": 0.0, "load": 4.0}, 0.0),
        ({"load": 4.0, "motor": 0.0}, 0.0),
        ({"motor": 0.0, "load": 0.6}, 0.0),
        ({"motor": 0.0, "load": 3.0}, 0.5),
        ({"load": 4.0}, 0.0),
        ({"motor": 0.0, "load": 0.0}, 0.5),
        ({"load": 0.0}, 0.5),
        ({"motor": 0.0, "load": 0.0}, 0.0),
    ],
)
@pytest.mark.parametrize("seed", [2, 3])
def test_only_the_sensor_behind_the_play_has_it(tmp_path, plays, dry, seed):
    verdict = open_experiment(drive(tmp_path, plays, dry, seed)).conclude().verdict
    found = {effect.name: effect.parameters for effect in verdict.effects}
    wanted = {f"play before {name}": width for name, width in plays.items() if width}
    assert found.keys() == wanted.keys() | ({"dry_friction"} if dry else set())
    assert verdict.verdict == ("named" if found else "none")
    for name, width in wanted.items():
        assert found[name]["w"].value == pytest.approx(width, abs=0.15)


JOINT = """\
kind = "axis"
name = "joint"
unit = "UNIT"

[base]
inertia = { value = 2.0, unit = "kg m2", tolerance = 0.05 }
viscous = { value = 2.0, unit = "N m s/rad", free = true, range = [0, 30] }
spring = { value = 50, unit = "N m/rad", free = true, range = [0, 200] }
"""


def joint(folder, unit, of_1_mm, plays, dry):
    """As `drive`, a rotary axis whose angle (`unit`) is that of a drive of 1 m at the radius."""
    experiment = drive(folder, plays, dry, seed=2)
    columns = np.genfromtxt(folder / "run.csv", delimiter=",", names=True)
    renamed = {"time_s": columns["time_s"], "torque_Nm": columns["force_N"]}
    text = experiment.read_text("utf-8").replace("force", "torque").replace("torque_N", "torque_Nm")
    text = text.replace('"position"', '"angle"').replace("= 0.2", f"= {0.2 * of_1_mm:.5g}")
    for name in plays:
        renamed[f"{name}_{unit}"] = of_1_mm * columns[f"{name}_mm"]
        text = text.replace(f"{name}_mm", f"{name}_{unit}")
    write(folder / "run.csv", renamed)
    experiment.write_text(text, encoding="utf-8")
    (folder / "machine.toml").write_text(JOINT.replace("UNIT", unit), encoding="utf-8")
    return experiment


@pytest.mark.parametrize(
    ("unit", "of_1_mm", "plays", "dry"),
    [
        ("rad", 1e-3, {"load": 3.0, "motor": 0.0}, 0.5),
        ("deg", 0.18 / np.pi, {"motor": 0.0, "load": 4.0}, 0.0),
        ("deg", 0.18 / np.pi, {"motor": 0.0, "load": 0.0}, 0.0),
    ],
)
def test_a_joint_has_its_play_before_the_encoder_at_the_load(tmp_path, unit, of_1_mm, plays, dry):
    verdict = open_experiment(joint(tmp_path, unit, of_1_mm, plays, dry)).conclude().verdict
    found = {effect.name: effect.parameters for effect in verdict.effects}
    wanted = {"play before load"} if plays["load"] else set()
    assert found.keys() == wanted | ({"dry_friction"} if dry else set())
    assert verdict.verdict == ("named" if found else "none")
    for name in wanted:
        low, high = found[name]["w"].ci95
        assert low < plays["load"] * of_1_mm < high < low + 0.2 * of_1_mm


def test_the_repaired_file_predicts_an_unseen_run(tmp_path):
    (tmp_path / "unseen").mkdir()
    plays = {"motor": 0.0, "load": 4.0}
    drive(tmp_path, plays)
    drive(tmp_path / "unseen", plays, seed=7)
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--out", "repaired.toml")
    assert done.returncode == 0, done.stderr
    unseen = "unseen/experiment.toml"
    before = run_here(tmp_path, "compare", unseen)
    after = run_here(tmp_path, "compare", unseen, "--apply", "repaired.toml")
    assert (before.returncode, after.returncode) == (1, 0), after.stderr
