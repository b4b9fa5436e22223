"""An effect that is in one run alone is named in that run, and not as one of all runs."""

from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import names
from mopro.engine.candidate import RUN
from mopro.experiment.wording import odd_run_words, sentence

SIGMA = 0.1
SERVO = Servo(runs=4)
RUNS = [f"run {nth}" for nth in range(4)]
IN_ONE_RUN = {
    name: [effect.in_run(name, nth) for effect in CATALOGUE] for nth, name in enumerate(RUNS)
}


def predict(settings, servo=SERVO):
    """The axis, with the effects that tell a run on in that alone."""
    return [
        servo._force(
            motion,
            {name: own for name, own in settings.items() if own.get(RUN, nth) == nth},
        )
        for nth, motion in enumerate(servo.motions)
    ]


def measured(truth, seed=0, odd=lambda t, q: 0.0 * t, servo=SERVO):
    """Readings with `truth` in them, and in run 2 also `odd` of time and place."""
    rng = np.random.default_rng(seed)
    data = []
    for own, force in zip(servo.measure({}, SIGMA, 0), predict(truth, servo), strict=True):
        extra = odd(own.time_s, own.labels["position"]) if own.run == RUNS[2] else 0.0
        noise = SIGMA * rng.standard_normal(len(force))
        data.append(replace(own, values=force + extra + noise))
    return data


def reconciled(data, in_one_run=IN_ONE_RUN):
    return mopro.reconcile(predict, CATALOGUE, data, in_one_run=in_one_run)


OF_ONE_RUN = {
    "a drag": {"viscous": {"b": 1.0, RUN: 1}},
    "a friction": {"coulomb": {"Fc": 0.6, RUN: 3}},
    "a mass": {"inertia": {"dM": 0.08, RUN: 0}},
    "a drag beside one of all": {"viscous": {"b": 3.0}, "inertia": {"dM": 0.08, RUN: 2}},
    "a friction beside a mass": {"coulomb": {"Fc": 0.6, RUN: 1}, "inertia": {"dM": 0.3}},
}


@pytest.mark.parametrize("truth", OF_ONE_RUN.values(), ids=OF_ONE_RUN)
@pytest.mark.parametrize("seed", [0, 1])
def test_an_effect_of_one_run_is_told_in_that_run_only(truth, seed):
    verdict = reconciled(measured(truth, seed))
    assert (verdict.verdict, names(verdict)) == ("named", set(truth))
    for effect in verdict.effects:
        hidden = truth[effect.name]
        assert effect.run == (RUNS[hidden[RUN]] if RUN in hidden else None)
        assert effect.held_out
        for name in hidden.keys() - {RUN}:
            low, high = effect.parameters[name].ci95
            assert low - 0.3 * (high - low) < hidden[name] < high + 0.3 * (high - low)
    (odd,) = {own.run for own in verdict.effects} - {None}
    assert verdict.odd_run.run == odd
    assert f" in {odd} only" in sentence(verdict)
    written = verdict.as_json()
    assert [e.get("run") for e in written["effects"]] == [e.run for e in verdict.effects]
    assert written["odd_run"]["run"] == odd
    assert written["odd_run"]["others_scatter_sigma"] < 1.1 < written["odd_run"]["scatter_sigma"]


@pytest.mark.parametrize("truth", [OF_ONE_RUN["a drag"], OF_ONE_RUN["a friction"]], ids=str)
def test_the_run_is_told_where_no_effect_of_it_can_be_tried(truth):
    verdict = reconciled(measured(truth), in_one_run={})
    assert (verdict.verdict, verdict.effects) == ("unexplained", ())
    ((_, own),) = truth.items()
    (line,) = odd_run_words(verdict)
    assert line.startswith(f"{RUNS[own[RUN]]} disagrees (")
    assert f"what is left in {RUNS[own[RUN]]} alone looks like" in sentence(verdict)


UNLISTED = {
    "a bump": lambda t, q: 0.6 * np.exp(-(((q - 0.05) / 0.01) ** 2)),
    "a line": lambda t, q: 0.3 * np.sin(300 * t),
    "a step": lambda t, q: 0.4 * (t > 0.6),
}


@pytest.mark.parametrize("odd", UNLISTED.values(), ids=UNLISTED)
def test_what_nobody_listed_in_one_run_is_no_effect_of_it(odd):
    verdict = reconciled(measured({}, odd=odd))
    assert (verdict.verdict, verdict.effects, verdict.odd_run.run) == ("unexplained", (), RUNS[2])


@pytest.mark.parametrize(
    "truth",
    [{}, {"viscous": {"b": 1.0}}, {"drift": {"rate": 0.5}}, {"bump": {"height": 0.6}}],
    ids=str,
)
def test_no_run_is_odd_where_all_are_alike(truth):
    verdicts = [reconciled(measured(truth, seed)) for seed in range(5)]
    assert [verdict.odd_run for verdict in verdicts] == [None] * 5
    assert not any(effect.run for verdict in verdicts for effect in verdict.effects)


def test_of_two_runs_it_may_be_either():
    """Each of them agrees with some drag; the one that agrees with none is not the odd one."""
    servo = Servo(runs=2)
    data = measured({"viscous": {"b": 1.0, RUN: 1}}, servo=servo)
    verdict = mopro.reconcile(
        lambda s: predict(s, servo),
        CATALOGUE,
        data,
        in_one_run={n: IN_ONE_RUN[n] for n in RUNS[:2]},
    )
    assert [(e.name, e.run) for e in verdict.effects] == [("viscous", RUNS[1])]
    both = [{"viscous": {"b": 2.0, RUN: 0}}, {"viscous": {"b": 1.0, RUN: 1}}]
    first, second = (measured(each, servo=servo)[nth] for nth, each in enumerate(both))
    verdict = mopro.reconcile(lambda s: predict(s, servo), CATALOGUE, [first, second])
    assert (verdict.verdict, verdict.odd_run) == ("unexplained", None)


def test_a_calibration_of_all_runs_is_a_finding_in_one():
    (parameter,) = CATALOGUE[0].parameters
    exact = replace(CATALOGUE[0], parameters=(replace(parameter, tolerated=(0.0, 2.0)),))
    own = exact.in_run("a.csv", 3)
    assert (own.run, own.fixed[RUN], own.form) == ("a.csv", 3.0, "in a.csv")
    assert not own.calibrates
