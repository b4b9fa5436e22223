"""Verdicts in words."""

import dataclasses
import math

import pytest

from mopro.engine import Estimate, Named, Verdict
from mopro.engine.residuals.remainder import Remainder
from mopro.engine.verdict import Draft, Gap
from mopro.experiment.comparison import Place
from mopro.experiment.wording import (
    advice,
    calibration_words,
    draft_words,
    effect_words,
    interval_words,
    origin_words,
    parameters_shown,
    place_words,
    reservations,
    sentence,
    value_words,
)


def named(name, rivals=None, **values):
    numbers = {n: Estimate(v, "1", (v - 1, v + 1), False) for n, v in values.items()}
    others = rivals or {}
    return Named(name, "", numbers, list(others), others, {}, 10.0, 8.0, True)


def verdict(word, *effects, left=None, settings=None, faint=(), noise=1.0, note=None):
    remainder = Remainder(left is not None, left, 0.5, note=note)
    gap = Gap("in", 2.0, 1.0, noise, None)
    return Verdict(word, effects, (), faint, (), gap, remainder, settings or {})


DRAG, STEPS = named("viscous_drag", b=9.0), named("lost_steps", n=3.0, run=1.0)
EITHER = named("viscous_drag", {"current_loop_lag": 0.25, "trigger_delay": 4.0}, b=9.0)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (verdict("none"), "None: simulation and data agree within the sensors' noise."),
        (
            verdict("none", noise=None),
            "None: no effect is called for, as far as that shows with unknown noise.",
        ),
        (
            verdict("none", note="the noise is 3 times as much as stated, and white"),
            "None: no effect is called for, and the noise is not as stated.",
        ),
        (verdict("named", DRAG, STEPS), "Named: viscous_drag, lost_steps."),
        (
            verdict("ambiguous", EITHER, STEPS),
            "Ambiguous: viscous_drag or current_loop_lag or trigger_delay, lost_steps.",
        ),
        (
            verdict("unexplained", left="a line at 11 Hz"),
            "Unexplained: what is left looks like a line at 11 Hz.",
        ),
        (
            verdict("unexplained", DRAG, left="a line at 11 Hz"),
            "Unexplained beside viscous_drag: what is left looks like a line at 11 Hz.",
        ),
    ],
)
def test_each_verdict_is_a_sentence(given, said):
    assert sentence(given) == said


def test_what_is_calibrated_is_told_as_such():
    weaker = named("force_constant", e=-0.25)
    calibrated = dataclasses.replace(verdict("none"), calibration=(weaker,))
    assert (
        sentence(calibrated) == "None: with force_constant calibrated, simulation and data agree."
    )
    assert list(calibration_words(calibrated)) == [
        "Calibrated, within the machine file's tolerance: force_constant, e = -0.25 "
        "(-1.25 to 0.75)."
    ]
    assert effect_words(weaker, calibrated) == "force_constant (calibration)"
    assert effect_words(weaker, verdict("named", weaker)) == "force_constant"


def test_a_term_that_would_do_as_well_is_told_with_what_may_decide():
    steps = Draft("stepping clock in laser", "measurement", "t", "1e-06 * v", "in", 49.5, True)
    either = dataclasses.replace(verdict("ambiguous", DRAG), drafts=(steps,))
    assert sentence(either) == "Ambiguous: viscous_drag, or a term that is not listed."
    assert list(draft_words(either)) == [
        "Not listed, would do as well: a term of t in the measurement, 1e-06 * v in "
        "(49.5 σ in all, held out)."
    ]
    assert "longer run" in advice(either)
    listed = dataclasses.replace(either, alternatives=(("current_loop_lag",),))
    assert advice(listed, "Turn it round.") == "Turn it round."
    beside = dataclasses.replace(verdict("unexplained", left="a law in t"), drafts=(steps,))
    assert [line.split(":")[0] for line in draft_words(beside)] == ["Not listed"]
    slip = Draft("step", "measurement", "t", "1e-04 * (t >= 2.5)", "in", 30.0, True, "run2.csv")
    assert list(draft_words(dataclasses.replace(beside, drafts=(slip,)))) == [
        "Not listed: a term of t in the measurement of run2.csv, 1e-04 * (t >= 2.5) in "
        "(30 σ in all, held out)."
    ]


