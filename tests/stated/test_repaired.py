"""The repaired machine file: it predicts what the verdict said, and no run that is not its own."""

import dataclasses
import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from helpers.commands import run_here
from helpers.stated import DRIVE, DRIVEN, FRICTION_OF_PLACE, drive_folder, write
from mopro.engine.residuals import NOTHING_LEFT
from mopro.engine.verdict import Estimate, Gap, Named, Verdict
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment
from mopro.experiment.stated.repaired import machine_text
from mopro.stated import file as machine_files
from mopro.stated.simulation import BASE

CATALOGUE = Path(machine_files.__file__).with_name("catalogue") / "axis.toml"
AXIS_EFFECTS = [
    (e["name"], e.get("form", ""), [key for key, own in e.items() if isinstance(own, dict)])
    for e in tomllib.loads(CATALOGUE.read_text("utf-8"))["effect"]
    # An axis that states its own law has no force, and this one does not turn.
    if "force" not in e["formula"] and not e.get("angular")
]
BY_VOLTS = DRIVEN.replace("force = {", 'drive = { unit = "V",')
OWN_LAW = """\
kind = "axis"
name = "drive"
unit = "mm"
acceleration = "{n} * drive - viscous * v - w2 * x"

[base]
{n} = {{ value = 0.5, unit = "m/V s2", free = true, range = [0.05, 2] }}  # {n} = 3, [base]
viscous = {{ value = 2.0, unit = "1/s", free = true, range = [0, 30] }}
w2 = {{ value = 25, unit = "1/s2", free = true, range = [0, 200] }}
"""


def estimate(value, unit="1"):
    return Estimate(value, unit, (0.9 * value, 1.1 * value), False)


def verdict(system, base, effects, without_drafts=None):
    """A verdict with these values of the base, and of effects of (name, form)."""
    units = {
        (name, p.name): p.unit
        for (name, _), own in effects.items()
        for p in system.model.form(name, own).parameters
    }
    named = tuple(
        Named(
            name, form, {n: estimate(v, units[name, n]) for n, v in own.items()},
            [], {}, {}, 9.0, 9.0, True,
        )
        for (name, form), own in effects.items()
    )  # fmt: skip
    settings = {BASE: dict(base), **{name: dict(own) for (name, _), own in effects.items()}}
    return Verdict(
        "named", named, (), (), (), Gap("mm", 1.0, 0.2, 0.2, None), NOTHING_LEFT, settings,
        base={name: estimate(v) for name, v in base.items()}, without_drafts=without_drafts,
    )  # fmt: skip


def studied(folder, machine, experiment=BY_VOLTS):
    return open_experiment(drive_folder(folder, machine, experiment, length_s=1.0)).system


# -- names ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "form", "parameters", "clash"), [(*e, name) for e in AXIS_EFFECTS for name in e[2]]
)
def test_a_number_called_as_a_parameter_keeps_its_own_value(
    tmp_path, name, form, parameters, clash
):
    system = studied(tmp_path, OWN_LAW.format(n=clash))
    assert (name, form) in {(e.name, e.form) for e in system.model.forms}
    values = {n: 0.125 + 0.01 * i for i, n in enumerate(parameters)}
    base = {clash: 0.7123456789, "viscous": 3.0, "w2": 20.0}
    found = verdict(system, base, {(name, form): values})
    text = machine_text(system.model, found)
    written = tomllib.loads(text)
    assert written["base"][clash]["value"] == 0.71234568
    assert written["effects"][name][clash]["value"] == values[clash]
    assert system.again(found, text).fault is None


@pytest.mark.parametrize("name", ["viscous_drag", "k", "stiffness", "sensor_lag"])
def test_a_free_number_called_as_an_effect_is_another_thing(tmp_path, name):
    """An effect of the file, with a parameter of its own name as well."""
    own = f'\n[[effect]]\nname = "{name}"\nenters = "force"\nformula = "-{name} * x"\n'
    own += f'{name} = {{ unit = "1/s2" }}\n'
    system = studied(tmp_path, OWN_LAW.format(n=name) + own)
    base = {name: 0.75, "viscous": 3.0, "w2": 20.0}
    found = verdict(system, base, {(name, ""): {name: 5.0}})
    assert system.model.values(found.settings)[name] == 0.75
    text = machine_text(system.model, found)
    written = tomllib.loads(text)
    assert written["base"][name]["value"] == 0.75
    assert written["effects"][name][name]["value"] == 5.0
    assert system.again(found, text).fault is None


