"""Free-form terms: what no listed effect explains is drafted as a law, and no effect is blamed."""

from dataclasses import replace

import numpy as np
import pytest

import mopro
from helpers.servo import CATALOGUE, Servo
from helpers.signals import names
from mopro.diagnosis import Candidate, Parameter

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


def test_no_law_is_looked_for_where_one_listed_effect_leaves_noise():
    lines = []
    data = measured({"viscous": {"b": 3.0}})
    verdict = mopro.reconcile(SERVO.predict, CATALOGUE, data, progress=lines.append)
    assert verdict.verdict == "named"
    assert not any(" in force" in line for line in lines)


def with_cube(settings):
    """The servo on a spring, with a term in the cube of the position that nobody listed."""
    stiffness = settings.get("spring", {"k": 0.0})["k"]
    cube = settings.get("cube", {"c": 0.0})["c"]
    forces = SERVO.predict({})
    return [
        own - stiffness * motion[0] - cube * motion[0] ** 3
        for own, motion in zip(forces, SERVO.motions, strict=True)
    ]


@pytest.mark.parametrize(("k", "named"), [(-5.0, set()), (2.0, set()), (40.0, {"spring"})])
def test_an_effect_that_is_another_beside_the_draft_stands_in_for_something_else(k, named):
    """Alone the spring makes up for most of the cube, as one of 12 N/m more."""
    spring = Candidate("spring", (Parameter("k", "N/m", -200.0, 200.0, (10.0,)),))
    truth = {"spring": {"k": k}, "cube": {"c": 1500.0}}
    verdict = mopro.reconcile(with_cube, [spring], measured(truth, predict=with_cube))
    assert (verdict.verdict, names(verdict)) == ("unexplained", named)
    assert [draft.name for draft in verdict.drafts] == ["x³ in force"]
    assert verdict.drafts[0].held_out
    reasons = [r.reason for r in verdict.rejected if r.name == "spring"]
    assert ["beside the free-form terms" in reason for reason in reasons] == [True] * (not named)
