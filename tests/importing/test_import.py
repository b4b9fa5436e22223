"""`mopro import` on logs that another generator made, with known relations and traps."""

import json
import tomllib

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import screw_log

RATE_HZ = 100.0


def moves(rng, seconds=30.0, rate_hz=RATE_HZ):
    """A command (mm) of smooth moves between random places, with rests."""
    times = np.arange(0, seconds, 1 / rate_hz)
    knots = np.arange(0, seconds + 2, 2.0)
    places = rng.uniform(0, 50, len(knots))
    phase = np.clip((times % 2.0) - 0.5, 0, 1)
    n = (times // 2).astype(int)
    return times, places[n] + (places[n + 1] - places[n]) * (3 * phase**2 - 2 * phase**3)


def write_csv(path, columns, delimiter=",", empty=""):
    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(empty if c is None else f"{c:.9g}" for c in row) for row in rows]
    path.write_text("\n".join([delimiter.join(columns), *lines]) + "\n")


def imported(mopro, folder, *arguments, name="log.csv"):
    done = mopro("import", name, "--as", "out", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    files = {p.name: tomllib.loads(p.read_text()) for p in (folder / "out").glob("*.toml")}
    return answer, files


@pytest.fixture
def servo(tmp_path):
    """Writes a log of a servo: measured = scale * command(t - delay) + noise."""

    def make(
        scale=1.0, delay_s=0.0, clock_s=0.0, command="target_mm", measured="actual_mm", seed=0
    ):
        rng = np.random.default_rng(seed)
        times, told = moves(rng)
        seen = scale * np.interp(times - delay_s, times, told) + 0.01 * abs(scale) * rng.normal(
            size=len(times)
        )
        write_csv(tmp_path / "log.csv", {"time_s": times + clock_s, command: told, measured: seen})
        return times, told, seen

    return make


def test_a_servo_becomes_a_kinematic_experiment(mopro, tmp_path, servo):
    times, told, seen = servo()
    answer, files = imported(mopro, tmp_path)
    experiment = files["experiment.toml"]
    assert answer["kind"] == files["machine.toml"]["kind"] == "kinematic"
    assert experiment["inputs"]["command"] == {"column": "target_mm", "unit": "mm"}
    (sensor,) = experiment["sensor"]
    assert sensor["quantity"] == "position"
    assert sensor["noise_rms"] == pytest.approx(0.01, rel=0.1)
    assert experiment["run"] == [{"data": "data.csv"}]
    data = np.genfromtxt(tmp_path / "out" / "data.csv", delimiter=",", names=True)
    assert data["time_s"] == pytest.approx(times)
    assert data["target_mm"] == pytest.approx(told)
    assert data["actual_mm"] == pytest.approx(seen)
    assert answer["check"] == []


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        (1000.0, "a unit off by 10^3"),
        (0.1, "a unit off by 10^-1"),
        (5.0, "a factor of 5"),
        (180 / np.pi, "degrees taken for radians"),
        (np.pi / 180, "radians taken for degrees"),
        (1 / 25.4, "inches taken for millimetres"),
        (-1.0, "the sign is opposite"),
        (-10.0, "the sign is opposite and the readings are 10 times the command"),
    ],
)
def test_another_scale_or_sign_is_told(mopro, tmp_path, servo, scale, said):
    servo(scale)
    answer, _ = imported(mopro, tmp_path)
    assert any(said in words for words in answer["check"])


def test_units_that_differ_are_no_scale(mopro, tmp_path, servo):
    servo(1000.0, measured="actual_um")
    assert imported(mopro, tmp_path)[0]["check"] == []


def test_counts_against_a_length_are_scaled_freely(mopro, tmp_path, servo):
    servo(437.0, measured="actual_count")
    answer, files = imported(mopro, tmp_path)
    ratio = files["machine.toml"]["base"]["ratio"]
    assert ratio["value"] == pytest.approx(437.0, rel=0.01)
    assert (ratio["unit"], ratio["free"]) == ("count/mm", True)
    assert any("the scale between them is fitted" in words for words in answer["check"])


@pytest.mark.parametrize("delay_s", [2.5, 0.2, -3.0])
def test_a_delay_of_one_clock_is_told_and_not_removed(mopro, tmp_path, servo, delay_s):
    _, _, seen = servo(delay_s=delay_s)
    answer, _ = imported(mopro, tmp_path)
    (words,) = [w for w in answer["check"] if "the readings come" in w]
    assert f"{abs(delay_s):.4g} ±" in words or f"{abs(delay_s):.2g}" in words
    assert ("after" if delay_s > 0 else "before") in words
    data = np.genfromtxt(tmp_path / "out" / "data.csv", delimiter=",", names=True)
    assert data["actual_mm"] == pytest.approx(seen)


