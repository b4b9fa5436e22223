"""Kinds of machine and sensors of many quantities, on records with a hidden effect."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helpers.commands import run_here
from helpers.stated import follows, write

RNG = np.random.default_rng
T = np.arange(0, 12, 0.02)
MOVES = 30 * np.sin(0.8 * T) * np.sin(2.1 * T)
SPEED = 24 * np.cos(0.8 * T) * np.sin(2.1 * T) + 63 * np.sin(0.8 * T) * np.cos(2.1 * T)


def reconciled(folder, experiment, columns, machine=None, only=None, **files):
    """The answer of `mopro reconcile --json` on files of these texts and columns."""
    (folder / "experiment.toml").write_text(experiment, encoding="utf-8")
    if machine is not None:
        (folder / "machine.toml").write_text(machine, encoding="utf-8")
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text, encoding="utf-8")
    write(folder / "run.csv", columns)
    limited = ["--only", only] if only else []
    done = run_here(folder, "reconcile", "experiment.toml", "--json", "--jobs", "1", *limited)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


def sizes(answer):
    """Value of each parameter of each effect, by `effect.parameter`."""
    return {
        f"{effect['name']}.{name}": p["value"]
        for effect in answer["effects"]
        for name, p in effect["parameters"].items()
    }


FOLLOWS = follows(0.02, "run.csv")


def test_a_bare_kinematic_machine_has_backlash(tmp_path):
    x = [float(MOVES[0])]
    for target in MOVES[1:].tolist():
        x.append(min(max(x[-1], target - 0.25), target + 0.25))
    measured = np.array(x) + 0.02 * RNG(1).standard_normal(len(T)) + 3.0
    answer = reconciled(
        tmp_path, FOLLOWS, {"time_s": T, "target_mm": MOVES, "position_mm": measured}
    )
    assert answer["verdict"] == "named"
    assert sizes(answer) == {"backlash.w": pytest.approx(0.5, abs=0.02)}


def test_a_line_in_time_is_found_up_to_half_the_sampling_rate(tmp_path):
    """At 100 Hz, 31.3 Hz are told with their own period, and not as a harmonic of twice that."""
    line_Hz, t = 31.3, np.arange(2000) / 100

    def run(cycles):
        target = 30 * np.sin(2 * np.pi * t * cycles / t[-1])
        measured = target + 0.03 * np.sin(2 * np.pi * line_Hz * t + 0.7)
        measured += 0.02 * RNG(1).standard_normal(len(t))
        return {"time_s": t, "target_mm": target, "position_mm": measured}

    write(tmp_path / "other.csv", run(1.6))
    several = FOLLOWS + '[[run]]\ndata = "other.csv"\n'
    answer = reconciled(tmp_path, several, run(2.3), only="periodic_in_time")
    assert answer["verdict"] == "named"
    assert sizes(answer)["periodic_in_time.P"] == pytest.approx(1 / line_Hz, rel=1e-4)


SWEEP = np.linspace(0.0, 4 * np.pi, 600)
TO_AND_FRO = 60 - 60 * np.cos(SWEEP)


def test_a_scale_that_is_bent_about_its_middle_is_drafted(tmp_path):
    """Of the motion to and fro it is a gain, and a line of three times its frequency in time."""
    bent = 0.4 * (TO_AND_FRO / 60 - 1) ** 3
    measured = TO_AND_FRO + bent + 0.02 * RNG(2).standard_normal(len(SWEEP))
    columns = {"time_s": SWEEP, "target_mm": TO_AND_FRO, "position_mm": measured}
    answer = reconciled(tmp_path, FOLLOWS, columns)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    assert (draft["of"], draft["enters"], draft["held_out"]) == ("x", "measurement", True)
    size, _, law = draft["law"].partition(" * ")
    assert law == "(x - 60)**3"
    assert float(size) == pytest.approx(0.4 / 60**3, rel=0.02)


def test_a_bow_that_is_a_line_in_time_as_well_is_told_beside_it(tmp_path):
    measured = TO_AND_FRO + 0.3 * (TO_AND_FRO / 60 - 1) ** 2
    measured += 0.02 * RNG(3).standard_normal(len(SWEEP))
    columns = {"time_s": SWEEP, "target_mm": TO_AND_FRO, "position_mm": measured}
    answer = reconciled(tmp_path, FOLLOWS, columns)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    assert draft["law"].endswith("* (x - 60)**2")


TURNS = (
    FOLLOWS.replace("_mm", "_deg").replace('"position"', '"angle"').replace("= 0.02", "= 0.0015")
)


def table(reach_deg, noise=0.0015, begun=0.0, way=1):
    """An axis that steps there and back twice, with an eccentric encoder and backlash.

    `begun`: the place in its play where the axis begins, in deg. `way`: its first direction.
    """
    there = np.arange(0.0, reach_deg + 1, 2.0)
    command = way * np.concatenate([there, there[-2:0:-1], there, there[-2::-1]])
    played, x = [], command[0] + begun
    for target in command.tolist():
        x = min(max(x, target - 0.004), target + 0.004)
        played.append(x)
    angle = np.deg2rad(command)
    measured = np.array(played) + 0.02 * np.sin(angle + 1) + 0.006 * np.sin(2 * angle - 0.4)
    measured += noise * RNG(31).standard_normal(len(command))
    return {
        "time_s": np.arange(float(len(command))), "target_deg": command, "position_deg": measured,
    }  # fmt: skip


def test_an_eccentric_encoder_is_named_from_one_turn(tmp_path):
    answer = reconciled(tmp_path, TURNS, table(360.0))
    (error, play) = answer["effects"]
    assert (error["name"], error["form"]) == ("periodic_error", "of a turn, 2nd harmonic")
    found = sizes(answer)
    first, second = (
        complex(found[f"periodic_error.s{n}"], found[f"periodic_error.c{n}"]) for n in ("", "2")
    )
    assert first == pytest.approx(0.02 * np.exp(1j), rel=0.03)
    assert second == pytest.approx(0.006 * np.exp(-0.4j), rel=0.05)
    assert "backlash" in {play["name"], *play["indistinguishable_from"]}


def test_runs_whose_play_is_taken_up_on_either_side_share_it(tmp_path):
    """Each in the direction of its first motion, as stations of a calibration are approached."""
    write(tmp_path / "down.csv", table(360.0, 0.0003, 0.004, way=-1))
    text = TURNS.replace("0.0015", "0.0003") + '[[run]]\ndata = "down.csv"\n'
    answer = reconciled(tmp_path, text, table(360.0, 0.0003, -0.004))
    assert sizes(answer)["backlash.w"] == pytest.approx(0.008, rel=0.02)
    assert answer["verdict"] == "named"


@pytest.mark.parametrize("begun", [-0.004, 0.004])
def test_a_play_that_is_taken_up_when_the_data_begin_is_named(tmp_path, begun):
    """By a precise instrument: in its middle at first, a play leaves the first station far off."""
    answer = reconciled(tmp_path, TURNS.replace("0.0015", "0.0003"), table(360.0, 0.0003, begun))
    assert answer["verdict"] == "named"
    assert {e["name"] for e in answer["effects"]} == {"backlash", "periodic_error"}
    found = sizes(answer)
    assert found["backlash.w"] == pytest.approx(0.008, rel=0.02)
    assert found["backlash.begun"] == np.sign(begun)
    assert answer["gap"]["after_rms"] < 1.05 * 0.0003


def test_less_than_a_turn_shows_no_period_of_one(tmp_path):
    answer = reconciled(tmp_path, TURNS, table(90.0))
    assert not any("turn" in effect["form"] for effect in answer["effects"])


EFFORT = """\
machine = "machine.toml"
[inputs]
command = { column = "position_mm" }
[[sensor]]
name = "effort"
quantity = "QUANTITY"
column = "effort_UNIT"
noise_rms = "unknown"
reads = "mass * a + viscous * v"
[[run]]
data = "run.csv"
"""
INVERSE = """\
kind = "kinematic"
name = "drive"
unit = "mm"
[base]
mass = { value = 50, unit = "MASS", free = true, range = [10, 300] }
viscous = { value = 100, unit = "DRAG", free = true, range = [0, 1000] }
"""


@pytest.mark.parametrize(
    ("quantity", "unit", "mass", "drag"),
    [("force", "N", "kg", "N s/m"), ("current", "A", "A s2/m", "A s/m")],
)
def test_an_effort_over_a_known_motion_has_friction_and_cogging(
    tmp_path, quantity, unit, mass, drag
):
    """The motion is told, and what it takes is measured."""
    t = np.arange(0.0, 20.0, 0.01)
    x = 0.08 * np.sin(1.6 * t) + 0.03 * np.sin(3.9 * t + 1)
    v = 0.128 * np.cos(1.6 * t) + 0.117 * np.cos(3.9 * t + 1)
    a = -0.2048 * np.sin(1.6 * t) - 0.4563 * np.sin(3.9 * t + 1)
    effort = 95 * a + 203 * v + 20.4 * np.tanh(v / 1e-3) + 2.5 * np.sin(2 * np.pi * x / 0.024)
    columns = {
        "time_s": t,
        "position_mm": 1000 * x,
        f"effort_{unit}": effort - 3.2 + 0.8 * RNG(6).standard_normal(len(t)),
    }
    experiment = EFFORT.replace("QUANTITY", quantity).replace("UNIT", unit)
    machine = INVERSE.replace("MASS", mass).replace("DRAG", drag)
    answer = reconciled(tmp_path, experiment, columns, machine)
    found = sizes(answer)
    assert {effect["name"] for effect in answer["effects"]} == {"dry_friction", "cogging"}
    assert found["dry_friction.Fc"] == pytest.approx(20.4, rel=0.02)
    assert found["cogging.P"] == pytest.approx(0.024, rel=0.01)
    assert answer["base"]["mass"]["value"] == pytest.approx(95, rel=0.02)
    assert answer["gap"]["after_rms"] < 1.0 < 10 < answer["gap"]["before_rms"]


@pytest.mark.parametrize(
    ("entry", "columns", "words"),
    [
        ('load = { column = "load_N" }', {"load_N": np.sin(T)}, "needs a command"),
        ('command = { column = "way_deg" }', {"way_deg": MOVES}, "in deg, and the place"),
    ],
    ids=["none", "an angle"],
)
def test_a_kinematic_machine_asks_for_a_command_of_its_place(tmp_path, entry, columns, words):
    text = FOLLOWS.replace('command = { column = "target_mm" }', entry)
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    write(tmp_path / "run.csv", {"time_s": T, **columns, "position_mm": MOVES})
    done = run_here(tmp_path, "compare", "experiment.toml")
    assert done.returncode == 2
    assert done.stderr.startswith("experiment.toml:1:1: ")
    assert words in done.stderr
    assert "[no-command]" in done.stderr


@pytest.mark.parametrize(
    ("quantity", "unit", "command", "rule"),
    [
        ("force", "N", "V", "no-command"),
        ("speed", "mm_s", "deg", "wrong-unit"),
        ("speed", "mm_s", "mm", ""),
    ],
)
def test_a_sensor_of_no_place_and_a_command_are_told_from_each_other(
    tmp_path, quantity, unit, command, rule
):
    """A speed has no error of a place: it is read, and nothing is listed in the measurement."""
    text = FOLLOWS.replace("target_mm", f"target_{command}").replace("position_mm", f"read_{unit}")
    text = text.replace('"position"', f'"{quantity}"')
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    speed = SPEED + 0.02 * RNG(2).standard_normal(len(T))
    write(tmp_path / "run.csv", {"time_s": T, f"target_{command}": MOVES, f"read_{unit}": speed})
    done = run_here(tmp_path, "compare", "experiment.toml")
    assert done.returncode == (2 if rule else 0), done.stderr
    assert f"[{rule}]" in done.stderr if rule else "no disagreement" in done.stdout


def test_an_effort_without_a_law_is_asked_for_one(tmp_path):
    """The place of the command tells the unit of the axis, as no sensor does."""
    text = (
        EFFORT.replace("QUANTITY", "force")
        .replace("UNIT", "N")
        .replace("machine.toml", "kinematic")
    )
    text = text.replace('reads = "mass * a + viscous * v"\n', "")
    (tmp_path / "experiment.toml").write_text(text, encoding="utf-8")
    write(tmp_path / "run.csv", {"time_s": T, "position_mm": MOVES, "effort_N": np.cos(T)})
    done = run_here(tmp_path, "reconcile", "experiment.toml")
    assert done.returncode == 2
    assert done.stderr.startswith("experiment.toml:4:3: state what effort reads: there is no force")
    assert 'reads = "mass * a' in done.stderr


@pytest.mark.parametrize("noise", ["unknown", 5e-5])
def test_four_slow_effects_of_a_stage_are_named_together(tmp_path, noise):
    """Each by itself leaves what may as well be noise with a long memory."""
    up = np.arange(0, 50.1, 0.2)
    target = np.concatenate([up, up[::-1], up[::2], up[::-2]])
    t = 2.0 * np.arange(len(target))
    turns = np.diff(target, prepend=-1.0)
    turns[turns == 0] = np.roll(turns, 1)[turns == 0]
    measured = target * (1 + 2e-4) + 4e-4 * np.sin(2 * np.pi * target / 2.5 + 0.3) + 1.5e-6 * t
    measured += -6e-4 * np.sign(turns) + 5e-5 * RNG(9).standard_normal(len(t))
    text = FOLLOWS.replace("noise_rms = 0.02", f"noise_rms = {json.dumps(noise)}")
    columns = {"time_s": t, "target_mm": target, "position_mm": measured}
    answer = reconciled(
        tmp_path, text.replace('"target_mm" }', '"target_mm", hold = true }'), columns
    )
    assert answer["verdict"] == "named"
    assert sizes(answer) == {
        "scale.k": pytest.approx(2e-4, rel=0.01),
        "drift.r": pytest.approx(1.5e-6, rel=0.01),
        "backlash.w": pytest.approx(1.2e-3, rel=0.01),
        "backlash.begun": -1.0,
        "periodic_error.P": pytest.approx(2.5, rel=1e-3),
        "periodic_error.s": pytest.approx(4e-4 * math.cos(0.3), rel=0.05),
        "periodic_error.c": pytest.approx(4e-4 * math.sin(0.3), rel=0.1),
    }


def test_of_equal_explanations_the_one_that_is_listed_first_is_named(tmp_path):
    """One pass at one pace tells no period of place from one in time; a machine has the former."""
    x = np.arange(0, 12.001, 0.05)
    measured = x + 0.020 * np.sin(2 * np.pi * x + 0.7) + 0.004 * np.sin(4 * np.pi * x + 1)
    measured += 0.0015 * ((x - 6) / 6) ** 2 + 0.0005 * RNG(3).standard_normal(len(x))
    columns = {"time_s": 2.0 * np.arange(len(x)), "target_mm": x, "position_mm": measured}
    answer = reconciled(tmp_path, FOLLOWS.replace("0.02", '"unknown"'), columns)
    (period,) = (e for e in answer["effects"] if e["name"].startswith("periodic"))
    assert period["name"] == "periodic_error"
    assert "periodic_in_time" in period["indistinguishable_from"]
    assert period["parameters"]["P"]["value"] == pytest.approx(1.0, rel=2e-3)


def test_a_period_of_place_is_named_where_the_axis_goes_from_place_to_place(tmp_path):
    """Two neighbouring places may be far apart in time: what was moved between tells nothing."""
    places = RNG(6).uniform(0, 100, 60)
    target = np.repeat(places, 5)
    measured = target + 0.05 * np.sin(2 * np.pi * target / 11.0 + 0.8)
    measured += 0.01 * RNG(7).standard_normal(len(target))
    t = np.arange(float(len(target)))
    columns = {"time_s": t, "target_mm": target, "position_mm": measured}
    answer = reconciled(tmp_path, FOLLOWS.replace("0.02", "0.01"), columns)
    assert answer["verdict"] == "named"
    assert sizes(answer) == {
        "periodic_error.P": pytest.approx(11.0, rel=5e-3),
        "periodic_error.s": pytest.approx(0.05 * math.cos(0.8), abs=0.004),
        "periodic_error.c": pytest.approx(0.05 * math.sin(0.8), abs=0.004),
    }


def test_a_few_places_show_no_period(tmp_path):
    """Of three places one that is off may be a period, a bend, or a place that is off."""
    target = np.repeat(RNG(9).permutation(np.repeat([0.0, 50.0, 100.0], 8)), 20)
    wrong = {0.0: 0.0, 50.0: 0.3, 100.0: 0.1}
    measured = target + np.array([wrong[x] for x in target])
    measured += 0.02 * RNG(8).standard_normal(len(target))
    t = np.arange(float(len(target)))
    columns = {"time_s": t, "target_mm": target, "position_mm": measured}
    answer = reconciled(tmp_path, FOLLOWS, columns)
    assert not {"periodic_error"} & {e["name"] for e in answer["effects"]}
    assert answer["verdict"] == "unexplained"


def test_no_effect_is_named_where_there_is_none(tmp_path):
    measured = MOVES + 0.02 * RNG(2).standard_normal(len(T))
    columns = {"time_s": T, "target_mm": MOVES, "position_mm": measured}
    assert reconciled(tmp_path, FOLLOWS, columns)["verdict"] == "none"


def test_a_stamp_in_milliseconds_since_a_date_and_irregular_sampling(tmp_path):
    t = np.cumsum(RNG(3).uniform(0.005, 0.05, 800))
    target = 20 * np.sin(1.3 * t) + 5 * np.sin(4.1 * t)
    late = np.interp(t - 0.08, t, target) + 0.02 * RNG(4).standard_normal(len(t))
    experiment = FOLLOWS.replace("[inputs]", 'time = { column = "stamp", unit = "ms" }\n[inputs]')
    columns = {"stamp": 1e3 * t + 1.7e12, "target_mm": target, "position_mm": late}
    found = sizes(reconciled(tmp_path, experiment, columns))
    assert found["delay.d"] == pytest.approx(0.08, abs=0.005)


def test_a_known_intervention_takes_an_effect_out_of_a_run(tmp_path):
    wave = 0.4 * np.sin(2 * math.pi * T / 3.0)
    noise = 0.05 * RNG(5).standard_normal((2, len(T)))
    write(tmp_path / "off.csv", {"time_s": T, "target_mm": MOVES, "position_mm": MOVES + noise[1]})
    experiment = FOLLOWS.replace("0.02", "0.05")
    experiment += '[[run]]\ndata = "off.csv"\nwithout = ["periodic_in_time"]\n'
    columns = {"time_s": T, "target_mm": MOVES, "position_mm": MOVES + wave + noise[0]}
    found = sizes(reconciled(tmp_path, experiment, columns))
    assert found["periodic_in_time.P"] == pytest.approx(3.0, rel=0.01)


def test_a_program_of_the_controller_is_a_command(tmp_path):
    t = np.arange(0, 2.0, 0.005)
    program = "UU012500/1\nVEL1 2.0\nACC1 20.0\nMRI1 2.0\nWX1\n"
    inch = np.interp(t, [0.05, 1.05], [0.0, 2.0]) + 2e-4 * RNG(6).standard_normal(len(t))
    experiment = FOLLOWS.replace('command = { column = "target_mm" }\n', "")
    experiment = experiment.replace("[inputs]\n", "").replace("position_mm", "position_in")
    experiment += 'program = "P.CMD"\n'
    (tmp_path / "P.CMD").write_text(program, encoding="utf-8")
    answer = reconciled(tmp_path, experiment, {"time_s": t, "position_in": inch})
    assert answer["gap"]["before_rms"] < 0.2


MOTOR = """\
kind = "axis"
name = "motor"
unit = "rad"
[base]
inertia = { value = 0.002, unit = "kg m2" }
constant = { value = 0.1, unit = "N m/A" }
resistance = { value = 2.0, unit = "ohm" }
supply = { value = 24.0, unit = "V" }
"""
DRIVEN_BY_DUTY = """\
machine = "machine.toml"
[inputs]
duty = { column = "pwm_percent", hold = true }
[[sensor]]
name = "tacho"
quantity = "speed"
column = "speed_rad_s"
noise_rms = 0.3
[[run]]
data = "run.csv"
start = { v = 0 }
"""


def test_a_motor_under_duty_has_dry_friction_in_its_speed(tmp_path):
    duty = np.where(np.sin(0.9 * T) > 0, 20.0, -12.0) + 8 * np.sin(2.7 * T)
    v, speeds, h = 0.0, [], 1e-3
    for share in (duty / 100).tolist():
        speeds.append(v)
        for _ in range(20):
            w = v + h / 0.002 * 0.1 * (24 * share - 0.1 * v) / 2.0
            v = math.copysign(max(abs(w) - h / 0.002 * 0.05, 0.0), w)
    measured = np.array(speeds) + 0.3 * RNG(7).standard_normal(len(T))
    columns = {"time_s": T, "pwm_percent": duty, "speed_rad_s": measured}
    answer = reconciled(tmp_path, DRIVEN_BY_DUTY, columns, MOTOR)
    assert sizes(answer)["dry_friction.Fc"] == pytest.approx(0.05, rel=0.05)
    (effect,) = answer["effects"]
    assert effect["parameters"]["Fc"]["unit"] == "N m"


OVEN = """\
kind = "thermal"
name = "oven"
[nodes]
chamber = "power - U * (T - ambient)"
[base]
capacity = { value = 500, unit = "J/K", free = true, range = [100, 2000] }
U = { value = 1.0, unit = "W/K", free = true, range = [0.1, 10] }
"""
OVEN_WITH_CORE = """\
kind = "thermal"
name = "oven"
[nodes]
chamber = "power - U * (T - ambient) - k * (T - core)"
core = "share * k * (chamber - T)"
[base]
capacity = { value = 500, unit = "J/K", free = true, range = [100, 2000] }
U = { value = 1.0, unit = "W/K", free = true, range = [0.1, 10] }
k = { value = 0.4, unit = "W/K", free = true, range = [0.1, 10] }
share = { value = 2.0, unit = "1" }
"""
HEATED = """\
machine = "machine.toml"
time = "time_min"
[inputs]
power = { column = "heater_W", hold = true }
ambient = { column = "room_C" }
[[sensor]]
name = "chamber"
quantity = "temperature"
column = "chamber_C"
noise_rms = 0.05
zero = 0
[[run]]
data = "run.csv"
start = { chamber = "free" }
"""


def test_an_oven_in_watts_has_a_lag_of_its_sensor(tmp_path):
    minutes = np.arange(0, 60, 0.1)
    power = np.where((minutes % 20) < 12, 60.0, 0.0)
    room = 20 + 2 * np.sin(minutes / 15)
    inside, read, readings = 20.0, 20.0, []
    for watts, air in zip(power.tolist(), room.tolist(), strict=True):
        readings.append(read)
        for _ in range(60):
            inside += 0.1 / 800 * (watts - 1.5 * (inside - air))
            read += 0.1 / 25 * (inside - read)
    measured = np.array(readings) + 0.05 * RNG(8).standard_normal(len(minutes))
    columns = {"time_min": minutes, "heater_W": power, "room_C": room, "chamber_C": measured}
    answer = reconciled(tmp_path, HEATED, columns, OVEN)
    assert sizes(answer)["sensor_lag.tau"] == pytest.approx(25.0, abs=1.5)
    assert answer["base"]["capacity"]["value"] == pytest.approx(800, rel=0.02)
    assert answer["base"]["U"]["value"] == pytest.approx(1.5, rel=0.02)


def closed(text):
    """The experiment file of an oven in a room whose temperature is not measured."""
    return text.replace('ambient = { column = "room_C" }\n', "").replace(
        'start = { chamber = "free" }\n', ""
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("inner", "first_C"), [(False, 21.1), (True, 21.1), (False, 85.0)])
def test_the_noise_of_the_first_reading_is_no_other_surroundings(tmp_path, seed, inner, first_C):
    """Nodes begin as warm as the room; `inner` is a second one, which no sensor reads.

    Some thermometers show 85 C until they have measured.
    """
    minutes = np.arange(0, 60, 0.1)
    power = np.where((minutes % 20) < 12, 60.0, 0.0)
    chamber, core, readings = 21.0, 21.0, []
    for watts in power.tolist():
        readings.append(chamber)
        for _ in range(60):
            flow = 0.4 * (chamber - core) if inner else 0.0
            chamber += 0.1 / 800 * (watts - 1.5 * (chamber - 21.0) - flow)
            core += 0.1 / 400 * flow
    measured = np.array(readings) + 0.05 * RNG(seed).standard_normal(len(minutes))
    measured[0] = first_C
    columns = {"time_min": minutes, "heater_W": power, "chamber_C": measured}
    answer = reconciled(tmp_path, closed(HEATED), columns, OVEN_WITH_CORE if inner else OVEN)
    assert (answer["verdict"], answer["effects"]) == ("none", [])
    assert answer["base"]["start of run.csv, chamber"]["value"] == pytest.approx(21.0, abs=0.03)


def test_a_user_s_period_and_shape_are_searched_for(tmp_path):
    machine = """\
