"""machine, measure, thesis and limits, as processes."""

import json

from mopro.instruments import read_lvdt, read_thermocouple

MOVE = "UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 8.0\nWX1\nWT500\n"


def test_machine_show_tells_numbers_and_origins(mopro):
    done = mopro("machine", "show", "--json")
    assert done.returncode == 0
    shown = json.loads(done.stdout)
    assert shown["name"] == "chow1992"
    by_key = {row["key"]: row for row in shown["quantities"]}
    mass = by_key["axis.moving_mass"]
    assert (mass["value"], mass["unit"], mass["origin"]) == (2.543, "kg", "thesis")
    assert "eq. 3.40" in mopro("machine", "show").stdout


def test_machine_check_finds_by_line(mopro, tmp_path):
    from importlib import resources

    text = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()
    (tmp_path / "good.toml").write_text(text + "[effects.viscous_drag]\nb = 9.0\n")
    (tmp_path / "bad.toml").write_text(text + "[effects.viscous_darg]\nb = 9.0\n")
    assert mopro("machine", "check", "good.toml").returncode == 0
    bad = mopro("machine", "check", "good.toml", "bad.toml")
    assert bad.returncode == 1
    line = text.count("\n") + 1
    assert f"bad.toml:{line}:2: there is no effect viscous_darg [unknown-effect]" in bad.stderr
    assert "did you mean `viscous_drag`?" in bad.stderr
    assert mopro("machine", "check", "nowhere.toml").returncode == 2
    run = mopro("run", "P.CMD", "--emulate", "--machine", "bad.toml", text=MOVE)
    assert run.returncode == 2
    assert "Traceback" not in run.stderr


def test_a_machine_files_effect_runs(mopro, tmp_path):
    from importlib import resources

    text = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()
    (tmp_path / "lossy.toml").write_text(text + "[effects.lost_steps]\nn = 2\n")
    done = mopro("run", "P.CMD", "--emulate", "--machine", "lossy.toml", "--json", text=MOVE)
    assert done.returncode == 1
    assert json.loads(done.stdout)["moves"][0]["lost_pitches"] == 2


def test_measure_writes_what_can_be_read_back(mopro, tmp_path):
    done = mopro("measure", "P.CMD", "--out", "LVDT20.DAT", text=MOVE)
    assert (done.returncode, done.stdout) == (0, "960 readings: LVDT20.DAT\n")
    volts = read_lvdt(tmp_path / "LVDT20.DAT")
    assert abs(volts[-100:].mean() - volts[:20].mean() - 8.0) < 0.05
    hot = "UU012500/1\nVEL1 1.0\nACC1 1.0\nWT200000\n"
    command = ("measure", "P.CMD", "--instrument", "thermocouple", "--out", "TEST12.DAT")
    assert mopro(*command, text=hot).returncode == 0
    temperature, times = read_thermocouple(tmp_path / "TEST12.DAT")
    assert times[-1] == 195
    assert temperature[-1] > temperature[0] + 1


def test_measure_writes_csv(mopro, tmp_path):
    assert mopro("measure", "P.CMD", "--out", "m.csv", text=MOVE).returncode == 0
    lines = (tmp_path / "m.csv").read_text().splitlines()
    assert lines[0] == "time_s,position_1_in"
    assert len(lines) == 961


def test_thesis_prints_a_table(mopro):
    done = mopro("thesis", "3.2")
    assert done.returncode == 0
    assert "not reproducible" in done.stdout
    rows = json.loads(mopro("thesis", "4.1", "--json").stdout)
    assert {row["quantity"] for row in rows} >= {"displacement", "velocity"}
    assert mopro("thesis", "9.9").returncode == 2


def test_parabolic_ramps_start_with_more_acceleration_and_finish_sooner(mopro, tmp_path):
    """The source's conclusion, where the supply limits the force at speed."""
    from importlib import resources

    text = (resources.files("mopro.machine") / "machines" / "chow1992.toml").read_text()
    (tmp_path / "weak.toml").write_text(
        text.replace("supply = { value = 75.0", "supply = { value = 40.0")
    )
    options = ("--machine", "weak.toml", "--payload", "5lb", "--velocities", "60")
    done = mopro("limits", *options, "--json", "--plot", "limits.png")
    assert done.returncode == 0
    trapezoid, parabola = json.loads(done.stdout)
    assert parabola["acceleration"] > 1.3 * trapezoid["acceleration"] > 400
    assert parabola["duration_s"] < trapezoid["duration_s"]
    assert (tmp_path / "limits.png").stat().st_size > 1000
    assert mopro("limits", "--velocities", "x").returncode == 2


def test_a_trip_is_told_and_fails_the_run(mopro):
    done = mopro("run", "P.CMD", "--emulate", text=MOVE.replace("MRI1 8.0", "MRI1 60.0"))
    assert done.returncode == 1
    assert "Axis 1 ran into its limit switch" in done.stdout
    assert "--for" not in done.stderr