@pytest.mark.parametrize(
    ("interval", "at_bound", "words", "origin"),
    [
        ((8.5, 9.25), False, "8.5 to 9.25", "95 %: 8.5 to 9.25"),
        ((8.5, 9.25), True, "8.5 to 9.25 (at its bound)", "95 %: 8.5 to 9.25 (at its bound)"),
        ((math.nan, math.nan), False, "as found by search", "as found by search"),
        ((-math.inf, math.inf), False, *["these data do not bound it"] * 2),
    ],
)
def test_an_interval_says_how_well_a_number_is_known(interval, at_bound, words, origin):
    estimate = Estimate(9.0, "N s/m", interval, at_bound)
    assert (interval_words(estimate), origin_words(estimate)) == (words, origin)


@pytest.mark.parametrize(
    ("value", "ends", "words"),
    [
        (95.123456, (90.0, 100.0), ("95.12 kg", "90 to 100")),
        (95.123456, (95.1229, 95.1240), ("95.1235 kg", "95.1229 to 95.124")),
        (-4.00012e11, (-4.0003e11, -3.9999e11), ("-4.00012e+11 kg", "-4.0003e+11 to -3.9999e+11")),
        (3.0, (3.0, 3.0), ("3 kg", "3 to 3")),
    ],
)
def test_a_narrow_interval_has_the_digits_that_tell_its_ends_apart(value, ends, words):
    estimate = Estimate(value, "kg", ends, False)
    assert (value_words(estimate), interval_words(estimate)) == words


@pytest.mark.parametrize(
    ("line", "phase", "axis", "direction", "words"),
    [
        (7, "cruise", 1, -1, "line 7, cruise, backward, axis 1"),
        (4, "dwell", 2, 0, "line 4, dwell, axis 2"),
        (0, "cruise", 1, 1, "cruise, forward, axis 1"),
        (3, "steady", None, 0, "row 3, steady"),
    ],
)
def test_a_place_is_told_as_far_as_it_is_known(line, phase, axis, direction, words):
    place = Place(
        "a.csv", line, phase, axis, direction, "laser", "in", 9, 0.0, 1.0, None, None, True
    )
    assert place_words(place) == words


def test_what_happened_in_one_run_is_reserved_with_its_name():
    runs = ("a.csv", "b.csv")
    once = verdict("named", DRAG, STEPS, settings={"lost_steps": {"run": 1.0}})
    assert list(reservations(once, runs)) == [
        "lost_steps is not in the machine file: it happened in b.csv alone."
    ]
    always = verdict("named", DRAG, STEPS, settings={"lost_steps": {"run": -1.0}})
    assert not list(reservations(always, runs))
    assert list(parameters_shown(STEPS)) == ["n"]


@pytest.mark.parametrize(
    ("drafts", "beside", "said"),
    [
        (1, None, "; the term below leaves no more than noise."),
        (2, None, "; the terms below leave no more than noise."),
        (1, "a line at 3 Hz", "; the term below leaves what looks like a line at 3 Hz."),
    ],
)
def test_what_drafts_leave_is_told_with_what_is_left(drafts, beside, said):
    draft = Draft("bend", "measurement", "x", "2 * x**2", "N", 30.0, True)
    left = Remainder(True, "a law of x", 0.0, variable="x", beside_drafts=beside)
    given = dataclasses.replace(verdict("unexplained"), drafts=(draft,) * drafts, remainder=left)
    assert sentence(given) == f"Unexplained: what is left looks like a law of x{said}"
