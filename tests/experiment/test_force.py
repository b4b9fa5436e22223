"""A force sensor: a quantity that stands in one place is read, compared and reconciled."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.diagnosis import diagnose
from mopro.effects import Active, Domain, catalogue
from mopro.errors import ModelError
from mopro.experiment import load_experiment
from mopro.experiment.comparison import DISAGREEMENT, NO_DISAGREEMENT, compare
from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.feasible import too_long
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.labels import PHASES, labels
from mopro.experiment.sawyer.nominal import planned
from mopro.experiment.sawyer.system import Sawyer, series_of
from mopro.experiment.sawyer.trials import Reading, Trial
from mopro.instruments.quantity import FORCE, POSITION
from mopro.instruments.sensor import Sensor
from mopro.plant import measured_at
from mopro.program import AXES

NOISE_N = 0.5
GAUGE = Sensor("gauge", FORCE, "force_1_N", 1000.0, 1, NOISE_N)
ENTRY = """
[[sensor]]
name = "gauge"
quantity = "force"
column = "force_1_N"
rate_hz = 1000.0
noise_rms = 0.5
"""
RUNS = [f'program = "{name}.CMD"\ndata = "{name}.csv"' for name in ("fast", "slow")]


def measured(lab, effects=None):
    """Both programs as a force sensor on axis 1 sees them."""
    for name in ("fast", "slow"):
        lab.record(f"{name}.CMD", f"{name}.csv", effects, [GAUGE])
    return load_experiment(lab.experiment(RUNS, ENTRY))


def test_an_experiment_file_has_a_force_sensor(lab):
    fast, slow = measured(lab).trials
    assert fast.readings[0].sensor == slow.readings[0].sensor == GAUGE
    assert fast.follows_motion


def test_a_force_in_metres_is_refused_and_newtons_are_suggested(lab):
    lab.program("fast.CMD")
    lab.write("fast.csv", "time_s,force_1_m\n0,0\n0.001,0\n")
    lab.experiment(RUNS[:1], ENTRY.replace("force_1_N", "force_1_m"))
    with pytest.raises(ModelError) as caught:
        lab.load()
    text = caught.value.render()
    assert "sensor gauge: column force_1_m has no unit of a force [wrong-unit]" in text
    assert "expected _N or _lbf" in text


def test_forces_of_the_machine_itself_agree_with_its_simulation(lab):
    comparison = compare(Sawyer(measured(lab)), 1)
    assert comparison.verdict == NO_DISAGREEMENT
    assert {place.axis for place in comparison.where} == {1}
    assert {place.unit for place in comparison.where} == {"N"}
    assert {place.phase for place in comparison.where} == set(PHASES)


def test_samples_have_the_labels_of_their_axis_and_are_held_out_with_its_moves(lab):
    experiment = measured(lab)
    first = series_of(ForwardModel(experiment))[0]
    reading = experiment.trials[0].readings[0]
    microstep_m = experiment.machine.microstep_m
    schedule = planned(experiment.trials[0], experiment.machine)
    own = labels(schedule, 1, reading.time_s, microstep_m)
    assert (first.unit, first.position_unit) == ("N", "m")
    assert np.array_equal(first.folds, own.move)
    assert set(first.folds) == {0, 1}
    assert np.array_equal(first.labels["position"], own.command_m)
    assert np.array_equal(first.labels["line"], own.line)


def test_a_drag_that_the_model_lacks_is_named(lab):
    experiment = measured(lab, {"viscous_drag": {"b": 8.0}})
    assert compare(Sawyer(experiment), 1).verdict == DISAGREEMENT
    found = diagnose(experiment)
    assert found.verdict.verdict == "named"
    (drag,) = found.verdict.effects
    low, high = drag.parameters["b"].ci95
    assert drag.name == "viscous_drag"
    assert low < 8.0 < high
    assert drag.parameters["b"].value == pytest.approx(8.0, rel=0.05)


def test_an_offset_of_all_runs_is_the_sensor_s_or_a_constant_force(lab):
    experiment = measured(lab)
    trials = tuple(
        replace(trial, readings=tuple(replace(r, values=r.values + 2.0) for r in trial.readings))
        for trial in experiment.trials
    )
    verdict = diagnose(replace(experiment, trials=trials)).verdict
    (offset,) = verdict.effects
    (size,) = offset.parameters.values()
    assert (verdict.verdict, offset.form, size.unit) == ("ambiguous", "gauge", "N")
    assert size.value == pytest.approx(2.0, abs=0.1)
    assert "constant_force" in offset.rivals


def test_what_acts_on_places_does_not_act_on_forces():
    dense = np.arange(4001) / 4000
    columns = {"time_s": dense, "force_1_N": np.sin(40 * dense)}
    stamps = np.arange(1000) / 1000
    machine = None  # nothing of it is asked for
    plain = measured_at(columns, GAUGE, machine, (), stamps)
    assert np.allclose(plain, np.sin(40 * stamps), atol=1e-6)
    changed = set()
    for effect in catalogue().values():
        values = tuple(max(p.plausible, key=abs) for p in effect.parameters)
        active = (Active(effect, values, AXES),)
        if not np.array_equal(measured_at(columns, GAUGE, machine, active, stamps), plain):
            changed.add(effect.name)
    assert changed == {effect.name for effect in catalogue().values() if effect.retimes}


def test_only_what_a_force_can_show_is_fitted_to_forces(lab):
    experiment = measured(lab)
    of_force = {candidate.name for candidate in candidates(ForwardModel(experiment))}
    domains = {name: catalogue()[name].domain for name in of_force}
    assert {n for n, d in domains.items() if d is Domain.MEASUREMENT} == {
        e.name for e in catalogue().values() if e.retimes
    }
    assert Domain.HEAT not in domains.values()
    assert {Domain.COMMAND, Domain.DYNAMICS} < {*domains.values()}


def test_a_laser_and_a_gauge_on_one_run_are_predicted_as_each_by_itself(lab):
    laser = Sensor("laser", POSITION, "position_1_in", 1000.0, 1, 2e-5)
    lab.record("fast.CMD", "fast.csv", None, [laser, GAUGE])
    sensors = ENTRY + ENTRY.replace("force_1_N", "position_1_in").replace(
        '"force"', '"position"'
    ).replace("gauge", "laser")
    both, alone = (
        ForwardModel(load_experiment(lab.experiment(RUNS[:1], entries)))({})
        for entries in (sensors, ENTRY)
    )
    assert np.array_equal(both[0], alone[0])
    assert float(np.ptp(both[1])) == pytest.approx(2.0, rel=0.1)


def test_forces_may_last_no_longer_than_can_be_simulated():
    reading = Reading(GAUGE, np.array([0.0, 2000.0]), np.zeros(2))
    (finding,) = too_long([Trial("long.csv", None, None, 0.0, (reading,))])
    assert finding.message == "long.csv has 2000 s of forces"


@pytest.mark.parametrize("b", [-1e7, -1e15])
def test_a_motion_that_diverges_predicts_nothing_and_ends_nothing(lab, b):
    model = ForwardModel(measured(lab))
    predicted = model({"viscous_drag": {"b": b}})
    assert [len(own) for own in predicted] == [len(own) for own in model({})]
    assert not np.isfinite(np.concatenate(predicted)).all()
