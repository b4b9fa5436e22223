"""Cases on a machine other than the source's: the reference plant is that machine too."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mopro
from mopro.blind.cases import hidden_effects as hidden
from mopro.blind.cases.benchmark_machine import BenchmarkMachine, read_machine
from mopro.blind.cases.case import draw_case
from mopro.blind.cases.make import write
from mopro.blind.cases.spec import LASER, THERMOCOUPLE, CaseSpec
from mopro.blind.reference.motor import THESIS
from mopro.blind.reference.plant import ReferencePlant
from mopro.blind.scoring.scored_cases import hidden_plant
from mopro.experiment import load_experiment
from mopro.experiment.sawyer.system import Model
from mopro.machine import load_machine

STATED = Path(mopro.__file__).parent / "machine" / "machines" / "chow1992.toml"
OTHERWISE = {
    "pitch": '0.8128, unit = "mm"', "microsteps_per_full_step": '100, unit = "1"',
    "moving_mass": '4.0, unit = "kg"', "pull_out_force": '60.0, unit = "N"',
    "damping_ratio": '0.08, unit = "1"', "phase_current": '3.0, unit = "A"',
    "coil_resistance": '1.5, unit = "ohm"', "ambient": '30.0, unit = "C"',
    "side_area": '0.08, unit = "m2"', "specific_heat": '700.0, unit = "J/(kg K)"',
}  # fmt: skip


def stated(**changes):
    text = STATED.read_text()
    for key, value in changes.items():
        text, count = re.subn(rf'(?m)^{key} = {{ value = [^,]+, unit = "[^"]+"',
                              f"{key} = {{ value = {value}", text)  # fmt: skip
        assert count == 1, key
    return text


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """Heavier, weaker and better damped, of another pitch and in warmer air."""
    file = tmp_path_factory.mktemp("machine") / "other.toml"
    file.write_text(stated(**OTHERWISE))
    return read_machine(str(file))


def experiment_of(spec, machine, folder):
    case = draw_case(4, "001", spec, machine.nominal)
    write(case, folder, np.random.default_rng(1), machine)
    return load_experiment(folder / "experiment.toml"), case


def gap(experiment):
    """The residual's rms in standard deviations, each series less its mean."""
    model = Model(experiment)
    left = [
        (s.values - p - np.mean(s.values - p)) / s.sigma
        for s, p in zip(model.series(), model({}), strict=True)
    ]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


@pytest.mark.parametrize(
    "spec",
    [
        CaseSpec("none", LASER, runs=2, run_s=2.0),
        CaseSpec("none", THERMOCOUPLE, style="cycles", runs=1, run_s=1200.0),
    ],
    ids=lambda spec: spec.sensor,
)
def test_two_plants_that_share_no_code_agree_on_it(spec, other, tmp_path):
    experiment, case = experiment_of(spec, other, tmp_path)
    assert gap(experiment) == pytest.approx(1.0, abs=0.05)
    usual = replace(experiment, machine=load_machine("chow1992"))
    assert gap(usual) > 3.0
    assert case.answer()["machine"]["mass_kg"] == 4.0
    assert not hidden_plant(case.answer()).stalled
    assert hidden_plant(case.answer()).nominal == other.nominal


def test_answers_without_a_machine_are_of_the_source_s():
    assert hidden_plant({"effects": [], "strange": None}) == ReferencePlant({}, nominal=THESIS)


def test_an_effect_has_a_size_that_suits_the_machine(other):
    def parameters(name, strength):
        return hidden.HIDDEN_EFFECTS[name].draw(np.random.default_rng(1), other.nominal)(strength)

    assert parameters("electrical_damping", 0.0) == {"zeta": 0.08}
    assert parameters("detent_force", 1.0)["Fd"] == pytest.approx(6.0)
    assert parameters("platen_conduction", 1.0)["T_p"] == 30.0


def test_the_built_in_machine_is_the_reference_s_own():
    known = read_machine("chow1992")
    assert known.stated == BenchmarkMachine().stated
    for field, value in vars(known.nominal).items():
        assert value == pytest.approx(getattr(THESIS, field), rel=1e-9), field


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (stated() + "\n[effects.viscous_drag]\nb = 2.0\n", "it has viscous_drag already"),
        (stated() + "\n[forcers]\n", "no [forcers]"),
        (stated().replace("[drive]\n", '[drive]\nmodel = "full"\n'), "its drive is full"),
        (stated(width='30.0, unit = "in"'), "it has 11.5 in"),
        (stated(moving_mass='-1.0, unit = "kg"'), "moving_mass"),
    ],
    ids=["effects", "forcers", "drive", "platen", "mass"],
)
def test_a_machine_that_the_reference_cannot_be_is_refused(mopro, text, message, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    options = ["--seed", "1", "--grid", "smoke", "--out", tmp_path, "--machine", file]
    done = mopro("blind", "make", *options)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "answers.json").exists()
