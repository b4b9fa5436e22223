"""Effects of a run's own time in the motor's machine files: they stay with their runs."""

import json
import shutil
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.laboratory import LASER, Lab
from mopro.emulator import Emulator, emulate
from mopro.engine.residuals import NOTHING_LEFT
from mopro.engine.verdict import Estimate, Gap, Named, Verdict
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.repaired import machine_text
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.program.compile import compile as compile_text

WARM = """
[[sensor]]
name = "warm"
quantity = "temperature"
column = "temperature_C"
rate_hz = 20.0
noise_rms = 0.01
"""
SENSORS = [
    Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 2e-5),
    Sensor("warm", TEMPERATURE, "temperature_C", 20.0, None, 0.01),
]
OWN = '\n[[effect]]\nname = "mine"\nenters = "{}"\nformula = "{}"\nq = {{ unit = {} }}\n'
EXTENDED = 'extends = "chow1992"\n'
SHORT = "UU012500/1\nVEL1 {}\nACC1 0.2\nMRI1 1.0\nWX1\nWT200\n"
# What belongs to runs: the name, its values in settings of two runs, and the machine's own text.
OF_TIME = {
    "a drift of the air": ("ambient_drift", {"r": 0.05}, ""),
    "a hum": ("hum", {"A": 1e-4, "f": 60.0, "phi_1": 0.4, "phi_2": -1.9}, ""),
    "two lines": ("hum", {"A": 1e-4, "f": 50.0, "phi_1": 0.4, "phi_2": 2.0, "A3": 5e-5,
                          "phi3_1": -0.3, "phi3_2": 1.0}, ""),
    "of the user": ("mine", {"q": 3e-4}, OWN.format("measurement", "q * t", '"m/s"')),
    "a command": ("mine", {"q": 3e-4}, OWN.format("command", "q * sqrt(t)", '["m", "1/s0.5"]')),
    "a wave": ("mine", {"q": 1e-4}, OWN.format("measurement", "q * sin(40 * t / 1)", '"m"')
               .replace("40 * t / 1", "t / P") + 'P = { unit = "s", role = "shape", range = [0.01, '
               "1.0], start = 0.1 }\n"),
}  # fmt: skip


def laboratory(folder, *files, machine=EXTENDED, seed=1, effects=None):
    """An experiment of short moves, with these data files: a laser and a thermometer."""
    folder.mkdir(exist_ok=True)
    lab, rng = Lab(folder), np.random.default_rng(seed)
    for file in files:
        program = lab.program(f"{file.replace('/', '_')}.CMD", SHORT.format(rng.integers(5, 15)))
        lab.path(file).parent.mkdir(exist_ok=True)
        lab.record(program, file, effects, SENSORS[:1])
        rows = np.loadtxt(lab.path(file), delimiter=",", skiprows=1)
        warm = 24.87 + 0.01 * rng.standard_normal(len(rows))
        lab.csv(file, {"time_s": rows[:, 0], "position_1_in": rows[:, 1], "temperature_C": warm})
    lab.write("machine.toml", machine)
    return lab.experiment(entries(files), LASER + WARM, "machine.toml")


def entries(files):
    return [f'program = "{f.replace("/", "_")}.CMD"\ndata = "{f}"' for f in files]


def verdict(**effects):
    named = tuple(
        Named(name, "", {n: Estimate(v, "1", (v, v), False) for n, v in own.items()},
              [], {}, {}, 9.0, 9.0, True)
        for name, own in effects.items()
    )  # fmt: skip
    gap = Gap("in", 1.0, 0.2, 0.2, None)
    return Verdict("named", named, (), (), (), gap, NOTHING_LEFT, dict(effects))


def predicted(path, machine=None, settings=None):
    """The experiment on `machine`, and what it predicts with `settings`."""
    opened = open_experiment(path, None if machine is None else str(machine))
    return opened, ForwardModel(opened.system.experiment)(settings or {})


def repaired(folder, path, **effects):
    text = machine_text(open_experiment(path).system.experiment, verdict(**effects))
    file = folder / "repaired.toml"
    file.write_text(text)
    return file, tomllib.loads(text)