def test_a_number_with_a_tolerance_called_as_an_effect_is_refused_at_its_place(tmp_path):
    machine = OWN_LAW.format(n="pull").replace("free = true, range = [0.05, 2]", "tolerance = 0.1")
    machine += '\n[[effect]]\nname = "pull"\nenters = "force"\nformula = "-q * x"\n'
    machine += 'q = { unit = "1/s2" }\n'
    with pytest.raises(
        ModelError, match=r"machine.toml:7:1: pull is the name of an effect as well"
    ):
        studied(tmp_path, machine)


LAW = 'kind = "axis"\nname = "d"\nunit = "mm"\nacceleration = "g * drive - w2 * x"\n'
G = "g = { value = 0.5, unit = 'm/V s2' }\n"
STATED = ("value = 25", "unit = '1/s2'", "free = true", "range = [1, 90]")
W = f"w2 = {{ {', '.join(STATED)} }}\n"
BASE_OF = f"[base]\n{G}"
SPELLINGS = {
    "in one line each": BASE_OF + W,
    "dotted at the top": f"base.{G}base . {W}",
    "spaces and a comment": f"  [ base ] # w2 = 3\n  {G}\t{W.replace(' =', '=', 1)}",
    "a table of its own": f"{BASE_OF}[base.w2]\n" + "\n".join(STATED),
    "dotted below": BASE_OF + "\n".join(f"w2.{own}" for own in STATED),
    "quoted": '["base"]\n' + G + W.replace("w2", '"w2"'),
    "all in one line": f"base = {{ {G.strip()}, {W.strip()} }}\n",
    "an effect in a table of effects": f"{BASE_OF}{W}[effects]\nviscous_drag = {{ b = 0.5 }}\n",
    "an effect at the top": f"effects.viscous_drag.b = 0.5\n{BASE_OF}{W}",
    "a line separator in a comment": f"{BASE_OF}# a\u2028b\n{W}",
}
SPELLINGS = {name: LAW + text for name, text in SPELLINGS.items()}


@pytest.mark.parametrize("machine", SPELLINGS.values(), ids=SPELLINGS)
def test_a_file_is_written_as_fitted_or_refused_with_what_to_do(tmp_path, machine):
    system = studied(tmp_path, machine)
    found = verdict(system, {"w2": 20.0}, {("viscous_drag", ""): {"b": 3.0}})
    text = machine_text(system.model, found)
    again = system.again(found, text)
    if again.fault is None:
        written = tomllib.loads(text)
        assert written["base"]["w2"]["value"] == 20.0
        assert written["effects"]["viscous_drag"]["b"]["value"] == 3.0
    else:
        assert "w2 of [base] was not written: state it" in str(again.fault)
        assert "w2 = { value = 20.0" in str(again.fault)


@pytest.mark.parametrize(
    "name", sorted(SPELLINGS.keys() - {"a table of its own", "all in one line"})
)
def test_a_number_is_written_however_its_key_is_spelled(tmp_path, name):
    system = studied(tmp_path, SPELLINGS[name])
    found = verdict(system, {"w2": 20.0}, {})
    assert system.again(found, machine_text(system.model, found)).fault is None


def test_an_effect_of_the_experiment_replaces_that_of_the_machine(tmp_path):
    own = '\n[[effect]]\nname = "mine"\nenters = "force"\nformula = "{}"\nq = {{ unit = "{}" }}\n'
    machine = SPELLINGS["in one line each"] + own.format("-q * v", "1/s")
    system = studied(tmp_path, machine, BY_VOLTS + own.format("-q * x", "1/s2"))
    found = verdict(system, {"w2": 20.0}, {("mine", ""): {"q": 4.0}})
    text = machine_text(system.model, found)
    assert [e["formula"] for e in tomllib.loads(text)["effect"]] == ["-q * x"]
    assert system.again(found, text).fault is None


@pytest.mark.parametrize("own", ["", FRICTION_OF_PLACE.replace("F1 *", "F1 * 2 *")])
def test_an_effect_that_is_on_keeps_the_formula_that_the_experiment_states(tmp_path, own):
    on = '[effects."friction of place"]\nF1 = { value = 0.5, unit = "N/m" }\n'
    text = DRIVEN + FRICTION_OF_PLACE
    system = studied(tmp_path, DRIVE + own + "\n" + on, text)
    found = verdict(system, {"viscous": 2.5}, {})
    written = machine_text(system.model, found)
    assert written.count('formula = "F1 * abs(x)"') == written.count("formula") == 1
    assert system.again(found, written).fault is None


