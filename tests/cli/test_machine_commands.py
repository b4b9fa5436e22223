"""machine, measure, thesis and limits, as processes."""

import json
import re
import tomllib

import pytest

from helpers.commands import run_here
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


@pytest.mark.parametrize("extends", [[], ["--extends"]])
def test_a_new_machine_file_is_valid_and_bears_its_name(mopro, tmp_path, extends):
    done = mopro("machine", "new", "mine.toml", *extends)
    assert done.returncode == 0
    assert mopro("machine", "check", "mine.toml").stdout == "mine.toml: mine: no findings\n"
    nominal, mine = (
        json.loads(mopro("machine", "show", name, "--json").stdout)["quantities"]
        for name in ("chow1992", "mine.toml")
    )
    assert mine == nominal
    again = mopro("machine", "new", "mine.toml")
    assert again.returncode == 2
    assert "not overwritten" in again.stderr


@pytest.mark.parametrize("kind", ["kinematic", "axis", "thermal"])
def test_a_new_file_of_a_kind_is_toml_with_its_name(mopro, tmp_path, kind):
    assert mopro("machine", "new", "m y.toml", "--from", kind).returncode == 0
    machine = tomllib.loads((tmp_path / "m y.toml").read_text())
    assert (machine["kind"], machine["name"]) == (kind, "m y")
    assert mopro("machine", "check", "m y.toml").stdout == "m y.toml: m y: no findings\n"


def test_an_extending_file_states_only_what_differs(mopro, tmp_path):
    (tmp_path / "heavy.toml").write_text(
        'extends = "chow1992"\n[axis]\n'
        'moving_mass = { value = 6.0, unit = "lb", origin = "measured", place = "scales" }\n'
        "[effects.viscous_drag]\nb = 9.0\n"
    )
    shown = json.loads(mopro("machine", "show", "heavy.toml", "--json").stdout)
    by_key = {row["key"]: row for row in shown["quantities"]}
    assert shown["name"] == "heavy"
    assert by_key["axis.moving_mass"]["value"] == pytest.approx(2.7215542)
    assert by_key["axis.moving_mass"]["place"] == "scales"
    assert by_key["axis.pitch"]["place"] == "2.1, 4.1"
    assert by_key["effects.viscous_drag.b"]["value"] == 9.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('extends = "chow"\n', "bad.toml:1:1: expected extends: the name of a built-in machine"),
        ('extends = "chow1992"\naxis = 3\n', "bad.toml:2:1: expected a section [axis]"),
        ('extends = "chow1992"\n[axis]\nmass = 3\n', "bad.toml:3:1: unknown key mass"),
        (
            'extends = "chow1992"\n[heat]\nambient = { value = 20.0, unit = "F", '
            'origin = "measured" }\n',
            "bad.toml:3:27: ambient: 'F' is not a unit of temperature",
        ),
        (
            'extends = "chow1992"\n[axis]\npitch = { value = 0.04, unit = "um", '
            'origin = "measured" }\n',
            "bad.toml:2:2: pitch, pull_out_force and moving_mass give a natural frequency",
        ),
    ],
)
def test_faults_of_an_extending_file_have_its_places(mopro, tmp_path, text, said):
    (tmp_path / "bad.toml").write_text(text)
    done = mopro("machine", "check", "bad.toml")
    assert done.returncode in (1, 2)
    assert said in done.stderr


SENSOR = """machine = "chow1992"
[[sensor]]
{}
[[run]]
program = "P.CMD"
data = "data.csv"
"""
# Noise and rounding of each instrument, in its column's unit; an LVDT is not quite linear.
SIGMA = {"laser": 5e-4, "encoder": 5e-4, "lvdt": 0.025, "probe.toml": 2.0}
OWN = """name = "probe"
quantity = "position"
column = "position_1_um"
rate_hz = 500.0
noise_rms = 2.0
"""


@pytest.mark.parametrize(
    ("instrument", "sensor"),
    [
        ("laser", 'kind = "laser"'),
        ("encoder", 'kind = "encoder"'),
        ("lvdt", 'kind = "lvdt"'),
        ("probe.toml", OWN),
    ],
)
def test_compare_reads_what_measure_writes(mopro, tmp_path, instrument, sensor):
    """An LVDT's 960 readings end before the program: nothing is refused, nor found."""
    (tmp_path / "probe.toml").write_text(OWN)
    (tmp_path / "experiment.toml").write_text(SENSOR.format(sensor))
    strokes = "MRI1 2.0\nWX1\nWT400\nMRI1 -2.0\nWX1\nWT300\n" * 2
    moves = "UU012500/1\nVEL1 15.0\nACC1 0.2\n" + strokes
    done = mopro("measure", "P.CMD", "--instrument", instrument, "--out", "data.csv", text=moves)
    assert done.returncode == 0
    compared = mopro("compare", "experiment.toml", "--json")
    assert compared.returncode in (0, 1), compared.stderr
    (series,) = json.loads(compared.stdout)["series"]
    assert series["rms"] < 1.15 * SIGMA[instrument]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--instrument", "radar"], "no instrument has this name"),
        (["--instrument", "laser", "--out", "a.DAT"], "only lvdt and thermocouple write .DAT"),
        (["--instrument", "bad.toml"], "bad.toml:1:1: the sensor has no rate_hz"),
        (["--instrument", "bad.toml", "--out", "bad.toml"], "must end in one of .dat, .csv"),
    ],
)
def test_instruments_that_cannot_measure_are_refused(mopro, tmp_path, arguments, said):
    (tmp_path / "bad.toml").write_text(OWN.replace("rate_hz = 500.0\n", ""))
    done = mopro("measure", "P.CMD", "--out", "a.csv", *arguments, text=MOVE)
    assert done.returncode == 2
    assert said in done.stderr


def test_the_commands_of_a_first_folder_run(mopro, tmp_path):
    assert mopro("init", "first").returncode == 0
    folder = tmp_path / "first"
    blocks = re.findall(r"```sh\n(.*?)```", (folder / "README.md").read_text(), re.DOTALL)
    commands = [line for block in blocks for line in block.splitlines()]
    codes = [run_here(folder, *line.split()[1:]).returncode for line in commands]
    assert codes == [0, 0, 1, 0, 0]
    repaired = (folder / "repaired.toml").read_text()
    assert 'name = "chow1992-repaired"' in repaired
    assert "[effects.viscous_drag]" in repaired
    again = mopro("init", "first")
    assert again.returncode == 2
    assert "nothing is overwritten" in again.stderr
