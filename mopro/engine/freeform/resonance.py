"""A resonance: what the acceleration makes swing on a spring, and so moves what is measured."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from scipy import fft

from mopro.engine.assumed import FEWEST, LEAST_SHARE, ROUNDING
from mopro.engine.candidate import Candidate, Law, Parameter, ResidualView, Role
from mopro.engine.freeform.series_motion import (
    LARGEST,
    Values,
    labelled,
    motion_of,
    span_of,
    step_of,
    values_of,
)
from mopro.engine.series import Floats, Series
from mopro.engine.swing import swing

# Damping ratios of what rings at all, and the one at which resonances are looked for: the tried
# frequencies are its width apart. Halved, twice as many are tried; doubled, a start is up to 10 %
# off.
_LEAST_DAMPING, _MOST_DAMPING = LEAST_SHARE**3, LEAST_SHARE * 5
_TRIED_DAMPING = LEAST_SHARE / 2


def resonance(sensor: str, rows: Mapping[int, Series]) -> Iterator[Candidate]:
    """In proportion to what follows the acceleration as a mass on a spring does.

    A frame or a tool that gives way, or a part of the mass that swings. None without an
    acceleration, or where no three periods of six samples each go into a run.
    """
    series = list(rows.values())
    longest = max(float(np.ptp(values_of(s, ""))) for s in series)
    shortest = 2 * FEWEST * max(step_of(s) for s in series)
    ascending = all(len(s) > 1 and bool((np.diff(values_of(s, "")) > 0).all()) for s in series)
    if not labelled(series, "acceleration") or not ascending or FEWEST * shortest >= longest:
        return
    reach = max(float(np.ptp(values_of(s, "acceleration"))) for s in series)
    if not reach:
        return

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        driven = motion_of(own, predicted).acceleration
        return values["c"] * swing(values_of(own, ""), driven, values["f"], values["zeta"])

    tried = _frequencies(FEWEST / longest, 1 / shortest)

    def find(view: ResidualView) -> Iterator[Values]:
        likeliest = _likeliest(rows, view, tried)
        if likeliest is not None:
            yield likeliest | {"zeta": _TRIED_DAMPING}

    size = span_of(series) / reach
    parameters = (
        Parameter("c", f"{series[0].unit} per unit of a", -LARGEST * size, LARGEST * size),
        Parameter("f", "Hz", FEWEST / longest, 1 / shortest, role=Role.SHAPE, difference=1e-5),
        Parameter("zeta", "1", _LEAST_DAMPING, _MOST_DAMPING, role=Role.SHAPE),
    )
    law = Law(
        "measurement", "a", series[0].unit,
        lambda values: f"{values['c']:.4g} * swing(a, {values['f']:.4g}, {values['zeta']:.3g})",
        of_data, alone=False,
    )  # fmt: skip
    yield Candidate(f"swing of a in {sensor}", parameters, find_starts=find, law=law)


def _frequencies(least: float, most: float) -> Floats:
    """Frequencies (Hz) from `least` to `most`, a resonance's width apart."""
    number = 1 + math.ceil(math.log(most / least) / (2 * _TRIED_DAMPING))
    return np.geomspace(least, most, number)


def _likeliest(
    rows: Mapping[int, Series], view: ResidualView, tried: Floats
) -> dict[str, float] | None:
    """Size and frequency of the resonance that explains most beside the acceleration itself.

    Of the frequencies (Hz) that are `tried`. Products of signals are sums over their spectra, and
    each resonance is a factor there. None where nothing accelerates.
    """
    steps = {row: step_of(own) for row, own in rows.items()}
    interval = min(steps.values())
    length = fft.next_fast_len(2 * max(map(len, rows.values())))
    frequencies = fft.rfftfreq(length, interval)[1:]
    square = np.zeros(len(frequencies))
    product = square.astype(complex)
    for row, own in rows.items():
        if math.isclose(steps[row], interval, rel_tol=1e-3):
            driven = motion_of(own, view.predictions[row]).acceleration / view.sigmas[row]
            spectrum = fft.rfft(own.without_nuisances(driven), length)[1:]
            square += np.abs(spectrum) ** 2
            product += spectrum.conj() * fft.rfft(view.residuals[row], length)[1:]
    if not square.any():
        return None
    # Of thousands of frequencies a resonance answers neighbours alike.
    bands = np.floor(np.log(frequencies) / (LEAST_SHARE * _TRIED_DAMPING)).astype(int)
    first = np.flatnonzero(np.diff(bands, prepend=bands[0] - 1))
    square, product = np.add.reduceat(square, first), np.add.reduceat(product, first)
    ratio = frequencies[first] / tried[:, None]
    response = 1 / (1 - ratio**2 + 2j * _TRIED_DAMPING * ratio)
    # What the acceleration by itself explains of both is left out.
    shared = (response.real @ square) / square.sum()
    gained = (response.conj() @ product).real - shared * product.real.sum()
    whole = np.abs(response) ** 2 @ square
    apart = whole - shared**2 * square.sum()
    distinct = apart > ROUNDING * whole
    gains = np.where(distinct, gained**2 / np.where(distinct, apart, 1.0), 0.0)
    best = int(np.argmax(gains))
    if not distinct[best]:
        return None
    return {"c": float(gained[best] / apart[best]), "f": float(tried[best])}
