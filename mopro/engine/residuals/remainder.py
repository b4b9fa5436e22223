"""Test of the residual of a fit against noise, and a description of what is in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from mopro.engine.assumed import FALSE_ALARMS, LEAST_SAMPLES, LEAST_SHARE, TOLERANCE
from mopro.engine.residuals.noise_model import Noise
from mopro.engine.residuals.noise_tests import chi2_log_p, ends_white
from mopro.engine.residuals.residual_shapes import Finding, shape_findings
from mopro.engine.residuals.whitened import Residuals, difference_variance
from mopro.engine.series import Floats

# Standard errors by which the variance of noise with a memory may be above the stated one.
_STANDARD_ERRORS = -float(special.ndtri(FALSE_ALARMS / 2))


@dataclass(frozen=True)
class Remainder:
    """Answer of the tests: whether the residual is more than noise, and its clearest shape.

    `scatter`: its RMS in standard deviations of the sensors' noise, 1 where that is unknown.
    `variable`: what it is a function of (v, sgn v, x, x mod, a or t), if one shape is clearest;
    sensor where nothing but wild samples has been left out.
    `only_size`: no test of a shape fails, and the scatter alone is larger than stated. `note`: why
    what fails a test may be noise all the same. `beside_drafts`: where free-form terms describe it,
    the clearest shape of what they leave in turn; None for noise.
    """

    significant: bool
    description: str | None
    p_value: float
    scatter: float = 1.0
    variable: str | None = None
    only_size: bool = False
    note: str | None = None
    beside_drafts: str | None = None


NOTHING_LEFT = Remainder(False, None, 1.0)


def examine(
    residuals: Residuals, residual: Floats, parameters: int, variable: str | None = None
) -> Remainder:
    """Test a whitened `residual`, to which so many `parameters` were fitted.

    Shapes are tested against white noise of the stated size, or as strong as neighbouring
    samples differ where that is more or nothing is stated. The size is tested where it is
    stated for all series. If a shape of `variable` is significant, that is described, else the
    clearest one.
    """
    known, shapes = residuals.known_noise, shape_findings(residuals, residual)
    size = _excess(residual, residuals.count - parameters) if known else Finding(0.0, None)
    findings = [size, *shapes] if known else shapes
    if not findings:
        return Remainder(False, None, 1.0)
    scatter = math.sqrt(float(np.mean(residual**2))) if known else 1.0
    log_p = min(finding.log_p for finding in findings) + math.log(len(findings))
    p_value = math.exp(min(log_p, 0.0))
    if p_value >= FALSE_ALARMS:
        return Remainder(False, None, p_value, scatter)
    level = math.log(FALSE_ALARMS / len(findings))
    described = [f for f in shapes if f.description and f.log_p < level]
    telling = [f for f in described if not f.general]
    wanted = [[f for f in group if f.variable == variable] for group in (telling, described)]
    described = next((group for group in (*wanted, telling) if group), described)
    if described:
        clearest = min(described, key=lambda finding: finding.log_p)
        return Remainder(True, clearest.description, p_value, scatter, clearest.variable)
    tested = all(len(series) >= LEAST_SAMPLES for series in residuals.data)
    white = tested and all(f.log_p >= level for f in shapes)
    words = f"more scatter than the sensor's noise, {scatter:.3g} times as much"
    return Remainder(True, words, p_value, scatter, only_size=white)


def as_noise(
    residuals: Residuals, noise: Noise, residual: Floats, remainder: Remainder
) -> str | None:
    """Reason why a residual that fails the tests may be noise all the same; None if none."""
    if remainder.only_size:
        return (
            f"the noise is {remainder.scatter:.2g} times as much as stated, and white: "
            "intervals and evidence are those of the larger one"
        )
    parts = residuals.split(residual)
    white = sum(len(own) * difference_variance(own) for own in parts) / len(residual)
    square = float(np.mean(residual**2))
    alike = f"neighbouring samples are {'alike' if white < square else 'unlike'}"
    most = (1 + TOLERANCE) ** 2
    if not residuals.known_noise:
        if _is_much_of_the_signal(residuals, residual):
            return None
        if 1 / most < white / square < most:
            return f"the noise is white but for {remainder.description}"
        return f"the noise has a memory: {alike}"
    # The variance of noise with a memory is known from few independent samples.
    spread = 1 + _STANDARD_ERRORS * math.sqrt(2 / float(noise.samples.sum()))
    if square > most * spread or 1 / most < white < most:
        return None
    size = "of the stated size" if square > 1 / most else f"{square**0.5:.2g} times the stated"
    return f"the noise is {size} and not white: {alike}"


def _is_much_of_the_signal(residuals: Residuals, residual: Floats) -> bool:
    """True if what is left of a series is a tenth of its signal, and neighbours show none of it.

    No noise is taken for that, whatever its memory: of red noise with a correlation of 0.99 from
    sample to sample the neighbours show a tenth. Nor where the noise that they show is white, and
    what is left beyond that is a tenth of the signal. In standard deviations.
    """
    signal = residuals.without_nuisances(residuals.measured * residuals.weights)
    for own, all_ in zip(residuals.split(residual), residuals.split(signal), strict=True):
        shown, left = len(own) * difference_variance(own), float(own @ own)
        if ends_white(own):
            left -= shown
        elif shown >= LEAST_SHARE**2 * left:
            continue
        if left > LEAST_SHARE**2 * float(all_ @ all_):
            return True
    return False


def noise_of(residuals: Residuals, residual: Floats, parameters: int) -> Noise:
    """The stated noise, or noise like `residual` where that is more (see `examine`).

    White noise that is larger than stated is white noise of unknown size: a spectrum would be
    known from no more than the frequencies of each band.
    """
    stated = Noise.as_stated(residuals)
    remainder = examine(residuals, residual, parameters)
    if not remainder.significant:
        return stated
    return stated.of_unknown_size() if remainder.only_size else stated.like(residual)


def _excess(residual: Floats, freedom: int) -> Finding:
    """Chi-squared test with the largest noise that is tolerated."""
    rss = float(residual @ residual) / (1 + TOLERANCE) ** 2
    return Finding(chi2_log_p(rss, freedom), None)
