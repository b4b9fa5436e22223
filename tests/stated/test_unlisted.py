"""Free-form terms in the equations of other machines, and the listed effects next to them."""

import json
import math
import re

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, drive_folder, write
from mopro.experiment.opened import experiment_file
from mopro.experiment.stated.from_kind import completed
from mopro.experiment.stated.read import read_stated_experiment
from mopro.stated.file import EFFORT, catalogue, unlisted_terms
from mopro.stated.names import check, unlisted_of

RNG = np.random.default_rng
# Listed effects that a law of the input may be taken for, beside which it is drafted.
OF_INPUT = ("input_gain", "dry_friction", "quadratic_drag")


def answered(folder, only=()):
    limited = [word for name in only for word in ("--only", name)]
    done = run_here(folder, "reconcile", "experiment.toml", "--json", *limited)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


def test_a_friction_that_nobody_listed_is_drafted_as_a_law(tmp_path):
    drive_folder(tmp_path, DRIVE, of_place=12.0)
    answer = answered(tmp_path, (*OF_INPUT, "cubic_stiffness", "bias_force", "cogging"))
    assert answer["verdict"] == "unexplained"
    (draft,) = answer["drafts"]
    assert (draft["of"], draft["enters"], draft["unit"]) == ("x", "friction", "N")
    size, _, law = draft["law"].partition(" * ")
    assert law == "abs(x)"
    assert float(size) == pytest.approx(12.0, rel=0.1)
    assert answer["remainder"]["variable"] == "x"


MOTOR = """\
machine = "axis"
[inputs]
duty = { column = "duty", hold = true }
[[sensor]]
name = "encoder"
quantity = "angle"
column = "angle_rad"
noise_rms = 0.003
[[run]]
data = "run.csv"
start = { x = 0, v = 0 }
"""


def motor_folder(folder, by_direction=0.0, saturation=0.0, most=1.0, dead=0.0, least=-1.0):
    """A motor whose drive is stronger one way by a share, or weaker by a share of the duty².

    It gives no more than the duty `most` and no less than `least`, and less by `dead` than it is
    told, or nothing.
    """
    t, rng = np.arange(0, 16, 0.02), RNG(4)
    duty = np.repeat(rng.uniform(-0.9, 0.9, 16), 50)
    x = v = 0.0
    angles, h = [], 1e-3
    for share in duty.tolist():
        angles.append(x)
        share = max(min(share, most), least)
        share = math.copysign(max(abs(share) - dead, 0.0), share)
        pushed = 50.0 * (share + by_direction * abs(share) - saturation * share**3)
        for _ in range(20):
            a = pushed - 1.5 * (v + h / 2 * (pushed - 1.5 * v))
            x += h * v + h * h / 2 * (pushed - 1.5 * v)
            v += h * a
    measured = np.array(angles) + 0.003 * rng.standard_normal(len(t))
    (folder / "experiment.toml").write_text(MOTOR, encoding="utf-8")
    write(folder / "run.csv", {"time_s": t, "duty": duty, "angle_rad": measured})


def test_a_drive_that_is_stronger_one_way_is_named_by_its_input(tmp_path):
    motor_folder(tmp_path, by_direction=0.1)
    answer = answered(tmp_path)
    (effect,) = answer["effects"]
    assert effect["name"] == "direction_dependent_gain"
    assert effect["parameters"]["k_u"]["value"] == pytest.approx(0.1, rel=0.02)


def test_a_drive_that_is_dead_about_zero_is_no_friction(tmp_path):
    """Without it in the catalogue a friction with a lag of the sensor was told in its place."""
    motor_folder(tmp_path, dead=0.08)
    answer = answered(tmp_path)
    (effect,) = answer["effects"]
    assert (answer["verdict"], effect["name"]) == ("named", "input_dead_zone")
    assert effect["parameters"]["w"]["value"] == pytest.approx(0.08, rel=0.02)
    assert effect["parameters"]["w"]["unit"] == "1"


def test_a_drive_that_saturates_is_drafted_as_a_law_of_the_command(tmp_path):
    motor_folder(tmp_path, saturation=0.2)
    answer = answered(tmp_path)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    draft = answer["drafts"][0]
    assert (draft["of"], draft["enters"]) == ("command", "input")
    assert draft["law"].endswith(" * u**3")
    assert draft["law"].startswith("-")


