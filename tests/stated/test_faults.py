"""Faults of files of machines beside the motor: each told in words, at its place."""

import math

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, DRIVEN, FRICTION_OF_PLACE, drive_folder, driven, write
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment
from mopro.experiment.stated.system import Stated
from mopro.stated.candidates import candidates
from mopro.stated.simulation import BASE

EFFECT = FRICTION_OF_PLACE


@pytest.fixture(scope="module")
def record():
    return driven(3.0)


def told(folder, record, machine=DRIVE, experiment=DRIVEN, *options):
    """The stderr of `mopro compare` for files that it refuses."""
    (folder / "machine.toml").write_text(machine, encoding="utf-8")
    (folder / "experiment.toml").write_text(experiment, encoding="utf-8")
    write(folder / "run.csv", record)
    done = run_here(folder, "compare", "experiment.toml", *options)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("F1 * abs(x)", "F1 * abs(x", "machine.toml:13:20: no formula"),
        ("F1 * abs(x)", "F1 * exec(x)", "machine.toml:13:17: exec is no function"),
        ("F1 * abs(x)", "F1 * abs(y2)", "machine.toml:13:21: unknown name y2"),
        ("F1 * abs(x)", "F1 * abs(v)", "[wrong-unit]"),
        ("F1 * abs(x)", "F1 * (x + t)", "machine.toml:13:22: units do not match: m and s"),
        ("F1 * abs(x)", "F1 * lag(x, t)", "whole signals"),
        ("F1 * abs(x)", "F1 * x.real", "a dot is not of the language"),
        ("N/m", "furlong", "'furlong' in 'furlong' is no unit"),
        ('friction"', 'frixion"', "expected enters: one of force, friction"),
        ("F1 =", "x =", "has a meaning in formulas already"),
        ('{ unit = "N/m" }', "3", "expected F1 ="),
        ("formula =", "formulae =", "has no formula"),
        ('kind = "axis"', 'kind = "axes"', "expected kind: one of"),
        ("mass = {", "mess = {", "expected a mass or an inertia"),
        ("range = [0, 30]", "range = [5, 30]", "viscous is outside of its range"),
        ("range = [0, 30]", "range = 3", "[lowest, highest]"),
        ("tolerance = 0.05", "tolerance = 5", "a share"),
        ('unit = "mm"', 'unit = "kg"', "a unit of a length"),
        ('unit = "kg"', 'unit = "m"', "machine.toml:6:1: mass is in m"),
        ('{ unit = "N/m" }', '{ unit = ["{force}", "1/m"] }', "a unit or a list of units"),
        ('{ unit = "N/m" }', "{ unit = [3] }", "a unit or a list of units"),
        ('{ unit = "N/m" }', '{ unit = ["{"] }', "a unit or a list of units"),
    ],
)
def test_faults_of_a_machine_file(tmp_path, record, old, new, words):
    machine = DRIVE + EFFECT
    assert old in machine
    assert words in told(tmp_path, record, machine.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('column = "force_N", hold', 'column = "forse_N", hold', "did you mean force_N"),
        ('column = "force_N", hold', 'formula = "forse_N + 1", unit = "N", hold', "unknown name"),
        ('column = "force_N", hold', 'formula = "force_N +", unit = "N", hold', "no formula"),
        ('"position_mm"', '"position"', "state unit"),
        ('"position"\n', '"mass"\n', "expected quantity: one of"),
        ("noise_rms = 0.2", "noise_rms = 0", "a sensor has noise"),
        ("noise_rms = 0.2", 'noise_rms = "some"', "expected noise_rms"),
        ("noise_rms = 0.2", "noise_rms = 0.2\nscale = 0", "a scale of 0"),
        ('data = "run.csv"', 'data = "ran.csv"', "there is no file"),
        ("start = { x = 0, v = 0 }", "start = { z = 0 }", "unknown key z"),
        ("start = { x = 0, v = 0 }", "part = [0.5, 0.2]", "shares of the time"),
        ("start = { x = 0, v = 0 }", 'use = "time_s > 99"', "no row of run.csv is used"),
        ("start = { x = 0, v = 0 }", 'program = "run.csv"', "goes where it is told"),
        ("force = {", "x = {", "has a meaning in formulas already"),
        ("[inputs]", 'time = "force_N"\n[inputs]', "expected a unit of time"),
        ("[inputs]", 'time = { column = "position_mm", unit = "s" }\n[inputs]', "does not go on"),
    ],
)
def test_faults_of_an_experiment_file(tmp_path, record, old, new, words):
    assert old in DRIVEN
    assert words in told(tmp_path, record, experiment=DRIVEN.replace(old, new))


