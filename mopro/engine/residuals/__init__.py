"""Residuals: data less a prediction, whitened, and what they hold beyond noise.

`Residuals` whitens and takes the nuisances out. `Noise` is what residuals are judged by, `examine`
tests whether one is noise and says what else is in it; `without_rough_ends` and `without_wild`
leave out samples that decide nothing. Knows no model, effect or machine.
"""

from mopro.engine.residuals.calibration import Corrected
from mopro.engine.residuals.noise_model import Noise
from mopro.engine.residuals.noise_tests import cusum_step, whiteness_p
from mopro.engine.residuals.remainder import NOTHING_LEFT, Remainder, as_noise, examine, noise_of
from mopro.engine.residuals.whitened import Residuals, difference_variance, projected_out
from mopro.engine.residuals.wild import (
    least_noise,
    wild_samples,
    without_rough_ends,
    without_wild,
)

__all__ = [
    "NOTHING_LEFT",
    "Corrected",
    "Noise",
    "Remainder",
    "Residuals",
    "as_noise",
    "cusum_step",
    "difference_variance",
    "examine",
    "least_noise",
    "noise_of",
    "projected_out",
    "whiteness_p",
    "wild_samples",
    "without_rough_ends",
    "without_wild",
]