@pytest.mark.parametrize(("name", "values", "own"), OF_TIME.values(), ids=OF_TIME)
def test_what_is_of_a_run_s_own_time_stays_with_the_run(tmp_path, name, values, own):
    files = ["a.csv", "b.csv"]
    path = laboratory(tmp_path / "fitted", *files, machine=EXTENDED + own)
    effects = {name: values, "sensor_gain": {"g": 0.01}}
    applied, written = repaired(tmp_path, path, **effects)
    assert written["effects"][name]["runs"].keys() == set(files)
    assert "runs" not in written["effects"]["sensor_gain"]
    assert run_here(tmp_path, "machine", "check", "repaired.toml").returncode == 0

    # Its own runs, in the other order as well, and alone in another folder.
    _, asked = predicted(path, settings=effects)
    opened, seen = predicted(path, applied)
    assert opened.notes == open_experiment(path).notes
    _, without = predicted(path, settings={"sensor_gain": {"g": 0.01}})
    assert any(np.ptp(one - two) > 1e-6 for one, two in zip(asked, without, strict=True))
    for one, two in zip(seen, asked, strict=True):
        assert one == pytest.approx(two, abs=1e-9)
    for kept in (files[::-1], files[1:]):
        copied = shutil.copytree(tmp_path / "fitted", tmp_path / "-".join(kept))
        other = Lab(copied).experiment(entries(kept), LASER + WARM, "machine.toml")
        first = predicted(other, applied)[1][:2]
        assert np.concatenate(first) == pytest.approx(np.concatenate(asked[2:]), abs=1e-9)

    # Other runs, one of which has a file of the same name.
    other = laboratory(tmp_path / "other", "a.csv", "c.csv", seed=2, machine=EXTENDED + own)
    opened, seen = predicted(other, applied)
    _, plain = predicted(other, settings={"sensor_gain": {"g": 0.01}})
    for one, two in zip(seen, plain, strict=True):
        assert one == pytest.approx(two, abs=1e-12)
    said = f"{name} of fitted-repaired is left out here: it belongs to another a.csv, b.csv"
    assert said.replace("fitted", "machine") in opened.notes


@pytest.mark.parametrize(
    ("name", "values"), [("viscous_drag", {"b": 9.0}), ("periodic_error", {"A": 1e-5})]
)
def test_an_effect_of_the_machine_is_on_in_every_run(tmp_path, name, values):
    _, written = repaired(tmp_path, laboratory(tmp_path, "a.csv"), **{name: values})
    assert "runs" not in written["effects"][name]


def test_a_run_beside_those_of_an_effect_is_without_it_also_in_a_fit(tmp_path):
    path = laboratory(tmp_path, "a.csv")
    applied, _ = repaired(tmp_path, path, hum={"A": 1e-3, "f": 60.0, "phi_1": 0.4})
    first = (tmp_path / "a.csv").read_bytes()
    path = laboratory(tmp_path, "a.csv", "b.csv", machine=applied.read_text(), seed=3)
    (tmp_path / "a.csv").write_bytes(first)
    _, plain = predicted(path, "chow1992")
    for settings in ({}, {"hum": {"A": 2e-3, "f": 60.0}}):
        opened, seen = predicted(path, settings=settings)
        assert np.ptp(seen[0] - plain[0]) > 0.05
        assert seen[2] == pytest.approx(plain[2], abs=1e-12)
    (note,) = (n for n in opened.notes if "left out" in n)
    assert note.endswith("is left out in b.csv: it belongs to a.csv")
    _, written = repaired(tmp_path, path, hum={"A": 2e-3, "f": 60.0, "phi_1": 0.2})
    assert written["effects"]["hum"]["runs"].keys() == {"a.csv"}


def test_files_of_one_name_in_two_folders_are_two_runs(tmp_path):
    path = laboratory(tmp_path / "e", "one/run.csv", "two/run.csv")
    values = {"A": 1e-4, "f": 60.0, "phi_1": 0.4, "phi_2": -1.9}
    applied, written = repaired(tmp_path, path, hum=values)
    assert written["effects"]["hum"]["runs"].keys() == {"one/run.csv", "two/run.csv"}
    (_, seen), (_, asked) = predicted(path, applied), predicted(path, settings={"hum": values})
    assert np.concatenate(seen) == pytest.approx(np.concatenate(asked), abs=1e-9)


@pytest.mark.parametrize("name", ['a "b".csv', "ä.csv", "a b'.csv", "x" * 120 + ".csv"])
def test_any_name_of_a_data_file_is_found_again(tmp_path, name):
    path = laboratory(tmp_path / "e", "a.csv")
    (tmp_path / "e" / "a.csv").rename(tmp_path / "e" / name)
    path.write_text(path.read_text().replace('data = "a.csv"', f"data = {json.dumps(name)}"))
    applied, written = repaired(tmp_path, path, ambient_drift={"r": 0.05})
    assert written["effects"]["ambient_drift"]["runs"].keys() == {name}
    opened, seen = predicted(path, applied)
    assert not any("left out" in note for note in opened.notes)
    assert np.ptp(seen[1]) > 0


