"""Free-form terms: what no listed effect explains is drafted as a law, and no effect is blamed."""

import re
from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers import signals
from helpers.servo import CATALOGUE, Servo
from helpers.signals import candidates, names, sizes, times
from mopro.engine import Candidate, Parameter, Series
from mopro.engine.candidate import Law
from mopro.engine.residuals import projected_out

SIGMA = 0.1
SERVO = Servo()


def values_of(draft, t, x):
    """The values of a drafted law; its text is an expression of Python."""
    words = {"sin": np.sin, "exp": np.exp, "sign": np.sign, "pi": np.pi, "abs": np.abs}
    return eval(draft.law, {"__builtins__": {}}, words | {"t": t, "x": x})


def with_bend(settings):
    """The servo, with a term in the square of the position that nobody listed."""
    bend = settings.get("bend", {"c": 0.0})["c"]
    others = {name: values for name, values in settings.items() if name != "bend"}
    forces = SERVO.predict(others)
    return [own + bend * motion[0] ** 2 for own, motion in zip(forces, SERVO.motions, strict=True)]


def measured(truth, seed=0, servo=SERVO, predict=with_bend):
    data = servo.measure({}, SIGMA, seed)
    return [
        replace(series, values=series.values + own - none)
        for series, own, none in zip(data, predict(truth), predict({}), strict=True)
    ]


UNLISTED = {
    "a bump": ({"bump": {"height": 0.6}}, "x"),
    "a drift": ({"drift": {"rate": 0.5}}, "t"),
    "a line of 50 Hz": ({"hum": {"A": 0.15}}, "t"),
    "a bend in x": ({"bend": {"c": 20.0}}, "x"),
}


@pytest.mark.parametrize("beside", [{}, {"viscous": {"b": 3.0}}], ids=["alone", "beside a drag"])
@pytest.mark.parametrize(("truth", "of"), UNLISTED.values(), ids=UNLISTED)
def test_what_nobody_listed_is_drafted_as_a_law_of_its_variable(truth, of, beside):
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, measured(truth | beside))
    assert (verdict.verdict, names(verdict)) == ("unexplained", set(beside))
    (draft,) = verdict.drafts
    assert (draft.of, draft.enters, draft.unit, draft.held_out) == (of, "measurement", "N", True)
    assert verdict.remainder.variable == of
    assert draft.sigmas > 10
    # The phase of a line in time differs from run to run: the law has that of the first.
    size = np.ptp(values_of(draft, SERVO.time_s, SERVO.motions[0][0]))
    with_it, without = with_bend(truth)[0], with_bend({})[0]
    assert size == pytest.approx(np.ptp(with_it - without), rel=0.15)
    assert draft.name not in verdict.settings


def burst(t, x):
    return 0.5 * np.sin(900 * t) * (abs(t - 0.5) < 0.1)


ALTOGETHER = {
    "a bend": (lambda t, x: 20 * x**2, False),
    "what fades": (lambda t, x: 0.5 * np.exp(-t / 0.1), False),
    "a wave that is no sine": (lambda t, x: 0.3 * np.sign(np.sin(2 * np.pi * x / 0.05)), True),
    "a bend and a burst": (lambda t, x: 20 * x**2 + burst(t, x), True),
}


@pytest.mark.parametrize(("hidden", "more"), ALTOGETHER.values(), ids=ALTOGETHER)
def test_what_the_drafts_leave_in_turn_is_told(hidden, more):
    data = [
        replace(own, values=own.values + hidden(own.time_s, own.labels["position"]))
        for own in measured({})
    ]
    verdict = mopro.reconcile(SERVO.predict, [], data)
    left = verdict.remainder
    assert left.variable == verdict.drafts[0].of
    assert (left.significant, left.beside_drafts is not None) == (True, more)
    assert verdict.as_json()["remainder"]["beside_drafts"] == left.beside_drafts


def test_what_is_left_is_described_as_the_law_that_is_drafted():
    """The square of another one is a line in time as well, of which there is no need."""
    data = [
        replace(own, values=own.values + 3 * motion[1] * abs(motion[1]), labels={})
        for own, motion in zip(SERVO.measure({}, SIGMA, 0), SERVO.motions, strict=True)
    ]
    drag = Candidate(
        "drag",
        (Parameter("c", "1", -9, 9, (1.0,)),),
        law=Law("force", "v", "N", lambda p: "c v|v|"),
    )

    def simulate(settings):
        c = settings.get("drag", {"c": 0.0})["c"]
        return [
            f + c * v * abs(v)
            for f, (_, v, _) in zip(SERVO.predict({}), SERVO.motions, strict=True)
        ]

    verdict = mopro.reconcile(simulate, [], data, unlisted=[drag])
    assert [d.of for d in verdict.drafts] == ["v"]
    assert verdict.remainder.description == "a law of v"
    assert verdict.remainder.beside_drafts is None


