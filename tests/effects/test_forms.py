"""Each effect says in which forms it is fitted, and what of it is whose."""

import dataclasses

import numpy as np
import pytest

from helpers.one_run import LASER, PROGRAM, of
from mopro.effects import Domain, Effect, Parameter, catalogue
from mopro.effects.effect import Scene, angle_in
from mopro.effects.resolve import active_effects
from mopro.engine import Role
from mopro.engine.candidate import RUN
from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.trials import LoggedCommand
from mopro.instruments.quantity import TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.motion import plan
from mopro.source import Source

MACHINE = load_machine("chow1992")
ALL = pytest.mark.parametrize("effect", catalogue().values(), ids=lambda effect: effect.name)
OTHER_AXIS = dataclasses.replace(LASER, name="other", column="position_2_in", axis=2)
THERMOCOUPLE = Sensor("tc", TEMPERATURE, "temperature_C", 2.0, noise_rms=0.1)


def motor(*sensors, machine=MACHINE):
    """A run in which each of the sensors (a laser unless given) read zero."""
    experiment = of(np.zeros(200))
    (trial,) = experiment.trials
    (reading,) = trial.readings
    readings = tuple(dataclasses.replace(reading, sensor=s) for s in sensors or (LASER,))
    trials = (dataclasses.replace(trial, readings=readings),)
    return ForwardModel(dataclasses.replace(experiment, machine=machine, trials=trials))


@pytest.fixture(scope="module")
def view():
    return motor()


@ALL
def test_forms_fit_the_effect_s_own_parameters_within_its_bounds(effect, view):
    forms = {form.form: form for form in effect.candidates(view)}
    names = {p.name: p for p in effect.parameters}
    names |= {angle_in(0, p.name): p for p in effect.parameters if p.per_run}
    for form in forms.values():
        assert form.name == effect.name
        assert {*form.fixed} <= {*names}
        for fitted in form.parameters:
            assert fitted.name in names or fitted.name == RUN
            if fitted.role is not Role.SEARCHED:
                stated = names[fitted.name]
                assert fitted.unit == stated.unit
                assert stated.low <= fitted.low < fitted.high <= stated.high
                assert all(fitted.low <= start <= fitted.high for start in fitted.starts)
        if form.extends is not None:
            fewer = {p.name for p in forms[form.extends].parameters}
            assert fewer < {p.name for p in form.parameters}


@ALL
def test_no_number_is_held_that_is_only_known_to_within_a_range(effect):
    """With one that is wrong another effect fits better, and an interval is too narrow."""
    forms = list(effect.candidates(motor(LASER, OTHER_AXIS, THERMOCOUPLE)))
    for p in effect.parameters:
        held = {form.fixed[p.name] for form in forms if p.name in form.fixed}
        known = p.plausible[0] == p.plausible[1] or len(held) > 1 or p.unit_of
        assert known or not held or p.response is not Role.SHAPE, p.name


def test_a_constant_that_is_assumed_is_fitted_at_the_price_of_its_prior(view):
    (form,) = catalogue()["resistance_tempco"].candidates(view)
    size, reference = form.parameters
    air_C = MACHINE.heat.ambient_C
    assert (reference.name, reference.role) == ("T0", Role.CONSTANT)
    assert (reference.low, reference.high) == catalogue()["resistance_tempco"].parameter(
        "T0"
    ).plausible
    assert reference.starts == (air_C, reference.low, reference.high)
    assert (size.name, dict(form.fixed)) == ("alpha", {})


def test_a_constant_that_the_machine_s_file_states_is_not_assumed():
    stated = MACHINE.with_effects({"resistance_tempco": {"alpha": 0.00393, "T0": 21.0}})
    (form,) = catalogue()["resistance_tempco"].candidates(motor(THERMOCOUPLE, machine=stated))
    assert [p.name for p in form.parameters] == ["alpha"]
    assert dict(form.fixed) == {"T0": 21.0}


