"""`mopro.reconcile` on a servo axis with hidden effects, on a table, and on bad data."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import names
from mopro.engine import Candidate, Parameter, Series

SIGMA = 0.1
SERVO = Servo()


def hidden(truth, seed=0, sigma=SIGMA, servo=SERVO, catalogue=CATALOGUE):
    return mopro.reconcile(servo.predict, catalogue, servo.measure(truth, sigma, seed))


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
    verdict = hidden(truth)
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
    verdicts = [hidden({}, seed).verdict for seed in range(20)]
    assert verdicts == ["none"] * 20


def hidden_with_unknown_noise(truth, seed=0, **how):
    data = [replace(series, sigma=None) for series in SERVO.measure(truth, SIGMA, seed, **how)]
    return mopro.reconcile(SERVO.predict, CATALOGUE, data)


UNMODELLED = [
    ({"bump": {"height": 0.6}}, "in position"),
    ({"drift": {"rate": 0.5}}, "drift in time"),
    ({"hum": {"A": 0.15}}, "line at 50 Hz"),
]


def test_unknown_noise_is_estimated():
    assert [hidden_with_unknown_noise({}, seed).verdict for seed in range(20)] == ["none"] * 20
    truth = {"viscous": {"b": 3.0}, "inertia": {"dM": 0.2}}
    verdict = hidden_with_unknown_noise(truth)
    assert (verdict.verdict, names(verdict)) == ("named", set(truth))


@pytest.mark.parametrize("verdict_on", [hidden_with_unknown_noise, lambda truth: hidden(truth)])
@pytest.mark.parametrize(("truth", "words"), UNMODELLED, ids=str)
def test_what_no_effect_accounts_for_is_unexplained_and_described(truth, words, verdict_on):
    verdict = verdict_on(truth)
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    assert words in verdict.remainder.description


def test_a_strong_effect_is_named_beside_a_drift_with_hidden_with_unknown_noise():
    both = hidden_with_unknown_noise({"viscous": {"b": 10.0}, "drift": {"rate": 0.5}})
    assert (both.verdict, names(both)) == ("unexplained", {"viscous"})


def test_a_strong_effect_is_named_beside_an_unexplained_hum():
    verdict = hidden({"viscous": {"b": 3.0}, "hum": {"A": 0.15}})
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"viscous"})


def test_a_constant_offset_is_no_effect():
    data = SERVO.measure({}, SIGMA, seed=1, offset=25.0)
    assert mopro.reconcile(SERVO.predict, CATALOGUE, data).verdict == "none"


@pytest.mark.parametrize(("slope", "named"), [(0.0, set()), (8.0, {"slope"})])
def test_a_slope_is_named_beside_a_slow_disturbance_only_if_it_is_much_larger(slope, named):
    """An exponential approach, 3 σ high, contains a slope of that order; 8 σ more are another."""
    t = np.linspace(0.0, 1.0, 2000)
    straight = Candidate("slope", (Parameter("b", "N", -90.0, 90.0, (0.1,)),))
    values = 3 * SIGMA * (1 - np.exp(-t / 0.3)) + slope * SIGMA * t
    values = values + SIGMA * np.random.default_rng(1).standard_normal(len(t))
    data = [Series("run", "force", "N", values, SIGMA, t, np.arange(2000) // 200)]
    verdict = mopro.reconcile(lambda s: [s.get("slope", {"b": 0.0})["b"] * t], [straight], data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", named)


def test_an_effect_that_is_there_is_named_beside_a_larger_remainder():
    """Beside a bump of 1.4 V, `weak` explains five times what remains, `strong` fifty times."""
    t, there = np.linspace(0.0, 5.0, 2000), (("strong", 7.0), ("weak", 11.0))
    shapes = {name: np.sin(f * t) for name, f in (*there, ("absent", 29.0))}
    size = Parameter("size", "V", -90.0, 90.0, (1.0,))

    def simulate(settings):
        return [sum((v["size"] * shapes[n] for n, v in settings.items()), np.zeros(2000))]

    bump = 1.4 * np.exp(-(((t - 2.0) / 0.8) ** 2))
    (values,) = simulate({"strong": {"size": 5.0}, "weak": {"size": 1.5}})
    values = values + bump + 0.5 * np.random.default_rng(4).standard_normal(2000)
    data = [Series("run", "probe", "V", values, 0.5, t, np.arange(2000) // 400)]
    verdict = mopro.reconcile(simulate, [Candidate(n, (size,)) for n in shapes], data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"strong", "weak"})
    assert "absent" in {rejected.name for rejected in verdict.rejected}


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    truth, hits, count = {"viscous": {"b": 1.0}, "inertia": {"dM": 0.05}}, 0, 0
    for seed in range(12):
        for effect in hidden(truth, seed, servo=Servo(runs=2, samples=200)).effects:
            for name, estimate in effect.parameters.items():
                low, high = estimate.ci95
                hits += low <= truth[effect.name][name] <= high
                count += 1
    assert count >= 23
    assert hits / count >= 0.85


def test_a_ripple_in_one_run_alone_is_not_named():
    """Fitted there, it raises chi-squared in the other runs."""
    data = SERVO.measure({}, SIGMA, 0)
    q = SERVO.motions[0][0]
    rippled = Series(
        "run 0", "force", "N", data[0].values + 0.12 * np.sin(2 * np.pi * q / 0.02), SIGMA,
        SERVO.time_s, labels=data[0].labels,
    )  # fmt: skip
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, [rippled, *data[1:]])
    assert not verdict.effects
    assert any("from part to part" in r.reason for r in verdict.rejected)


@pytest.mark.parametrize(
    "truth",
    [
        {"viscous": {"b": 2.0}, "coulomb": {"Fc": 0.5}},
        {"inertia": {"dM": 0.1}, "hum": {"A": 0.15}},
    ],
    ids="+".join,
)
def test_the_order_of_candidates_and_of_runs_does_not_matter(truth):
    data = SERVO.measure(truth, SIGMA, 3)
    plain = mopro.reconcile(SERVO.predict, CATALOGUE, data)
    turned = mopro.reconcile(lambda s: SERVO.predict(s)[::-1], CATALOGUE[::-1], data[::-1])
    assert names(plain) == truth.keys() - {"hum"}
    assert (turned.verdict, turned.notes) == (plain.verdict, plain.notes)
    assert {d.name for d in turned.drafts} == {d.name for d in plain.drafts}
    assert turned.remainder.description == plain.remainder.description
    assert turned.gap.after_rms == pytest.approx(plain.gap.after_rms, rel=1e-4)
    others = {effect.name: effect for effect in turned.effects}
    for effect in plain.effects:
        other = others[effect.name]
        assert other.log10_bayes_factor == pytest.approx(effect.log10_bayes_factor, rel=1e-3)
        assert other.indistinguishable_from == effect.indistinguishable_from
        for name, estimate in effect.parameters.items():
            assert other.parameters[name].ci95 == pytest.approx(estimate.ci95, rel=1e-3)


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


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e4])
def test_units_do_not_matter_where_the_noise_is_unknown(scale):
    truth = {"viscous": {"b": 2.0}, "coulomb": {"Fc": 0.5}}
    servo = Servo()
    data = [
        replace(series, values=scale * series.values, sigma=None, unit="other")
        for series in servo.measure(truth, SIGMA, seed=5)
    ]

    def simulate(settings):
        return [scale * force for force in servo.predict(settings)]

    verdict = mopro.reconcile(simulate, CATALOGUE, data)
    assert names(verdict) == set(truth)
    (drag,) = (e for e in verdict.effects if e.name == "viscous")
    low, high = drag.parameters["b"].ci95
    assert low < 2.0 < high
    assert high - low < 0.2
    assert verdict.gap.after_rms == pytest.approx(scale * SIGMA, rel=0.1)
    assert verdict.where[0].rms == pytest.approx(verdict.gap.runs[0].before_rms)


def test_an_unexplained_line_is_described_in_the_unit_of_the_series():
    data = [
        replace(series, values=1e-3 * series.values, sigma=None, unit="kN")
        for series in SERVO.measure({"hum": {"A": 0.3}}, SIGMA, seed=6)
    ]

    def simulate(settings):
        return [1e-3 * force for force in SERVO.predict(settings)]

    verdict = mopro.reconcile(simulate, CATALOGUE, data)
    assert verdict.verdict == "unexplained"
    assert verdict.remainder.description.startswith("a line at 50 Hz in time, 0.0003 kN")


def test_json_has_the_fields_of_the_contract():
    answer = hidden({"viscous": {"b": 3.0}}).as_json()
    assert {"verdict", "effects", "where", "gap", "remainder", "next_experiment"} <= answer.keys()
    (effect,) = answer["effects"]
    assert {"name", "indistinguishable_from", "parameters", "evidence"} <= effect.keys()
    assert effect["parameters"]["b"]["unit"] == "N s/m"
    assert {"unit", "before_rms", "after_rms", "noise_rms", "held_out"} <= answer["gap"].keys()
    assert answer["where"][0]["rms"] > answer["where"][0]["sigma"]


def test_json_has_the_drafts_the_base_and_what_is_said_of_the_noise():
    def simulate(settings):
        others = {name: values for name, values in settings.items() if name != "base"}
        return [own + settings["base"]["F0"] * SERVO.time_s for own in SERVO.predict(others)]

    data = SERVO.measure({"viscous": {"b": 3.0}, "hum": {"A": 0.15}}, SIGMA, 0)
    number = Parameter("F0", "N/s", -5.0, 5.0, (0.0,))
    verdict = mopro.reconcile(simulate, CATALOGUE, data, base=[number])
    answer = json.loads(json.dumps(verdict.as_json()))
    assert answer["verdict"] == "unexplained"
    assert answer["remainder"]["variable"] == "t"
    assert answer["explained"].keys() == {"share", "held_out_share"}
    assert 0.9 < answer["explained"]["share"] < 1.0
    assert answer["alternatives"] == []
    assert answer["notes"] == []
    assert answer["base"]["F0"].keys() == {"value", "unit", "ci95", "at_bound"}
    assert answer["correlations"].keys() == {"base.F0", "viscous.b"}
    (draft,) = answer["drafts"]
    assert (draft["enters"], draft["of"], draft["unit"]) == ("measurement", "t", "N")
    assert "sin(2 * pi * 50" in draft["law"]
    assert draft["held_out"] is True
    assert draft["confirmed"] is False


def test_json_lists_alternatives_as_sets_and_the_notes():
    twin = Candidate("twin", CATALOGUE[0].parameters)

    def simulate(settings):
        own = {n: v for n, v in settings.items() if n != "twin"}
        if "twin" in settings:
            own["viscous"] = settings["twin"]
        return SERVO.predict(own)

    data = [replace(s, sigma=SIGMA / 3) for s in SERVO.measure({"viscous": {"b": 3.0}}, SIGMA, 0)]
    answer = json.loads(json.dumps(mopro.reconcile(simulate, [*CATALOGUE, twin], data).as_json()))
    assert answer["verdict"] == "ambiguous"
    assert answer["alternatives"] == [["twin"]]
    assert len(answer["notes"]) == 1


def test_a_single_part_is_cut_in_time_to_be_held_out():
    (series, *_) = SERVO.measure({"viscous": {"b": 3.0}}, SIGMA, seed=1)
    servo = Servo(runs=1)
    verdict = mopro.reconcile(servo.predict, CATALOGUE, [series])
    assert names(verdict) == {"viscous"}
    assert verdict.gap.after_rms < verdict.gap.held_out_rms < 1.05 * verdict.gap.after_rms
    assert verdict.effects[0].held_out
    assert verdict.as_json()["gap"]["held_out"] is True


@pytest.mark.parametrize(
    ("bump", "searched", "expected"), [(0.0, True, "none"), (20.0, False, "unexplained")]
)
def test_the_finer_simulation_is_used_where_it_could_account_for_a_tenth_of_the_excess(
    bump, searched, expected
):
    """A step error of 30 σ in all does so by itself, and not beside a bump of 1000 σ."""
    t = np.linspace(0, 1, 2000)
    error = np.cos(2 * np.pi * 2 * t) * 30 * SIGMA / math.sqrt(1000)
    bump_N = bump * np.exp(-(((t - 0.5) / 0.02) ** 2))
    measured = bump_N + SIGMA * np.random.default_rng(1).standard_normal(2000)
    data = [Series("run", "force", "N", measured, SIGMA, t, np.arange(2000) // 200)]
    slope = Candidate("slope", (Parameter("b", "N", -9, 9, (0.1,)),))
    asked = []

    def finer(settings):
        asked.append(settings)
        return [settings.get("slope", {"b": 0.0})["b"] * t]

    def coarse(settings):
        return [settings.get("slope", {"b": 0.0})["b"] * t + error]

    verdict = mopro.reconcile(coarse, [slope], data, finer=finer)
    assert verdict.verdict == expected
    assert (len(asked) > 1) == searched


def test_a_coarse_model_tells_changes_and_no_residual():
    """One that is off by 50 σ, and by 1 % in all that effects change, gives the same answer."""
    t = np.linspace(0, 1, 2000)
    shapes = {"slope": t, "wave": np.sin(9 * t), "bend": t**2}
    effects = [Candidate(n, (Parameter("b", "N", -9, 9, (0.1,)),)) for n in shapes]
    noise = SIGMA * np.random.default_rng(1).standard_normal(2000)
    data = [Series("run", "force", "N", 2 * t + noise, SIGMA, t, np.arange(2000) // 200)]

    def asked(error, answered):
        def simulate(settings):
            answered.append(settings)
            changed = sum(own["b"] * shapes[name] for name, own in settings.items())
            return [(1 + error) * changed + 5000 * SIGMA * error * np.cos(7 * t)]

        return simulate

    alone, beside, rough = [], [], []
    exact = mopro.reconcile(asked(0.0, alone), effects, data)
    verdict = mopro.reconcile(asked(0.0, beside), effects, data, coarse=asked(0.01, rough))
    (own,), (known) = verdict.effects, exact.effects[0].parameters["b"]
    assert own.name == "slope"
    assert own.parameters["b"].value == pytest.approx(known.value, abs=1e-3)
    assert own.parameters["b"].ci95 == pytest.approx(known.ci95, abs=2e-3)
    assert len(beside) < len(alone) < len(beside) + len(rough)


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


@pytest.mark.parametrize("sigma", [0.0, -1.0, math.nan])
def test_a_sigma_must_be_above_0(sigma):
    data = [replace(series, sigma=sigma) for series in SERVO.measure({}, SIGMA, 0)]
    with pytest.raises(ValueError, match="run 0, force: expected a sigma above 0, or None"):
        mopro.reconcile(SERVO.predict, CATALOGUE, data)


def test_a_model_that_is_not_finite_without_effects_is_refused():
    with pytest.raises(ValueError, match="without effects predicts values that are not finite"):
        mopro.reconcile(
            lambda s: [force * math.nan for force in SERVO.predict(s)], CATALOGUE,
            SERVO.measure({}, SIGMA, 0),
        )  # fmt: skip


def test_an_effect_with_which_the_model_is_not_finite_is_not_believed():
    wild = Candidate("wild", (Parameter("a", "N", 0.0, 10.0, (1.0,)),))

    def simulate(settings):
        others = {name: values for name, values in settings.items() if name != "wild"}
        forces = SERVO.predict(others)
        return [np.full_like(own, math.inf) for own in forces] if "wild" in settings else forces

    data = SERVO.measure({"viscous": {"b": 3.0}}, SIGMA, 0)
    verdict = mopro.reconcile(simulate, [*CATALOGUE, wild], data)
    assert (verdict.verdict, names(verdict)) == ("named", {"viscous"})
