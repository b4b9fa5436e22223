"""The examples of measured machines, on small synthetic records of the same form."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def write(path: Path, columns: dict[str, np.ndarray]) -> None:
    with path.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines)
        writer.writerow(columns)
        writer.writerows(np.column_stack(list(columns.values())).tolist())


def sections(script: str, folder: Path) -> dict[str, list[str]]:
    """The lines that a script prints below each title, after `verdict: ...`."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / script), str(folder)],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: dict[str, list[str]] = {}
    for line in done.stdout.splitlines():
        if not line.startswith(" "):
            title, verdict = line.rsplit(": ", 1)
            found[title] = [verdict]
        else:
            found[title].append(line.strip())
    return found


def value(lines: list[str], name: str) -> float:
    """The value printed for `name`, which a section must have."""
    (line,) = (own for own in lines if own.startswith(name + " "))
    return float(line.removeprefix(name).split()[0])


def change(lines: list[str], start: str) -> tuple[float, float]:
    """Gap before and after of the line that begins with `start`."""
    line = next(own for own in lines if own.startswith(start))
    before, after = line.removeprefix(start).split(" -> ")[:2]
    return float(before), float(after.split()[0])


# -- servos ------------------------------------------------------------------------------


def servo_file(path: Path, servos: dict[str, int], play: float, seed: int) -> None:
    """Servos with `play` counts of backlash; the values of `servos` are the way they turn."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 30, 0.1)
    cycle = np.sin(2 * math.pi * t / 5.0)
    pull = 400 * np.sign(cycle) * np.maximum(np.abs(cycle) - 0.3, 0)
    strong = np.where(np.abs(pull) > 60, np.sign(pull), 0)
    side = strong[np.maximum.accumulate(np.where(strong != 0, np.arange(len(t)), 0))]
    rest = (2347, 1747) if "3250" in path.stem else (1747, 2347)
    columns = {"time_s": t}
    for servo, way in servos.items():
        position = 2047 + way * (0.01 * pull + play / 2 * side) + 0.5 * rng.standard_normal(len(t))
        columns[f"{servo}_target_count"] = np.where(t < 1, 1947, 2047)
        columns[f"{servo}_position_count"] = position.round()
    columns["pullA_position_count"] = rest[0] + np.maximum(pull, 0)
    columns["pullB_position_count"] = rest[1] + np.minimum(pull, 0)
    write(path, columns)


def test_servo_names_backlash_that_a_preload_takes_away(tmp_path: Path) -> None:
    pair = {"dut1": -1, "dut2": 1}
    servo_file(tmp_path / "single_sts3215.csv", {"dut": -1}, 7.0, 1)
    servo_file(tmp_path / "single_sts3250.csv", {"dut": 1}, 1.5, 2)
    servo_file(tmp_path / "coupled_sts3215_no_offset.csv", pair, 6.0, 3)
    servo_file(tmp_path / "coupled_sts3215_home_offset.csv", pair, 0.0, 4)
    servo_file(tmp_path / "coupled_sts3215_pgain_zero_deadband.csv", pair, 1.0, 5)
    found = sections("servo_backlash.py", tmp_path)
    assert value(found["single_sts3215 dut"], "backlash play") == pytest.approx(7.0, abs=0.3)
    for servo in pair:
        preloaded = found[f"coupled_sts3215_home_offset {servo}"]
        assert not [line for line in preloaded if line.startswith("backlash")]
    taken_away = found["backlash taken away in one of two pairs"]
    assert value(taken_away, "backlash play") == pytest.approx(6.0, abs=0.3)


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
    telescope_file(tmp_path / "astrophysics_run_a.csv", 383.0, 1600, 1)
    telescope_file(tmp_path / "losmandy_g11_gemini.csv", 239.0, 1200, 2)
    telescope_file(tmp_path / "astrophysics_run_b_long.csv", 383.0, 1600, 3)
    found = sections("telescope_worm.py", tmp_path)
    for name, period in (("astrophysics_run_a", 383.0), ("losmandy_g11_gemini", 239.0)):
        assert found[name][0] == "named"
        assert value(found[name], "worm P") == pytest.approx(period, rel=0.02)
        assert found[f"{name}, declination"][0] == "none"
        before, after = change(found[f"{name}, first 60 %"], "cross-test")
        assert after < before / 3
    before, after = change(found["astrophysics_run_b_long, bent drift, period of run a"], "gap ra")
    assert after < before / 3


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
    rng = np.random.default_rng(1)
    for name, length, angle in (("large_swing", 12.0, -1.0), ("small_swing", 6.0, -0.1)):
        t = np.arange(0, length, 0.01)
        measured = swing(t, angle, 0.02, 0.15) + 2e-4 * rng.standard_normal(len(t))
        columns = {"time_s": t, "angle_from_hanging_rad": measured}
        write(tmp_path / f"{name}.csv", columns)
    found = sections("pendulum_friction.py", tmp_path)
    for name in ("large swing, first two thirds", "small swing"):
        assert value(found[name], "dry friction Fc") == pytest.approx(0.15, abs=0.02)
    _, by_model = change(found["small swing by the base model of the large"], "gap encoder")
    _, by_verdict = change(found["small swing by the verdict of the large"], "gap encoder")
    assert by_verdict < by_model / 3


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
    t = 2.0 * np.arange(400)
    heater_file(tmp_path / "tclab_step_test.csv", np.full(400, 50.0), 1)
    sine = 50 + 50 * np.sin(2 * math.pi * t / 300)
    heater_file(tmp_path / "tclab_sine_test_5min_period.csv", sine, 2)
    found = sections("heater_coupling.py", tmp_path)["step"]
    assert value(found, "coupling k") == pytest.approx(0.0024, rel=0.05)
    assert value(found, "sensor lag tau") == pytest.approx(18.0, abs=2.0)
    before, after = change(found, "cross-test")
    assert after < before / 5