def test_the_frequency_of_a_drafted_line_is_that_of_the_line():
    (draft,) = mopro.reconcile(SERVO.predict, [], measured({"hum": {"A": 0.15}})).drafts
    hertz = float(draft.law.split("2 * pi * ")[1].split(" ")[0])
    assert hertz == pytest.approx(50.0, abs=0.05)


def test_a_law_that_predicts_the_same_as_a_listed_effect_is_no_alternative():
    """With two effects in the answer the laws compete, and one of them is the listed drift."""
    drift = Candidate("drift", (Parameter("rate", "N/s", -5.0, 5.0, (0.1,)),))
    truth = {"drift": {"rate": 0.5}, "viscous": {"b": 3.0}}
    lines = []
    verdict = mopro.reconcile(
        SERVO.predict, [*CATALOGUE, drift], measured(truth), progress=lines.append
    )
    assert any("t in force" in line for line in lines), "the law was looked at"
    assert (verdict.verdict, names(verdict)) == ("named", set(truth))
    assert (verdict.alternatives, verdict.drafts, verdict.notes) == ((), (), ())


def test_a_law_in_other_words_is_no_alternative_beside_an_effect_that_was_extended():
    """A drift that bends at a large size has not the signature of `t`, and is the same when small.

    The two sines beside it are a form that was extended to fit; both sets have it.
    """
    t = np.arange(2000) / 1000
    sines = {"A": np.sin(40 * t), "A3": np.sin(120 * t)}
    sizes = {name: Parameter(name, "N", -9.0, 9.0, (0.1,)) for name in sines}
    catalogue = [
        Candidate("hum", (sizes["A"],), form="one", fixed={"A3": 0.0}),
        Candidate("hum", (sizes["A"], sizes["A3"]), form="both", extends="one"),
        Candidate("drift", (Parameter("rate", "N/s", -5.0, 5.0, (2.0,)),)),
    ]

    def predict(settings):
        hum, drift = settings.get("hum", {}), settings.get("drift", {"rate": 0.0})["rate"] * t
        return [drift + drift**2 + sum(size * sines[name] for name, size in hum.items())]

    (exact,) = predict({"hum": {"A": 0.5, "A3": 0.2}, "drift": {"rate": 0.03}})
    values = exact + SIGMA * np.random.default_rng(3).standard_normal(len(t))
    data = [Series("run", "probe", "N", values, SIGMA, t, np.arange(len(t)) // 200)]
    verdict = mopro.reconcile(predict, catalogue, data)
    assert (verdict.verdict, names(verdict)) == ("named", {"hum", "drift"})
    assert (verdict.notes, verdict.drafts) == ((), ())


def test_no_law_is_fitted_where_one_listed_effect_leaves_noise_and_none_is_likelier():
    lines = []
    data = measured({"viscous": {"b": 3.0}})
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, data, progress=lines.append)
    assert verdict.verdict == "named"
    assert not any("fitting" in line and " in force" in line for line in lines)


def test_a_weak_term_beside_a_single_effect_that_leaves_noise_is_drafted():
    """No test of the remainder tells of a bend of up to 0.06 N in noise of 0.1 N."""
    truth = {"viscous": {"b": 3.0}, "bend": {"c": 4.0}}
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, measured(truth))
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"viscous"})
    (draft,) = verdict.drafts
    assert (draft.of, draft.held_out) == ("x", True)
    bent = values_of(draft, np.zeros(2), np.array([0.0, 1.0]))
    assert bent[1] - bent[0] == pytest.approx(4.0, rel=0.2)


def with_cube(settings):
    """The servo on a spring, with a term in the cube of the position that nobody listed."""
    stiffness = settings.get("spring", {"k": 0.0})["k"]
    cube = settings.get("cube", {"c": 0.0})["c"]
    forces = SERVO.predict({})
    return [
        own - stiffness * motion[0] - cube * motion[0] ** 3
        for own, motion in zip(forces, SERVO.motions, strict=True)
    ]


