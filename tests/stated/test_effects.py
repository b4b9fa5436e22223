"""A user's effect: found where it is hidden, absent where it is not; files that are repaired."""

import json
import tomllib

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, DRIVEN, FRICTION_OF_PLACE, drive_folder, write
from mopro.experiment.opened import open_experiment

HIDDEN_N_M = 12.0


def reconciled(folder, *options):
    drive_folder(folder, DRIVE + FRICTION_OF_PLACE, **dict(options))
    done = run_here(folder, "reconcile", "experiment.toml", "--json", "--out", "out.toml")
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("seed", [1, 2])
def test_friction_of_place_is_found(tmp_path, seed):
    answer = reconciled(tmp_path, ("of_place", HIDDEN_N_M), ("seed", seed))
    (effect,) = answer["effects"]
    assert effect["name"] == "friction of place"
    assert effect["parameters"]["F1"]["value"] == pytest.approx(HIDDEN_N_M, rel=0.1)
    repaired = tomllib.loads((tmp_path / "out.toml").read_text("utf-8"))
    assert repaired["effects"]["friction of place"]["F1"]["unit"] == "N/m"
    assert repaired["base"]["viscous"].keys() == {"value", "unit", "before"}
    assert answer["gap"]["runs"][0]["rerun_rms"] == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize("hidden", [{}, {"dry": 0.4}])
def test_friction_of_place_is_absent_where_it_is_not(tmp_path, hidden):
    answer = reconciled(tmp_path, *hidden.items(), ("seed", 3))
    named = {effect["name"] for effect in answer["effects"]}
    assert named == ({"dry_friction"} if hidden else set())


def test_a_repaired_file_is_read_compared_and_finds_no_more(tmp_path):
    reconciled(tmp_path, ("of_place", HIDDEN_N_M))
    assert "no findings" in run_here(tmp_path, "machine", "check", "out.toml").stdout
    assert "friction of place" in run_here(tmp_path, "machine", "show", "out.toml").stdout
    done = run_here(tmp_path, "compare", "experiment.toml", "--apply", "out.toml", "--json")
    (gap,) = json.loads(done.stdout)["applied"]
    assert gap["after_rms"] < 0.25 < gap["before_rms"]
    text = DRIVEN.replace("machine.toml", "out.toml")
    (tmp_path / "again.toml").write_text(text, encoding="utf-8")
    again = run_here(tmp_path, "reconcile", "again.toml", "--json", "--report", "page.html")
    assert json.loads(again.stdout)["verdict"] == "none"
    assert "friction of place" in (tmp_path / "page.html").read_text("utf-8")


def test_a_number_that_is_named_is_in_the_repaired_file(tmp_path):
    """A mass that is 15 % off, where 5 % are tolerated, is no calibration."""
    drive_folder(tmp_path, DRIVE, mass=2.3)
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--json", "--out", "out.toml")
    answer = json.loads(done.stdout)
    (named,) = answer["effects"]
    assert "mass" in {named["name"], *named["indistinguishable_from"]}
    assert answer["gap"]["runs"][0]["rerun_rms"] == pytest.approx(0.2, rel=0.1)
    numbers = tomllib.loads((tmp_path / "out.toml").read_text("utf-8"))["base"]
    assert numbers["mass"]["value"] == pytest.approx(2.3, rel=0.02)


@pytest.mark.parametrize("seed", [2, 3])
def test_a_mass_that_is_off_within_its_tolerance_is_not_told_as_a_gain(tmp_path, seed):
    """It shifts a sharp resonance, and its signature tells little of what it explains."""
    machine = DRIVE.replace(
        '2.0, unit = "kg", tolerance = 0.05', '0.78, unit = "kg", tolerance = 0.08'
    )
    machine = machine.replace('2.0, unit = "N s/m"', '0.4, unit = "N s/m"').replace("50", "28")
    drive_folder(tmp_path, machine, mass=0.765, viscous=0.5, spring=32.0, length_s=16.0, seed=seed)
    answer = json.loads(run_here(tmp_path, "reconcile", "experiment.toml", "--json").stdout)
    assert answer["effects"] == []
    assert [number["name"] for number in answer["calibration"]] == ["mass"]
    assert answer["calibration"][0]["parameters"]["mass"]["value"] == pytest.approx(0.765, rel=2e-3)


def test_an_effect_is_left_out_by_its_name(tmp_path):
    drive_folder(tmp_path, DRIVE + FRICTION_OF_PLACE, length_s=2.0)
    wrong = run_here(tmp_path, "reconcile", "experiment.toml", "--only", "friction of plaice")
    assert wrong.returncode == 2
    assert "did you mean `friction of place`?" in wrong.stderr
    options = ("--only", "friction of place", "--json")
    answer = json.loads(run_here(tmp_path, "reconcile", "experiment.toml", *options).stdout)
    assert "dry_friction" in answer["left_out"]


