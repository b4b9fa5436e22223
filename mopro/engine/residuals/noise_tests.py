"""Tests of a series against white noise of unit variance: size, autocorrelation, steps, lines.

Each returns the natural logarithm of its p-value, as p-values below 1e-308 are common here.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import fft, special

from mopro.engine.assumed import FEWEST, LEAST_SAMPLES, LEAST_SHARE, TINY, VERY_STRONG
from mopro.engine.series import Floats

# Kolmogorov distance (times √n) beyond which the first term of its series is all of it: the
# second is e⁻⁵⁴ of it there, and the library's logarithm underflows further out.
_FIRST_TERM_ALONE = 3.0


def is_still(z: Floats) -> bool:
    """True if a series shows none of the noise that is stated for it, as a sensor at rest."""
    return float(np.var(z)) < LEAST_SHARE**2


def chi2_log_p(rss: float, freedom: int) -> float:
    """Chi-squared test of a sum of squares with so many degrees of freedom."""
    return _gamma_log_p(max(freedom, 1) / 2, rss / 2)


def normal_log_p(z: float, trials: int = 1) -> float:
    """Two-sided test of the largest of `trials` standard normal numbers (Bonferroni)."""
    return min(0.0, math.log(2 * trials) + float(special.log_ndtr(-abs(z))))


def line_log_p(power: float, lines: int, series: int) -> float:
    """Test of the strongest of `lines` in a periodogram summed over so many series.

    The power of one line of white noise of variance 1 is exponential with mean 1.
    """
    return min(0.0, math.log(lines) + _gamma_log_p(series, power))


def _gamma_log_p(a: float, x: float) -> float:
    """ln of the share of a gamma distribution of shape `a` above `x`.

    Where that underflows, by its continued fraction up to the second term (DLMF 8.9.2).
    """
    if p := float(special.gammaincc(a, x)):
        return math.log(p)
    return float(a * math.log(x) - x - special.gammaln(a) - math.log(x + 1 - a))


def cumulative_periodogram(z: Floats) -> Floats:
    """Share of the variance at each frequency and below, without the last, which is 1."""
    power = np.abs(fft.rfft(z - z.mean()))[1 : (len(z) + 1) // 2] ** 2
    shares: Floats = np.cumsum(power)[:-1] / float(power.sum())
    return shares


def bartlett_log_p(shares: Floats) -> float:
    """Bartlett's test (1955) of a cumulative periodogram: that of white noise is a straight line.

    The distance from that line has Kolmogorov's limiting distribution.
    """
    steps = np.arange(len(shares) + 1) / len(shares)
    largest = max(float(np.max(steps[1:] - shares)), float(np.max(shares - steps[:-1])))
    distance = largest * math.sqrt(len(shares))
    if distance > _FIRST_TERM_ALONE:
        return math.log(2) - 2 * distance**2
    return math.log(float(special.kolmogorov(distance)))


def whiteness_p(z: Floats) -> float:
    """p-value of Bartlett's test; 1 for few samples and for a sensor that is still."""
    if len(z) < LEAST_SAMPLES or is_still(z):
        return 1.0
    return math.exp(bartlett_log_p(cumulative_periodogram(z)))


def ends_white(z: Floats) -> bool:
    """True if the upper half of the frequencies is white, by very strong evidence.

    Against noise with a memory of first order, of the correlation of neighbours that `z` has: its
    power falls to the end of the spectrum, where something slow beside white noise has a floor.
    The likelihoods are Whittle's, at the size that fits best. False for few samples, and where
    neighbours are not alike.
    """
    if len(z) < LEAST_SAMPLES:
        return False
    memory = 1 - float(np.mean(np.diff(z) ** 2)) / 2 / float(np.mean(z**2) or 1.0)
    if memory <= 0:
        return False
    upper = np.arange(len(z) // 2, len(z))
    power = fft.dct(z, norm="ortho")[upper] ** 2
    shape = 1 / (1 + memory**2 - 2 * memory * np.cos(np.pi * upper / len(z)))
    white, red = (len(upper) * math.log(float(p.mean()) or TINY) for p in (power, power / shape))
    return white + VERY_STRONG < red + float(np.log(shape).sum())


def cusum_step(z: Floats) -> tuple[int, float]:
    """The last sample before the likeliest step of the mean, and the contrast there.

    The contrast is standard normal at a given place if there is no step: the CUSUM of the
    centred samples over its standard deviation, √(m (n - m) / n) after m of n samples. Negative
    for a step up. Either side has FEWEST samples: fewer are wild ones at the edge of a record.
    """
    n = len(z)
    before = np.arange(FEWEST, n - FEWEST + 1)
    contrast = np.cumsum(z - z.mean())[before - 1] / np.sqrt(before * (n - before) / n)
    place = int(np.argmax(np.abs(contrast)))
    return int(before[place]) - 1, float(contrast[place])