@pytest.mark.parametrize(
    ("k", "reason"),
    [(-5.0, "beside the free-form terms"), (2.0, "beside the free-form terms"),
     (40.0, "as a function of x, what is there has another shape")],
)  # fmt: skip
def test_an_effect_that_the_draft_shows_to_be_something_else_is_a_part_of_the_law(k, reason):
    """Alone the spring makes up for most of the cube, as one of 12 N/m more."""
    spring = Candidate("spring", (Parameter("k", "N/m", -200.0, 200.0, (10.0,)),))
    truth = {"spring": {"k": k}, "cube": {"c": 1500.0}}
    verdict = mopro.reconcile(with_cube, [spring], measured(truth, predict=with_cube))
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    (rejected,) = [r for r in verdict.rejected if r.name == "spring"]
    assert reason in rejected.reason
    drafts = {draft.name: draft for draft in verdict.drafts}
    assert set(drafts) == {"x in force", "x³ in force"}
    assert all(draft.held_out for draft in drafts.values())
    # The force is 1 N at 1 m where only the line counts, and where only the cube does.
    t, one = np.zeros(1), np.ones(1)
    assert values_of(drafts["x in force"], t, one) == pytest.approx(-k, abs=0.5)
    assert values_of(drafts["x³ in force"], t, one) == pytest.approx(-1500.0, rel=0.05)


def test_a_term_takes_the_place_of_an_effect_whose_size_differs_from_part_to_part():
    """A drag that is another in each run: no drag of one size, and a law of v all the same."""

    def predict(settings):
        own = zip(SERVO.predict({}), SERVO.motions, (2.0, 3.0, 4.0), strict=True)
        return [force + drag * motion[1] * len(settings) for force, motion, drag in own]

    data = [
        replace(series, labels={**series.labels, "velocity": motion[1]})
        for series, motion in zip(
            measured({"drags": {}}, predict=predict), SERVO.motions, strict=True
        )
    ]
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    assert any(r.name == "viscous" and "from part to part" in r.reason for r in verdict.rejected)
    assert verdict.remainder.variable == "v"
    assert [draft.name for draft in verdict.drafts] == ["v in force"]