def test_two_clocks_are_aligned_with_an_interval(tmp_path, mopro):
    inside = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        times, told = moves(rng)
        offset = rng.uniform(-8, 8)
        seen_s = np.arange(0, 25, 0.013)
        seen = np.interp(seen_s, times, told) + 0.05 * rng.normal(size=len(seen_s))
        write_csv(tmp_path / "told.csv", {"t_s": times, "cmd_mm": told})
        write_csv(tmp_path / "seen.csv", {"t_ms": 1e3 * (seen_s + 10 + offset), "pos_mm": seen})
        out = f"out{seed}"
        done = mopro("import", "told.csv", "seen.csv", "--as", out, "--json")
        decisions = json.loads(done.stdout)["decisions"]
        (moved,) = [d for d in decisions if d["taken_as"].startswith("shifted by")]
        estimate, _, half = moved["reason"].split("cross-correlation: ")[1].split()[:3]
        assert abs(float(estimate) - 10 - offset) < 0.005
        inside += abs(float(estimate) - 10 - offset) <= float(half)
        assert moved["check"]
        data = np.genfromtxt(tmp_path / out / "data.csv", delimiter=",", names=True)
        both = ~np.isnan(data["pos_mm"])
        assert np.std(data["pos_mm"][both] - data["cmd_mm"][both]) < 0.1
    assert inside >= 8


def test_dates_align_clocks_that_have_them(tmp_path, mopro):
    times, told = moves(np.random.default_rng(0))
    stamps = 1_700_000_000_000_000_000 + np.rint(times * 1e9).astype(np.int64)
    for name, column, start in (("a", "cmd_mm", 0), ("b", "pos_mm", 500)):
        rows = [f"{s},{v:.6f}" for s, v in zip(stamps[start:], told[start:], strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"stamp_ns,{column}", *rows]) + "\n")
    done = mopro("import", "a.csv", "b.csv", "--as", "out", "--json")
    decisions = json.loads(done.stdout)["decisions"]
    assert any("none to be seen" in d["reason"] for d in decisions)
    data = np.genfromtxt(tmp_path / "out" / "data.csv", delimiter=",", names=True)
    assert np.isnan(data["pos_mm"][:500]).all()
    assert data["pos_mm"][600] == pytest.approx(data["cmd_mm"][600])


