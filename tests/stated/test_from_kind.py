"""An experiment that states the kind of its machine alone: free numbers, sized by the data."""

import json
import tomllib

import numpy as np
import pytest
from scipy import signal

from helpers.commands import run_here
from helpers.stated import DRIVEN, FRICTION_OF_PLACE, driven, write
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment

AXIS = DRIVEN.replace('"machine.toml"', '"axis"')


def fitted(folder, text, columns):
    """The numbers of the machine in SI as they fit without effects, and the machine."""
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    write(folder / "run.csv", columns)
    system = open_experiment(folder / "experiment.toml").system
    return system.model.values(system.base.settings), system.experiment.machine


def test_a_force_shows_mass_and_viscous_friction(tmp_path):
    found, machine = fitted(tmp_path, AXIS, driven(spring=0.0, mass=2.0, viscous=3.0))
    assert found == pytest.approx({"mass": 2.0, "viscous": 3.0}, rel=0.01)
    assert all(number.free and number.low < number.high for number in machine.numbers.values())


def test_a_spring_that_a_regression_asks_for_is_a_part_of_the_model(tmp_path):
    found, _ = fitted(tmp_path, AXIS, driven(mass=0.02, viscous=0.1, spring=4.0))
    assert found == pytest.approx({"mass": 0.02, "viscous": 0.1, "spring": 4.0}, rel=0.02)


def shaken(hardening, count=1500):
    """An oscillator of 68 Hz and 5 % damping under noise, nine samples a cycle, in mm.

    x'' = 1.8e5 u - 42.7 x' - w² x - hardening x³, by Runge and Kutta's method.
    """
    rng, rate_hz, parts = np.random.default_rng(5), 610.0, 16
    u = signal.lfilter(*signal.butter(4, 0.65), rng.standard_normal(count))
    u *= np.linspace(0.03, 0.22, count)
    square, h = (2 * np.pi * 68) ** 2, 1 / rate_hz / parts
    state, places = np.zeros(2), []

    def rates(state, pushed):
        x, v = state
        return np.array([v, pushed - 42.7 * v - square * x - hardening * x**3])

    for pushed in 1.8e5 * u:
        places.append(state[0])
        for _ in range(parts):
            first = rates(state, pushed)
            second = rates(state + h / 2 * first, pushed)
            third = rates(state + h / 2 * second, pushed)
            fourth = rates(state + h * third, pushed)
            state = state + h / 6 * (first + 2 * second + 2 * third + fourth)
    noise = 2e-4 * rng.standard_normal(count)
    return {"time_s": np.arange(count) / rate_hz, "u_V": u, "position_mm": places + noise}


SHAKEN = AXIS.replace('force = { column = "force_N"', 'drive = { column = "u_V"').replace(
    "noise_rms = 0.2", 'noise_rms = "unknown"'
)


def test_a_resonance_that_is_sampled_a_few_times_a_cycle_is_a_spring(tmp_path):
    found, _ = fitted(tmp_path, SHAKEN, shaken(0.0))
    expected = {"w2": (2 * np.pi * 68) ** 2, "gain_drive": 180.0, "damping": 42.7}
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("zero_mm", [None, 5.0])
def test_a_hardening_spring_is_named_where_only_the_kind_is_stated(tmp_path, zero_mm):
    """Also if the log begins in the midst of it, and the sensor's zero is anywhere."""
    text, columns = SHAKEN, shaken(4e5)
    if zero_mm is not None:
        text = text.replace("x = 0, v = 0", 'x = "free", v = "free"')
        columns = {name: own[900:] for name, own in columns.items()}
        columns["position_mm"] = columns["position_mm"] + zero_mm
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    write(tmp_path / "run.csv", columns)
    answer = json.loads(run_here(tmp_path, "reconcile", "experiment.toml", "--json").stdout)
    (named,) = answer["effects"]
    assert (answer["verdict"], named["name"]) == ("named", "cubic_stiffness")
    assert named["parameters"]["k3"]["value"] == pytest.approx(4e11, rel=0.005)