def test_a_reading_that_lags_is_drafted_as_a_lag():
    """A step response through a sensor with a time constant of 0.3 s, which nobody listed."""
    t = np.linspace(0.0, 5.0, 1000)
    ambient = Candidate("drift", (Parameter("rate", "K/s", -10.0, 10.0, (1.0,)),))

    def predict(settings):
        return [10.0 * (1 - np.exp(-t)) + settings.get("drift", {"rate": 0.0})["rate"] * t]

    # The answer of a first-order lag to 1 - exp(-t), in closed form.
    late = 10.0 * (1 - (np.exp(-t) - 0.3 * np.exp(-t / 0.3)) / 0.7)
    values = late + 0.05 * np.random.default_rng(3).standard_normal(len(t))
    data = [Series("run", "probe", "K", values, 0.05, t, np.arange(1000) // 200)]
    verdict = mopro.reconcile(predict, [ambient], data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    (draft,) = verdict.drafts
    assert (draft.name, draft.of, draft.enters) == ("lag in probe", "t", "measurement")
    lag_s = float(draft.law.removeprefix("(lag(y, ").removesuffix(") - y)"))
    assert lag_s == pytest.approx(0.3, rel=0.02)
    # A prediction that is made from the readings holds what would be told by them.
    (fed_back,) = (replace(series, fed_back=True) for series in data)
    drafts = mopro.reconcile(predict, [ambient], [fed_back]).drafts
    assert "lag in probe" not in {draft.name for draft in drafts}


def late_by(shift_s):
    """Readings of an axis that moves and rests, four times, taken `shift_s` (samples) late (m).

    Also the times (s) and the speeds (m/s), accelerations (m/s2) that were commanded.
    """
    t = np.arange(4000) / 1000
    a = np.select([t % 1 < 0.2, t % 1 < 0.4, t % 1 < 0.6], [0.5, 0.0, -0.5], 0.0)
    v = np.cumsum(a) / 1000
    v[a == 0] = np.where(np.abs(v[a == 0]) < 0.01, 0.0, v[a == 0])
    return np.interp(t - shift_s, t, np.cumsum(v) / 1000), t, v, a


# What the delay grows with: the time in motion, that in ramps, or the number of starts.
LATE = {
    "motion": lambda v, a: np.cumsum(v != 0) / 1000,
    "ramps": lambda v, a: np.cumsum(a != 0) / 1000,
    "starts": lambda v, a: np.cumsum(np.diff(v != 0, prepend=0) > 0),
}


@pytest.mark.parametrize("grows_with", LATE)
def test_a_command_that_comes_late_is_drafted_with_what_its_delay_grows_with(grows_with):
    x, t, v, a = late_by(0.0)
    values, *_ = late_by(5e-5 * LATE[grows_with](v, a))
    noise = 5e-7 * np.random.default_rng(5).standard_normal(len(t))
    labels = {"position": x, "velocity": v, "acceleration": a}
    data = [
        Series("run", "laser", "m", values + noise, 5e-7, t, t.astype(int), labels=labels,
               of_place=True)
    ]  # fmt: skip
    verdict = mopro.reconcile(lambda settings: [x], [], data)
    assert (verdict.verdict, verdict.remainder.variable) == ("unexplained", "command")
    assert [draft.name for draft in verdict.drafts] == [f"late by {grows_with} in laser"]
    assert float(verdict.drafts[0].law.split(" ")[0]) == pytest.approx(-5e-5, rel=0.05)


def taken_late(late_s, sigma_m):
    """Series of readings of that axis `late_s` (samples) late, and a model with a rate and a delay.

    Also the two effects of the model, which lists no clock that steps.
    """
    x, t, v, a = late_by(0.0)
    noise = sigma_m * np.random.default_rng(8).standard_normal(len(t))
    values = np.interp(t + late_s, t, x) + noise
    labels = {"position": x, "velocity": v, "acceleration": a}
    data = [
        Series("run", "laser", "m", values, sigma_m, t, t.astype(int), labels=labels, of_place=True)
    ]
    effects = [
        Candidate("rate", (Parameter("e", "1", -1e-3, 1e-3, (1e-5,)),)),
        Candidate("delay", (Parameter("d", "s", -1e-3, 1e-3, (1e-5,)),)),
    ]

    def simulate(settings):
        rate = settings.get("rate", {"e": 0.0})["e"]
        return [np.interp(t * (1 + rate) - settings.get("delay", {"d": 0.0})["d"], t, x)]

    return data, simulate, effects


def drafted_steps(verdict):
    """Size and interval (s) of the steps of the clock that a verdict drafts."""
    assert (verdict.verdict, names(verdict)) == ("unexplained", set())
    assert [draft.name for draft in verdict.drafts] == ["stepping clock in laser"]
    size, every = re.findall(r"[0-9.]+(?:e-?[0-9]+)?", verdict.drafts[0].law)[:2]
    return float(size), float(every)


@pytest.mark.parametrize("steps", [True, False])
def test_a_clock_that_steps_is_not_told_as_another_rate_with_a_delay(steps):
    """Steps of 12 us each 0.37 s; or the rate and the delay that come nearest, which are listed."""
    t = np.arange(4000) / 1000
    late_s = 12e-6 * (np.floor(t / 0.37 + 0.2) if steps else t / 0.37 - 0.3)
    data, simulate, effects = taken_late(late_s, 1e-6)
    verdict = mopro.reconcile(simulate, effects, data)
    if not steps:
        assert (verdict.verdict, names(verdict)) == ("named", {"rate", "delay"})
        return
    assert drafted_steps(verdict) == (pytest.approx(12e-6, rel=0.05), pytest.approx(0.37, rel=0.01))


@pytest.mark.parametrize("steps", [True, False])
def test_steps_of_a_clock_that_no_sample_shows_are_not_told_as_another_rate(steps):
    """Steps of 12 us, in which the axis goes 1.2 um, each 0.37 s; or the rate that comes nearest.

    In noise of 4 um no test of a remainder tells one from the other.
    """
    t = np.arange(4000) / 1000
    late_s = 12e-6 * (np.floor(t / 0.37) if steps else t / 0.37)
    data, simulate, effects = taken_late(late_s, 4e-6)
    verdict = mopro.reconcile(simulate, effects[:1], data)
    if not steps:
        assert (verdict.verdict, names(verdict)) == ("named", {"rate"})
        return
    assert drafted_steps(verdict) == (pytest.approx(12e-6, rel=0.05), pytest.approx(0.37, rel=0.01))


def test_a_term_that_does_as_well_as_a_listed_effect_is_told_beside_it():
    """Those steps in noise of 4.5 um: likelier than the rate, but by less than its benefit."""
    t = np.arange(4000) / 1000
    data, simulate, effects = taken_late(12e-6 * np.floor(t / 0.37), 4.5e-6)
    verdict = mopro.reconcile(simulate, effects[:1], data)
    assert (verdict.verdict, names(verdict)) == ("ambiguous", {"rate"})
    assert verdict.notes == ("stepping clock in laser would do as well",)
    (draft,) = verdict.drafts
    assert (draft.of, draft.held_out) == ("t", True)
    assert (verdict.alternatives, verdict.remainder.significant) == ((), False)


@pytest.mark.parametrize("sigma_m", [1e-6, 3e-6])
def test_a_clock_that_steps_is_found_beside_an_effect_that_makes_up_for_most_of_it(sigma_m):
    """A drag in v|v|, whose best fit alone takes more than half of the steps."""
    t = np.arange(4000) / 1000
    data, simulate, effects = taken_late(12e-6 * np.floor(t / 0.37), sigma_m)
    drag = Candidate("drag", (Parameter("c", "s2/m", -0.1, 0.1, (1e-4,)),))
    *_, v, _ = late_by(0.0)

    def with_drag(settings):
        (x,) = simulate({name: own for name, own in settings.items() if name != "drag"})
        return [x + settings.get("drag", {"c": 0.0})["c"] * v * np.abs(v)]

    data = [replace(data[0], values=data[0].values + 1e-3 * v * np.abs(v))]
    verdict = mopro.reconcile(with_drag, [effects[0], drag], data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"drag"})
    assert [draft.name for draft in verdict.drafts] == ["stepping clock in laser"]
    size, every = re.findall(r"[0-9.]+(?:e-?[0-9]+)?", verdict.drafts[0].law)[:2]
    assert float(size) == pytest.approx(12e-6, rel=0.05)
    assert float(every) == pytest.approx(0.37, rel=0.01)
    # Its size is that beside the steps: alone it would make up for some of them.
    (effect,) = verdict.effects
    told = effect.parameters["c"]
    assert told.ci95[0] < 1e-3 < told.ci95[1]
    assert told.ci95[1] - told.ci95[0] < 2e-4
    assert verdict.settings == {"drag": {"c": told.value}}
    assert list(verdict.correlations) == ["drag.c"]


@pytest.mark.parametrize("power", [1, 2])
def test_a_scale_or_a_bend_that_grows_with_time_is_drafted_as_such(power):
    x, t, v, a = late_by(0.0)
    grown = 1e-5 * t * (x if power == 1 else 30 * x**2)
    noise = 5e-7 * np.random.default_rng(5).standard_normal(len(t))
    labels = {"position": x, "velocity": v, "acceleration": a}
    data = [
        Series("run", "laser", "m", x + grown + noise, 5e-7, t, t.astype(int), labels=labels,
               of_place=True)
    ]  # fmt: skip
    verdict = mopro.reconcile(lambda settings: [x], [], data)
    assert (verdict.verdict, verdict.remainder.variable) == ("unexplained", "x")
    (draft,) = verdict.drafts
    found = values_of(draft, t, x)
    np.testing.assert_allclose(found, grown, atol=0.03 * np.max(np.abs(grown)))


# What a term in the direction of motion changes with, as a function of t, x and a.
CHANGING = {
    "fading sgn v": lambda t, x, a: np.exp(-t / 0.8),
    "sgn v x": lambda t, x, a: 40.0 * x,
    "sgn v |a|": lambda t, x, a: 2.0 * np.abs(a),
}


@pytest.mark.parametrize("changes_with", CHANGING)
def test_what_has_the_direction_of_motion_is_drafted_with_what_it_changes_with(changes_with):
    """Beside a part that is the same throughout, which is drafted too if the law has it."""
    t = np.arange(4000) / 1000
    a = np.select([t % 1 < 0.2, t % 1 < 0.4, t % 1 < 0.6], [0.5, 0.0, -0.5], 0.0)
    a = a * np.where(t % 2 < 1, 1.0, -1.0)
    v = np.cumsum(a) / 1000
    v[np.abs(v) < 1e-9] = 0.0
    x = np.cumsum(v) / 1000
    last = np.sign(v)[np.maximum.accumulate(np.where(v != 0, np.arange(len(t)), 0))]
    seen = x + 1e-5 * last * CHANGING[changes_with](t, x, a)
    labels = {"position": x, "velocity": v, "acceleration": a}
    data = [
        Series(f"run {seed}", "laser", "m",
               seen + 5e-7 * np.random.default_rng(seed).standard_normal(len(t)), 5e-7, t,
               t.astype(int), labels=labels)
        for seed in range(2)
    ]  # fmt: skip
    verdict = mopro.reconcile(lambda settings: [x, x], [], data)
    assert (verdict.verdict, verdict.remainder.variable) == ("unexplained", "sgn v")
    assert [draft.name for draft in verdict.drafts] == [f"{changes_with} in laser"]


def test_one_term_takes_the_place_of_two_listed_effects_that_do_no_better():
    """`early` and `late` are the two halves of a bend in x, as large as each other in the data.

    Eight more effects are listed, as of many there are more pairs that do as well by chance.
    """
    t = np.linspace(0.0, 4.0, 2000)
    x = np.sin(3 * t)
    shapes = {"early": np.where(t < 2, x**2, 0.0), "late": np.where(t < 2, 0.0, x**2)}
    shapes |= {f"absent {f}": np.sin(f * t) for f in range(20, 28)}
    size = Parameter("size", "V", -90.0, 90.0, (1.0,))

    def simulate(settings):
        return [sum((own["size"] * shapes[n] for n, own in settings.items()), np.zeros(len(t)))]

    def verdict(**sizes):
        (values,) = simulate({name: {"size": own} for name, own in sizes.items()})
        values = values + SIGMA * np.random.default_rng(3).standard_normal(len(t))
        data = [Series("run", "probe", "V", values, SIGMA, t, np.arange(len(t)) // 200,
                       labels={"position": x})]  # fmt: skip
        return mopro.reconcile(simulate, [Candidate(n, (size,)) for n in shapes], data)

    bend = verdict(early=2.0, late=2.0)
    assert (bend.verdict, names(bend)) == ("unexplained", set())
    assert [draft.name for draft in bend.drafts] == ["x² in probe"]
    both = verdict(early=2.0, late=-1.0)
    assert (both.verdict, names(both)) == ("named", {"early", "late"})


def test_a_scale_that_grows_with_time_does_not_reshape_a_bend_in_place():
    """A bend in x^3 is named beside a scale that grows by 5e-5 a second, which is drafted.

    Both are terms of x in the measurement, but the scale is no other form of the bend.
    """
    x, t, v, a = late_by(0.0)
    labels = {"position": x, "velocity": v, "acceleration": a}
    noise = 1e-5 * np.random.default_rng(4).standard_normal(len(t))
    values = x + 0.02 * x**3 + 5e-5 * x * t + noise
    data = [Series("run", "laser", "m", values, 1e-5, t, t.astype(int), labels=labels)]
    bend = Candidate("bend", (Parameter("c", "1/m2", -1.0, 1.0, (0.01,)),))
    verdict = mopro.reconcile(
        lambda settings: [x + settings.get("bend", {"c": 0.0})["c"] * x**3], [bend], data
    )
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"bend"})
    low, high = verdict.effects[0].parameters["c"].ci95
    assert low < 0.02 < high
    assert [draft.law.split(" * ", 1)[1] for draft in verdict.drafts] == ["x * t"]