def test_a_drive_that_gives_no_more_than_a_level_is_drafted_with_the_level(tmp_path):
    motor_folder(tmp_path, most=0.4)
    answer = answered(tmp_path, (*OF_INPUT, "direction_dependent_gain"))
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    assert (draft["of"], draft["enters"]) == ("command", "input")
    size, level = re.fullmatch(r"(\S+) \* max\(u - (\S+), 0\)", draft["law"]).groups()
    assert (float(size), float(level)) == pytest.approx((-1.0, 0.4), rel=0.05)


def test_a_drive_that_gives_no_more_either_way_is_drafted_with_one_level(tmp_path):
    motor_folder(tmp_path, most=0.5, least=-0.5)
    answer = answered(tmp_path, OF_INPUT)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    assert (draft["of"], draft["enters"]) == ("command", "input")
    form = r"(\S+) \* \(u - min\(max\(u, -(\S+)\), (\S+)\)\)"
    size, level, again = re.fullmatch(form, draft["law"]).groups()
    assert level == again
    assert (float(size), float(level)) == pytest.approx((-1.0, 0.5), rel=0.05)


def test_a_gain_by_direction_stays_beside_a_draft_of_the_input(tmp_path):
    """That the drive saturates, as a function of the command, is no other form of it."""
    rng, t, h = RNG(6), np.arange(0, 16, 0.02), 1e-4
    force = 5 * np.sin(2.4 * t) + 4 * np.sin(7.1 * t + 1)
    x = v = 0.0
    places = []
    for push in force.tolist():
        places.append(x)
        for _ in range(200):
            given = min(push, 5.0) * (0.8 if v < 0 else 1.2)
            v += h / 2.0 * (given - 3.0 * v - 40.0 * x)
            x += h * v
    measured = 1e3 * np.array(places) + 0.2 * rng.standard_normal(len(t))
    drive_folder(tmp_path, DRIVE)
    write(tmp_path / "run.csv", {"time_s": t, "force_N": force, "position_mm": measured})
    answer = answered(tmp_path, ("direction_dependent_gain", "input_gain", "dry_friction"))
    (effect,) = answer["effects"]
    assert effect["name"] == "direction_dependent_gain"
    assert effect["parameters"]["k"]["value"] == pytest.approx(0.2, rel=0.05)
    assert ("command", "input") in {(draft["of"], draft["enters"]) for draft in answer["drafts"]}


OVEN = """\
machine = "thermal"
[inputs]
duty = { column = "duty_percent", hold = true }
[[sensor]]
name = "oven"
quantity = "temperature"
column = "oven_C"
noise_rms = 0.08
[[run]]
data = "run.csv"
"""


def oven_folder(folder, rate=1e-3, fading=0.0, vent=0.0, leak=0.0):
    """An oven whose surroundings warm up by `rate` (K/s), its heater `fading` (1/s).

    Beyond 70 °C a vent opens, which takes `vent` (1/s) times the rest. Its loss grows by `leak`
    (1/s) of itself.
    """
    t, rng = np.arange(0, 3000, 5.0), RNG(5)
    duty = np.repeat(rng.uniform(0, 100, 8), 75)
    inside, found = 22.0, []
    for i, share in enumerate(duty.tolist()):
        found.append(inside)
        for k in range(20):
            air = 22.0 + rate * (t[i] + k / 4)
            heat = 0.008 * share * (1 - fading * (t[i] + k / 4))
            loss = 0.006 * (1 + leak * (t[i] + k / 4)) * (inside - air)
            inside += 0.25 * (heat - loss - vent * max(inside - 70.0, 0.0))
    measured = np.array(found) + 0.08 * rng.standard_normal(len(t))
    (folder / "experiment.toml").write_text(OVEN, encoding="utf-8")
    write(folder / "run.csv", {"time_s": t, "duty_percent": duty, "oven_C": measured})


def test_a_vent_that_opens_is_drafted_with_the_temperature_at_which_it_does(tmp_path):
    oven_folder(tmp_path, rate=0.0, vent=0.02)
    answer = answered(tmp_path)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    assert (draft["of"], draft["enters"]) == ("T", "heat")
    size, level = re.fullmatch(r"(\S+) \* max\(T - (\S+), 0\)", draft["law"]).groups()
    assert float(size) == pytest.approx(-0.02, rel=0.1)
    assert float(level) == pytest.approx(70.0, abs=1.0)


def test_surroundings_that_warm_up_are_named_with_their_rate(tmp_path):
    oven_folder(tmp_path)
    (effect,) = answered(tmp_path)["effects"]
    assert effect["name"] == "surroundings_drift"
    rate = effect["parameters"]["r"]
    assert rate["ci95"][0] < 1e-3 < rate["ci95"][1]
    assert math.isclose(rate["value"], 1e-3, rel_tol=0.1)


