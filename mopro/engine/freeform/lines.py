"""Lines of one frequency in time or of one period in position, and a local bump."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from scipy import fft

from mopro.engine.assumed import BUMP_BINS, FEWEST
from mopro.engine.candidate import Candidate, Law, Parameter, ResidualView, Role
from mopro.engine.freeform.series_motion import (
    LARGEST,
    POSITION,
    Values,
    motion_of,
    span_of,
    step_of,
    values_of,
)
from mopro.engine.series import Floats, Series
from mopro.engine.spectrum import position_spectrum, sinusoid

# Intervals of position in which a bump is looked for: a quarter of the least that one takes.
_BINS = 4 * max(BUMP_BINS)


def line_in_time(sensor: str, rows: Mapping[int, Series]) -> Candidate:
    """A line of one frequency in time, with a size and phase of its own in each run."""
    size = LARGEST * span_of(list(rows.values()))
    names = {rows[row].run: (f"s{i}", f"c{i}") for i, row in enumerate(rows)}

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor or own.time_s is None:
            return np.zeros(len(own))
        angle = 2 * math.pi * values["f"] * own.time_s
        sine, cosine = names[own.run]
        return np.asarray(values[sine] * np.sin(angle) + values[cosine] * np.cos(angle))

    def find(view: ResidualView) -> Iterator[Values]:
        frequency = _strongest(rows, view)
        if frequency is None:
            return
        values = {"f": frequency}
        for row, series in rows.items():
            angle = 2 * math.pi * frequency * values_of(series, "")
            found = sinusoid(angle, view.residuals[row] * view.sigmas[row])
            values |= dict(zip(names[series.run], found, strict=True))
        yield values

    fastest = max(0.5 / step_of(series) for series in rows.values())
    longest = max(float(np.ptp(values_of(series, ""))) for series in rows.values())
    slowest = min(FEWEST / longest, fastest / 2) if longest else fastest / 2
    f = Parameter("f", "Hz", slowest, fastest, role=Role.SHAPE, difference=1e-7)
    unit = next(iter(rows.values())).unit
    sizes = [Parameter(n, unit, -size, size, run=run) for run, pair in names.items() for n in pair]
    law = Law(
        "measurement", "t", unit,
        lambda values: f"{math.hypot(values['s0'], values['c0']):.4g} * "
        f"sin(2 * pi * {values['f']:.5g} * t)", of_data,
    )  # fmt: skip
    return Candidate(f"line in time in {sensor}", (f, *sizes), find_starts=find, law=law)


def _strongest(rows: Mapping[int, Series], view: ResidualView) -> float | None:
    """Frequency (Hz) of the strongest line of the periodograms, summed over the series."""
    length = fft.next_fast_len(2 * max(map(len, rows.values())))
    steps = {row: step_of(series) for row, series in rows.items()}
    step = min(steps.values())
    power = np.zeros(length // 2)
    for row in rows:
        if math.isclose(steps[row], step, rel_tol=1e-3):
            power += np.abs(fft.rfft(view.residuals[row], length)[1 : length // 2 + 1]) ** 2
    longest = max(float(np.ptp(values_of(series, ""))) for series in rows.values())
    frequencies = np.arange(1, len(power) + 1) / (length * step)
    power[frequencies * longest < FEWEST] = 0.0
    return float(frequencies[int(np.argmax(power))]) if power.any() else None


def line_in_position(sensor: str, rows: Mapping[int, Series]) -> Candidate:
    """A line of one period in position, the same in all runs."""
    series = list(rows.values())
    size = LARGEST * span_of(series)
    reach = max(float(np.ptp(values_of(s, POSITION))) for s in series) or 1.0
    count = max(s.count for s in series)

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        angle = 2 * math.pi * motion_of(own, predicted).position / values["p"]
        return np.asarray(values["s"] * np.sin(angle) + values["c"] * np.cos(angle))

    def find(view: ResidualView) -> Iterator[Values]:
        places = [motion_of(s, view.predictions[row]).position for row, s in rows.items()]
        if not max(float(np.ptp(x)) for x in places):
            return
        cycles, power = position_spectrum(
            places, [view.residuals[row] for row in rows], count=count
        )
        power = np.where(cycles * reach < FEWEST, 0.0, power)
        if not power.any():
            return
        period = 1 / float(cycles[int(np.argmax(power))])
        angle = 2 * math.pi * np.concatenate(places) / period
        left = np.concatenate([view.residuals[row] * view.sigmas[row] for row in rows])
        sine, cosine = sinusoid(angle, left)
        yield {"p": period, "s": sine, "c": cosine}

    unit = series[0].unit
    p = Parameter("p", series[0].position_unit, max(reach / 5000, min(2 * count, reach / 2)),
                  reach, role=Role.SHAPE, inverse=True, difference=1e-6)  # fmt: skip
    law = Law(
        "measurement", "x mod", unit,
        lambda values: f"{math.hypot(values['s'], values['c']):.4g} * "
        f"sin(2 * pi * x / {values['p']:.5g} + {math.atan2(values['c'], values['s']):.3g})",
        of_data,
    )  # fmt: skip
    sizes = (Parameter("s", unit, -size, size), Parameter("c", unit, -size, size))
    return Candidate(f"line in position in {sensor}", (p, *sizes), find_starts=find, law=law)


def bump(sensor: str, rows: Mapping[int, Series]) -> Candidate:
    """A local bump in position, of the shape of Gauss' curve."""
    series = list(rows.values())
    size = LARGEST * span_of(series)
    places = np.concatenate([values_of(s, POSITION) for s in series])
    low, reach = float(places.min()), float(np.ptp(places)) or 1.0
    middles = low + reach * (np.arange(_BINS) + 0.5) / _BINS
    binned = np.minimum((places - low) / reach * _BINS, _BINS - 1).astype(np.intp)

    def shape(x: Floats, at: float, width: float) -> Floats:
        return np.asarray(np.exp(-0.5 * ((x - at) / width) ** 2))

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        return values["h"] * shape(motion_of(own, predicted).position, values["at"], values["w"])

    def find(view: ResidualView) -> Iterator[Values]:
        left = np.concatenate([view.residuals[row] * view.sigmas[row] for row in rows])
        # Sums over intervals that are short for every width.
        samples = np.bincount(binned, minlength=_BINS)
        sums = np.bincount(binned, left, minlength=_BINS)
        best: tuple[float, Values] = (0.0, {})
        for intervals in BUMP_BINS:
            width = reach / intervals / 2
            for at in np.arange(low, low + reach, width):
                form = shape(middles, float(at), width)
                form -= samples @ form / samples.sum()
                norm = float(samples @ form**2)
                along = float(form @ sums)
                # Between places that were visited a bump of any height shows nothing.
                height = min(max(along / norm, -size), size) if norm else 0.0
                gain = height * (2 * along - height * norm)
                if gain > best[0]:
                    best = gain, {"h": height, "at": float(at), "w": width}
        if best[1]:
            yield best[1]

    unit, place = series[0].unit, series[0].position_unit
    law = Law(
        "measurement", "x", unit,
        lambda values: f"{values['h']:.4g} * exp(-((x - {values['at']:.4g}) / "
        f"{values['w']:.3g})**2 / 2)", of_data,
    )  # fmt: skip
    parameters = (
        Parameter("h", unit, -size, size),
        Parameter("at", place, low, low + reach, role=Role.SHAPE),
        Parameter("w", place, reach / 500, reach, role=Role.SHAPE, inverse=True),
    )
    return Candidate(f"bump in {sensor}", parameters, find_starts=find, law=law)