def test_a_command_on_change_is_held(tmp_path, mopro):
    times = np.arange(0, 20, 0.05)
    told = 10.0 * (times // 4)
    seen = told + 0.01 * np.random.default_rng(0).normal(size=len(times))
    changes = [v if n == 0 or v != told[n - 1] else None for n, v in enumerate(told)]
    write_csv(tmp_path / "log.csv", {"time_s": times, "setpoint_mm": changes, "pos_mm": seen})
    _, files = imported(mopro, tmp_path)
    assert files["experiment.toml"]["inputs"]["command"]["hold"] is True
    data = np.genfromtxt(tmp_path / "out" / "data.csv", delimiter=",", names=True)
    assert data["setpoint_mm"] == pytest.approx(told)


def test_a_heater_becomes_a_thermal_experiment(tmp_path, mopro):
    times = np.arange(0, 900, 1.0)
    duty = 50.0 * (times % 300 < 150)
    warm = 20 + 30 * (1 - np.exp(-times / 150))
    columns = {"time_s": times, "heater1_percent": duty, "T1 (degC)": warm, "T2 (degC)": warm - 5}
    write_csv(tmp_path / "log.csv", columns, delimiter=";")
    answer, files = imported(mopro, tmp_path)
    machine, experiment = files["machine.toml"], files["experiment.toml"]
    assert answer["kind"] == machine["kind"] == "thermal"
    assert machine["nodes"] == {
        "T1": "a_duty * duty - U * (T - ambient)",
        "T2": "-U * (T - ambient)",
    }
    assert experiment["inputs"]["duty"] == {
        "column": "heater1_percent", "unit": "%", "hold": True,
    }  # fmt: skip
    assert [s["name"] for s in experiment["sensor"]] == ["T1", "T2"]
    assert machine["base"]["U"]["free"] is True


def test_a_free_pendulum_swings_at_its_frequency(tmp_path, mopro):
    times = np.arange(0, 30, 0.01)
    angle = 0.3 * np.exp(-times / 10) * np.cos(8.0 * times)
    write_csv(tmp_path / "log.csv", {"time_s": times, "angle_rad": angle})
    _, files = imported(mopro, tmp_path, "--kind", "axis")
    w2 = files["machine.toml"]["base"]["w2"]
    assert w2["range"][0] < 64 < w2["range"][1]
    assert w2["value"] == pytest.approx(64, rel=0.1)


def test_an_axis_under_force_has_its_input(tmp_path, mopro):
    times = np.arange(0, 10, 0.01)
    write_csv(
        tmp_path / "log.csv",
        {"time_s": times, "motor current [mA]": 500 * np.sin(times), "pos_mm": np.cos(times)},
    )
    answer, files = imported(mopro, tmp_path)
    assert answer["kind"] == "axis"
    assert files["experiment.toml"]["inputs"]["current"]["unit"] == "A"
    data = np.genfromtxt(tmp_path / "out" / "data.csv", delimiter=",", names=True)
    assert np.max(data["motor_current_A"]) == pytest.approx(0.5, rel=0.01)


def test_what_cannot_be_decided_is_asked_for(tmp_path, mopro):
    times = np.arange(0, 30, 0.01)
    write_csv(tmp_path / "log.csv", {"time_s": times, "angle_rad": np.cos(times)})
    done = mopro("import", "log.csv", "--as", "out")
    assert done.returncode == 2
    assert "say which it is: --kind axis" in done.stderr
    assert not (tmp_path / "out").exists()


def test_nothing_is_overwritten(tmp_path, mopro, servo):
    servo()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "machine.toml").write_text("mine")
    done = mopro("import", "log.csv", "--as", "out")
    assert done.returncode == 2
    assert "machine.toml exists, and nothing is overwritten" in done.stderr
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["machine.toml"]
    assert (tmp_path / "out" / "machine.toml").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["absent.csv"], "absent.csv: cannot be read"),
        (["log.csv", "--command", "speed"], "there is no column speed of numbers"),
        (["log.csv", "--kind", "thermal"], "no column is a measurement for a machine of kind"),
    ],
)
def test_wrong_use_exits_with_2(tmp_path, mopro, servo, arguments, said):
    servo()
    done = mopro("import", *arguments, "--as", "out")
    assert done.returncode == 2
    assert said in done.stderr


def test_names_that_would_break_the_files_do_not(tmp_path, mopro):
    times, told = moves(np.random.default_rng(0))
    name = "pos'] = 1\\\"; [mm]"
    columns = {"time_s": times, "target [mm]": told, f'"{name}"'.replace('\\"', '""'): told + 0.01}
    write_csv(tmp_path / "log.csv", columns)
    _, files = imported(mopro, tmp_path)
    assert files["experiment.toml"]["sensor"][0]["column"] == "pos_1_mm"


def test_an_import_for_the_drive_of_1992_runs(tmp_path, mopro):
    """The logged command of a straight move, read by an encoder: no disagreement."""
    times = np.arange(0, 2, 0.001)
    told = 25.4 * (3 * np.clip(times - 0.3, 0, 1) ** 2 - 2 * np.clip(times - 0.3, 0, 1) ** 3)
    seen = told + 0.05 * np.random.default_rng(0).normal(size=len(times))
    write_csv(tmp_path / "log.csv", {"t [s]": times, "cmd [mm]": told, "laser pos [mm]": seen})
    imported(mopro, tmp_path, "--kind", "sawyer")
    done = mopro("compare", "out/experiment.toml", "--json")
    assert done.returncode in (0, 1), done.stderr
    (series,) = json.loads(done.stdout)["series"]
    assert series["rms"] < 0.1


def test_a_real_process_says_what_it_decided(tmp_path, mopro_process, servo):
    servo()
    done = mopro_process("import", "log.csv", "--as", "out")
    assert done.returncode == 0
    assert "column target_mm: command (position in mm; its name says" in done.stdout
    assert "next: mopro compare out" in done.stdout


def swing(times):
    return {"angle_rad": 0.3 * np.exp(-times / 5) * np.cos(8.0 * times)}


def pushed(times):
    force = np.sign(np.sin(times))
    speed = np.cumsum(force) * (times[1] - times[0])
    return {"force_N": force, "pos_m": np.cumsum(speed) * (times[1] - times[0])}