def test_a_law_that_divides_by_zero_is_told(tmp_path, record):
    machine = DRIVE.replace("\n[base]", '\nacceleration = "1 / (spring - spring) * x"\n[base]')
    machine = machine.replace("[base]", '[base]\nk = { value = 1, unit = "1/s2" }')
    said = told(tmp_path, record, machine.replace("spring) * x", "spring) * x * spring * k"))
    assert "no finite number" in said


def test_a_law_that_runs_away_is_told(tmp_path, record):
    machine = DRIVE.replace("\n[base]", '\nacceleration = "k * x**3 + 1e3 * k * m"\n[base]')
    machine += 'k = { value = 1e9, unit = "1/s2" }\nm = { value = 1, unit = "m" }\n'
    said = told(tmp_path, record, machine.replace("k * x**3", "k * x**3 / m**2"))
    assert "runs away" in said


OVEN = """\
kind = "thermal"
name = "oven"
[nodes]
block = "a * duty - U * (T - ambient)"
[base]
a = { value = 0.3, unit = "K/s", free = true, range = [0, 5000] }
U = { value = 0.003, unit = "1/s", free = true, range = [0, 5000] }
"""
BLOCK = """\
machine = "machine.toml"
[inputs]
duty = { column = "duty_percent", hold = true }
[[sensor]]
name = "block"
quantity = "temperature"
column = "block_C"
noise_rms = 0.1
zero = 0
[[run]]
data = "run.csv"
"""


def oven_folder(folder, machine=OVEN):
    """An oven with a time constant of 165 s and a gain of 100 K, in closed form."""
    t = np.arange(0.0, 802.0, 2.0)
    duty = np.where(t < 400, 50.0, 10.0)
    at_400 = 50 * (1 - np.exp(-400 / 165))
    heated = 50 * (1 - np.exp(-t / 165))
    cooled = 10 + (at_400 - 10) * np.exp(-(t - 400) / 165)
    rise = np.where(t < 400, heated, cooled)
    (folder / "machine.toml").write_text(machine, encoding="utf-8")
    (folder / "experiment.toml").write_text(BLOCK, encoding="utf-8")
    write(folder / "run.csv", {"time_s": t, "duty_percent": duty, "block_C": 21 + rise})
    return folder / "experiment.toml"


def test_numbers_are_fitted_from_where_they_are_stated_however_wide_their_range(tmp_path):
    verdict = open_experiment(oven_folder(tmp_path)).conclude(1, lambda _: None, ()).verdict
    assert verdict.verdict == "none"
    assert verdict.base["U"].value == pytest.approx(1 / 165, rel=1e-3)
    assert verdict.base["a"].value == pytest.approx(100 / 165, rel=1e-3)


def test_terms_of_a_model_that_runs_away_with_its_numbers_are_refused_at_the_run(tmp_path):
    """Its loss has the wrong sign, so that what radiates is soon no number."""
    oven = OVEN.replace("- U", "+ U").replace("5000", "50")
    opened = open_experiment(oven_folder(tmp_path, oven))
    system = opened.system
    assert isinstance(system, Stated)
    numbers = {**system.base.settings[BASE], "U": 0.1}
    with pytest.raises(ModelError) as told:
        candidates(system.model, system.series, {BASE: numbers})
    assert "experiment.toml:10:" in str(told.value)
    assert all(words in str(told.value) for words in ("runs away", "U = 0.1 1/s"))


def test_a_term_that_divides_by_zero_is_told_at_its_formula(tmp_path):
    machine = DRIVE + EFFECT.replace("abs(x)", "x / (t / (t + t) - 1 / 2)").replace("F1", "F9")
    drive_folder(tmp_path, machine)
    done = run_here(tmp_path, "reconcile", "experiment.toml")
    assert done.returncode == 2
    assert "machine.toml:13:1: the formula gives no finite number at 0 s of run" in done.stderr


def test_columns_of_text_and_empty_ones_are_told_with_line_and_column(tmp_path, record):
    told(tmp_path, record, DRIVE.replace("axis", "axes"))
    lines = (tmp_path / "run.csv").read_text("utf-8").splitlines()
    lines[3] = lines[3].rsplit(",", 1)[0] + ",fast"
    (tmp_path / "machine.toml").write_text(DRIVE, encoding="utf-8")
    (tmp_path / "run.csv").write_text("\n".join(lines), encoding="utf-8")
    assert "'fast' is no number" in run_here(tmp_path, "compare", "experiment.toml").stderr
    empty = [lines[0], *(line.rsplit(",", 1)[0] + "," for line in lines[1:])]
    (tmp_path / "run.csv").write_text("\n".join(empty), encoding="utf-8")
    said = run_here(tmp_path, "compare", "experiment.toml").stderr
    assert "position_mm has 0 samples" in said


