"""Effects that a motor's file states as formulas: the simulator's, a fit's, and a file's faults."""

import dataclasses

import numpy as np
import pytest

import mopro
from helpers.diagnosis import diagnose
from mopro.effects import catalogue, catalogue_of
from mopro.effects.formula_effects import effect_of
from mopro.errors import ModelError
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.repaired import machine_of, machine_text
from mopro.experiment.sawyer.trials import Experiment, Reading, Trial
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor
from mopro.machine.file import read_machine
from mopro.motion import plan
from mopro.source import Source

PROGRAM = mopro.compile(
    "UU012500/1\nVEL1 15.0\nACC1 0.5\nMRI1 3.0\nWX1\nWT100\nMRI1 -4.0\nWX1\nWT100\n"
)
PLACE = "friction of place"
OF_PLACE = 'enters = "friction"\nformula = "F1 * abs(x)"\nF1 = { unit = "N/m" }\n'


def machine(*effects, on=""):
    """The motor with effects of its own, of (name, text); `on` switches some on."""
    sections = "".join(f"\n[[effect]]\nname = {name!r}\n{text}" for name, text in effects)
    return read_machine(Source("m.toml", f'name = "m"\nextends = "chow1992"\n{sections}\n{on}'))


def moved(machine, effects=None, **how):
    return mopro.emulate(PROGRAM, machine=machine, effects=effects, **how)["position_1_m"]


# -- the same as the catalogue's, where it is the same law ---------------------------------

TWINS = [
    ("force", "-b * v", "b", "N s/m", 9.0, "viscous_drag", {"b": 9.0}),
    ("force", "-b * v", "b", "N ms/um", 9e-3, "viscous_drag", {"b": 9.0}),
    ("friction", "F", "F", "N", 4.0, "coulomb_friction", {"Fc": 4.0, "delta": 5e-6}),
]


@pytest.mark.parametrize("twin", TWINS, ids=["force", "other units", "friction"])
def test_a_formula_moves_the_motor_as_the_same_law_of_the_catalogue(twin):
    enters, formula, number, unit, value, name, values = twin
    text = f'enters = "{enters}"\nformula = "{formula}"\n{number} = {{ unit = "{unit}" }}\n'
    mine = moved(machine(("mine", text)), {"mine": {number: value}})
    assert mine == pytest.approx(moved("chow1992", {name: values}), abs=1e-15)
    assert np.ptp(mine - moved("chow1992")) > 1e-7


def test_a_formula_compiled_is_the_same_to_the_bit():
    text = (
        'enters = "force"\nA = { unit = "N" }\nP = { unit = "mm", role = "period" }\n'
        'formula = "A * sin(2 * pi * x / P) * (1 if v > 0 or x < 0 else min(exp(sign(x)), 2))"\n'
    )
    of_file = machine(("mine", text), on="[effects.mine]\nA = 3\nP = 20\n")
    plain, compiled = (moved(of_file, compiled=c) for c in (False, True))
    assert np.array_equal(plain, compiled)
    assert np.ptp(plain - moved("chow1992")) > 1e-7


def test_a_term_may_depend_on_the_motor_s_force():
    text = 'enters = "force"\nformula = "k * motor"\nk = { unit = "1" }\n'
    mine = moved(machine(("mine", text)), {"mine": {"k": -0.1}})
    weaker = moved("chow1992", {"force_constant": {"e": -0.1}})
    assert mine == pytest.approx(weaker, abs=1e-7)
    assert np.ptp(mine - moved("chow1992")) > 1e-6


def test_a_command_is_the_one_that_the_drive_gets():
    text = 'enters = "command"\nformula = "k * x"\nk = { unit = "1" }\n'
    longer = moved(machine(("mine", text)), {"mine": {"k": 0.01}}, resolved=False)
    plain = moved("chow1992", resolved=False)
    assert longer[-1] == pytest.approx(1.01 * plain[-1], abs=1e-7)
    assert longer == pytest.approx(1.01 * plain, abs=3e-6)