def test_out_is_refused_where_the_file_would_not_predict_the_verdict(tmp_path):
    drive_folder(tmp_path, SPELLINGS["all in one line"], BY_VOLTS, viscous=0.0)
    done = run_here(tmp_path, "reconcile", "experiment.toml", "--out", "out.toml")
    assert done.returncode == 2
    assert "[not-as-fitted]" in done.stderr
    assert "w2 of [base] was not written" in done.stderr
    assert not (tmp_path / "out.toml").exists()
    assert "Fitted: w2" in done.stdout, "the verdict is told all the same"


PROGRAM = """\
kind = "python"
name = "p"
python = "m.py:simulate"

[base]
g = { value = 1.0, unit = "1", free = true, range = [0.5, 2] }

[[effect]]
name = "one"
NAME = { unit = "1", range = [0, 3] }

[[effect]]
name = "two"
h = { unit = "1", range = [0, 3] }
"""


def program(folder, name, more=""):
    (folder / "m.py").write_text(
        "def simulate(numbers, columns):\n"
        "    size = numbers['g'] + numbers['h'] + 10 * numbers.get('f', 0)\n"
        "    return {'scale': columns['force_N'] * size}\n"
    )
    text = DRIVEN.replace("start = { x = 0, v = 0 }", "")
    path = drive_folder(folder, PROGRAM.replace("NAME", name) + more, text, length_s=1.0)
    return open_experiment(path, allow_python=True).system


@pytest.mark.parametrize(
    ("name", "taken"), [("g", r"a number of \[base\]"), ("h", "a parameter of one")]
)
def test_the_numbers_of_a_program_have_names_of_their_own(tmp_path, name, taken):
    with pytest.raises(ModelError, match=f"{name} is {taken} already"):
        program(tmp_path, name)


def test_effects_of_the_machine_file_reach_a_program(tmp_path):
    system = program(tmp_path, "f", "[effects.one]\nf = 0.25\n[effects.two]\nh = 0.5\n")
    (read,) = system.model({BASE: {"g": 1.5}})
    assert read == pytest.approx(4.5 * system.experiment.columns[0]["force_N"])
    found = verdict(system, {"g": 1.5}, {("one", ""): {"f": 0.125}})
    text = machine_text(system.model, found)
    assert tomllib.loads(text)["effects"]["one"]["f"]["value"] == 0.125
    assert system.again(found, text).fault is None


SLIDE = """\
kind = "python"
name = "slide"
python = "m.py:simulate"

[[effect]]
name = "creep"
r = { unit = "mm/s", range = [-1, 1] }

[[effect]]
name = "late"
d = { unit = "s", range = [0, 0.2] }
"""


@pytest.mark.parametrize(("on", "off"), [("creep", "late"), ("late", "creep")])
def test_what_a_program_makes_of_the_clock_stays_with_its_runs(tmp_path, on, off):
    """A program that is called with a later clock tells which effect is one of the run's time."""
    (tmp_path / "m.py").write_text(
        "import numpy as np\n\n\ndef simulate(n, columns):\n"
        "    t, told = columns['time_s'], columns['command_mm']\n"
        "    return {'scale': np.interp(t - n['d'], t, told) + n['r'] * t}\n"
    )
    path = stage(tmp_path, "run.csv")
    (tmp_path / "machine.toml").write_text(SLIDE)
    t, rng = np.arange(0, 8, 0.02), np.random.default_rng(4)
    d, r = (0.0, 0.05) if on == "creep" else (0.07, 0.0)
    read = 10 * np.sin(np.maximum(t - d, 0.0)) + r * t + 0.01 * rng.standard_normal(len(t))
    columns = {"time_s": t, "command_mm": 10 * np.sin(t), "position_mm": read}
    write(tmp_path / "run.csv", columns)
    repaired = open_experiment(path, allow_python=True).conclude().repaired
    assert repaired.of_runs == (("creep",) if on == "creep" else ())
    effects = tomllib.loads(repaired.text)["effects"]
    assert list(effects) == [on]
    assert ("runs" in effects[on]) is (on == "creep")


# -- drafts --------------------------------------------------------------------------------


