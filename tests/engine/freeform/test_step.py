"""A step in the readings of one run: found in closed form, and drafted beside what is listed."""

import re

import numpy as np
import pytest

import mopro
from helpers.signals import candidates, names, of_size, sizes
from mopro.engine import Series
from mopro.engine.candidate import ResidualView
from mopro.engine.freeform import measurement_laws

T = np.linspace(0.0, 2.0, 400)
RUNS = ("run1.csv", "run2.csv", "run3.csv")
SPEED = [np.cos(15.0 * T + i) for i in range(len(RUNS))]
SIGMA = 0.05


def series(values):
    return [
        Series(run, "probe", "V", own, SIGMA, T, np.arange(400) // 80)
        for run, own in zip(RUNS, values, strict=True)
    ]


def found(residual, tangent):
    """Moment (s) and height (sigmas) of each step that is found in the first run.

    `residual` (samples) and `tangent` (samples x numbers) are those of that run.
    """
    data = series([T] * 3)
    term = next(c for c in measurement_laws(data) if c.name == "step in probe in run1.csv")
    others, untouched = [np.zeros(400)] * 2, [np.zeros_like(tangent)] * 2
    view = ResidualView(
        data, [residual, *others], [1.0] * 3, [T] * 3, [tangent, *untouched], {}, lambda _: 0.0,
        lambda _: np.zeros(1200),
    )  # fmt: skip
    return [(start["at"], start["c"]) for start in term.find_starts(view)]


def test_the_step_that_is_found_is_the_one_of_least_squares():
    """Beside an offset and a sine that other effects make up for, by fits at every sample."""
    noise = np.random.default_rng(3).standard_normal(400)
    tangent = np.sin(3.0 * T)
    tangent = (tangent - tangent.mean())[:, None] / np.linalg.norm(tangent - tangent.mean())
    known = np.column_stack([np.ones(400), tangent])
    readings = noise + 1.5 * (T >= 1.3)
    residual = readings - known @ np.linalg.lstsq(known, readings, rcond=None)[0]

    def fitted(first):
        columns = np.column_stack([known, np.arange(400) >= first])
        coefficients, rss, *_ = np.linalg.lstsq(columns, readings, rcond=None)
        return rss[0], first, coefficients[-1]

    _, first, height = min(fitted(first) for first in range(3, 398))
    ((at, c),) = found(residual, tangent)
    assert (T[first - 1] < at <= T[first], c) == (True, pytest.approx(height))
    assert at == pytest.approx(1.3, abs=0.02)


def test_a_run_that_an_effect_makes_up_for_altogether_has_no_step():
    everything = np.linalg.qr(np.column_stack([np.ones(400), np.eye(400)[:, 1:]]))[0][:, 1:]
    rounding = 1e-12 * np.random.default_rng(2).standard_normal(400)
    assert found(rounding, everything) == []


def model(settings):
    (drag,) = sizes(settings, "drag")
    return [drag * speed for speed in SPEED]


@pytest.mark.parametrize("truth", [{}, of_size(drag=0.1)], ids=["alone", "beside a drag"])
def test_steps_of_two_runs_are_drafted_and_a_smaller_effect_is_named(truth):
    """Steps of 0.3 and -0.4 V explain four times what the drag does."""
    steps = {"run1.csv": (0.3, 1.3), "run2.csv": (-0.4, 0.7)}
    rng = np.random.default_rng(5)
    readings = [own + SIGMA * rng.standard_normal(400) for own in model(truth)]
    for number, run in enumerate(RUNS):
        height, at = steps.get(run, (0.0, 0.0))
        readings[number] += height * (at <= T)
    verdict = mopro.reconcile(model, candidates("drag"), series(readings))
    assert (verdict.verdict, names(verdict)) == ("unexplained", set(truth))
    assert {(d.run, d.of, d.enters, d.held_out) for d in verdict.drafts} == {
        (run, "t", "measurement", True) for run in steps
    }
    for draft in verdict.drafts:
        height, at = map(float, re.findall(r"-?[0-9.]+", draft.law))
        assert (height, at) == (
            pytest.approx(steps[draft.run][0], abs=0.02),
            pytest.approx(steps[draft.run][1], abs=0.02),
        )
    assert [d["run"] for d in verdict.as_json()["drafts"]] == [d.run for d in verdict.drafts]
    for effect in verdict.effects:
        low, high = effect.parameters["size"].ci95
        assert low < 0.1 < high