def motor(times):
    force, place = pushed(times).values()
    return {"pwm_percent": 50 * force, "shaft angle_deg": 20 * place}


def heated(times):
    return {
        "heater1_percent": np.full(len(times), 50.0),
        "T (degC)": 20 + 30 * (1 - np.exp(-times / 4)),
    }


def tracked(times):
    return {"target_deg": 10 * np.sin(times), "actual_deg": 10 * np.sin(times - 0.1)}


@pytest.mark.parametrize(
    ("columns", "arguments"),
    [(swing, ["--kind", "axis"]), (pushed, []), (motor, []), (heated, []), (tracked, [])],
)
def test_what_is_written_can_be_compared(tmp_path, mopro, columns, arguments):
    times = np.arange(0, 12, 0.02)
    noisy = {
        name: values + (1e-3 * np.random.default_rng(0).normal(size=len(times)))
        for name, values in columns(times).items()
    }
    write_csv(tmp_path / "log.csv", {"time_s": times, **noisy})
    imported(mopro, tmp_path, *arguments)
    assert mopro("machine", "check", "out/machine.toml").returncode == 0
    done = mopro("compare", "out/experiment.toml", "--json")
    assert done.returncode in (0, 1), done.stderr
    assert json.loads(done.stdout)["series"]


def test_a_set_point_that_is_logged_on_changes_holds_through_the_rests(tmp_path):
    """Most of its rows have a value: only its rests are blank."""
    text = screw_log([3.0, -2.0, 4.0], 8.0, 0.8, ripple=0.0, scale=1.0)
    (tmp_path / "screw.csv").write_text(text, "utf-8")
    done = run_here(tmp_path, "import", "screw.csv", "--as", "screw")
    assert "moves: 3 (changes of Sollwert)" in done.stdout
    experiment = (tmp_path / "screw" / "experiment.toml").read_text("utf-8")
    assert 'command = { column = "Sollwert_mm", unit = "mm", hold = true }' in experiment
    options = ("--only", "backlash", "--json")
    answer = json.loads(run_here(tmp_path, "reconcile", "screw/experiment.toml", *options).stdout)
    (effect,) = answer["effects"]
    assert effect["parameters"]["w"]["value"] == pytest.approx(0.06, abs=0.003)


def test_readings_that_were_lost_do_not_make_an_input_hold(tmp_path):
    rng = np.random.default_rng(1)
    rows = ["time_s,force_N,position_mm"]
    for n in range(200):
        force = "" if n % 23 == 5 else f"{rng.normal():.4f}"
        rows.append(f"{n / 50},{force},{rng.normal():.4f}")
    (tmp_path / "log.csv").write_text("\n".join(rows), "utf-8")
    done = run_here(tmp_path, "import", "log.csv", "--as", "there")
    assert done.returncode == 0, done.stderr
    assert "hold" not in (tmp_path / "there" / "experiment.toml").read_text("utf-8")


# -- what the user states -------------------------------------------------------------------


def scope(folder, names=("CH1", "CH2")):
    """A command and a reading as an oscilloscope writes them: no units."""
    times, told = moves(np.random.default_rng(0), seconds=12.0)
    seen = told + 0.01 * np.random.default_rng(1).normal(size=len(times))
    write_csv(folder / "log.csv", dict(zip(("time_s", *names), (times, told, seen), strict=True)))


STATED = ("--command", "CH1", "--measured", "CH2")


def test_units_that_the_user_states_are_those_of_the_columns(tmp_path, mopro):
    scope(tmp_path)
    units = ("--unit", "CH1=mm", "--unit", "CH2=µm")
    answer, files = imported(mopro, tmp_path, *STATED, *units)
    assert (answer["kind"], answer["command"], answer["sensors"]) == ("kinematic", "CH1", ["CH2"])
    assert files["experiment.toml"]["inputs"]["command"]["unit"] == "mm"
    assert files["experiment.toml"]["sensor"][0]["unit"] == "um"