MODEL = """\
def simulate(numbers, columns):
    x = columns["force_N"] / numbers["k"]
    return {"scale": 1e3 * (x + numbers["k3"] * x**3)}
"""
FOREIGN = """\
kind = "python"
name = "spring"
python = "model.py:simulate"

[base]
k = { value = 100.0, unit = "N/m", free = true, range = [10, 1000] }

[[effect]]
name = "hardening"
k3 = { unit = "1/m2", range = [-50, 50] }
"""


def foreign_folder(folder):
    experiment = DRIVEN.replace("start = { x = 0, v = 0 }\n", "")
    drive_folder(folder, FOREIGN, experiment, length_s=2.0)
    (folder / "model.py").write_text(MODEL, encoding="utf-8")


def test_a_model_that_is_a_program_is_run_only_if_it_is_allowed(tmp_path):
    foreign_folder(tmp_path)
    (tmp_path / "model.py").write_text("open('ran', 'w').close()\n" + MODEL, encoding="utf-8")
    refused = run_here(tmp_path, "reconcile", "experiment.toml")
    assert refused.returncode == 2
    assert "--allow-python" in refused.stderr
    assert not (tmp_path / "ran").exists()
    allowed = run_here(tmp_path, "reconcile", "experiment.toml", "--allow-python", "--json")
    assert allowed.returncode in (0, 1), allowed.stderr
    assert (tmp_path / "ran").exists()
    assert "k" in json.loads(allowed.stdout)["base"]


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ("", 0.0),
        ("gap = 2.5", 2.5),
        ('gap = { value = 2.5, unit = "mm" }', 2.5),
        ('gap = { value = 0.0025, unit = "m" }', 2.5),
    ],
)
def test_a_program_is_told_what_the_machine_file_switches_on_in_its_own_units(
    tmp_path, stated, told
):
    """Numbers are in the units of the file, parameters in those of their effects."""
    foreign_folder(tmp_path)
    own = '\n[[effect]]\nname = "play"\ngap = { unit = "mm", range = [0, 5] }\n'
    text = FOREIGN + own + (f"\n[effects.play]\n{stated}\n" if stated else "")
    (tmp_path / "machine.toml").write_text(text, encoding="utf-8")
    (tmp_path / "model.py").write_text(
        "def simulate(numbers, columns):\n"
        "    place = columns['position_mm']\n"
        "    return {'scale': place - place + 100 * numbers['gap'] + numbers['k'] / 1e3}\n",
        encoding="utf-8",
    )
    model = open_experiment(tmp_path / "experiment.toml", allow_python=True).system.model
    (predicted,) = model({"base": {"k": 100.0}})
    assert predicted == pytest.approx(np.full(len(predicted), 100 * told + 0.1))


@pytest.mark.parametrize(
    "text", ["def simulate(n, c):\n    return 1 / 0\n", "x = )", "y = 1\n", "import nothing_here\n"]
)
def test_a_program_that_fails_is_told_in_words(tmp_path, text):
    foreign_folder(tmp_path)
    (tmp_path / "model.py").write_text(text, encoding="utf-8")
    done = run_here(tmp_path, "compare", "experiment.toml", "--allow-python")
    assert done.returncode == 2
    assert "model.py" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        ("5", "returns int, expected a dict with an array of 100 numbers for scale"),
        ("None", "returns NoneType"),
        ("{}", "returns an empty dict"),
        ("{'place': 1}", "returns place, expected"),
        ("{'scale': [1.0, 2.0]}", "returns an array of float64 and of shape (2,)"),
        ("{'scale': c['force_N'][:, None]}", "of shape (100, 1)"),
        ("{'scale': ['a'] * 100}", "returns an array of <U1"),
        ("{'scale': c['force_N'] * 1j}", "returns an array of complex128"),
        ("{'scale': [[1.0], 2.0]}", "returns for scale no array ("),
        ("__import__('sys').exit(3)", "SystemExit: 3"),
    ],
)
def test_what_a_program_returns_is_told_if_it_is_no_prediction(tmp_path, returned, words):
    foreign_folder(tmp_path)
    text = f"def simulate(n, c):\n    return {returned}\n"
    (tmp_path / "model.py").write_text(text, encoding="utf-8")
    done = run_here(tmp_path, "compare", "experiment.toml", "--allow-python")
    assert done.returncode == 2, done.stdout
    assert "model.py" in done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr


JUMPS = """
[[effect]]
name = "jumps"
enters = "force"
formula = "-F1 * sign(v)"
F1 = { unit = "N", range = [0, 10] }
"""
RUBS = JUMPS.replace('"jumps"', '"rubs"').replace('"force"', '"friction"').replace(
    "-F1 * sign(v)", "F1"
)  # fmt: skip


