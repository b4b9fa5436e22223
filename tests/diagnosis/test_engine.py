"""The engine on a servo axis with effects hidden in it, on a table, and on bad data."""

import math
from dataclasses import replace

import numpy as np
import pytest
from servo import CATALOGUE, Servo

import mopro
from mopro.diagnosis import Candidate, Parameter, Series

SIGMA = 0.1
SERVO = Servo()


def verdict_of(truth, seed=0, sigma=SIGMA, servo=SERVO, catalogue=CATALOGUE):
    return mopro.reconcile(servo.predict, catalogue, servo.measure(truth, sigma, seed))


def names(verdict):
    return {effect.name for effect in verdict.effects}


@pytest.mark.parametrize(
    "truth",
    [
        {"viscous": {"b": 3.0}},
        {"coulomb": {"Fc": 0.5}},
        {"stribeck": {"Fs": 0.6, "v0": 0.2}},
        {"inertia": {"dM": -0.1}},
        {"position_ripple": {"sine": 0.2, "cosine": 0.1, "period": 0.02}},
        {"viscous": {"b": 2.0}, "coulomb": {"Fc": 0.5}},
        {"viscous": {"b": 2.0}, "inertia": {"dM": 0.2}},
        {"viscous": {"b": 2.0}, "coulomb": {"Fc": 0.5},
         "position_ripple": {"sine": 0.2, "cosine": 0.1, "period": 0.02}},
    ],
    ids="+".join,
)  # fmt: skip
def test_hidden_effects_are_named_and_the_gap_closes(truth):
    verdict = verdict_of(truth)
    assert (verdict.verdict, names(verdict)) == ("named", set(truth))
    assert verdict.gap.after_rms < 1.1 * SIGMA < verdict.gap.before_rms
    assert verdict.gap.held_out_rms < 1.1 * SIGMA
    for effect in verdict.effects:
        assert effect.held_out
        assert effect.log10_bayes_factor > 2
        for name, estimate in effect.parameters.items():
            low, high = estimate.ci95
            width = high - low
            assert low - width < truth[effect.name][name] < high + width


def test_nothing_hidden_is_none_in_twenty_of_twenty():
    verdicts = [verdict_of({}, seed).verdict for seed in range(20)]
    assert verdicts == ["none"] * 20


def unknown_noise(truth, seed=0, **how):
    data = [replace(series, sigma=None) for series in SERVO.measure(truth, SIGMA, seed, **how)]
    return mopro.reconcile(SERVO.predict, CATALOGUE, data)


def test_noise_that_nobody_knows_is_told_by_the_data():
    """White noise of any strength is none; a shape in what is left is seen all the same."""
    assert [unknown_noise({}, seed).verdict for seed in range(20)] == ["none"] * 20
    heavy = unknown_noise({"viscous": {"b": 3.0}, "inertia": {"dM": 0.2}})
    assert (heavy.verdict, names(heavy)) == ("named", {"viscous", "inertia"})
    for truth, words in (
        ({"bump": {"height": 0.6}}, "in position"),
        ({"drift": {"rate": 0.5}}, "drift in time"),
        ({"hum": {"A": 0.15}}, "line at 50 Hz"),
    ):
        strange = unknown_noise(truth)
        assert (strange.verdict, names(strange)) == ("unexplained", set())
        assert words in strange.remainder.description


def test_a_clear_effect_beside_something_strange_is_kept_with_unknown_noise_too():
    both = unknown_noise({"viscous": {"b": 10.0}, "drift": {"rate": 0.5}})
    assert (both.verdict, names(both)) == ("unexplained", {"viscous"})


def test_a_constant_offset_is_no_effect():
    data = SERVO.measure({}, SIGMA, seed=1, offset=25.0)
    assert mopro.reconcile(SERVO.predict, CATALOGUE, data).verdict == "none"


@pytest.mark.parametrize(
    ("truth", "words"),
    [
        ({"bump": {"height": 0.6}}, "in position"),
        ({"drift": {"rate": 0.5}}, "drift in time"),
        ({"hum": {"A": 0.15}}, "line at 50 Hz"),
    ],
    ids=str,
)
def test_what_no_effect_accounts_for_is_unexplained_and_described(truth, words):
    verdict = verdict_of(truth)
    assert verdict.verdict == "unexplained"
    assert words in verdict.remainder.description
    assert not verdict.effects


def test_something_named_beside_something_unexplained():
    verdict = verdict_of({"viscous": {"b": 3.0}, "hum": {"A": 0.15}})
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"viscous"})


