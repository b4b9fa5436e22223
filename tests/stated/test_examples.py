"""The examples' files of measured machines, on small synthetic records of the same form."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.paths import ROOT
from helpers.stated import write

EXAMPLES = ROOT / "examples"
MOST_LINES = 25


def reconciled(folder: Path, name: str, *options: str) -> dict:
    """The answer of `mopro reconcile NAME.toml --json`, which writes NAME.repaired.toml."""
    out = ("--out", f"{name}.repaired.toml", "--jobs", "1")
    done = run_here(folder, "reconcile", f"{name}.toml", "--json", *out, *options)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


def value(answer: dict, effect: str, parameter: str) -> float:
    (found,) = (e for e in answer["effects"] if e["name"] == effect)
    return float(found["parameters"][parameter]["value"])


def names(answer: dict) -> set[str]:
    return {effect["name"] for effect in answer["effects"]}


def applied(folder: Path, unseen: str, machine: str) -> list[dict]:
    done = run_here(folder, "compare", f"{unseen}.toml", "--apply", f"{machine}.toml", "--json")
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)["applied"]


def example(tmp_path: Path, name: str) -> Path:
    return Path(shutil.copytree(EXAMPLES / name, tmp_path / name))


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*/*.toml")), ids=lambda f: f.parent.name)
def test_an_example_is_short(file: Path) -> None:
    assert len(file.read_text("utf-8").splitlines()) <= MOST_LINES


# -- servos ------------------------------------------------------------------------------


def servo_file(
    path: Path, servos: dict[str, int], play: float, seed: int, turned_at: float = 60
) -> None:
    """Servos with `play` counts of backlash; the values of `servos` are the way they turn.

    The play turns over at a pull of `turned_at` counts.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0, 40, 0.1)
    cycle = np.sin(2 * math.pi * t / 5.0)
    pull = 400 * np.sign(cycle) * np.maximum(np.abs(cycle) - 0.3, 0)
    strong = np.where(np.abs(pull) > turned_at, np.sign(pull), 0)
    side = strong[np.maximum.accumulate(np.where(strong != 0, np.arange(len(t)), 0))]
    columns = {"time_s": t}
    for servo, way in servos.items():
        position = 2047 + way * (0.01 * pull + play / 2 * side) + 0.5 * rng.standard_normal(len(t))
        columns[f"{servo}_target_count"] = np.where(t < 1, 1947, 2047)
        columns[f"{servo}_position_count"] = position.round()
    columns["pullA_position_count"] = 1747 + np.maximum(pull, 0)
    columns["pullB_position_count"] = 2347 + np.minimum(pull, 0)
    write(path, columns)


def test_servo_names_backlash_that_a_preload_takes_away(tmp_path: Path) -> None:
    folder = example(tmp_path, "servo")
    servo_file(folder / "single_sts3215.csv", {"dut": -1}, 7.0, 1)
    servo_file(folder / "coupled_sts3215_no_offset.csv", {"dut1": -1}, 6.0, 3)
    servo_file(folder / "coupled_sts3215_home_offset.csv", {"dut1": -1}, 0.0, 4)
    found = reconciled(folder, "experiment")
    assert value(found, "backlash_under_load", "w") == pytest.approx(7.0, abs=0.5)
    (gap,) = applied(folder, "unseen", "experiment.repaired")
    assert gap["after_rms"] < gap["before_rms"] / 3
    assert not {n for n in names(reconciled(folder, "preloaded")) if "backlash" in n}
    pair = reconciled(folder, "pair")
    assert value(pair, "backlash_under_load", "w") == pytest.approx(6.0, abs=0.5)


def test_the_pull_that_turns_the_play_over_is_found(tmp_path: Path) -> None:
    """At a third of the largest pull: a tenth is assumed otherwise, and told two false effects."""
    folder = example(tmp_path, "servo")
    servo_file(folder / "single_sts3215.csv", {"dut": -1}, 7.0, 1, turned_at=93)
    found = reconciled(folder, "experiment")
    assert found["verdict"] in ("named", "ambiguous")
    assert value(found, "backlash_under_load", "w") == pytest.approx(7.0, abs=0.5)
    assert value(found, "backlash_under_load", "share") == pytest.approx(93 / 280, abs=0.1)
    assert not names(found) - {"backlash_under_load", "compliance", "friction_under_load"}


# -- telescopes --------------------------------------------------------------------------


def telescope_file(path: Path, period: float, length: float, seed: int) -> None:
    """A guided run of a mount whose worm errs by 3.8 arcsec; its declination only drifts."""
    rng = np.random.default_rng(seed)
    t = np.arange(4.0, length, 4.0)
    worm = 3.8 * np.sin(2 * math.pi * t / period + 0.5)
    columns = {"time_s": t}
    for axis, error in (("ra", worm + 0.01 * t), ("dec", -0.02 * t)):
        error = error + 0.3 * rng.standard_normal(len(t))
        left, sent, corrected = np.zeros(len(t)), np.zeros(len(t)), 0.0
        for i in range(len(t)):
            left[i] = error[i] - corrected
            sent[i] = 0.6 * left[i]
            corrected += sent[i]
        columns |= {f"{axis}_residual_arcsec": left, f"{axis}_correction_arcsec": sent}
    write(path, columns)


