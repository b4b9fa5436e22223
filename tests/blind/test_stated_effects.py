"""Effects of a user's file in the benchmark: candidates in each case, and hidden in some."""

import json
from dataclasses import replace

import numpy as np
import pytest

from mopro.blind.cases.benchmark_machine import read_machine
from mopro.blind.cases.case import draw_case
from mopro.blind.cases.grids import case_specs
from mopro.blind.cases.make import write
from mopro.blind.cases.spec import LASER, CaseSpec, case_instruments
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.scoring.scored_cases import hidden_plant
from mopro.errors import ModelError
from mopro.experiment import load_experiment

FILE = """\
[[effect]]
name = "friction of place"
enters = "friction"
formula = "F1 * abs(x)"
F1 = { unit = "N/m", range = [0, 200] }
"""
NAME = "friction of place"


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    file = tmp_path_factory.mktemp("effects") / "effects.toml"
    file.write_text(FILE)
    return read_machine("chow1992", effects=str(file))


def test_a_grid_has_cases_in_which_it_is_hidden_and_the_others_as_they_were(machine):
    plain, more = case_specs("smoke", 1), case_specs("smoke", 1, machine.effects)
    hidden = [spec for spec in more if spec.stated]
    assert [spec.effects[0][0] for spec in hidden] == [NAME] * 4
    assert len(more) == len(plain) + 4
    assert {spec.effects for spec in plain} < {spec.effects for spec in more}


def test_a_case_states_the_effect_and_hides_its_size(machine, tmp_path):
    hidden = CaseSpec("single", LASER, ((NAME, "clear"),), runs=1, run_s=1.0, stated=True)
    none = replace(hidden, group="none", effects=(), stated=False)
    cases = [draw_case(1, "001", spec, stated=machine.effects) for spec in (hidden, none)]
    answers = [json.loads(json.dumps(case.answer())) for case in cases]
    (effect,) = answers[0]["effects"]
    assert effect["name"] == NAME
    assert 0 < effect["parameters"]["F1"] < 200
    assert effect["total_sigma"] > 20
    assert hidden_plant(answers[0]).hidden == {NAME: effect["parameters"]}
    assert "stated" not in answers[1]
    for number, case in enumerate(cases):
        folder = tmp_path / str(number)
        write(case, folder, np.random.default_rng(0), machine)
        asked = (folder / "experiment.toml").read_text()
        assert f"{effect['parameters']['F1']:.4g}" not in asked
        read = load_experiment(folder / "experiment.toml")
        assert [formula.name for formula in read.machine.formulas] == [NAME]


def test_the_emulator_s_plant_is_the_reference_plant_where_nothing_is_hidden(machine):
    run = ProgramRun("UU012500/1\nVEL1 10.0\nACC1 0.3\nMRI1 1.0\nWX1\n")
    sensors = case_instruments("laser", "strokes")
    draws = np.random.default_rng(0)
    stamps, (emulated,) = machine.effects.plant({}).readings(run, sensors, draws)
    reference, (expected,) = ReferencePlant({}).readings(run, sensors, draws)
    assert stamps == pytest.approx(reference)
    assert emulated == pytest.approx(expected, abs=2e-5 / 20)


def test_an_amplitude_below_zero_is_hidden_nearer_to_zero_than_its_range(tmp_path):
    file = tmp_path / "effects.toml"
    file.write_text(FILE.replace("[0, 200]", "[-200, -50]"))
    machine = read_machine("chow1992", effects=str(file))
    run = ProgramRun("UU012500/1\nVEL1 10.0\nACC1 0.3\nMRI1 1.0\nWX1\n")
    plant = machine.effects.plant({NAME: {"F1": -10.0}})
    _, (changed,) = plant.readings(
        run, case_instruments("laser", "strokes"), np.random.default_rng(0)
    )
    assert np.isfinite(changed).all()
    assert not plant.stalled


def test_an_effect_without_a_range_cannot_be_drawn(tmp_path):
    file = tmp_path / "effects.toml"
    file.write_text(FILE.replace(", range = [0, 200]", ""))
    with pytest.raises(ModelError, match="expected a range of F1"):
        read_machine("chow1992", effects=str(file))
    file.write_text('name = "nothing"\n')
    with pytest.raises(ModelError, match=r"at least one \[\[effect\]\]"):
        read_machine("chow1992", effects=str(file))