kind = "kinematic"
name = "screw"
unit = "mm"
[[effect]]
name = "bump"
enters = "measurement"
formula = "h * exp(-((x - x0) / w)**2)"
h = { unit = "mm" }
x0 = { unit = "mm", role = "shape", range = [-30, 30] }
w = { unit = "mm", role = "shape", range = [0.5, 10] }
"""
    bump = 0.2 * np.exp(-(((MOVES - 12) / 2.5) ** 2))
    measured = MOVES + bump + 0.02 * RNG(9).standard_normal(len(T))
    experiment = FOLLOWS.replace('"kinematic"', '"machine.toml"')
    columns = {"time_s": T, "target_mm": MOVES, "position_mm": measured}
    found = sizes(reconciled(tmp_path, experiment, columns, machine))
    assert found["bump.x0"] == pytest.approx(12.0, abs=0.2)
    assert found["bump.h"] == pytest.approx(0.2, abs=0.02)


def test_the_sawyer_motor_may_be_called_by_its_kind(tmp_path):
    text = (run_here(tmp_path, "machine", "show", "chow1992", "--json")).stdout
    assert json.loads(text)["name"] == "chow1992"
    (tmp_path / "bad.toml").write_text('kind = "toaster"\nname = "x"\n', encoding="utf-8")
    assert "expected kind: one of" in run_here(tmp_path, "machine", "check", "bad.toml").stderr


PENDULUM = """\
kind = "axis"
name = "pendulum"
unit = "rad"
acceleration = "-w2 * sin(x) - b * v"
[base]
w2 = { value = 30, unit = "1/s2", free = true, range = [10, 60] }
b = { value = 0.02, unit = "1/s", free = true, range = [0, 1] }
"""
SWINGS = """\
machine = "machine.toml"
[[sensor]]
name = "encoder"
quantity = "angle"
column = "angle_rad"
noise_rms = 0.01
zero = 0
"""


@pytest.mark.parametrize("swings_rad", [(1.2,), (1.2, 0.5)])
def test_a_spring_that_a_free_number_nearly_makes_up_for_is_found(tmp_path, swings_rad):
    """Beside a free -w2 sin(x), a spring -k x leaves what a cubic one does, and does as well."""
    t, experiment = np.arange(0, 40, 0.025), SWINGS
    for seed, swing_rad in enumerate(swings_rad, start=5):
        swing = solve_ivp(
            lambda _, s: [s[1], -30 * np.sin(s[0]) - 2 * s[0] - 0.05 * s[1]],
            (0, 40), [swing_rad, 0.0], t_eval=t, rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        measured = swing.y[0] + 0.01 * RNG(seed).standard_normal(len(t))
        columns = {"time_s": t, "angle_rad": measured}
        write(tmp_path / f"swing{seed}.csv", columns)
        experiment += f'[[run]]\ndata = "swing{seed}.csv"\n'
    answer = reconciled(tmp_path, experiment, columns, PENDULUM)
    told = [effect["name"] for effect in answer["effects"]]
    every = {name for names in (told, *answer["alternatives"]) for name in names}
    assert {"stiffness", "cubic_stiffness"} <= every
    assert answer["verdict"] == "ambiguous"


@pytest.mark.parametrize("early_s", [0.04, -0.04])
def test_readings_that_come_early_or_late_are_delayed_either_way(tmp_path, early_s):
    """A log whose command is stamped late shows the axis before its command."""
    place = 30 * np.sin(0.8 * (T + early_s)) * np.sin(2.1 * (T + early_s))
    seen = place + 0.02 * RNG(3).standard_normal(len(T))
    columns = {"time_s": T, "target_mm": MOVES, "position_mm": seen}
    answer = reconciled(tmp_path, FOLLOWS, columns)
    assert [effect["name"] for effect in answer["effects"]] == ["delay"]
    assert sizes(answer)["delay.d"] == pytest.approx(-early_s, rel=0.02)
