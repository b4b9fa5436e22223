"""Places of disagreement between data and simulation: the right one, or none."""

import json
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.laboratory import LASER
from helpers.laboratory import PROGRAMS as PROGRAMS_OF_LAB
from helpers.paths import PROGRAMS
from mopro.engine.residuals.noise_tests import whiteness_p
from mopro.errors import DataError
from mopro.experiment import load_experiment
from mopro.experiment.comparison import compare
from mopro.experiment.sawyer import system
from mopro.experiment.sawyer.nominal import predict
from mopro.experiment.sawyer.system import Sawyer
from mopro.experiment.scaled_residuals import quantile_residual
from mopro.instruments import Thermocouple, read_lvdt, write_thermocouple
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.plant import simulate
from mopro.program.compile import compile_file
from mopro.recording import Header, open_sink
from mopro.thesis import table
from mopro.thesis.printed import THERMAL

# Beyond the ends of its range the transducer of `mopro measure` bends by 0.25 %.
BENT = {"sensor_nonlinearity": {"c3": 2.5e-3, "mid": 7.5 * 0.0254}}


def compared(lab):
    return compare(Sawyer(lab.load()))


def machine_with(lab, **effects):
    """A machine file with these effects switched on."""
    from importlib.resources import files

    text = (files("mopro.machine") / "machines" / "chow1992.toml").read_text()
    for name, values in effects.items():
        text += f"\n[effects.{name}]\n" + "".join(f"{k} = {v}\n" for k, v in values.items())
    lab.write("mine.toml", text)
    return "mine.toml"


def test_a_nominal_machine_does_not_disagree(lab):
    lab.two_runs()
    found = compared(lab)
    assert found.verdict == "no disagreement"
    assert {s.white for s in found.series} == {True}
    assert not any(place.significant for place in found.where)
    phases = {place.phase for place in found.where}
    assert phases == {"accelerate", "cruise", "decelerate", "settle", "dwell"}
    for series in found.series:
        assert series.sigma == pytest.approx(1, abs=0.06)
    assert sum(place.count for place in found.where) == sum(s.count for s in found.series)


def test_nothing_hidden_is_nothing_found_whatever_the_seed(lab, monkeypatch):
    """Over 2 runs of 40 seeds; a false alarm is meant to come once in a thousand."""
    lab.two_runs()
    experiment = lab.load()
    predicted = predict(experiment)
    monkeypatch.setattr(system, "predict", lambda _: predicted)
    alarms = 0
    for seed in range(40):
        generator = np.random.default_rng([seed, 7])
        trials = tuple(
            replaced(trial, [p + generator.normal(0, 2e-5, len(p)) for p in of_trial])
            for trial, of_trial in zip(experiment.trials, predicted, strict=True)
        )
        again = replace(experiment, trials=trials)
        alarms += compare(Sawyer(again), seed).verdict != "no disagreement"
    assert alarms == 0


def replaced(trial, values):
    readings = tuple(
        replace(reading, values=v) for reading, v in zip(trial.readings, values, strict=True)
    )
    return replace(trial, readings=readings)


def test_a_hidden_drag_is_located_in_the_cruise_of_the_fast_run(lab):
    lab.two_runs({"viscous_drag": {"b": 20.0}})
    found = compared(lab)
    assert found.verdict == "disagreement"
    worst = found.where[0]
    assert (worst.run, worst.phase, worst.axis, worst.unit) == ("fast.csv", "cruise", 1, "in")
    assert worst.line in (4, 7)
    # b v over the tooth's stiffness, 15 in/s.
    lag_in = 20.0 * 15 * 0.0254 / (2 * np.pi / 1.016e-3 * 111.2) / 0.0254
    assert abs(worst.mean) == pytest.approx(lag_in, rel=0.05)
    assert worst.sigma == pytest.approx(worst.rms / 2e-5)
    ways = {p.line: np.sign(p.mean) for p in found.where if p.phase == "cruise" and p.run[0] == "f"}
    assert ways == {4: -1, 7: 1}


def test_pitches_lost_in_one_move_are_located_at_its_line(lab):
    lab.two_runs({"lost_steps": {"n": 1.0, "move": 2.0, "at": 0.2}})
    found = compared(lab)
    bad = {(p.run, p.line) for p in found.where if p.sigma > 100 and p.phase == "settle"}
    assert bad == {("fast.csv", 7), ("slow.csv", 7)}