@ALL
def test_each_is_offered_where_its_quantity_is_measured_in_forms_of_different_names(effect):
    offered = candidates(motor(LASER, THERMOCOUPLE))
    keys = [c.key for c in offered if c.name == effect.name]
    assert len(set(keys)) == len(keys)
    # An offset of each series is fitted always.
    assert bool(keys) == (effect.constant_offset is None)


@ALL
def test_an_effect_of_heat_is_offered_where_a_temperature_is_measured(effect):
    of_position, of_temperature = (
        {c.name for c in candidates(motor(sensor))} for sensor in (LASER, THERMOCOUPLE)
    )
    assert (effect.name in of_temperature) == (effect.domain is Domain.HEAT)
    assert not (effect.name in of_position and effect.domain is Domain.HEAT)


def test_an_effect_of_the_measurement_is_offered_for_each_of_two_axes():
    forms = {c.key for c in candidates(motor(LASER, OTHER_AXIS))}
    assert {("sensor_gain", ""), ("sensor_gain", "axis 1"), ("sensor_gain", "axis 2")} <= forms
    assert ("viscous_drag", "axis 1") not in forms


def test_a_logged_command_has_no_program_that_could_be_taken_in_another_way():
    experiment = of(np.zeros(200))
    (trial,) = experiment.trials
    stamps = np.arange(0.0, 0.2, 1e-3)
    logged = dataclasses.replace(
        trial, program=None, command=LoggedCommand(stamps, {1: np.sin(stamps)})
    )
    offered = candidates(ForwardModel(dataclasses.replace(experiment, trials=(logged,))))
    absent = {"acceleration_scale", "velocity_scale", "start_delay", "lost_steps"}
    assert absent.isdisjoint({c.name for c in offered})
    assert {"controller_clock", "profile_tick"} <= {c.name for c in offered}


# -- an effect that declares no forms ----------------------------------------------


class Twofold(Effect):
    """Two amplitudes, a shape, an angle and a temperature. Source: test."""

    name = "twofold"
    domain = Domain.DYNAMICS
    parameters = (
        Parameter("a", "N", "force", 1.0, (0.0, 4.0), 0.0, 6.0, "one"),
        Parameter("b", "N", "force", 0.0, (-2.0, 2.0), -3.0, 30.0, "two"),
        Parameter("L", "m", "length", 0.1, (0.05, 0.2), 1e-3, 1.0, "length", null=0.1),
        Parameter("phi", "rad", "angle", 0.0, (-3.0, 3.0), -7.0, 7.0, "angle", role=Role.PHASE),
        Parameter("T0", "C", "temperature", 20.0, (15.0, 30.0), -50.0, 90.0, "where", null=20.0),
    )


def test_what_declares_no_forms_is_fitted_by_each_amplitude_and_by_all(view):
    forms = {form.form: form for form in Twofold().forms(view)}
    air = {"L": 0.1, "T0": MACHINE.heat.ambient_C}
    assert {name: form.fixed for name, form in forms.items()} == {
        "a": {**air, "b": 0.0}, "a and b": air, "b": {**air, "a": 0.0}, "b and a": air,
    }  # fmt: skip
    assert [p.name for p in forms["b and a"].parameters] == ["b", "a", "phi"]
    assert {name: form.extends for name, form in forms.items() if form.extends} == {
        "a and b": "a", "b and a": "b",
    }  # fmt: skip
    a, b, phi = forms["a and b"].parameters
    assert [(a.low, a.high, a.starts), (b.low, b.high, b.starts)] == [
        (0.0, 6.0, (1.0,)), (-3.0, 4.0, (1.0,)),
    ]  # fmt: skip
    assert phi.role is Role.PHASE


def test_what_declares_no_forms_has_the_constants_that_it_assumes_fitted(view):
    for form in Twofold().candidates(view):
        assert not {"L", "T0"} & {*form.fixed}
        assert {p.name for p in form.parameters if p.role is Role.CONSTANT} == {"L", "T0"}


# -- what a machine makes of an effect ---------------------------------------------