def test_a_family_is_answered_as_one():
    """Within one slow sine, drag and a lag of the same signature cannot be told apart."""
    twin = Candidate("twin_of_viscous", (Parameter("c", "N s/m", 0, 20, (1.0,)),))

    def predict(settings):
        renamed = {("viscous" if k == "twin_of_viscous" else k): v for k, v in settings.items()}
        if "twin_of_viscous" in settings:
            renamed["viscous"] = {"b": settings["twin_of_viscous"]["c"]}
        return SERVO.predict(renamed)

    data = SERVO.measure({"viscous": {"b": 3.0}}, SIGMA, 0)
    verdict = mopro.reconcile(predict, (*CATALOGUE, twin), data)
    (effect,) = verdict.effects
    assert verdict.verdict == "ambiguous"
    assert {effect.name, *effect.indistinguishable_from} == {"viscous", "twin_of_viscous"}


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    truth, hits, count = {"viscous": {"b": 1.0}, "inertia": {"dM": 0.05}}, 0, 0
    for seed in range(12):
        for effect in verdict_of(truth, seed, servo=Servo(runs=2, samples=200)).effects:
            for name, estimate in effect.parameters.items():
                low, high = estimate.ci95
                hits += low <= truth[effect.name][name] <= high
                count += 1
    assert count >= 23
    assert hits / count >= 0.85


def test_the_trap_of_the_ripple_that_only_fits_what_it_was_fitted_to():
    """A ripple in one run alone lowers the misfit there, and worsens the others."""
    data = SERVO.measure({}, SIGMA, 0)
    q = SERVO.motions[0][0]
    fooled = Series(
        "run 0", "force", "N", data[0].values + 0.12 * np.sin(2 * np.pi * q / 0.02), SIGMA,
        SERVO.time_s, labels=data[0].labels,
    )  # fmt: skip
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, [fooled, *data[1:]])
    assert not verdict.effects
    assert any("held out" in r.reason or "unexplained" in r.reason for r in verdict.rejected)


def test_order_of_runs_and_units_of_force_do_not_matter():
    truth = {"viscous": {"b": 2.0}, "coulomb": {"Fc": 0.5}}
    data = SERVO.measure(truth, SIGMA, 3)
    plain = mopro.reconcile(SERVO.predict, CATALOGUE, data)
    turned = mopro.reconcile(lambda s: SERVO.predict(s)[::-1], CATALOGUE, data[::-1])
    assert names(turned) == names(plain) == set(truth)
    in_mN = [Series(s.run, s.sensor, "mN", s.values * 1000, s.sigma * 1000, s.time_s) for s in data]
    scaled = mopro.reconcile(lambda s: [f * 1000 for f in SERVO.predict(s)], CATALOGUE, in_mN)
    assert scaled.gap.before_rms == pytest.approx(1000 * plain.gap.before_rms)
    for one, other in zip(plain.effects, scaled.effects, strict=True):
        for name, estimate in one.parameters.items():
            assert other.parameters[name].value == pytest.approx(estimate.value, rel=1e-3)


def test_json_has_the_fields_of_the_contract():
    answer = verdict_of({"viscous": {"b": 3.0}}).as_json()
    assert {"verdict", "effects", "where", "gap", "remainder", "next_experiment"} <= answer.keys()
    (effect,) = answer["effects"]
    assert {"name", "indistinguishable_from", "parameters", "evidence"} <= effect.keys()
    assert effect["parameters"]["b"]["unit"] == "N s/m"
    assert {"unit", "before_rms", "after_rms", "noise_rms", "held_out"} <= answer["gap"].keys()
    assert answer["where"][0]["rms"] > answer["where"][0]["sigma"]


class TestTable:
    """Few numbers of unknown noise, as in a table of steady states."""

    X = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    CATALOGUE = (
        Candidate("slope", (Parameter("a", "1", -10, 10, (1.0,)),)),
        Candidate("curve", (Parameter("b", "1", -10, 10, (1.0,)),)),
        Candidate("wave", (Parameter("c", "1", -10, 10, (1.0,)),)),
    )

    def predict(self, settings):
        shapes = {"slope": self.X, "curve": self.X**2, "wave": np.sin(2 * self.X)}
        total = np.zeros(8)
        for name, parameters in settings.items():
            total = total + shapes[name] * next(iter(parameters.values()))
        return [total]

    @pytest.mark.parametrize(("truth", "verdict"), [({}, "none"), ({"slope": {"a": 2.0}}, "named")])
    def test_noise_is_learnt_from_the_fit(self, truth, verdict):
        rng = np.random.default_rng(5)
        values = self.predict(truth)[0] + 0.3 * rng.standard_normal(8)
        table = Series("table", "rise", "K", values, None, folds=np.arange(8),
                       nuisances=np.zeros((8, 0)))  # fmt: skip
        answer = mopro.reconcile(self.predict, self.CATALOGUE, [table])
        assert (answer.verdict, names(answer)) == (verdict, set(truth))
        assert answer.gap.noise_rms is None


class TestBadInput:
    def refused(self, message, predict=SERVO.predict, catalogue=CATALOGUE, data=None):
        with pytest.raises(ValueError, match=message):
            mopro.reconcile(
                predict, catalogue, SERVO.measure({}, SIGMA, 0) if data is None else data
            )

    def test_each_is_named(self):
        gap = SERVO.measure({}, SIGMA, 0)
        gap[1].values[7] = math.nan
        self.refused("run 1, force: expected finite numbers", data=gap)
        self.refused("there are no data", data=[])
        self.refused("the model predicts", predict=lambda s: SERVO.predict(s)[:1])
        self.refused("the same name", catalogue=[CATALOGUE[0], CATALOGUE[0]])