def test_two_sensors_in_one_file_and_one_of_them_lacking_in_another(lab):
    other = LASER.replace('"laser"', '"second"').replace("_1_", "_2_").replace("s = 1", "s = 2")
    both = [
        Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 2e-5),
        Sensor("second", POSITION, "position_2_in", 2000.0, 2, 2e-5),
    ]
    lab.record("fast.CMD", "fast.csv", sensors=both)
    lab.record("slow.CMD", "slow.csv")
    runs = [f'program = "{name}.CMD"\ndata = "{name}.csv"' for name in ("fast", "slow")]
    lab.experiment(runs, LASER + other)
    experiment = lab.load()
    assert [len(trial.readings) for trial in experiment.trials] == [2, 1]
    assert "slow.csv: has no column position_2_in of sensor second" in experiment.notes[0]
    found = compare(Sawyer(experiment))
    assert found.verdict == "no disagreement"
    assert [(s.run, s.sensor) for s in found.series] == [
        ("fast.csv", "laser"), ("fast.csv", "second"), ("slow.csv", "laser"),
    ]  # fmt: skip


def test_a_logged_command_serves_as_the_program_it_was_logged_from(lab):
    lab.record("fast.CMD", "fast.csv")
    recording = mopro.emulate(mopro.compile(lab.path("fast.CMD").read_text()), resolved=False)
    lab.csv("log.csv", {
        "time_s": recording["time_s"], "position_1_mm": 1000 * recording["command_1_m"],
    })  # fmt: skip
    lab.experiment(['command = "log.csv"\ndata = "fast.csv"'])
    found = compared(lab)
    assert found.verdict == "no disagreement"
    assert {place.line for place in found.where} == {0}
    assert {place.direction for place in found.where} == {1, -1}


def test_a_recording_of_mopro_serves_as_data(lab):
    lab.program("fast.CMD")
    recording = mopro.emulate(mopro.compile(lab.path("fast.CMD").read_text()))
    noisy = recording["position_1_m"] + np.random.default_rng(3).normal(0, 5e-7, len(recording))
    header = Header(**recording.header.as_json())
    for suffix in ("parquet", "csv"):
        with open_sink(lab.path(f"run.{suffix}"), header) as sink:
            sink.write({**recording.columns, "position_1_m": noisy})
        sensor = LASER.replace("_in", "_m").replace("2e-5", "5e-7")
        lab.experiment([f'program = "fast.CMD"\ndata = "run.{suffix}"'], sensor)
        assert compared(lab).verdict == "no disagreement"


def test_a_slow_sensor_beside_a_fast_one_leaves_cells_empty(lab):
    """A temperature ten times a second among positions two thousand times a second."""
    warm = Sensor("warm", TEMPERATURE, "temperature_C", 2000.0, noise_rms=0.01)
    laser = Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 2e-5)
    lab.record("fast.CMD", "fast.csv", sensors=[laser, warm])
    header, *rows = lab.path("fast.csv").read_text().splitlines()
    rows = [row if n % 200 == 0 else f"{row.rsplit(',', 1)[0]}," for n, row in enumerate(rows)]
    lab.write("fast.csv", "\n".join([header, *rows]) + "\n")
    slow = '[[sensor]]\nname = "warm"\nquantity = "temperature"\ncolumn = "temperature_C"\n'
    lab.experiment(
        ['program = "fast.CMD"\ndata = "fast.csv"'],
        f"{LASER}{slow}rate_hz = 10.0\nnoise_rms = 0.01\n",
    )
    experiment = lab.load()
    assert experiment.notes == ()
    assert [len(r.values) for r in experiment.trials[0].readings] == [len(rows), 13]
    found = compare(Sawyer(experiment))
    assert found.verdict == "no disagreement"
    assert found.series[1].unit == "C"


@pytest.mark.parametrize("resolved", [True, False])
def test_a_drive_with_or_without_microsteps_is_the_same_machine(lab, resolved):
    """A sensor of 0.1 µm sees the microsteps; which drive it was is no disagreement."""
    recording = mopro.emulate(mopro.compile(PROGRAMS_OF_LAB["slow.CMD"]), resolved=resolved)
    lab.program("slow.CMD")
    noise = np.random.default_rng(2).normal(0, 4e-6, len(recording))
    position = recording["position_1_m"] / 0.0254 + noise
    lab.csv("slow.csv", {"time_s": recording["time_s"], "position_1_in": position})
    lab.experiment(['program = "slow.CMD"\ndata = "slow.csv"'], LASER.replace("2e-5", "4e-6"))
    assert compared(lab).verdict == "no disagreement"


def test_a_stated_payload_is_simulated(lab):
    lab.record("fast.CMD", "fast.csv", payload_kg=5 * 0.45359237)
    lab.experiment(['program = "fast.CMD"\ndata = "fast.csv"\npayload = "5lb"'])
    assert compared(lab).verdict == "no disagreement"
    lab.experiment(['program = "fast.CMD"\ndata = "fast.csv"\npayload = "4lb"'])
    found = compared(lab)
    assert found.verdict == "disagreement"
    # It rings at another frequency: all phases but the rest show it.
    assert found.where[0].phase != "dwell"
    assert found.where[-1].phase == "dwell"