@pytest.mark.parametrize(
    ("noise", "step", "values", "words"),
    [
        ("0.2", "", 3.0, "position_mm is 3 in all rows: it tells nothing"),
        ("1e-300", "", None, "position_mm is stated as 1e-300, and its numbers are rounded to"),
        ("1e300", "", None, "the noise of position_mm is stated as 1e+300, and 1e+70 is the most"),
        ("0.2", "", 1e150, "'1e+150' is no number that can be measured"),
        ("0.2", "adc_step = 5.0\n", 3.0, None),
    ],
)
def test_readings_that_no_sensor_of_the_stated_noise_gives_are_refused(
    tmp_path, record, noise, step, values, words
):
    experiment = DRIVEN.replace("noise_rms = 0.2\n", f"noise_rms = {noise}\n{step}")
    if values is not None:
        record = {**record, "position_mm": np.full(len(record["position_mm"]), values)}
    if words is None:
        (tmp_path / "machine.toml").write_text(DRIVE, encoding="utf-8")
        (tmp_path / "experiment.toml").write_text(experiment, encoding="utf-8")
        write(tmp_path / "run.csv", record)
        assert open_experiment(tmp_path / "experiment.toml")
    else:
        assert words in told(tmp_path, record, DRIVE, experiment)


# -- scales ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (10.0, "10 times too large (a factor of 10)"),
        (0.2, "5 times too small (a factor of 1/5)"),
        (6.0, "6 times too large (a factor of 6, such as deg/s for rpm)"),
        (1 / 6, "6 times too small (a factor of 1/6, such as rpm for deg/s)"),
        (-1.0, "of the other sign"),
    ],
)
def test_readings_of_another_scale_or_sign_are_told(tmp_path, record, factor, words):
    scaled = record | {"position_mm": factor * record["position_mm"]}
    (tmp_path / "machine.toml").write_text(DRIVE, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(DRIVEN, encoding="utf-8")
    write(tmp_path / "run.csv", scaled)
    said = run_here(tmp_path, "compare", "experiment.toml").stderr
    assert words in said


def test_a_free_scale_and_sign_are_calibrated(tmp_path, record):
    scaled = record | {"position_mm": -3.0 * record["position_mm"]}
    (tmp_path / "machine.toml").write_text(
        DRIVE.replace("free = true", "free = false"), encoding="utf-8"
    )
    text = DRIVEN.replace("noise_rms", 'scale = "free"\nsign = "free"\nnoise_rms')
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    machine = (tmp_path / "machine.toml").read_text("utf-8")
    machine = machine.replace('value = 2.0, unit = "N s', 'value = 3.0, unit = "N s')
    (tmp_path / "machine.toml").write_text(machine.replace("value = 50", "value = 40"))
    write(tmp_path / "run.csv", scaled)
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--only", "mass")
    assert "Fitted: scale of scale = " in done.stdout


def test_a_swing_in_degrees_that_is_taken_for_radians_is_refused(tmp_path):
    t = 0.02 * np.arange(300)
    x, v, angles = math.radians(60.0), 0.0, []
    for _ in t:
        angles.append(x)
        for _ in range(20):
            v -= 1e-3 * (25.0 * np.sin(x) + 0.05 * v)
            x += 1e-3 * v
    write(tmp_path / "run.csv", {"time_s": t, "angle_rad": np.degrees(angles)})
    (tmp_path / "machine.toml").write_text(
        'kind = "axis"\nname = "pendulum"\nunit = "rad"\nacceleration = "-w2 * sin(x) - b * v"\n'
        '[base]\nw2 = { value = 24, unit = "1/s2", free = true, range = [10, 50] }\n'
        'b = { value = 0.05, unit = "1/s", free = true, range = [0, 1] }\n'
    )
    (tmp_path / "experiment.toml").write_text(
        'machine = "machine.toml"\n[[sensor]]\nname = "encoder"\nquantity = "angle"\n'
        'column = "angle_rad"\nnoise_rms = "unknown"\n[[run]]\ndata = "run.csv"\n'
    )
    done = run_here(tmp_path, "compare", "experiment.toml")
    assert done.returncode == 2
    assert "degrees are taken for radians" in done.stderr


HELD = """\
machine = "kinematic"

[inputs]
command = { column = "target_count" }

[[sensor]]
name = "servo"
quantity = "position"
column = "actual_count"
noise_rms = 2.0

[[run]]
data = "run.csv"
"""


@pytest.mark.parametrize(
    ("factor", "words"), [(10.0, "a factor of 10"), (0.2, "a factor of 1/5"), (-1.0, "other sign")]
)
def test_a_level_that_is_a_multiple_of_the_command_is_told(tmp_path, factor, words):
    """A servo that holds its place: nothing moves that could show its scale."""
    rng = np.random.default_rng(1)
    there = 2047 + 2 * rng.standard_normal(200)
    columns = {"time_s": np.arange(200) / 10, "target_count": np.full(200, 2047.0)}
    (tmp_path / "experiment.toml").write_text(HELD, encoding="utf-8")
    write(tmp_path / "run.csv", {**columns, "actual_count": there})
    assert not open_experiment(tmp_path / "experiment.toml").notes
    write(tmp_path / "run.csv", {**columns, "actual_count": factor * there})
    (note,) = open_experiment(tmp_path / "experiment.toml").notes
    assert "where the command is at 2047" in note
    assert words in note


ROOM = """\
machine = "thermal"

[inputs]
power = { column = "power_W", unit = "W" }

[[sensor]]
name = "one"
quantity = "temperature"
column = "one_C"
noise_rms = 0.1
zero = 0

[[sensor]]
name = "two"
quantity = "temperature"
column = "two_C"
noise_rms = 0.1
zero = 0

[[run]]
data = "run.csv"
"""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t, ""),
        (lambda t: 1.8 * t + 32, "is it in Fahrenheit?"),
        (lambda t: 10 * t, "a factor of 10"),
        (lambda t: 0.2 * t, "a factor of 1/5"),
    ],
    ids=["sound", "Fahrenheit", "ten", "a fifth"],
)
def test_a_node_that_begins_elsewhere_than_the_room_is_told(tmp_path, change, words):
    t = np.arange(0.0, 300.0, 2.0)
    warm = 21.0 + 20.0 * -np.expm1(-t / 100)
    noise = 0.1 * np.random.default_rng(1).standard_normal((2, len(t)))
    columns = {"time_s": t, "power_W": np.full_like(t, 4.0)}
    columns |= {"one_C": change(warm + noise[0]), "two_C": 21.0 + noise[1]}
    (tmp_path / "experiment.toml").write_text(ROOM, encoding="utf-8")
    write(tmp_path / "run.csv", columns)
    notes = [n for n in open_experiment(tmp_path / "experiment.toml").notes if "begin" in n]
    assert [note.partition(":")[0] for note in notes] == (["one"] if words else [])
    assert all(words in note for note in notes)


