"""The rule for a prediction that is not finite, where it enters a fit: as far off as can be."""

import math

import numpy as np
import pytest

from mopro.engine import Candidate, Parameter, Series, reconcile
from mopro.engine.fits import least_squares_fit
from mopro.engine.residuals import Residuals
from mopro.engine.series import RUN_AWAY, unless_run_away

TIME_S = np.linspace(0.0, 2.0, 200)
SIGMA = 0.01
# What a simulation may come to: no number, none that is finite, and none that is one for long.
AWAY = [math.nan, math.inf, -math.inf, 1e308, -1e200, 1e70]


def predicted(settings, away):
    """A slope, and a burst that grows until it has run away."""
    values = settings.get("slope", {}).get("k", 0.0) * TIME_S
    if size := settings.get("burst", {}).get("b", 0.0):
        late = 1.5 - 0.5 * size < TIME_S
        values = np.where(late, away, values + size)
    return [values]


SLOPE = Candidate("slope", (Parameter("k", "V/s", -5.0, 5.0, (0.5,)),))
BURST = Candidate("burst", (Parameter("b", "V", -1.0, 1.0, (0.5,)),))


def measured():
    noise = SIGMA * np.random.default_rng(4).standard_normal(len(TIME_S))
    return Series("run", "probe", "V", 0.3 * TIME_S + noise, SIGMA)


@pytest.mark.parametrize("away", AWAY)
def test_a_prediction_that_runs_away_is_as_far_off_as_can_be(away):
    series = measured()
    residuals = Residuals(lambda s: predicted(s, away), [series])
    left = residuals.at({"burst": {"b": 1.0}})
    assert np.isfinite(left).all()
    # Nothing that is finite is worth less.
    worst = Residuals(lambda s: [1e40 * TIME_S], [series]).at({})
    late = np.flatnonzero(TIME_S > 1.0)
    assert (np.abs(left[late]) >= np.abs(worst[late])).all()
    assert np.isfinite(left @ left)
    assert np.isfinite(np.float32(left @ left))


@pytest.mark.parametrize("away", AWAY)
def test_an_effect_that_runs_away_is_not_believed_and_ends_nothing(away):
    verdict = reconcile(lambda s: predicted(s, away), [SLOPE, BURST], [measured()])
    assert [effect.name for effect in verdict.effects] == ["slope"]
    assert verdict.verdict == "named"


@pytest.mark.parametrize("away", AWAY)
def test_a_descent_that_begins_where_it_has_run_away_ends(away):
    residuals = Residuals(lambda s: predicted(s, away), [measured()])
    start = {"burst": {"b": 0.5}, "slope": {"k": 0.0}}
    fit = least_squares_fit(residuals, [SLOPE, BURST], [start])
    assert np.isfinite(fit.rss)


def test_what_has_run_away_is_nan_and_the_rest_is_as_it_was():
    values = np.array([0.0, -1.0, 0.5 * RUN_AWAY, -2 * RUN_AWAY, math.inf, math.nan])
    kept = unless_run_away(values)
    assert kept[:3].tolist() == values[:3].tolist()
    assert np.isnan(kept[3:]).all()