# -- the thesis' own instruments --------------------------------------------------------


@pytest.fixture
def lvdt(lab, mopro):
    """LVDT1 and LVDT3 as `mopro measure` stores them."""
    for name, seed in (("LVDT1", 1), ("LVDT3", 3)):
        shutil.copy(PROGRAMS / f"{name}.CMD", lab.folder)
        done = mopro("measure", f"{name}.CMD", "--out", f"{name}.DAT", "--seed", seed)
        assert (done.returncode, done.stderr) == (0, "")
    return lab


def test_raw_files_of_the_lvdt_are_read_back(lvdt):
    lvdt.experiment(
        [f'program = "{n}.CMD"\ndata = "{n}.DAT"' for n in ("LVDT1", "LVDT3")],
        '[[sensor]]\nkind = "lvdt"\n',
        machine_with(lvdt, **BENT),
    )
    experiment = lvdt.load()
    reading = experiment.trials[0].readings[0]
    assert reading.values == pytest.approx(read_lvdt(lvdt.path("LVDT1.DAT")))
    assert reading.time_s[-1] == pytest.approx(959 / 800)
    assert reading.sensor.noise_rms == pytest.approx(0.025)
    assert reading.sensor.adc_step == pytest.approx(4.883e-3, abs=5e-7)
    found = compare(Sawyer(experiment))
    assert found.verdict == "no disagreement"


def test_the_bend_of_a_real_lvdt_is_a_disagreement_of_a_straight_one(lvdt, mopro):
    straight = '[[sensor]]\nkind = "lvdt"\nlinearity = 0\n'
    lvdt.experiment(['program = "LVDT3.CMD"\ndata = "LVDT3.DAT"'], straight)
    done = mopro("compare", "e.toml", "--json")
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert (answer["verdict"], answer["machine"]) == ("disagreement", "chow1992")
    assert answer["where"][0]["phase"] in ("accelerate", "settle", "dwell")
    assert {"run", "line", "phase", "axis", "rms", "sigma"} <= answer["where"][0].keys()


def test_the_defaults_of_an_instrument_can_be_stated_otherwise(lvdt):
    lvdt.experiment(
        ['program = "LVDT3.CMD"\ndata = "LVDT3.DAT"\nsensor = "core"'],
        '[[sensor]]\nkind = "lvdt"\nname = "core"\ncolumn = "position_1_mm"\nadc_step = 0\n'
        '[[sensor]]\nkind = "lvdt"\nname = "other"\n',
    )
    reading = lvdt.load().trials[0].readings[0]
    assert (reading.sensor.name, reading.sensor.adc_step) == ("core", 0.0)
    assert reading.sensor.noise_rms == pytest.approx(0.635)
    assert np.ptp(reading.values) == pytest.approx(15 * 25.4, rel=0.02)


# -- heat ---------------------------------------------------------------------------------

THERMOCOUPLE = '[[sensor]]\nkind = "thermocouple"\n'


@pytest.fixture
def hot(lab):
    """An hour of TEMP1 as the thermocouple's file would have it."""
    shutil.copy(PROGRAMS / "TEMP1.CMD", lab.folder)
    machine, chain = load_machine("chow1992"), Thermocouple()
    schedule = plan(compile_file(PROGRAMS / "TEMP1.CMD"), for_s=3600.0)
    times = chain.times_s(3600.0)
    stored = chain.stored_C(simulate(schedule, machine).temperature_C(times))
    write_thermocouple(lab.path("T.DAT"), stored, times)
    return lab


def test_what_mopro_measure_stores_of_the_heat_agrees(lab, mopro):
    shutil.copy(PROGRAMS / "TEMP2.CMD", lab.folder)
    done = mopro(
        "measure", "TEMP2.CMD", "--instrument", "thermocouple", "--for", "3min", "--out", "T.DAT"
    )
    assert done.returncode == 0, done.stderr
    lab.experiment(['program = "TEMP2.CMD"\ndata = "T.DAT"'], THERMOCOUPLE)
    assert compared(lab).verdict == "no disagreement"


def test_an_hour_of_heat_needs_no_equation_of_motion(hot):
    hot.experiment(['program = "TEMP1.CMD"\ndata = "T.DAT"'], THERMOCOUPLE)
    begun = time.process_time()
    experiment = hot.load()
    found = compare(Sawyer(experiment))
    assert time.process_time() - begun < 5
    (trial,) = experiment.trials
    assert trial.duration_s == pytest.approx(3600, abs=15)
    assert found.verdict == "no disagreement"
    assert {place.axis for place in found.where} == {None}


