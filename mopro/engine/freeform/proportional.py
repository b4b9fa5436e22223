"""Terms in proportion to a function of the motion, throughout or fading, and a lag."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.engine.assumed import FEWEST, LEAST_SHARE
from mopro.engine.candidate import Candidate, Law, Parameter, ResidualView, Role
from mopro.engine.freeform.series_motion import (
    LARGEST,
    POSITION,
    Motion,
    Values,
    labelled,
    motion_of,
    span_of,
    step_of,
    values_of,
)
from mopro.engine.lag import lag
from mopro.engine.play import follow
from mopro.engine.series import Floats, Series

# Size at which a term is probed, as a multiple of the largest value measured.
_PROBED = LEAST_SHARE**2
# Times of fading that are tried, between the shortest and the longest. Halved, a start may be twice
# too slow; doubled, no fit begins nearer to its minimum.
_FADING_TRIED = 8


@dataclass(frozen=True)
class Shape:
    """A function of the motion: its `name`, the labels that it needs, its variable and text.

    `by_play`: where the place is predicted, the term shifts it as a play does. `alone`: as in
    Law.
    """

    name: str
    labels: tuple[str, ...]
    variable: str
    text: str
    of: Callable[[Motion], Floats]
    by_play: bool = False
    alone: bool = True


SHAPES = (
    Shape("v", ("velocity",), "v", "v", lambda m: m.velocity),
    Shape("v|v|", ("velocity",), "v", "v * abs(v)", lambda m: m.velocity * np.abs(m.velocity)),
    Shape("sgn v", ("velocity",), "sgn v", "sign(v)", lambda m: m.direction, by_play=True),
    Shape("a", ("acceleration",), "a", "a", lambda m: m.acceleration),
    Shape("x", (POSITION,), "x", "x", lambda m: m.position),
    Shape("x²", (POSITION,), "x", "x**2", lambda m: m.position**2),
    Shape("x³", (POSITION,), "x", "x**3", lambda m: m.position**3),
    Shape("other x", ("other_position",), "x", "y", lambda m: m.label("other_position"),
          alone=False),
    Shape("v t", ("velocity",), "t", "v * t", lambda m: m.velocity * m.time_s),
    # A scale and a bend that grow with time, as a frame that warms has.
    Shape("x t", (POSITION,), "x", "x * t", lambda m: m.position * m.time_s, alone=False),
    Shape("x² t", (POSITION,), "x", "x**2 * t", lambda m: m.position**2 * m.time_s, alone=False),
    Shape("T", ("temperature",), "T", "T", lambda m: m.label("temperature")),
    # What has the direction of motion may change with the place or with the load.
    Shape("sgn v x", ("velocity", POSITION), "sgn v", "sign(v) * x",
           lambda m: m.direction * m.position, alone=False),
    Shape("sgn v |a|", ("velocity", "acceleration"), "sgn v", "sign(v) * abs(a)",
           lambda m: m.direction * np.abs(m.acceleration), alone=False),
)  # fmt: skip
# A command that comes late, by a delay in proportion to the time in motion, that in ramps, or the
# number of moves. To first order the place is off by the speed times the delay.
LATE = (
    Shape("late by motion", ("velocity",), "command", "v * time_in_motion",
           lambda m: m.velocity * m.seconds_of("velocity")),
    Shape("late by ramps", ("velocity", "acceleration"), "command", "v * time_in_ramps",
           lambda m: m.velocity * m.seconds_of("acceleration")),
    Shape("late by starts", ("velocity",), "command", "v * starts",
           lambda m: m.velocity * m.starts),
)  # fmt: skip
TIME = Shape("t", (), "t", "t", lambda m: m.time_s - m.time_s.mean())
# What is there when a run begins, and fades, as what warms up does.
FADING = (
    Shape("fading", (), "t", "exp(-t / tau)", lambda m: np.ones(len(m.series))),
    Shape("fading sgn v", ("velocity",), "sgn v", "sign(v) * exp(-t / tau)",
           lambda m: m.direction),
)  # fmt: skip


def bends_about_the_middle(series: Sequence[Series]) -> Iterator[Shape]:
    """Even and odd bends about the middle of the travel, as of a bowed rail, or a scale's error.

    None where the middle is about 0: there they are the powers of x.
    """
    places = np.concatenate([values_of(s, POSITION) for s in series])
    low, high = float(places.min()), float(places.max())
    middle = (low + high) / 2
    if abs(middle) < LEAST_SHARE * (high - low):
        return
    text = f"(x - {middle:.4g})"

    def even(m: Motion) -> Floats:
        return (m.position - middle) ** 2

    def odd(m: Motion) -> Floats:
        return (m.position - middle) ** 3

    yield Shape("x² about the middle", (POSITION,), "x", f"{text}**2", even)
    yield Shape("x³ about the middle", (POSITION,), "x", f"{text}**3", odd)


def proportional(sensor: str, series: Sequence[Series], shape: Shape) -> Iterator[Candidate]:
    """A term in proportion to a function of the motion; none where that is constant."""
    if any(s.time_s is None for s in series) and "t" in shape.name:
        return
    reach = max(float(np.ptp(shape.of(Motion(s)))) for s in series)
    if not reach:
        return
    size = span_of(series) / reach

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        motion = motion_of(own, predicted)
        if shape.by_play and motion.predicted is not None:
            half = values["c"]
            return np.asarray(np.sign(half) * (predicted - follow(predicted, abs(half))))
        return values["c"] * shape.of(motion)

    law = Law(
        "measurement", shape.variable, series[0].unit,
        lambda values: f"{values['c']:.4g} * {shape.text}", of_data, alone=shape.alone,
    )  # fmt: skip
    c = Parameter("c", f"{series[0].unit} per unit of {shape.name}", -LARGEST * size,
                  LARGEST * size, (_PROBED * size,))  # fmt: skip
    yield Candidate(f"{shape.name} in {sensor}", (c,), law=law)


def fading(sensor: str, rows: Mapping[int, Series], shape: Shape) -> Iterator[Candidate]:
    """A term that fades in every run, within a third of it; none where no time passes."""
    series = list(rows.values())
    longest = max(float(np.ptp(values_of(s, ""))) for s in series) / FEWEST
    shortest = FEWEST * min(step_of(s) for s in series)
    if not shortest < longest:
        return

    def faded(own: Series, motion: Motion, tau: float) -> Floats:
        time_s = values_of(own, "")
        return np.asarray(shape.of(motion) * np.exp(-(time_s - time_s[0]) / tau))

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        return values["c"] * faded(own, motion_of(own, predicted), values["tau"])

    def find(view: ResidualView) -> Iterator[Values]:
        best, start = 0.0, {}
        motions = {row: motion_of(own, view.predictions[row]) for row, own in rows.items()}
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

    size = LARGEST * span_of(series)
    law = Law(
        "measurement", shape.variable, series[0].unit,
        lambda values: f"{values['c']:.4g} * {shape.text}".replace("tau", f"{values['tau']:.4g}"),
        of_data,
    )  # fmt: skip
    c = Parameter("c", series[0].unit, -size, size)
    tau = Parameter("tau", "s", shortest, longest, role=Role.SHAPE)
    yield Candidate(f"{shape.name} in {sensor}", (c, tau), find_starts=find, law=law)


def lag_term(sensor: str, series: Sequence[Series]) -> Iterator[Candidate]:
    """A lag of the first order of what is predicted: a late reading, or one in advance.

    None where the speed of a place tells the same, where the prediction is made from the readings,
    or where the times do not ascend.
    """
    known = labelled(series, "velocity") and all(s.of_place for s in series)
    ascending = all(len(s) > 1 and bool((np.diff(values_of(s, "")) > 0).all()) for s in series)
    if known or not ascending or any(s.fed_back for s in series):
        return
    longest = max(float(np.ptp(values_of(s, ""))) for s in series)

    def of_data(own: Series, predicted: Floats, values: Values) -> Floats:
        if own.sensor != sensor:
            return np.zeros(len(own))
        behind = lag(values_of(own, ""), predicted, abs(values["c"])) - predicted
        return np.asarray(math.copysign(1.0, values["c"]) * behind)

    def formula(values: Values) -> str:
        sign = "" if values["c"] > 0 else "-"
        return f"{sign}(lag(y, {abs(values['c']):.4g}) - y)"

    law = Law("measurement", "t", series[0].unit, formula, of_data, alone=False)
    c = Parameter("c", "s", -longest, longest, (_PROBED * longest,))
    yield Candidate(f"lag in {sensor}", (c,), law=law)
