"""Fits of sets of effects by least squares, and the statistics of a fit.

A `Fit` costs a simulation for each evaluation of its residual. `Evidence` judges fits by one noise,
`held_out` by parts that were not fitted, and `spread` by the size that an effect has in each part.
Knows no search.
"""

from mopro.engine.fits.descent import Descent
from mopro.engine.fits.evidence import Evidence
from mopro.engine.fits.fit import (
    Fit,
    Identity,
    Key,
    explained_by,
    growing_fit,
    least_squares_fit,
    with_central_jacobian,
)
from mopro.engine.fits.heldout import ONE_RUN, OTHER_RUNS, HeldOut, held_out, parts_of
from mopro.engine.fits.jacobian import SecantJacobian, gauss_newton_step
from mopro.engine.fits.limit import NO_LIMIT, Limit
from mopro.engine.fits.tolerated import with_tolerances
from mopro.engine.fits.uniformity import Spread, spread

__all__ = [
    "NO_LIMIT",
    "ONE_RUN",
    "OTHER_RUNS",
    "Descent",
    "Evidence",
    "Fit",
    "HeldOut",
    "Identity",
    "Key",
    "Limit",
    "SecantJacobian",
    "Spread",
    "explained_by",
    "gauss_newton_step",
    "growing_fit",
    "held_out",
    "least_squares_fit",
    "parts_of",
    "spread",
    "with_central_jacobian",
    "with_tolerances",
]