def test_missing_heat_is_seen(hot):
    machine = machine_with(hot, speed_dependent_heat={"kh": 0.05})
    hot.experiment(['program = "TEMP1.CMD"\ndata = "T.DAT"'], THERMOCOUPLE, machine)
    found = compared(hot)
    assert found.verdict == "disagreement"
    assert found.series[0].unit == "C"


TABLE = """velocity_in_s,acceleration_in_s2,x_in,y_in,temperature_rise_C
0,0,0,0,{}
15,200,16,0,{}
24,200,8,8,{}
"""


def test_a_steady_table_is_held_against_the_heat_balance(lab):
    text = TABLE.splitlines()[0] + "\n"
    for row, test in zip(table("3.2"), THERMAL, strict=True):
        text += f"{test.velocity},200,{test.x},{test.y},{row.computed}\n"
    lab.write("table.csv", text)
    lab.experiment(['table = "table.csv"'], THERMOCOUPLE)
    found = compared(lab)
    assert found.verdict == "no disagreement"
    assert found.series[0].rms < 1e-6
    assert sorted(place.line for place in found.where) == list(range(1, 9))


def test_a_table_without_known_noise_is_not_judged(lab):
    lab.write("table.csv", TABLE.format(80, 70, 60))
    lab.experiment(['table = "table.csv"'])
    assert lab.load().tables[0].noise_K is None
    found = compared(lab)
    assert found.verdict == "not judged"
    assert found.series[0].white is None
    assert found.where[0].rms > 1


def test_differences_of_temperatures_are_printed_in_kelvin(lab, mopro):
    lab.write("table.csv", TABLE.format(80, 70, 60))
    lab.experiment(['table = "table.csv"'], THERMOCOUPLE)
    printed = mopro("compare", "e.toml").stdout
    rows = [line for line in printed.splitlines() if line.startswith("table.csv")]
    assert rows
    assert all(" K " in row and " C " not in row for row in rows)


def test_a_negative_rise_is_named(lab):
    lab.write("table.csv", TABLE.format(80, -70, 60))
    lab.experiment(['table = "table.csv"'])
    with pytest.raises(DataError, match=r"table\.csv:3:13: expected temperature_rise_C: at"):
        load_experiment(lab.path("e.toml"))


# -- the statistics -----------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.5, 3.0])
def test_a_coarse_converter_leaves_white_noise(noise):
    """A slow signal repeats its rounding; the quantile residual does not."""
    sensor = Sensor("t", TEMPERATURE, "temperature_C", 1.0, noise_rms=noise, adc_step=1.0)
    generator = np.random.default_rng(11)
    alarms, sizes = 0, []
    for phase in range(50):
        true = phase / 50 + 20 * np.sin(np.arange(2000) / 3000)
        seen = np.rint(true + generator.normal(0.0, noise or 1e-12, 2000))
        z = quantile_residual(seen, true, sensor, generator)
        alarms += whiteness_p(z) < 0.01
        sizes.append(z.var())
    assert alarms <= 3
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.15)


# -- the command ---------------------------------------------------------------------------


def test_the_command_says_that_nothing_disagrees(lab, mopro):
    lab.two_runs()
    done = mopro("compare", "e.toml")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.rstrip().endswith("no disagreement")


def test_the_command_has_the_worst_places_first_and_exits_with_1(lab, mopro):
    lab.two_runs({"viscous_drag": {"b": 20.0}})
    done = mopro("compare", "e.toml")
    assert done.returncode == 1
    assert "disagreement in " in done.stdout
    rows = [line.split() for line in done.stdout.splitlines() if "cruise" in line]
    assert rows[0][0] == "fast.csv"


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda rows: ["time_s,position_1_mm", *rows[1:]], "[mixed-units]"),
        (lambda rows: [rows[0], rows[2], rows[1], *rows[3:]], "the clock runs backwards"),
        (lambda rows: rows[:1000], "fast.CMD takes 1.21667 s"),
        (lambda rows: [*rows[:9], "x,y", *rows[10:]], "fast.csv:10:1: 'x' is no number"),
    ],
)
def test_the_command_refuses_bad_data_without_a_traceback(lab, mopro, spoil, message):
    lab.two_runs()
    rows = lab.path("fast.csv").read_text().splitlines()
    lab.write("fast.csv", "\n".join(spoil(rows)) + "\n")
    done = mopro("compare", "e.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_seed_below_0_is_refused(mopro):
    done = mopro("compare", "experiment.toml", "--seed", "-1")
    assert done.returncode == 2
    assert "--seed" in done.stderr
    assert "Traceback" not in done.stderr