def test_a_stated_unit_takes_the_place_of_the_heading_s(tmp_path, mopro):
    scope(tmp_path, ("target_mm", "pos_mm"))
    _, files = imported(mopro, tmp_path, "--unit", "target_mm=in", "--unit", "pos_mm=in")
    assert files["experiment.toml"]["sensor"][0]["unit"] == "in"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "state its unit, such as --measured CH1 --unit CH1=mm"),
        (STATED, "CH1 is used as stated with --command, and its unit is not stated: state it, "
                 "such as --unit CH1=mm"),
        ((*STATED, "--unit", "CH1=mm"), "such as --unit CH2=mm"),
        ((*STATED, "--unit", "CH1=furlong"), "'furlong' is no unit; known are "),
        ((*STATED, "--unit", "CH3=mm"), "there is no column CH3 of numbers; there are CH1, CH2"),
        ((*STATED, "--unit", "CH1"), "expected COLUMN=UNIT, such as pos=mm, found CH1"),
        ((*STATED, "--unit", "CH1=mm", "--unit", "CH2="), "'' is no unit"),
    ],
)  # fmt: skip
def test_what_is_not_stated_is_asked_for_with_the_words_to_type(tmp_path, mopro, arguments, said):
    scope(tmp_path)
    done = mopro("import", "log.csv", "--as", "out", *arguments)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_stated_command_and_reading_in_volts_are_places(tmp_path, mopro):
    scope(tmp_path, ("CH1 (V)", "CH2 (V)"))
    stated = ("--command", "CH1 (V)", "--measured", "CH2 (V)")
    answer, files = imported(mopro, tmp_path, *stated)
    assert answer["kind"] == "kinematic"
    assert files["machine.toml"]["unit"] == "V"
    assert mopro("compare", "out/experiment.toml").returncode in (0, 1)


@pytest.mark.parametrize(
    "heading", ["heater_W", "power_mW", "P_W", "P [kW]", "heater power (watts)"]
)
def test_a_power_warms_a_capacity_and_is_lost(tmp_path, mopro, heading):
    times = np.arange(0, 900, 1.0)
    power = 5.0 * (times % 300 < 150)
    warm = np.zeros(len(times))
    for n in range(1, len(times)):
        warm[n] = warm[n - 1] + (power[n - 1] - 0.1 * warm[n - 1]) / 20.0
    size = {"power_mW": 1e3, "P [kW]": 1e-3}.get(heading, 1.0)
    noise = 0.01 * np.random.default_rng(0).normal(size=len(times))
    write_csv(tmp_path / "log.csv", {"time_s": times, heading: size * power,
                                     "T_C": 20 + warm + noise})  # fmt: skip
    _, files = imported(mopro, tmp_path)
    machine = files["machine.toml"]
    assert machine["nodes"] == {"T_column": "power - loss * (T - ambient)"}
    base = machine["base"]
    assert {name: own["unit"] for name, own in base.items()} == {"capacity": "J/K", "loss": "W/K"}
    assert base["capacity"]["value"] == pytest.approx(20.0, rel=0.1)
    assert base["loss"]["value"] == pytest.approx(0.1, rel=0.1)


def test_every_column_that_is_not_used_is_told_with_why(tmp_path, mopro, servo):
    times, told, seen = servo()
    others = {
        "flow": told, "gear": 0 * told + 3, "speed_count": told, "head_deg": told, "motor_A": told,
    }  # fmt: skip
    columns = {"time_s": times, "target_mm": told, "actual_mm": seen, **others}
    write_csv(tmp_path / "log.csv", columns)
    answer, _ = imported(mopro, tmp_path)
    assert answer["unused"].keys() == {*others}
    assert "state it with --unit flow=UNIT" in answer["unused"]["flow"]
    assert "it is 3 throughout" in answer["unused"]["gear"]
    assert "no unit of that" in answer["unused"]["speed_count"]
    assert "of another axis than actual_mm" in answer["unused"]["head_deg"]
    assert "it could be an input" in answer["unused"]["motor_A"]
    (tmp_path / "again").mkdir()
    said = mopro("import", "log.csv", "--as", "again").stdout
    assert all(f"column {name}: not used (" in said for name in others)


@pytest.mark.parametrize(
    ("heading", "quantity", "unit"),
    [
        ("torque_nm", "torque", "N m"),
        ("stage [nm]", "position", "nm"),
        ("motor_Nm", "torque", "N m"),
    ],
)
def test_nm_are_nanometres_unless_the_name_is_that_of_a_torque(heading, quantity, unit):
    from mopro.instruments.quantity import unit_of_column
    from mopro.logs.column_names import heading as taken
    from mopro.logs.column_names import quantity_of

    found = taken(heading)
    assert quantity_of(found.name, found.unit) == quantity
    assert unit_of_column(found.unit) == unit


# -- slips that are told ----------------------------------------------------------------------