def test_two_files_that_state_the_same_have_one_effect_and_one_kernel():
    one, other = (machine((PLACE, OF_PLACE)).formulas[0] for _ in range(2))
    assert effect_of(one) is effect_of(other)
    different = machine((PLACE, OF_PLACE.replace("abs(x)", "2 * abs(x)"))).formulas[0]
    assert effect_of(different) != effect_of(one)


def test_a_catalogue_without_formulas_is_the_common_one():
    assert catalogue_of(machine()) is catalogue()
    assert [*catalogue_of(machine((PLACE, OF_PLACE)))] == [*catalogue(), PLACE]


# -- found where it is hidden, absent where it is not --------------------------------------

ENCODER = Sensor("encoder", POSITION, "position_1_in", 500.0, 1, 2e-4)
RIVALS = {"viscous_drag", "coulomb_friction", "umbilical_spring", "payload_mass", PLACE}


def experiment(own, truth, seed, program=PROGRAM, sensor=ENCODER):
    rng = np.random.default_rng(seed)
    stamps = np.arange(int(plan(program).duration_s * sensor.rate_hz)) / sensor.rate_hz
    blank = Reading(sensor, stamps, np.zeros(len(stamps)))
    bare = Experiment(
        Source("e.toml", ""), own, (Trial("run.csv", program, None, 0.0, (blank,)),), ()
    )
    (seen,) = ForwardModel(bare)(truth)
    noisy = seen + sensor.noise_rms * rng.standard_normal(len(stamps))
    trial = dataclasses.replace(
        bare.trials[0], readings=(dataclasses.replace(blank, values=noisy),)
    )
    return dataclasses.replace(bare, trials=(trial,))


def diagnosed(own, truth, seed, rivals=RIVALS, program=PROGRAM):
    asked = experiment(own, truth, seed, program)
    return asked, diagnose(asked, left_out={*catalogue_of(own)} - rivals).verdict


@pytest.mark.parametrize("seed", range(5))
def test_a_friction_of_place_is_found_where_it_is_hidden_and_nowhere_else(seed):
    size = float(np.random.default_rng(seed).uniform(60, 160))
    truth = [{PLACE: {"F1": size}}, {"coulomb_friction": {"Fc": size / 20}}, {}][seed % 3]
    asked, verdict = diagnosed(machine((PLACE, OF_PLACE)), truth, seed)
    assert {effect.name for effect in verdict.effects} == truth.keys()
    if PLACE in truth:
        found = verdict.effects[0].parameters["F1"]
        assert found.unit == "N/m"
        low, high = found.ci95
        assert low - (high - low) / 2 < size < high + (high - low) / 2
        repaired = machine_of(asked.machine, machine_text(asked, verdict))
        assert repaired.effects[0].values["F1"].number == pytest.approx(found.value)
        assert moved(repaired) == pytest.approx(
            moved(asked.machine, {PLACE: {"F1": found.value}}), abs=1e-12
        )


def test_an_effect_of_the_experiment_s_file_is_stated_in_the_repaired_machine():
    own = machine((PLACE, OF_PLACE))
    stated = dataclasses.replace(own, source=Source("m.toml", 'name = "m"\nextends = "chow1992"\n'))
    asked, verdict = diagnosed(stated, {PLACE: {"F1": 100.0}}, 1)
    text = machine_text(asked, verdict)
    assert '\n[[effect]]\nname = "friction of place"\nenters = "friction"\n' in text
    assert read_machine(Source("r.toml", text)).formulas == own.formulas


def test_the_shape_of_a_measurement_is_searched():
    text = (
        'enters = "measurement"\nformula = "A * sin(2 * pi * x / P) * sign(v)"\n'
        'A = { unit = "um" }\nP = { unit = "mm", role = "period" }\n'
    )
    truth = {"wave": {"A": 12.0, "P": 9.0}}
    _, verdict = diagnosed(machine(("wave", text)), truth, 3, {"wave", "periodic_error"})
    (found,) = verdict.effects
    assert found.name == "wave"
    assert found.parameters["P"].value == pytest.approx(9.0, rel=0.01)