def test_a_heater_that_weakens_is_drafted_as_a_gain_that_changes_in_time(tmp_path):
    oven_folder(tmp_path, rate=0.0, fading=1e-4)
    answer = answered(tmp_path)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    draft = answer["drafts"][0]
    assert (draft["of"], draft["enters"]) == ("t", "input")
    size, _, law = draft["law"].partition(" * ")
    assert law == "u * t"
    assert float(size) == pytest.approx(-1e-4, rel=0.05)


def test_a_loss_that_grows_is_drafted_as_one_that_changes_in_time(tmp_path):
    oven_folder(tmp_path, rate=0.0, leak=1e-4)
    answer = answered(tmp_path)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    assert (draft["of"], draft["enters"]) == ("t", "heat")
    size, _, law = draft["law"].partition(" * ")
    assert law == "(T - ambient) * t"
    assert float(size) == pytest.approx(-0.006e-4, rel=0.05)


PLATES = """\
kind = "thermal"
name = "plates"
[nodes]
plate = "a * duty - U * (T - ambient)"
case = "-W * (T - ambient)"
[base]
a = { value = 0.8, unit = "K/s", free = true, range = [0.05, 5] }
U = { value = 0.005, unit = "1/s", free = true, range = [0.0005, 0.05] }
W = { value = 0.005, unit = "1/s", free = true, range = [0.0005, 0.05] }
"""


def test_two_nodes_of_unlike_capacity_have_an_unequal_coupling(tmp_path):
    """0.12 W/K between 60 and 45 J/K."""
    t, rng = np.arange(0, 3000, 5.0), RNG(6)
    duty = np.repeat(rng.uniform(0, 100, 8), 75)
    plate = case = 21.0
    plates, cases = [], []
    for share in duty.tolist():
        plates.append(plate)
        cases.append(case)
        for _ in range(20):
            between = 0.12 * (plate - case)
            heat = 0.5 * share - 0.35 * (plate - 21.0) - between
            plate, case = (
                plate + 0.25 / 60 * heat,
                case + 0.25 / 45 * (between - 0.3 * (case - 21.0)),
            )
    noise = 0.06 * rng.standard_normal((2, len(t)))
    measured = {"plate_C": np.array(plates) + noise[0], "case_C": np.array(cases) + noise[1]}
    sensor = OVEN[OVEN.index("[[sensor]]") : OVEN.index("[[run]]")]
    sensors = sensor.replace("oven", "plate") + sensor.replace("oven", "case")
    text = OVEN.replace(sensor, sensors).replace('"thermal"', '"machine.toml"')
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    (tmp_path / "machine.toml").write_text(PLATES, encoding="utf-8")
    write(tmp_path / "run.csv", {"time_s": t, "duty_percent": duty, **measured})
    effects = {e["name"]: e["parameters"] for e in answered(tmp_path)["effects"]}
    assert effects.keys() == {"coupling", "unequal_coupling"}
    k, d = effects["coupling"]["k"]["value"], effects["unequal_coupling"]["d"]["value"]
    assert k == pytest.approx(0.12 / 45, rel=0.02)
    assert k + d == pytest.approx(0.12 / 60, rel=0.04)


AXIS = {"v", "sgn v", "x", "x mod", "t", "command"}


@pytest.mark.parametrize(
    ("make", "variables"),
    [(drive_folder, AXIS), (motor_folder, AXIS), (oven_folder, {"T", "t", "command"})],
)
def test_the_units_of_free_form_terms_match(tmp_path, make, variables):
    make(tmp_path)
    experiment = completed(
        read_stated_experiment(experiment_file(tmp_path / "experiment.toml").entries)
    )
    terms = unlisted_of(experiment)
    assert {term.of for term in terms} == variables
    check(experiment, terms)


UNITS = (("foreign", "N"), ("force", "N"), ("load", "N"), ("power", "W"), ("u", "N"), ("x", "m"))


@pytest.mark.parametrize(
    "listed",
    [
        *(catalogue(kind, UNITS) for kind in ("kinematic", "axis", "thermal")),
        catalogue("kinematic", UNITS, EFFORT),
        *(unlisted_terms(kind, UNITS) for kind in ("axis", "thermal")),
    ],
    ids=["kinematic", "axis", "thermal", "effort", "free-form axis", "free-form thermal"],
)
def test_forms_of_an_effect_are_told_by_their_parameters(listed):
    """A machine file states the parameters of an effect, and not its form."""
    told = [(effect.name, frozenset(p.name for p in effect.parameters)) for effect in listed]
    assert listed
    assert len(set(told)) == len(told)