# -- commands ------------------------------------------------------------------------------


def reconciled(folder, *args):
    done = run_here(folder, "reconcile", "e.toml", "--out", "out.toml", "--json", *args)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def applied(folder, machine):
    done = run_here(folder, "compare", "e.toml", "--apply", machine, "--json")
    return json.loads(done.stdout)["applied"], done.stderr


def test_a_hum_is_as_the_verdict_said_in_its_runs_and_off_in_others(tmp_path):
    for folder, files in (("one", {"a.csv": 0.4, "b.csv": -1.9}), ("two", {"c.csv": 2.5})):
        (tmp_path / folder).mkdir()
        lab = Lab(tmp_path / folder)
        for file, phi in files.items():
            program = lab.program(f"{file}.CMD", SHORT.format(10 + len(file)))
            lab.record(program, file, {"hum": {"A": 2e-5, "f": 60.0, "phi": phi}})
        lab.experiment(entries(files))
    answer = reconciled(tmp_path / "one", "--only", "hum")
    assert [effect["name"] for effect in answer["effects"]] == ["hum"]
    (told,) = answer["reservations"]
    assert told.startswith("hum is of the runs' own time: in the machine file it belongs to")
    for run in answer["gap"]["runs"]:
        assert run["rerun_rms"] == pytest.approx(run["after_rms"], rel=1e-3)
    gaps, said = applied(tmp_path / "one", "out.toml")
    assert "left out" not in said
    for gap, run in zip(gaps, answer["gap"]["runs"], strict=True):
        assert gap["after_rms"] == pytest.approx(run["after_rms"], rel=0.01)
    (gap,), said = applied(tmp_path / "two", "../one/out.toml")
    assert gap["after_rms"] == gap["before_rms"]
    assert said == "hum of chow1992-repaired is left out here: it belongs to a.csv, b.csv\n"


def test_what_is_in_one_run_only_is_told_so_and_stays_with_it(tmp_path):
    """A payload of one run that its experiment does not state."""
    lab, files = Lab(tmp_path), ["a.csv", "b.csv", "c.csv"]
    for nth, file in enumerate(files):
        program = lab.program(f"{file}.CMD", SHORT.format(10 + nth))
        lab.record(program, file, {"payload_mass": {"dm": 2.0}} if nth == 1 else {})
    lab.experiment(entries(files))
    only = [word for name in ("payload_mass", "viscous_drag") for word in ("--only", name)]
    answer = reconciled(tmp_path, *only)
    assert [(e["name"], e["run"]) for e in answer["effects"]] == [("payload_mass", "b.csv")]
    assert answer["effects"][0]["parameters"]["dm"]["value"] == pytest.approx(2.0, rel=0.01)
    assert answer["odd_run"]["run"] == "b.csv"
    (told,) = answer["reservations"]
    assert told.startswith("payload_mass is in b.csv only: in the machine file it belongs to that")
    written = tomllib.loads((tmp_path / "out.toml").read_text())
    assert written["effects"]["payload_mass"]["runs"].keys() == {"b.csv"}
    for run in answer["gap"]["runs"]:
        assert run["rerun_rms"] == pytest.approx(run["after_rms"], rel=1e-3)
    gaps, said = applied(tmp_path, "out.toml")
    assert "payload_mass of chow1992-repaired is left out in a.csv, c.csv" in said
    for gap in gaps:
        assert gap["after_rms"] == pytest.approx(2e-5, rel=0.1)
    shown = run_here(tmp_path, "reconcile", "e.toml", "--report", "why.html", *only)
    for text in (shown.stdout, (tmp_path / "why.html").read_text()):
        assert "Named: payload_mass in b.csv only." in text
        assert "b.csv disagrees (" in text


def test_a_payload_of_one_run_that_is_stated_in_another_unit_is_told(tmp_path):
    """5 kg for 5 lb: less than stated, and as much as the forcer itself."""
    lab, files = Lab(tmp_path), ["a.csv", "b.csv", "c.csv"]
    for nth, file in enumerate(files):
        program = lab.program(f"{file}.CMD", SHORT.format(10 + nth))
        lab.record(program, file, payload_kg=5 * 0.45359237 if nth == 1 else 0.0)
    first, second, third = entries(files)
    lab.experiment([first, second + "\npayload_kg = 5.0", third])
    only = [word for name in ("payload_mass", "viscous_drag") for word in ("--only", name)]
    (effect,) = reconciled(tmp_path, *only)["effects"]
    assert (effect["name"], effect["run"]) == ("payload_mass", "b.csv")
    assert effect["parameters"]["dm"]["value"] == pytest.approx(-2.732, abs=0.01)