@pytest.mark.parametrize("scale", [2.0, 0.5, 4.0, 0.25])
def test_twice_and_four_times_are_told_by_import_and_compare(mopro, tmp_path, servo, scale):
    servo(scale)
    answer, _ = imported(mopro, tmp_path)
    size = {2.0: "2", 0.5: "1/2", 4.0: "4", 0.25: "1/4"}[scale]
    assert any(f"a factor of {size}, such as" in words for words in answer["check"])
    done = mopro("compare", "out/experiment.toml")
    assert f"a factor of {size}, such as" in done.stdout + done.stderr


def test_the_step_of_rounded_readings_is_written_and_asked_for(mopro, tmp_path, servo):
    times, told, seen = servo()
    rounded = 0.05 * np.rint(seen / 0.05)
    columns = {"time_s": times, "target_mm": told, "actual_mm": rounded}
    write_csv(tmp_path / "log.csv", columns)
    _, files = imported(mopro, tmp_path)
    assert files["experiment.toml"]["sensor"][0]["adc_step"] == pytest.approx(0.05)
    file = tmp_path / "out" / "experiment.toml"
    lines = [x for x in file.read_text("utf-8").splitlines() if not x.startswith("adc_step")]
    text = "\n".join("noise_rms = 0.01" if x.startswith("noise_rms") else x for x in lines)
    file.write_text(text, "utf-8")
    done = mopro("compare", "out/experiment.toml")
    assert "every reading is a multiple of 0.05 mm: state adc_step = 0.05" in done.stderr


def test_the_noise_is_not_that_of_a_stuck_sensor(mopro, tmp_path):
    times = np.arange(0, 30, 0.01)
    told = 10 * np.sin(times / 3) * (times > 10)
    seen = told + 0.02 * np.random.default_rng(0).normal(size=len(times))
    seen[(times > 15) & (times < 22)] = seen[1500]
    write_csv(tmp_path / "log.csv", {"time_s": times, "target_mm": told, "actual_mm": seen})
    _, files = imported(mopro, tmp_path)
    noise = files["experiment.toml"]["sensor"][0]["noise_rms"]
    assert noise == pytest.approx(0.02, rel=0.15)


# -- command and readings in two files --------------------------------------------------------


@pytest.mark.parametrize("one_clock", [True, False])
def test_columns_of_one_name_in_two_files_are_told_apart_by_their_files(tmp_path, mopro, one_clock):
    """As robots log: lists in cells, the same headings in the file of commands and of states.

    The stamps of both are one clock's: a lag of the machine stays in the data.
    """
    times, told = moves(np.random.default_rng(0), seconds=12.0)
    times = np.round(times + 1e-4 * np.random.default_rng(2).uniform(size=len(times)), 7)
    lag = 20 if one_clock else 0
    seen = np.concatenate((np.full(lag, told[0]), told))[
        : len(told)
    ] + 0.01 * np.random.default_rng(1).normal(size=len(times))
    for name, values, start in (("m.control", told, 0), ("m.state", seen, 0 if one_clock else 3)):
        stamps = 1e6 * times + start
        rows = [f'X,{t:.1f},"[{v:.6f}, 0.5]"' for t, v in zip(stamps, values, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["type,timestamp,positions", *rows]))
    files = ("m.control.csv", "m.state.csv", "--time-unit", "us")
    refused = mopro("import", *files, "--as", "out", "--command", "positions[0]")
    assert "there are m.control:positions[0], m.control:positions[1], m.state:" in refused.stderr
    one, other = "m.control:positions[0]", "m.state:positions[0]"
    stated = ("--command", one, "--measured", other, "--unit", f"{one}=rad", "--unit",
              f"{other}=rad")  # fmt: skip
    done = mopro("import", *files, "--as", "out", *stated, "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert (answer["kind"], answer["command"], answer["sensors"]) == ("kinematic", one, [other])
    told = [d for d in answer["decisions"] if d["subject"].startswith("clock timestamp of")]
    assert [d["taken_as"] for d in told] == ["not shifted"]
    assert ("no two clocks have the same jitter" in told[0]["reason"]) == one_clock
    done = mopro("compare", "out/experiment.toml", "--json")
    rms = json.loads(done.stdout)["series"][0]["rms"]
    assert rms > 1.0 if one_clock else rms == pytest.approx(0.01, rel=0.1)


def test_a_command_is_not_offered_as_what_is_measured(tmp_path, mopro):
    scope(tmp_path, ("command", "position"))
    done = mopro("import", "log.csv", "--as", "out")
    assert "such as --measured position --unit position=mm" in done.stderr