def test_the_file_has_what_fits_without_the_drafts(tmp_path):
    system = studied(tmp_path, OWN_LAW.format(n="g"))
    base = {"g": 0.7, "viscous": 3.0, "w2": 20.0}
    alone = {BASE: {**base, "w2": 22.0}, "bias_force": {"g": 0.25}}
    found = verdict(system, base, {("bias_force", ""): {"g": 0.5}}, without_drafts=alone)
    text = machine_text(system.model, found)
    written = tomllib.loads(text)
    assert written["base"]["w2"]["value"] == 22.0
    assert written["effects"]["bias_force"]["g"]["value"] == 0.25
    assert "without the drafts; beside them 20, 95 %: 18 to 22" in text
    assert system.again(found, text).fault is None
    beside = dataclasses.replace(found, without_drafts=None)
    assert system.again(beside, text).fault is not None


# -- what belongs to a run -----------------------------------------------------------------

STAGE = 'kind = "kinematic"\nname = "stage"\nunit = "mm"\n'
FOLLOWED = """\
machine = "machine.toml"

[inputs]
command = { column = "command_mm" }

[[sensor]]
name = "scale"
quantity = "position"
column = "position_mm"
noise_rms = 0.01
"""
TIME_TERMS = {
    "drift": ("drift", {"r": 0.05}, ""),
    "bending drift": ("bending_drift", {"q2": 0.01, "q3": 0.001}, ""),
    "a wave": ("periodic_in_time", {"P": 0.7, "s": 0.2, "c": 0.1}, ""),
    "of the user": (
        "mine", {"q": 0.1},
        '\n[[effect]]\nname = "mine"\nenters = "command"\nformula = "q * sqrt(t)"\n'
        'q = { unit = ["mm", "1/s0.5"] }\n',
    ),
}  # fmt: skip