def test_an_effect_that_the_cause_of_the_draft_hides_is_named_beside_it():
    """A wave of 0.2 V, of which 0.05 V is left by itself where a bend in x makes up for it."""
    t = times(2000)
    x, wave = np.sin(1.5 * t), np.cos(3 * t) + 0.8 * np.sin(7 * t)

    def predict(settings):
        return [sizes(settings, "wave")[0] * wave]

    bend = 0.5 * x**2
    centred = wave - wave.mean()
    alone = 0.2 + float(bend @ centred) / float(centred @ centred)
    assert 0.0 < alone < 0.1
    (series,) = signals.measured(0.2 * wave + bend, 0.05, seed=1)
    data = [replace(series, labels={"position": x})]
    verdict = mopro.reconcile(predict, candidates("wave"), data)
    assert (verdict.verdict, names(verdict)) == ("unexplained", {"wave"})
    (draft,) = verdict.drafts
    assert (draft.name, draft.held_out) == ("x² in probe", True)
    (named,) = verdict.effects
    assert named.parameters["size"].value == pytest.approx(0.2, rel=0.02)
    assert named.held_out
    # Beside the bend: by itself the wave takes away a twelfth of it.
    beside = projected_out(np.linalg.qr(np.column_stack([np.ones_like(t), x**2]))[0], wave)
    assert named.sigmas == pytest.approx(0.2 * np.linalg.norm(beside) / 0.05, rel=0.1)