HEATED = "UU012500/1\nVEL2 12.0\nACC2 0.2\n:B1\nMRI2 20.0\nWX2\nMRI2 -20.0\nWX2\nJUMP B1\n"


def test_a_drift_of_the_air_is_left_out_of_a_run_with_another(tmp_path):
    time_s, rng = np.arange(0.0, 2400.0, 10.0), np.random.default_rng(1)
    for folder, rate in (("one", 4e-4), ("two", 0.0), ("three", -4e-4)):
        (tmp_path / folder).mkdir()
        lab = Lab(tmp_path / folder)
        lab.program("P.CMD", HEATED)
        emulator = Emulator(load_machine("chow1992"), effects={"ambient_drift": {"r": rate}})
        seen = emulator.begin(emulator.plan(compile_text(HEATED), 2401.0)).temperature_C(time_s)
        seen = seen + 0.2 * rng.standard_normal(len(time_s))
        lab.csv("run.csv", {"time_s": time_s, "temperature_C": seen})
        sensor = WARM.replace("20.0", "0.1").replace("0.01", "0.2")
        lab.experiment(['program = "P.CMD"\ndata = "run.csv"'], sensor)
    answer = reconciled(tmp_path / "one", "--only", "ambient_drift")
    assert [effect["name"] for effect in answer["effects"]] == ["ambient_drift"]
    (run,) = answer["gap"]["runs"]
    assert run["rerun_rms"] == pytest.approx(run["after_rms"], rel=1e-3)
    assert applied(tmp_path / "one", "out.toml")[1] == ""
    for folder in ("two", "three"):
        (gap,), said = applied(tmp_path / folder, "../one/out.toml")
        assert gap["after_rms"] == gap["before_rms"]
        assert "is left out here: it belongs to another run.csv" in said


HUM = '[effects.hum]\nA = 1e-3\nphi = 1.0\nruns = { "a.csv" = "1c291ca3" }\n'
TELLS = "hum of m is left out here: it belongs to a.csv\n"
SIMULATING = {
    "run": ("run", "P.CMD", "--emulate", "--out", "p.csv"),
    "measure": ("measure", "P.CMD", "--instrument", "laser", "--no-ripple", "--out", "p.csv"),
    "lint": ("lint", "P.CMD", "P.CMD"),
    "limits": ("limits", "--velocities", "10"),
}


@pytest.mark.parametrize("args", SIMULATING.values(), ids=SIMULATING)
def test_a_simulation_is_another_run_and_this_is_told_once(tmp_path, args):
    results = []
    for nth, text in enumerate((HUM, "", HUM[: HUM.index("runs")])):
        folder = tmp_path / str(nth)
        folder.mkdir()
        (folder / "P.CMD").write_text(SHORT.format(10))
        (folder / "m.toml").write_text(EXTENDED + text)
        done = run_here(folder, *args, "--machine", "m.toml")
        assert done.returncode == 0
        assert done.stderr == ("" if nth else TELLS)
        read = (folder / "p.csv").read_text() if args[0] == "measure" else ""
        results.append((done.stdout, read))
    left_out, without, by_hand = results
    assert left_out == without
    assert (by_hand != without) is (args[0] == "measure"), "without `runs` it is on"


def test_emulate_leaves_it_out(tmp_path):
    (tmp_path / "m.toml").write_text(EXTENDED + HUM)
    program = compile_text(SHORT.format(10))
    header = emulate(program, machine=str(tmp_path / "m.toml")).header
    assert header.effects == []


# -- the file ------------------------------------------------------------------------------

FORM = 'expected runs = { "run.csv" = "1c291ca3" }'


@pytest.mark.parametrize(
    ("stated", "place", "said"),
    [
        ('runs = "a.csv"', "3:1", FORM),
        ('runs = ["a.csv"]', "3:1", FORM),
        ("runs = {}", "3:1", FORM),
        ("runs = true", "3:1", FORM),
        ('runs = { "a.csv" = 3 }', "3:10", "eight hexadecimal digits"),
        ('runs = { "a.csv" = "1c29" }', "3:10", "eight hexadecimal digits"),
        ('runs = { "a.csv" = "1c291cag" }', "3:10", "eight hexadecimal digits"),
        ("runs = 3.0", "3:1", "hum has no parameter runs"),
        ("phi_1 = 3.0", "3:1", "hum has no parameter phi_1"),
        ('phi_3 = 1.0\nruns = { "a.csv" = "1c291ca3", "b.csv" = "00000000" }', "3:1", "phi_3"),
        ('phi_1 = 99.0\nruns = { "a.csv" = "1c291ca3" }', "3:1", "out of bounds"),
    ],
)
def test_a_bad_form_is_refused_at_its_place(tmp_path, stated, place, said):
    (tmp_path / "m.toml").write_text(f"{EXTENDED}[effects.hum]\n{stated}\n")
    done = run_here(tmp_path, "machine", "check", "m.toml")
    assert done.returncode == 1
    assert done.stderr.startswith(f"m.toml:{place}: ")
    assert said in done.stderr