def stage(folder, *files, machine=STAGE, seed=1):
    """An experiment on a stage that follows its command, of these data files."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(seed)
    t = np.arange(0, 4, 0.02)
    for file in files:
        command = 10 * np.sin(t * rng.uniform(0.8, 1.2))
        read = command + 0.01 * rng.standard_normal(len(t))
        write(folder / file, {"time_s": t, "command_mm": command, "position_mm": read})
    (folder / "machine.toml").write_text(machine)
    runs = "".join(f'\n[[run]]\ndata = "{file}"\n' for file in files)
    (folder / "experiment.toml").write_text(FOLLOWED + runs)
    return folder / "experiment.toml"


@pytest.mark.parametrize(("name", "values", "own"), TIME_TERMS.values(), ids=TIME_TERMS)
def test_what_is_of_a_run_s_own_time_stays_with_the_run(tmp_path, name, values, own):
    path = stage(tmp_path / "fitted", "a.csv", "b.csv", machine=STAGE + own)
    system = open_experiment(path).system
    found = verdict(system, {}, {(name, ""): values, ("scale", ""): {"k": 0.01}})
    text = machine_text(system.model, found)
    assert system.again(found, text).fault is None
    assert tomllib.loads(text)["effects"][name]["runs"].keys() == {"a.csv", "b.csv"}
    assert "runs" not in tomllib.loads(text)["effects"]["scale"]
    applied = tmp_path / "repaired.toml"
    applied.write_text(text)

    def on(path):
        return open_experiment(path, str(applied)).system.model({})

    # The same runs, also in another order, alone, and copied to another folder.
    (tmp_path / "copied").mkdir()
    shutil.copy(tmp_path / "fitted" / "b.csv", tmp_path / "copied" / "b.csv")
    (tmp_path / "copied" / "machine.toml").write_text(STAGE)
    (tmp_path / "copied" / "e.toml").write_text(FOLLOWED + '\n[[run]]\ndata = "b.csv"\n')
    whole = system.model({k: v for k, v in found.settings.items() if k != BASE})
    assert on(path)[1] == pytest.approx(whole[1], abs=1e-9)
    assert on(tmp_path / "copied" / "e.toml")[0] == pytest.approx(whole[1], abs=1e-9)
    # Other runs, one of which has a file of the same name.
    other = stage(tmp_path / "other", "a.csv", "c.csv", seed=2)
    plain = open_experiment(other).system.model({"scale": {"k": 0.01}})
    for seen, expected in zip(on(other), plain, strict=True):
        assert seen == pytest.approx(expected, abs=1e-12)
    notes = open_experiment(other, str(applied)).notes
    assert any(f"{name} of stage is left out here: it belongs to another a.csv" in n for n in notes)


def test_a_run_beside_those_of_an_effect_is_without_it(tmp_path):
    path = stage(tmp_path, "a.csv")
    system = open_experiment(path).system
    text = machine_text(system.model, verdict(system, {}, {("drift", ""): {"r": 0.05}}))
    first = (tmp_path / "a.csv").read_bytes()
    both = stage(tmp_path, "a.csv", "b.csv", machine=text, seed=3)
    (tmp_path / "a.csv").write_bytes(first)
    model = open_experiment(both).system.model
    with_it, without = model({})
    assert np.ptp(with_it - model.experiment.trials[0].inputs["command"] * 1e3) > 0.1
    assert without == pytest.approx(model.experiment.trials[1].inputs["command"] * 1e3)


def test_files_of_one_name_in_two_folders_are_two_runs(tmp_path):
    path = stage(tmp_path, "one.csv", "two.csv")
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / f"{folder}.csv").rename(tmp_path / folder / "run.csv")
        path.write_text(path.read_text().replace(f"{folder}.csv", f"{folder}/run.csv"))
    system = open_experiment(path).system
    text = machine_text(system.model, verdict(system, {}, {("drift", ""): {"r": 0.05}}))
    assert tomllib.loads(text)["effects"]["drift"]["runs"].keys() == {"one/run.csv", "two/run.csv"}
    (tmp_path / "machine.toml").write_text(text)
    opened = open_experiment(path)
    assert not any("left out" in note for note in opened.notes)
    for seen, asked in zip(
        opened.system.model({}), system.model({"drift": {"r": 0.05}}), strict=True
    ):
        assert seen == pytest.approx(asked, abs=1e-9)


@pytest.mark.parametrize("stated", ['"a.csv"', "{}", '{ "a.csv" = 3 }', '{ "a.csv" = "1c29" }'])
def test_bad_runs_are_refused_at_their_place(tmp_path, stated):
    path = stage(tmp_path, "a.csv", machine=f"{STAGE}[effects.drift]\nr = 0.05\nruns = {stated}\n")
    with pytest.raises(ModelError, match=r"machine.toml:6:\d+: expected runs = "):
        open_experiment(path)


def test_an_effect_of_place_is_the_machine_s_in_every_run(tmp_path):
    path = stage(tmp_path, "a.csv")
    system = open_experiment(path).system
    values = {"P": 5.0, "s": 0.2, "c": 0.1}
    text = machine_text(system.model, verdict(system, {}, {("periodic_error", ""): values}))
    assert "runs" not in text


def test_a_drift_is_told_to_belong_to_its_run_and_left_out_of_another(tmp_path):
    t = np.arange(0, 8, 0.02)
    for folder, rate in (("one", 0.05), ("two", 0.0)):
        path = stage(tmp_path / folder, "run.csv")
        rng = np.random.default_rng(len(folder) + round(100 * rate))
        command = 10 * np.sin(t)
        read = 1.01 * command + rate * t + 0.01 * rng.standard_normal(len(t))
        write(path.parent / "run.csv", {"time_s": t, "command_mm": command, "position_mm": read})
    done = run_here(tmp_path / "one", "reconcile", "experiment.toml", "--out", "out.toml")
    assert "drift is of the runs' own time" in done.stdout
    for folder in ("one", "two"):
        args = ("compare", "experiment.toml", "--apply", "../one/out.toml", "--json")
        done = run_here(tmp_path / folder, *args)
        (gap,) = json.loads(done.stdout)["applied"]
        assert gap["after_rms"] == pytest.approx(0.01, rel=0.1)
        assert ("drift of stage is left out" in done.stderr) is (folder == "two")


def test_what_is_in_one_run_only_is_told_so_and_stays_with_it(tmp_path):
    path = stage(tmp_path, "a.csv", "b.csv", "c.csv")
    rows = np.loadtxt(tmp_path / "b.csv", delimiter=",", skiprows=1)
    t, command, read = rows.T
    write(
        tmp_path / "b.csv",
        {"time_s": t, "command_mm": command, "position_mm": read + 0.01 * command},
    )
    done = run_here(tmp_path, "reconcile", path.name, "--out", "out.toml", "--json")
    answer = json.loads(done.stdout)
    assert [(e["name"], e["run"]) for e in answer["effects"]] == [("scale", "b.csv")]
    assert (answer["verdict"], answer["odd_run"]["run"]) == ("named", "b.csv")
    assert answer["effects"][0]["parameters"]["k"]["value"] == pytest.approx(0.01, rel=0.05)
    own = tomllib.loads((tmp_path / "out.toml").read_text())["effects"]["scale"]
    assert (own.keys(), own["runs"].keys()) == ({"k", "runs"}, {"b.csv"})
    done = run_here(tmp_path, "compare", path.name, "--apply", "out.toml", "--json")
    for gap in json.loads(done.stdout)["applied"]:
        assert gap["after_rms"] == pytest.approx(0.01, rel=0.2)
    assert "scale of stage is left out in a.csv, c.csv: it belongs to b.csv" in done.stderr


@pytest.mark.parametrize("at_s", [1.5, 2.6])
def test_a_step_in_one_run_does_not_spoil_what_the_file_has_for_all(tmp_path, at_s):
    """A scale of 0.4 % in three runs, in one of which the reading jumps by 0.4 mm."""
    path = stage(tmp_path, "a.csv", "b.csv", "c.csv")
    for file in ("a.csv", "b.csv", "c.csv"):
        t, command, read = np.loadtxt(tmp_path / file, delimiter=",", skiprows=1).T
        jump = 0.4 * (t > at_s) * (file == "b.csv")
        columns = {"time_s": t, "command_mm": command, "position_mm": read + 0.004 * command + jump}
        write(tmp_path / file, columns)
    answer = json.loads(
        run_here(tmp_path, "reconcile", path.name, "--out", "out.toml", "--json").stdout
    )
    assert [draft["run"] for draft in answer["drafts"]] == ["b.csv"]
    own = tomllib.loads((tmp_path / "out.toml").read_text())["effects"]["scale"]["k"]
    assert own["value"] == pytest.approx(0.004, rel=0.05)
    told = [words for words in answer["reservations"] if "drafts" in words]
    assert told == ["The machine file has no drafts: what is in one run is none of the machine."]
    for gap in answer["gap"]["runs"]:
        assert gap["rerun_rms"] == pytest.approx(gap["after_rms"], rel=1e-6)


def test_settings_may_have_an_effect_on_in_one_run_alone(tmp_path):
    model = open_experiment(stage(tmp_path, "a.csv", "b.csv")).system.model
    plain, with_it = model({}), model({"scale": {"k": 0.1}})
    own = model({"scale": {"k": 0.1, "run": 1.0}})
    assert own[0] == pytest.approx(plain[0], abs=1e-12)
    assert own[1] == pytest.approx(with_it[1], abs=1e-12)


# -- what harms a run that was not fitted ---------------------------------------------------

GEARED = """\
kind = "kinematic"
unit = "mm"
name = "geared"
position = "ratio * command"

