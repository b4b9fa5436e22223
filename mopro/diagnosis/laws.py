"""Free-form terms of the measurement: functions of time and motion that no catalogue lists.

Each is added to the predictions of one sensor, in all its runs. They stand beside the catalogue
at a price of their own, and describe what is left where no listed effect does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from threading import Lock

import numpy as np
from cachetools import LRUCache, cached
from scipy import fft

from mopro.diagnosis.constants import BUMP_BINS, FEWEST, LEAST_SHARE
from mopro.diagnosis.model import (
    Candidate,
    Floats,
    Law,
    Parameter,
    ResidualView,
    Role,
    Series,
    Settings,
    Simulate,
)
from mopro.diagnosis.statistics.spectrum import position_spectrum, sinusoid
from mopro.play import follow

Values = Mapping[str, float]

# Size of a term that is looked for, as a multiple of the largest value measured, and the size at
# which it is probed.
_LARGEST, _PROBED = 1 / LEAST_SHARE**2, LEAST_SHARE**2
# Intervals of position in which a bump is looked for: a quarter of the least that one takes.
_BINS = 4 * max(BUMP_BINS)
# Predictions kept: a term that is fitted beside effects asks for the same ones again.
_CACHE_SIZE = 16


class WithLaws:
    """The model `simulate`, with the free-form terms in the settings added to its predictions."""

    def __init__(
        self, simulate: Simulate, data: Sequence[Series], laws: Sequence[Candidate]
    ) -> None:
        self._simulate, self._data = simulate, data
        self._terms = {c.name: c.law.of_data for c in laws if c.law and c.law.of_data}
        # Asked by several threads at once.
        cache: LRUCache[Hashable, Sequence[Floats]] = LRUCache(_CACHE_SIZE)
        self._of_the_model = cached(cache, key=_key, lock=Lock())(self._predict)

    def __call__(self, settings: Settings) -> Sequence[Floats]:
        plain = {name: values for name, values in settings.items() if name not in self._terms}
        predicted = self._of_the_model(plain)
        # In one order, as sums depend on it.
        for name, term in self._terms.items():
            if name not in settings:
                continue
            predicted = [
                own + term(series, own, settings[name])
                for own, series in zip(predicted, self._data, strict=True)
            ]
        return predicted

    def _predict(self, settings: Settings) -> Sequence[Floats]:
        return [np.asarray(p, dtype=float) for p in self._simulate(settings)]


def _key(settings: Settings) -> Hashable:
    return tuple(sorted((name, tuple(sorted(own.items()))) for name, own in settings.items()))


def measurement_laws(data: Sequence[Series]) -> list[Candidate]:
    """The free-form terms of each sensor that its series have labels for.

    A label that repeats the series' own values describes nothing.
    """
    answer: list[Candidate] = []
    ordered = sorted(enumerate(data), key=lambda each: each[1].sensor)
    for sensor, group in groupby(ordered, key=lambda each: each[1].sensor):
        rows = dict(group)
        answer += _of_sensor(sensor, rows)
    return answer


def _of_sensor(sensor: str, rows: Mapping[int, Series]) -> Iterator[Candidate]:
    series = list(rows.values())
    for shape in _SHAPES:
        if all(_labelled(series, label) for label in shape.labels):
            yield from _proportional(sensor, series, shape)
    if all(s.time_s is not None for s in series):
        for shape in _LATE if _with_rests(series) else ():
            yield from _proportional(sensor, series, shape)
        yield from _proportional(sensor, series, _TIME)
        for shape in _FADING:
            if all(_labelled(series, label) for label in shape.labels):
                yield from _fading(sensor, rows, shape)
        yield from _lag(sensor, series)
        yield _line_in_time(sensor, rows)
    if _labelled(series, _POSITION):
        yield _line_in_position(sensor, rows)
        yield _bump(sensor, rows)


def _with_rests(series: Sequence[Series]) -> bool:
    """True if the labels tell of moves with rests between them."""
    told = all("velocity" in s.labels and "acceleration" in s.labels for s in series)
    return told and any(bool((_values(s, "velocity") == 0).any()) for s in series)


def _labelled(series: Sequence[Series], label: str) -> bool:
    return all(
        label in s.labels and not np.array_equal(_values(s, label), s.values) for s in series
    )


def _values(series: Series, label: str) -> Floats:
    values = series.time_s if label == "" else series.labels[label]
    return np.asarray(values, dtype=float)


@dataclass(frozen=True)
class _Motion:
    """The motion that a term depends on (samples): labels of a series, or what is predicted."""

    series: Series
    predicted: Floats | None = None

    @property
    def time_s(self) -> Floats:
        return _values(self.series, "")

    @property
    def position(self) -> Floats:
        return _values(self.series, _POSITION) if self.predicted is None else self.predicted

    @property
    def velocity(self) -> Floats:
        if self.predicted is None:
            return self.label("velocity")
        return np.gradient(self.predicted, self.time_s)

    @property
    def acceleration(self) -> Floats:
        if self.predicted is None:
            return self.label("acceleration")
        return np.gradient(self.velocity, self.time_s)

    @property
    def direction(self) -> Floats:
        """Sign of the last motion; 0 before the first."""
        sign = np.sign(self.velocity)
        last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), -1))
        return np.where(last >= 0, sign[last], 0.0)

    def label(self, name: str) -> Floats:
        return _values(self.series, name)

    def seconds_of(self, name: str) -> Floats:
        """Time (s) spent so far where a label was not 0 (samples)."""
        during = self.label(name)[:-1] != 0
        return np.concatenate([[0.0], np.cumsum(np.diff(self.time_s) * during)])

    @property
    def starts(self) -> Floats:
        """Number of moves begun so far: the commanded speed has left 0 so often (samples)."""
        moving = self.label("velocity") != 0
        return np.cumsum(np.diff(moving.astype(float), prepend=0.0) > 0).astype(float)


def _motion(series: Series, predicted: Floats) -> _Motion:
    """Motion that is predicted, of places at ascending times; else that of the labels."""
    time_s = series.time_s
    told = series.of_place and time_s is not None and bool((np.diff(time_s) > 0).all())
    return _Motion(series, predicted if told and len(series) > 1 else None)


@dataclass(frozen=True)
class _Shape:
    """A function of the motion: its `name`, the labels that it needs, its variable and text.

    `by_play`: where the place is predicted, the term shifts it as a play does.
    """

    name: str
    labels: tuple[str, ...]
    variable: str
    text: str
    of: Callable[[_Motion], Floats]
    by_play: bool = False


_POSITION = "position"
_SHAPES = (
    _Shape("v", ("velocity",), "v", "v", lambda m: m.velocity),
    _Shape("v|v|", ("velocity",), "v", "v * abs(v)", lambda m: m.velocity * np.abs(m.velocity)),
    _Shape("sgn v", ("velocity",), "sgn v", "sign(v)", lambda m: m.direction, by_play=True),
    _Shape("a", ("acceleration",), "a", "a", lambda m: m.acceleration),
    _Shape("x", (_POSITION,), "x", "x", lambda m: m.position),
    _Shape("x²", (_POSITION,), "x", "x**2", lambda m: m.position**2),
    _Shape("x³", (_POSITION,), "x", "x**3", lambda m: m.position**3),
    _Shape("other x", ("other_position",), "x", "y", lambda m: m.label("other_position")),
    _Shape("v t", ("velocity",), "t", "v * t", lambda m: m.velocity * m.time_s),
    _Shape("T", ("temperature",), "T", "T", lambda m: m.label("temperature")),
    # What has the direction of motion may change with the place or with the load.
    _Shape("sgn v x", ("velocity", _POSITION), "sgn v", "sign(v) * x",
           lambda m: m.direction * m.position),
    _Shape("sgn v |a|", ("velocity", "acceleration"), "sgn v", "sign(v) * abs(a)",
           lambda m: m.direction * np.abs(m.acceleration)),
)  # fmt: skip
# A command that comes late, by a delay in proportion to the time in motion, that in ramps, or the
# number of moves. To first order the place is off by the speed times the delay.
_LATE = (
    _Shape("late by motion", ("velocity",), "command", "v * time_in_motion",
           lambda m: m.velocity * m.seconds_of("velocity")),
    _Shape("late by ramps", ("velocity", "acceleration"), "command", "v * time_in_ramps",
           lambda m: m.velocity * m.seconds_of("acceleration")),
    _Shape("late by starts", ("velocity",), "command", "v * starts",
           lambda m: m.velocity * m.starts),
)  # fmt: skip
_TIME = _Shape("t", (), "t", "t", lambda m: m.time_s - m.time_s.mean())
# What is there when a run begins, and fades, as what warms up does.
_FADING = (
    _Shape("fading", (), "t", "exp(-t / tau)", lambda m: np.ones(len(m.series))),
    _Shape("fading sgn v", ("velocity",), "sgn v", "sign(v) * exp(-t / tau)",
           lambda m: m.direction),
)  # fmt: skip
# Times in which it fades that are tried: so many between the shortest and the longest.
_FADING_TRIED = 8


def _largest(series: Sequence[Series]) -> float:
    return max(float(np.ptp(s.values)) for s in series) or 1.0


def _proportional(sensor: str, series: Sequence[Series], shape: _Shape) -> Iterator[Candidate]:
    """A term in proportion to a function of the motion; none where that is constant."""
    if any(s.time_s is None for s in series) and "t" in shape.name:
        return
    reach = max(float(np.ptp(shape.of(_Motion(s)))) for s in series)
    if not reach:
        return
    size = _largest(series) / reach

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        motion = _motion(own, predicted)
        if shape.by_play and motion.predicted is not None:
            half = values["c"]
            return np.asarray(np.sign(half) * (predicted - follow(predicted, abs(half))))
        return values["c"] * shape.of(motion)

    law = Law(
        "measurement", shape.variable, series[0].unit,
        lambda values: f"{values['c']:.4g} * {shape.text}", of_data,
    )  # fmt: skip
    c = Parameter("c", f"{series[0].unit} per unit of {shape.name}", -_LARGEST * size,
                  _LARGEST * size, (_PROBED * size,))  # fmt: skip
    yield Candidate(f"{shape.name} in {sensor}", (c,), law=law)


def _lag(sensor: str, series: Sequence[Series]) -> Iterator[Candidate]:
    """A lag of the first order of what is predicted: a late reading, or one in advance.

    None where the speed of a place tells the same, where the prediction is made from the readings,
    or where the times do not ascend.
    """
    told = _labelled(series, "velocity") and all(s.of_place for s in series)
    ascending = all(len(s) > 1 and bool((np.diff(_values(s, "")) > 0).all()) for s in series)
    if told or not ascending or any(s.fed_back for s in series):
        return
    longest = max(float(np.ptp(_values(s, ""))) for s in series)

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        from mopro.lag import lag  # loads numba

        if own.sensor != sensor:
            return np.zeros(len(own))
        behind = lag(_values(own, ""), predicted, abs(values["c"])) - predicted
        return np.asarray(math.copysign(1.0, values["c"]) * behind)

    def formula(values: Values) -> str:
        sign = "" if values["c"] > 0 else "-"
        return f"{sign}(lag(y, {abs(values['c']):.4g}) - y)"

    law = Law("measurement", "t", series[0].unit, formula, of_data)
    c = Parameter("c", "s", -longest, longest, (_PROBED * longest,))
    yield Candidate(f"lag in {sensor}", (c,), law=law)


def _fading(sensor: str, rows: Mapping[int, Series], shape: _Shape) -> Iterator[Candidate]:
    """A term that fades in every run, within a third of it; none where no time passes."""
    series = list(rows.values())
    longest = max(float(np.ptp(_values(s, ""))) for s in series) / FEWEST
    shortest = FEWEST * min(_step(s) for s in series)
    if not shortest < longest:
        return

    def faded(own: Series, motion: _Motion, tau: float) -> Floats:
        time_s = _values(own, "")
        return np.asarray(shape.of(motion) * np.exp(-(time_s - time_s[0]) / tau))

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        return values["c"] * faded(own, _motion(own, predicted), values["tau"])

    def find(view: ResidualView) -> Iterator[Values]:
        best, start = 0.0, {}
        motions = {row: _motion(own, view.predictions[row]) for row, own in rows.items()}
        left = np.concatenate([view.residuals[row] for row in rows])
        for tau in np.geomspace(shortest, longest, _FADING_TRIED).tolist():
            shapes = [
                own.without_nuisances(faded(own, motions[row], tau)) / view.sigmas[row]
                for row, own in rows.items()
            ]
            joined = np.concatenate(shapes)
            square, product = float(joined @ joined), float(joined @ left)
            if square and product**2 / square > best:
                best, start = product**2 / square, {"c": product / square, "tau": tau}
        if start:
            yield start

    size = _LARGEST * _largest(series)
    law = Law(
        "measurement", shape.variable, series[0].unit,
        lambda values: f"{values['c']:.4g} * {shape.text}".replace("tau", f"{values['tau']:.4g}"),
        of_data,
    )  # fmt: skip
    c = Parameter("c", series[0].unit, -size, size)
    tau = Parameter("tau", "s", shortest, longest, role=Role.SHAPE)
    yield Candidate(f"{shape.name} in {sensor}", (c, tau), find_starts=find, law=law)


def _line_in_time(sensor: str, rows: Mapping[int, Series]) -> Candidate:
    """A line of one frequency in time, with a size and phase of its own in each run."""
    size = _LARGEST * _largest(list(rows.values()))
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
            angle = 2 * math.pi * frequency * _values(series, "")
            found = sinusoid(angle, view.residuals[row] * view.sigmas[row])
            values |= dict(zip(names[series.run], found, strict=True))
        yield values

    fastest = max(0.5 / _step(series) for series in rows.values())
    longest = max(float(np.ptp(_values(series, ""))) for series in rows.values())
    slowest = min(FEWEST / longest, fastest / 2) if longest else fastest / 2
    f = Parameter("f", "Hz", slowest, fastest, role=Role.SHAPE, difference=1e-7)
    unit = next(iter(rows.values())).unit
    sizes = [Parameter(n, unit, -size, size) for pair in names.values() for n in pair]
    law = Law(
        "measurement", "t", unit,
        lambda values: f"{math.hypot(values['s0'], values['c0']):.4g} * "
        f"sin(2 * pi * {values['f']:.5g} * t)", of_data,
    )  # fmt: skip
    return Candidate(f"line in time in {sensor}", (f, *sizes), find_starts=find, law=law)


def _step(series: Series) -> float:
    return float(np.median(np.diff(_values(series, "")))) if len(series) > 1 else 1.0


def _strongest(rows: Mapping[int, Series], view: ResidualView) -> float | None:
    """Frequency (Hz) of the strongest line of the periodograms, summed over the series."""
    length = fft.next_fast_len(2 * max(map(len, rows.values())))
    steps = {row: _step(series) for row, series in rows.items()}
    step = min(steps.values())
    power = np.zeros(length // 2)
    for row in rows:
        if math.isclose(steps[row], step, rel_tol=1e-3):
            power += np.abs(fft.rfft(view.residuals[row], length)[1 : length // 2 + 1]) ** 2
    longest = max(float(np.ptp(_values(series, ""))) for series in rows.values())
    frequencies = np.arange(1, len(power) + 1) / (length * step)
    power[frequencies * longest < FEWEST] = 0.0
    return float(frequencies[int(np.argmax(power))]) if power.any() else None


def _line_in_position(sensor: str, rows: Mapping[int, Series]) -> Candidate:
    """A line of one period in position, the same in all runs."""
    series = list(rows.values())
    size = _LARGEST * _largest(series)
    reach = max(float(np.ptp(_values(s, _POSITION))) for s in series) or 1.0

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        angle = 2 * math.pi * _motion(own, predicted).position / values["p"]
        return np.asarray(values["s"] * np.sin(angle) + values["c"] * np.cos(angle))

    def find(view: ResidualView) -> Iterator[Values]:
        places = [_motion(s, view.predictions[row]).position for row, s in rows.items()]
        if not max(float(np.ptp(x)) for x in places):
            return
        cycles, power = position_spectrum(places, [view.residuals[row] for row in rows])
        power = np.where(cycles * reach < FEWEST, 0.0, power)
        if not power.any():
            return
        period = 1 / float(cycles[int(np.argmax(power))])
        angle = 2 * math.pi * np.concatenate(places) / period
        left = np.concatenate([view.residuals[row] * view.sigmas[row] for row in rows])
        sine, cosine = sinusoid(angle, left)
        yield {"p": period, "s": sine, "c": cosine}

    unit = series[0].unit
    p = Parameter("p", series[0].position_unit, reach / 5000, reach, role=Role.SHAPE,
                  inverse=True, difference=1e-6)  # fmt: skip
    law = Law(
        "measurement", "x mod", unit,
        lambda values: f"{math.hypot(values['s'], values['c']):.4g} * "
        f"sin(2 * pi * x / {values['p']:.5g} + {math.atan2(values['c'], values['s']):.3g})",
        of_data,
    )  # fmt: skip
    sizes = (Parameter("s", unit, -size, size), Parameter("c", unit, -size, size))
    return Candidate(f"line in position in {sensor}", (p, *sizes), find_starts=find, law=law)


def _bump(sensor: str, rows: Mapping[int, Series]) -> Candidate:
    """A local bump in position, of the shape of Gauss' curve."""
    series = list(rows.values())
    size = _LARGEST * _largest(series)
    places = np.concatenate([_values(s, _POSITION) for s in series])
    low, reach = float(places.min()), float(np.ptp(places)) or 1.0
    middles = low + reach * (np.arange(_BINS) + 0.5) / _BINS
    binned = np.minimum((places - low) / reach * _BINS, _BINS - 1).astype(np.intp)

    def shape(x: Floats, at: float, width: float) -> Floats:
        return np.asarray(np.exp(-0.5 * ((x - at) / width) ** 2))

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        return values["h"] * shape(_motion(own, predicted).position, values["at"], values["w"])

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
                height = float(form @ sums) / norm if norm else 0.0
                if height**2 * norm > best[0]:
                    best = height**2 * norm, {"h": height, "at": float(at), "w": width}
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