@pytest.mark.parametrize("stated", [
    'runs = { "a.csv" = "1C291CA3" }', '[effects.hum.runs]\n"a.csv" = "1c291ca3"',
    'runs."a.csv" = "1c291ca3"',
])  # fmt: skip
def test_each_form_of_toml_is_read_and_replaced(tmp_path, stated):
    machine = f"{EXTENDED}[effects.hum]\nA = 1e-4\n{stated}\n"
    path = laboratory(tmp_path, "a.csv", machine=machine)
    assert open_experiment(path).system.experiment.machine.runs == {"hum": {"a.csv": "1c291ca3"}}
    _, written = repaired(tmp_path, path, hum={"A": 2e-4, "f": 60.0, "phi_1": 0.1})
    assert written["effects"]["hum"]["runs"]["a.csv"] != "1c291ca3"


def test_show_has_the_effects_of_runs_and_their_runs(tmp_path):
    (tmp_path / "m.toml").write_text(EXTENDED + HUM)
    rows = json.loads(run_here(tmp_path, "machine", "show", "m.toml", "--json").stdout)
    own = {row["key"]: row["value"] for row in rows["quantities"]}
    assert own["effects.hum.phi"] == 1.0
    assert own["effects.hum.runs"] == "a.csv"


# -- names ---------------------------------------------------------------------------------

QUANTITIES = ["pull_out_force", "pitch", "value", "unit_1", "runs", "q_1"]


@pytest.mark.parametrize("effect", ["axis", "drive", "limits", "effects", "name"])
@pytest.mark.parametrize("parameter", QUANTITIES)
def test_names_of_an_effect_and_of_the_machine_are_of_different_tables(tmp_path, effect, parameter):
    own = OWN.replace("mine", effect).replace("q = ", f"{parameter} = ")
    own = own.format("measurement", f"{parameter} * x", '"1"')
    path = laboratory(tmp_path, "a.csv", machine=EXTENDED + own)
    values = {effect: {parameter: 0.0125}}
    applied, written = repaired(tmp_path, path, **values)
    assert written["effects"][effect][parameter]["value"] == 0.0125
    opened, seen = predicted(path, applied)
    before = open_experiment(path).system.experiment.machine
    assert opened.system.experiment.machine.axis == before.axis
    assert opened.system.experiment.machine.drive == before.drive
    assert seen[0] == pytest.approx(predicted(path, settings=values)[1][0], abs=1e-9)


@pytest.mark.parametrize("name", ["axis", "axes", "run"])
def test_a_parameter_called_as_a_key_of_its_section_is_refused(tmp_path, name):
    own = OWN.replace("q = ", f"{name} = ").format("measurement", f"{name} * x", '"1"')
    with pytest.raises(ModelError, match=rf"machine.toml:7:1: the name {name} has a meaning"):
        open_experiment(laboratory(tmp_path, "a.csv", machine=EXTENDED + own))


def test_an_effect_of_the_experiment_replaces_that_of_the_machine(tmp_path):
    own = [OWN.format("measurement", f"q * {of}", '"1"') for of in ("x", "abs(x)")]
    path = laboratory(tmp_path, "a.csv", machine=EXTENDED + own[0])
    path.write_text(path.read_text() + own[1])
    applied, written = repaired(tmp_path, path, mine={"q": 0.0125})
    assert [effect["formula"] for effect in written["effect"]] == ["q * abs(x)"]
    asked = predicted(path, settings={"mine": {"q": 0.0125}})[1]
    (tmp_path / "e.toml").write_text(path.read_text().replace(own[1], ""))
    assert predicted(path, applied)[1][0] == pytest.approx(asked[0], abs=1e-9)


def test_the_machine_file_says_the_verdict_of_its_last_repair(tmp_path):
    path = laboratory(tmp_path, "a.csv")
    found = verdict(viscous_drag={"b": 4.0})
    for said in ("named", "unexplained"):
        asked = open_experiment(path).system.experiment
        text = machine_text(asked, replace(found, verdict=said))
        (tmp_path / "machine.toml").write_text(text)
        assert load_machine(str(tmp_path / "machine.toml")).verdict == said
        assert text.count("verdict = ") == 1
    assert load_machine("chow1992").verdict is None