def test_a_force_that_turns_with_the_motion_is_that_of_dry_friction(tmp_path):
    """A force of -F1 sign(v) and a dry friction F1 predict the same where the axis never sticks."""
    (tmp_path / "machine.toml").write_text(DRIVE + JUMPS + RUBS, encoding="utf-8")
    t = np.arange(0, 6, 0.02)
    force = 30 * np.sin(2.3 * t) + 20 * np.sin(6.1 * t)
    write(tmp_path / "run.csv", {"time_s": t, "force_N": force, "position_mm": 0.1 * np.sin(t)})
    (tmp_path / "experiment.toml").write_text(DRIVEN, encoding="utf-8")
    model = open_experiment(tmp_path / "experiment.toml").system.model
    (jumping,), (rubbing,) = (model({name: {"F1": 2.0}}) for name in ("jumps", "rubs"))
    (without,) = model({})
    assert np.ptp(rubbing - without) > 100.0
    assert jumping == pytest.approx(rubbing, abs=1e-9)


SWINGING = """\
kind = "axis"
name = "arm"
unit = "rad"
acceleration = "ACCELERATION"

[base]
w2 = { value = 30.0, unit = "1/s2", free = true, range = [1, 400] }
c = { value = 0.3, unit = "1/s", free = true, range = [0, 5] }
"""
GAIN = 'k = { value = 15, unit = "1/s2", free = true, range = [0.1, 100] }\n'
SEEN = """\
machine = "machine.toml"
INPUTS
[[sensor]]
name = "encoder"
quantity = "angle"
column = "x_rad"
noise_rms = 0.003
zero = 0
"""
OF_LOAD = """
[[effect]]
name = "of the load"
enters = "ENTERS"
formula = "FORMULA"
F1 = { unit = "1/s2" }
"""


def swung(t, drive, x, v, acceleration, limit):
    """Angles (times x runs) under a held `drive`, with a dry friction of `limit`, by Verlet."""
    step, angles = (t[1] - t[0]) / 200, []
    for pushed in drive:
        angles.append(x)
        for _ in range(200):
            own = v + step * acceleration(pushed, x, v)
            own = np.sign(own) * np.maximum(np.abs(own) - step * limit(pushed, x), 0.0)
            x, v = x + step / 2 * (v + own), own
    return np.array(angles)


@pytest.mark.parametrize(
    ("enters", "formula"),
    [
        ("friction", "F1 * abs(cos(x))"),
        ("friction", "F1 * abs(drive)"),
        ("force", "-F1 * abs(drive) * sign(v)"),
    ],
)
def test_a_friction_of_the_load_is_found_on_five_runs(tmp_path, enters, formula):
    """Of arms that swing freely from anywhere, or that are driven; all their numbers are free."""
    rng, free, size = np.random.default_rng(3), "cos" in formula, 2.0
    t = 0.05 * np.arange(80)
    waves = np.outer(t, rng.uniform(1, 3, 5)) + 6 * rng.random(5)
    drive = np.sin(waves) + 0.6 * np.sin(2.1 * waves)
    if free:
        law, inputs, numbers = "-w2 * sin(x) - c * v", "", ""
        start = rng.uniform(0.6, 1.4, 5) * rng.choice([-1, 1], 5), rng.uniform(-1, 1, 5)
        x = swung(
            t, 0 * drive, *start, lambda u, x, v: -40 * np.sin(x) - 0.15 * v,
            lambda u, x: size * np.abs(np.cos(x)),
        )  # fmt: skip
    else:
        law, numbers = "k * drive - w2 * x - c * v", GAIN
        inputs = '[inputs]\ndrive = { column = "drive", unit = "1", hold = true }\n'
        x = swung(
            t, drive, np.zeros(5), np.zeros(5), lambda u, x, v: 20 * u - 6 * x - v,
            lambda u, x: size * np.abs(u),
        )  # fmt: skip
    machine = SWINGING.replace("ACCELERATION", law) + numbers
    machine += OF_LOAD.replace("ENTERS", enters).replace("FORMULA", formula)
    experiment = SEEN.replace("INPUTS", inputs)
    read = x + 0.003 * rng.standard_normal(x.shape)
    for nth in range(5):
        write(tmp_path / f"{nth}.csv", {"time_s": t, "drive": drive[:, nth], "x_rad": read[:, nth]})
        experiment += f'[[run]]\ndata = "{nth}.csv"\n'
    (tmp_path / "machine.toml").write_text(machine, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(experiment, encoding="utf-8")
    verdict = open_experiment(tmp_path / "experiment.toml").conclude().verdict
    (effect,) = verdict.effects
    assert (verdict.verdict, effect.name) == ("named", "of the load")
    low, high = effect.parameters["F1"].ci95
    assert low < size < high < 1.02 * size