@pytest.mark.parametrize("period_mm", [0.23, 0.41])
def test_a_period_much_shorter_than_the_travel_is_found(period_mm):
    """More than a hundred cycles in the travel of 51 mm; the samples of the motion show them."""
    slow = mopro.compile("UU012500/1\nVEL1 1.0\nACC1 0.1\nMRI1 1.5\nWX1\nWT100\nMRI1 -2.0\nWX1\n")
    text = (
        'enters = "measurement"\nformula = "A * sin(2 * pi * x / P)"\n'
        'A = { unit = "um" }\nP = { unit = "mm", role = "period" }\n'
    )
    truth = {"wave": {"A": 6.0, "P": period_mm}}
    _, verdict = diagnosed(machine(("wave", text)), truth, 3, {"wave"}, slow)
    (found,) = verdict.effects
    assert found.parameters["P"].value == pytest.approx(period_mm, rel=1e-3)
    assert found.parameters["A"].value == pytest.approx(6.0, rel=0.1)


# -- faults ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "rule", "words"),
    [
        (OF_PLACE.replace("abs(x)", "abs(z)"), "unknown-name", "unknown name z"),
        (OF_PLACE.replace("abs(x)", "abs(v)"), "wrong-unit", "and what enters as friction is in N"),
        (OF_PLACE.replace("abs(x)", "abs(x"), "bad-formula", "never closed"),
        (OF_PLACE.replace("F1 * abs(x)", "F1 * lag(x, 1)"), "wrong-unit", "s is expected"),
        (OF_PLACE.replace("abs(x)", "rate(x)").replace("N/m", "N s/m"), "bad-formula", "signals"),
        (OF_PLACE.replace('"friction"', '"power"'), "bad-value", "one of force, friction, command"),
        (OF_PLACE + 'form = "b"\n', "unknown-key", "form is of effects of other kinds"),
        (OF_PLACE.replace("F1 =", "v ="), "bad-name", "the name v has a meaning"),
        (OF_PLACE.replace("N/m", "furlong"), "wrong-unit", "furlong"),
    ],
)  # fmt: skip
def test_a_fault_of_a_motor_s_formula_is_told_at_its_line(text, rule, words):
    with pytest.raises(ModelError) as caught:
        machine((PLACE, text))
    assert [(d.rule, words in d.message) for d in caught.value.diagnostics] == [(rule, True)]
    assert caught.value.diagnostics[0].span.line > 4


def test_a_term_that_divides_by_zero_in_the_runs_is_told():
    own = machine((PLACE, OF_PLACE.replace("abs(x)", "x / x").replace("N/m", "N")))
    with pytest.raises(ModelError, match="no finite number at 0 s, where x is 0 m") as caught:
        diagnosed(own, {}, 1)
    assert caught.value.diagnostics[0].span.line == 7


def test_a_shape_of_a_unit_that_the_runs_have_not_needs_a_range():
    text = OF_PLACE.replace("abs(x)", "abs(x) * exp(-w)") + 'w = { unit = "1", role = "shape" }\n'
    with pytest.raises(ModelError, match="expected a range of w"):
        diagnosed(machine((PLACE, text)), {}, 1)


def test_another_unit_of_the_same_dimension_is_converted_and_any_other_refused():
    on = '[effects."friction of place"]\nF1 = { value = 2, unit = "N/mm", origin = "assumed" }\n'
    stated = machine((PLACE, OF_PLACE), on=on)
    assert moved(stated) == pytest.approx(
        moved(machine((PLACE, OF_PLACE)), {PLACE: {"F1": 2000.0}}), abs=1e-15
    )
    wrong = machine((PLACE, OF_PLACE), on=on.replace("N/mm", "kg"))
    with pytest.raises(ModelError, match="does not measure"):
        moved(wrong)