[base]
ratio = { value = 1.0, unit = "1", free = true, range = [0.5, 2] }
"""


@pytest.mark.parametrize("bow", [0.004, 0.0])
def test_a_number_that_makes_up_for_what_is_unexplained_is_in_no_file(tmp_path, bow):
    """A ratio that is fitted to one side of a bow is wrong on the other."""
    path = stage(tmp_path, "near.csv", "far.csv", machine=GEARED)
    rng, t = np.random.default_rng(8), np.arange(0, 4, 0.02)
    for file, middle in (("near.csv", 5.0), ("far.csv", 15.0)):
        x = middle + 5 * np.sin(2 * t)
        read = 1.02 * x + bow * (x - 10) ** 2 + 0.01 * rng.standard_normal(len(t))
        write(tmp_path / file, {"time_s": t, "command_mm": x, "position_mm": read})
    done = run_here(tmp_path, "reconcile", path.name, "--out", "out.toml", "--json")
    answer = json.loads(done.stdout)
    ratio = tomllib.loads((tmp_path / "out.toml").read_text())["base"]["ratio"]
    said = any("Nothing that was fitted is in" in line for line in answer["reservations"])
    if bow:
        came_in = tomllib.loads(GEARED)["base"]["ratio"]
        assert (answer["verdict"], ratio, said) == ("unexplained", came_in, True)
        assert any(run["held_out_rms"] > run["before_rms"] for run in answer["gap"]["runs"])
    else:
        assert (ratio["value"], said) == (pytest.approx(1.02, abs=1e-3), False)