def test_an_oscillator_whose_place_is_a_voltage_has_a_hardening_spring(tmp_path):
    """As `machine = "axis"` and as a law of the user's, in V throughout."""
    columns = shaken(4e5, count=800)
    columns["out_V"] = columns.pop("position_mm")
    law = """\
kind = "axis"
name = "oscillator"
unit = "V"
acceleration = "gain * drive - w2 * x - damping * v"
[base]
gain = { value = 1e5, unit = "1/s2", free = true, range = [1e4, 1e6] }
w2 = { value = 1e5, unit = "1/s2", free = true, range = [1e4, 1e6] }
damping = { value = 20, unit = "1/s", free = true, range = [0, 200] }
"""
    (tmp_path / "machine.toml").write_text(law, encoding="utf-8")
    write(tmp_path / "run.csv", columns)
    for machine in ("axis", "machine.toml"):
        text = SHAKEN.replace('"position_mm"', '"out_V"').replace('"axis"', f'"{machine}"')
        (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
        done = run_here(
            tmp_path, "reconcile", "experiment.toml", "--json", "--out", "repaired.toml"
        )
        answer = json.loads(done.stdout)
        assert answer["gap"]["unit"] == "V"
        (named,) = answer["effects"]
        assert (answer["verdict"], named["name"]) == ("named", "cubic_stiffness")
        k3 = named["parameters"]["k3"]
        assert k3["unit"] == "1/(V2 s2)"
        assert k3["value"] == pytest.approx(4e5, rel=0.005)
    assert 'unit = "V"' in (tmp_path / "repaired.toml").read_text(encoding="utf-8")


def test_a_voltage_without_an_input_of_that_name_may_be_the_place(tmp_path):
    columns = shaken(0.0, count=300)
    columns["out_V"] = columns.pop("position_mm")
    text = SHAKEN.replace('"position_mm"', '"out_V"').replace('"position"', '"voltage"')
    (tmp_path / "machine.toml").write_text(
        'kind = "axis"\nname = "m"\nunit = "V"\nacceleration = "-w2 * x + k * drive"\n[base]\n'
        'w2 = { value = 1e5, unit = "1/s2" }\nk = { value = 1e5, unit = "1/s2" }\n',
        encoding="utf-8",
    )
    text = text.replace('"axis"', '"machine.toml"')
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    write(tmp_path / "run.csv", columns)
    done = run_here(tmp_path, "compare", "experiment.toml")
    assert done.returncode == 2
    assert 'quantity = "position" of the axis' in done.stderr


def test_a_free_start_is_told_in_the_unit_of_the_axis(tmp_path):
    columns = driven(mass=2.0, viscous=3.0, spring=40.0)
    columns = {name: own[100:] for name, own in columns.items()}
    text = AXIS.replace("start = { x = 0, v = 0 }", 'start = { x = "free", v = "free" }')
    text = text.replace("noise_rms = 0.2", "noise_rms = 0.2\nzero = 0")
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    write(tmp_path / "run.csv", columns)
    answer = json.loads(run_here(tmp_path, "reconcile", "experiment.toml", "--json").stdout)
    place = answer["base"]["start of run.csv, x"]
    assert place["unit"] == "mm"
    assert place["value"] == pytest.approx(columns["position_mm"][0], abs=0.3)


def spun(dry, count=3000):
    """A wheel under voltages of half a second each: w' = 40 u - 4 w - dry sgn w, in closed form."""
    rng, speeds, w = np.random.default_rng(4), [], 0.0
    u = np.repeat(rng.uniform(-6, 6, count // 50), 50)
    for pushed in 40 * u:
        speeds.append(w)
        left_s = 0.01
        while left_s > 0 and (w or abs(pushed) > dry):
            final = (pushed - dry * np.sign(w or pushed)) / 4
            crossing_s = np.log(1 - w / final) / 4 if w * final < 0 else np.inf
            w = 0.0 if crossing_s <= left_s else final + (w - final) * np.exp(-4 * left_s)
            left_s -= min(left_s, crossing_s)
    noise = 0.3 * rng.standard_normal(count)
    return {"time_s": np.arange(count) / 100, "u_V": u, "wheel_rad_s": speeds + noise}


def test_a_dry_friction_that_does_not_fall_with_the_speed_has_its_plain_form(tmp_path):
    text = SHAKEN.replace('"position"', '"speed"').replace('"position_mm"', '"wheel_rad_s"')
    text = text.replace("x = 0, v = 0", 'v = "free"')
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    write(tmp_path / "run.csv", spun(30.0))
    answer = json.loads(run_here(tmp_path, "reconcile", "experiment.toml", "--json").stdout)
    (named,) = answer["effects"]
    assert (named["name"], sorted(named["parameters"])) == ("dry_friction", ["Fc"])
    assert named["parameters"]["Fc"]["value"] == pytest.approx(30.0, abs=0.3)


def test_what_is_no_force_shows_ratios_to_the_mass(tmp_path):
    columns = driven(spring=0.0, mass=2.0, viscous=3.0)
    columns["duty"] = columns.pop("force_N") / -20
    text = AXIS.replace('force = { column = "force_N"', 'duty = { column = "duty", unit = "1"')
    found, machine = fitted(tmp_path, text, columns)
    assert found == pytest.approx({"gain_duty": -10.0, "damping": 1.5}, rel=0.01)
    assert machine.numbers["gain_duty"].unit == "mm/s2"


def test_a_torque_and_a_speed_show_the_inertia(tmp_path):
    columns = driven(spring=0.0, mass=2.0, viscous=3.0)
    speed = np.gradient(columns["position_mm"] / 1e3, columns["time_s"])
    rng = np.random.default_rng(1)
    made = {
        "time_s": columns["time_s"], "torque_Nm": columns["force_N"],
        "wheel_rad_s": speed + 1e-3 * rng.standard_normal(len(speed)),
    }  # fmt: skip
    text = AXIS.replace('force = { column = "force_N"', 'torque = { column = "torque_Nm"')
    text = text.replace('"position"', '"speed"').replace('"position_mm"', '"wheel_rad_s"')
    text = text.replace("noise_rms = 0.2", "noise_rms = 0.01").replace("x = 0, v = 0", 'v = "free"')
    found, machine = fitted(tmp_path, text, made)
    assert found == pytest.approx({"inertia": 2.0, "viscous": 3.0}, rel=0.05)
    assert machine.unit == "rad"


HEATED = """\
machine = "thermal"

[inputs]
heater = {{ column = "{column}", unit = "{unit}", hold = true }}

[[sensor]]
name = "block"
quantity = "temperature"
column = "block_C"
noise_rms = 0.1
zero = 0

[[run]]
data = "run.csv"
"""


def heated(column, scale):
    """A block of 40 J/K that loses 0.2 W/K, at 22 C, under 5 W for half of the time."""
    t = np.arange(0.0, 600.0, 2.0)
    power = np.where(t < 300.0, 5.0, 0.0)
    risen, place = np.zeros_like(t), 0.0
    for i in range(1, len(t)):
        place = place * np.exp(-2.0 / 200) + power[i - 1] / 0.2 * (1 - np.exp(-2.0 / 200))
        risen[i] = place
    noise = 0.1 * np.random.default_rng(2).standard_normal(len(t))
    return {"time_s": t, column: power * scale, "block_C": 22.0 + risen + noise}


def test_a_power_shows_capacity_and_loss(tmp_path):
    text = HEATED.format(column="heater_W", unit="W")
    found, _ = fitted(tmp_path, text, heated("heater_W", 1.0))
    assert found == pytest.approx({"capacity": 40.0, "loss": 0.2}, rel=0.02)


def test_a_duty_shows_the_rates_alone(tmp_path):
    text = HEATED.format(column="heater_percent", unit="%")
    found, _ = fitted(tmp_path, text, heated("heater_percent", 10.0))
    assert found == pytest.approx({"a_heater": 0.25, "U": 0.005}, rel=0.02)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (AXIS.replace('[inputs]\nforce = { column = "force_N", hold = true }\n', ""),
         'add, with the name of your column: [inputs] force = { column = "force_N" }'),
        (HEATED.format(column="heater_W", unit="W").replace("[inputs]\nheater", "[other]\nheater"),
         "unknown key other"),
        (AXIS.replace('"position"', '"force"').replace('"position_mm"', '"force_N"'),
         'needs a sensor of its place or its speed'),
    ],
    ids=["no input", "no section", "no sensor"],
)  # fmt: skip
def test_what_is_missing_is_named_with_the_line_to_add(tmp_path, text, words):
    with pytest.raises(ModelError) as caught:
        fitted(tmp_path, text, driven(length_s=1.0))
    assert words in caught.value.render()


def test_the_repaired_file_is_a_machine_of_its_own_with_the_experiment_s_effect(tmp_path):
    """The effect stands in the experiment's file, as does nothing else of the machine."""
    fitted(tmp_path, AXIS + FRICTION_OF_PLACE, driven(of_place=12.0))
    options = ("--only", "friction of place", "--out", "out.toml")
    done = run_here(tmp_path, "reconcile", "experiment.toml", *options)
    assert "Named: friction of place." in done.stdout
    text = (tmp_path / "out.toml").read_text("utf-8")
    repaired = tomllib.loads(text)
    assert repaired["effect"][0]["formula"] == "F1 * abs(x)"
    assert repaired["effects"]["friction of place"]["F1"]["value"] == pytest.approx(12.0, rel=0.1)
    assert repaired["base"]["mass"]["value"] == pytest.approx(2.0, rel=0.01)
    again = run_here(tmp_path, "compare", "experiment.toml", "--apply", "out.toml")
    assert again.returncode == 0, again.stdout