def test_a_swing_of_another_scale_is_refused_with_the_factor(tmp_path):
    """A pendulum whose frequency shows how far it swings."""
    factor = 0.1
    step, x, v, places = 0.01, 1.5, 0.0, []
    for n in range(3200):
        if n % 4 == 0:
            places.append(x)
        v += step / 4 * (-64.0 * math.sin(x) - 0.05 * v)
        x += step / 4 * v
    measured = factor * np.array(places)
    law = 'acceleration = "-w2 * sin(x) - b * v"\n'
    numbers = 'w2 = { value = 64, unit = "1/s2", free = true, range = [55, 75] }\n'
    numbers += 'b = { value = 0.05, unit = "1/s", free = true, range = [0, 1] }\n'
    text = f'kind = "axis"\nname = "swing"\nunit = "rad"\n{law}[base]\n{numbers}'
    (tmp_path / "machine.toml").write_text(text, encoding="utf-8")
    sensor = '[[sensor]]\nname = "s"\nquantity = "angle"\ncolumn = "x_rad"\nnoise_rms = 0.001\n'
    asked = f'machine = "machine.toml"\n{sensor}[[run]]\ndata = "run.csv"\n'
    (tmp_path / "experiment.toml").write_text(asked, encoding="utf-8")
    write(tmp_path / "run.csv", {"time_s": step * np.arange(len(places)), "x_rad": measured})
    words = f"{factor:g} times too large" if factor > 1 else f"{1 / factor:g} times too small"
    with pytest.raises(ModelError, match=f"if they are {words}"):
        open_experiment(tmp_path / "experiment.toml")