def test_what_the_machine_has_already_is_off_where_it_has_it():
    machine = MACHINE.with_effects({"viscous_drag": {"b": 3.0}, "platen_conduction": {"G": 2.0}})
    offered = {c.key: c for c in candidates(motor(LASER, THERMOCOUPLE, machine=machine))}
    (drag,) = offered["viscous_drag", ""].parameters
    assert drag.null == 3.0
    assert 3.0 not in drag.starts
    assert offered["platen_conduction", "g"].fixed["G"] == 2.0


def test_a_drive_of_the_full_electrical_model_has_its_effect_at_its_supply():
    full = dataclasses.replace(MACHINE, drive=dataclasses.replace(MACHINE.drive, model="full"))
    (own,) = active_effects(full, catalogue())
    assert (own.name, own.values) == ("voltage_saturation", (MACHINE.drive.supply_V,))
    stated = full.with_effects({"voltage_saturation": {"Vb": 45.0}})
    assert [a.values for a in active_effects(stated, catalogue())] == [(45.0,)]


@pytest.mark.parametrize("name", ["force_constant", "electrical_damping"])
def test_a_number_that_an_effect_corrects_is_one_of_the_machine_file(name):
    number = catalogue()[name].toleranced(MACHINE)
    head = f"{number.key.partition('.')[2]} = {{"
    text = MACHINE.source.text.replace(head, f"{head} tolerance = 0.2,")
    tolerant = read_machine(Source("mine.toml", text))
    (form,) = [c for c in candidates(motor(machine=tolerant)) if c.name == name]
    (parameter,) = form.parameters
    reach = 0.2 * number.scale
    assert parameter.tolerated == (number.middle - reach, number.middle + reach)


def test_the_damping_is_as_uncertain_as_the_force_that_the_file_makes_it_with():
    """c_s = 2 zeta √(K m), and K goes with the force: half of its tolerance adds to zeta's."""
    text = MACHINE.source.text
    for key, share in (("damping_ratio", 0.15), ("pull_out_force", 0.1)):
        text = text.replace(f"{key} = {{", f"{key} = {{ tolerance = {share},")
    tolerant = read_machine(Source("mine.toml", text))
    (form,) = [c for c in candidates(motor(machine=tolerant)) if c.name == "electrical_damping"]
    assert form.parameters[0].tolerated == pytest.approx((0.03 * 0.8, 0.03 * 1.2))


@pytest.mark.parametrize(
    "effect", [e for e in catalogue().values() if e.changes_program], ids=lambda effect: effect.name
)
def test_no_plausible_value_makes_a_program_faster_than_what_an_effect_says(effect):
    """The first parameter at either end, the others at their defaults."""
    first, *others = effect.parameters
    defaults = [p.default for p in others]

    def duration_s(*values):
        return plan(effect.program(PROGRAM, *values)).duration_s

    shortest_s = min(duration_s(end, *defaults) for end in first.plausible)
    fastest = effect.fastest()
    said_s = duration_s(*fastest) if fastest else plan(PROGRAM).duration_s
    assert said_s == pytest.approx(shortest_s)


@pytest.mark.parametrize("domain", [Domain.DYNAMICS, Domain.MEASUREMENT])
def test_what_depends_on_the_temperature_says_so(domain):
    """Else a prediction would leave the heat out."""
    x = np.linspace(0.0, 0.1, 5)
    cold, hot = (Scene(x, x, np.full(5, kelvins), 20.0) for kelvins in (30.0, 80.0))
    for effect in (e for e in catalogue().values() if e.domain is domain):
        values = [p.plausible[1] for p in effect.parameters]
        seen = [
            (effect.geometry(x, s, *values), effect.reading(x, s, *values),
             effect.force_factor(s.temperature_C, *values))
            for s in (cold, hot)
        ]  # fmt: skip
        differs = any(not np.array_equal(one, other) for one, other in zip(*seen, strict=True))
        assert effect.needs_temperature == differs, effect.name


def test_a_static_deflection_is_what_the_largest_plausible_force_makes_of_the_stiffness():
    deflections = {e.name: e.static_deflection_m(MACHINE) for e in catalogue().values()}
    assert deflections.pop("constant_force") == 5.0 / MACHINE.axis.stiffness_N_m
    assert set(deflections.values()) == {0.0}