def test_telescope_names_the_worm_behind_the_corrections(tmp_path: Path) -> None:
    folder = example(tmp_path, "telescope")
    telescope_file(folder / "astrophysics_run_a.csv", 383.0, 2200, 1)
    found = reconciled(folder, "experiment")
    assert found["verdict"] == "named"
    assert value(found, "periodic_in_time", "P") == pytest.approx(383.0, rel=0.02)
    (gap,) = applied(folder, "unseen", "experiment.repaired")
    assert gap["after_rms"] < gap["before_rms"] / 3
    assert reconciled(folder, "declination")["verdict"] == "none"
    wrong = reconciled(folder, "wrong", "--only", "worm of 479 s")
    assert names(wrong) == set() or wrong["verdict"] == "unexplained"


# -- pendulum ----------------------------------------------------------------------------


def swing(t: np.ndarray, angle: float, viscous: float, dry: float) -> np.ndarray:
    """Angles of a pendulum with viscous and dry friction, in steps of 1 ms."""
    speed, angles, now = 0.0, [], 0.0
    for at in t.tolist():
        while now < at - 5e-4:
            speed -= 1e-3 * (64.0 * math.sin(angle) + viscous * speed)
            speed = math.copysign(max(abs(speed) - 1e-3 * dry, 0.0), speed)
            angle += 1e-3 * speed
            now += 1e-3
        angles.append(angle)
    return np.array(angles)


def test_pendulum_names_dry_friction_beside_viscous_damping(tmp_path: Path) -> None:
    folder = example(tmp_path, "pendulum")
    rng = np.random.default_rng(1)
    for name, length, angle in (("large_swing_55s_100Hz", 18.0, -1.0),
                                ("small_swing_until_rest_23s_200Hz", 6.0, -0.1)):  # fmt: skip
        t = np.arange(0, length, 0.02)
        measured = swing(t, angle, 0.02, 0.15) + 1e-3 * rng.standard_normal(len(t))
        write(folder / f"{name}.csv", {"time_s": t, "angle_from_hanging_rad": measured})
    found = reconciled(folder, "experiment")
    assert value(found, "dry_friction", "Fc") == pytest.approx(0.15, abs=0.02)
    for unseen in ("unseen", "rest"):
        (gap,) = applied(folder, unseen, "experiment.repaired")
        assert gap["after_rms"] < gap["before_rms"] / 2


# -- heaters -----------------------------------------------------------------------------


def heater_file(path: Path, duty: np.ndarray, seed: int) -> None:
    """Two blocks that exchange heat, each with a sensor that lags by 18 s."""
    rng = np.random.default_rng(seed)
    blocks, sensors = np.zeros(2), np.zeros(2)
    readings = []
    for power in duty.tolist():
        readings.append(sensors.copy())
        exchanged = 0.0024 * (blocks[::-1] - blocks)
        blocks = blocks + 2.0 * (np.array([0.006 * power, 0.0]) - 0.006 * blocks + exchanged)
        sensors = sensors + (1 - math.exp(-2.0 / 18.0)) * (blocks - sensors)
    one, two = (np.array(readings) + 22.0 + 0.05 * rng.standard_normal((len(duty), 2))).T
    columns = {"time_s": 2.0 * np.arange(len(duty)), "heater1_command_percent": duty}
    write(path, columns | {"sensor1_temperature_C": one, "sensor2_temperature_C": two})


def test_heater_names_coupling_and_lag_and_predicts_another_excitation(tmp_path: Path) -> None:
    folder = example(tmp_path, "heater")
    t = 2.0 * np.arange(400)
    heater_file(folder / "tclab_step_test.csv", np.full(400, 50.0), 1)
    sine = 50 + 50 * np.sin(2 * math.pi * t / 300)
    heater_file(folder / "tclab_sine_test_5min_period.csv", sine, 2)
    found = reconciled(folder, "experiment")
    assert value(found, "coupling", "k") == pytest.approx(0.0024, rel=0.1)
    assert value(found, "sensor_lag", "tau") == pytest.approx(18.0, abs=3.0)
    for gap in applied(folder, "unseen", "experiment.repaired"):
        assert gap["after_rms"] < gap["before_rms"] / 5
    text = (folder / "experiment.repaired.toml").read_text("utf-8")
    assert "free" not in text.replace("free_", "")
    assert "[effects.coupling]" in text
    assert "95 %:" in text


# -- in Python ---------------------------------------------------------------------------


def test_the_example_in_python_names_the_backlash(tmp_path: Path) -> None:
    servo_file(tmp_path / "single_sts3215.csv", {"dut": -1}, 7.0, 1)
    servo_file(tmp_path / "coupled_sts3215_no_offset.csv", {"dut1": -1, "dut2": 1}, 6.0, 3)
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "servo_backlash.py"), str(tmp_path)],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (line,) = (line.split() for line in done.stdout.splitlines() if "backlash play" in line)
    assert float(line[2]) == pytest.approx(7.0, abs=0.3)
