"""A step in the readings of one run: a scale that slips, a fringe or a microstep that is lost."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mopro.engine.assumed import FEWEST, ROUNDING
from mopro.engine.candidate import Candidate, Law, Parameter, ResidualView, Role
from mopro.engine.freeform.series_motion import LARGEST, Values, span_of, values_of
from mopro.engine.series import Floats, Series


def step_in_time(sensor: str, row: int, series: Series) -> Candidate:
    """All readings of one run from a moment `at` (s) on, `c` more. `row`: number of the series."""
    time_s = values_of(series, "")
    size = LARGEST * span_of([series])

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if (own.sensor, own.run) != (sensor, series.run):
            return np.zeros(len(own))
        return np.asarray(values["c"] * (values_of(own, "") >= values["at"]))

    def find(view: ResidualView) -> Iterator[Values]:
        first, height = _largest(series, view.residuals[row], view.tangents[row])
        if first:
            at = (time_s[first - 1] + time_s[first]) / 2
            yield {"c": height * view.sigmas[row], "at": float(at)}

    ends = float(time_s.min()), float(time_s.max())
    parameters = (
        Parameter("c", series.unit, -size, size, run=series.run),
        Parameter("at", "s", *ends, role=Role.SEARCHED),
    )
    law = Law(
        "measurement", "t", series.unit,
        lambda values: f"{values['c']:.4g} * (t >= {values['at']:.7g})", of_data, run=series.run,
    )  # fmt: skip
    name = f"step in {sensor} in {series.run}"
    return Candidate(name, parameters, find_starts=find, law=law)


def _largest(series: Series, residual: Floats, tangent: Floats) -> tuple[int, float]:
    """First sample of the step that explains most of a whitened residual, and its height (sigmas).

    Less what nuisances and other effects make up for, of which `residual` has none: `tangent` has
    the rows of the latter (samples x numbers). The number is 0 if there is no such step.
    """
    basis, _ = np.linalg.qr(series.nuisance_shapes())
    absorbed = np.hstack([basis, tangent])
    # Sums over all samples from each one on.
    product = residual[::-1].cumsum()[::-1]
    samples = np.arange(len(residual), 0, -1.0)
    square = samples - np.sum(absorbed[::-1].cumsum(axis=0)[::-1] ** 2, axis=1)
    distinct = square > ROUNDING * samples
    distinct[:FEWEST], distinct[len(distinct) - FEWEST :] = False, False
    explained = np.where(distinct, product**2 / np.where(distinct, square, 1.0), 0.0)
    first = int(np.argmax(explained))
    return (first, float(product[first] / square[first])) if distinct.any() else (0, 0.0)
