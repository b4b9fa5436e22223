"""The experiment that would tell rivals apart.

Pieces of motion are each tried on the model under every rival. For a position sensor
those that part the rivals best, for the time that they take, are put together into one
program; for a thermometer the best one is repeated for ever.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby

import numpy as np

from mopro.diagnosis import Named, Settings, Verdict
from mopro.effects import catalogue
from mopro.effects.resolve import with_values
from mopro.experiment.design.test_motions import (
    Bounds,
    Piece,
    moving_pieces,
    text_of,
    warming_pieces,
)
from mopro.experiment.model import Experiment, Floats, Reading, Trial
from mopro.experiment.predict.forward_model import ForwardModel
from mopro.instruments.quantity import QUANTITIES
from mopro.instruments.sensor import Sensor
from mopro.machine.constants import PlantConstants
from mopro.motion import plan
from mopro.program.compile import compile as compile_text

# A rival counts as parted here: ten in chi-squared (the margin) are then all but certain, be
# the effect a fifth smaller than it seems.
_PARTED = 8.0
# What no program of bearable length parts by this much is not worth its time.
_TOLD_APART = 2.0
_LONGEST_S = 90.0
_WARMING_S = 3600.0
_MOST_RIVALS = 8
_AFTER_S = 0.3
# So many standard deviations to either side are a 95 % interval.
_WITHIN_95 = 1.96


@dataclass(frozen=True)
class Proposal:
    """A program to run, with what payload, and by how many σ it parts two effects of a family.

    `separations` are those of each rival from what was named, `pairs` those of every two: any
    of a family may be what is true.
    """

    text: str
    summary: str
    payload_kg: float
    separations: dict[str, float]
    pairs: dict[tuple[str, str], float]


@dataclass(frozen=True)
class _Contest:
    """Two effects of a family, each with its settings; `known` is the relative error of size.

    `found` are the settings of the verdict, and each of `beside` has one number of what was
    found beside the family off by its standard deviation.
    """

    names: tuple[str, str]
    settings: Settings
    other: Settings
    known: float
    found: Settings
    beside: tuple[Settings, ...]


def propose(experiment: Experiment, verdict: Verdict) -> Proposal | None:
    """The program that separates the named effects best from their rivals.

    None where no motion would be seen to tell any of them apart.
    """
    contests = [c for effect in verdict.effects for c in _contests(verdict, effect)]
    named = frozenset(effect.name for effect in verdict.effects)
    sensors = [r.sensor for t in experiment.trials for r in t.readings]
    for quantity in QUANTITIES.values():
        sensor = next((s for s in sensors if s.quantity == quantity), None)
        if sensor is not None and contests:
            proposal = _Planner(experiment, sensor, contests, named).proposal()
            if proposal is not None:
                return proposal
    return None


def _contests(verdict: Verdict, effect: Named) -> list[_Contest]:
    """The effect against each of its rivals, and those against each other: any may be true."""
    known = 1 / max(effect.sigmas, 1.0)
    rivals = list(effect.alternatives.items())[:_MOST_RIVALS]
    family = [(effect.name, verdict.settings), *rivals]
    beside = tuple(_moved(verdict, effect))
    return [
        _Contest((name, rival), settings, others, known, verdict.settings, beside)
        for (name, settings), (rival, others) in combinations(family, 2)
    ]


def _moved(verdict: Verdict, effect: Named) -> Iterator[Settings]:
    """What was found, with one number of another effect than `effect` off by what it may be."""
    found = verdict.settings
    for other in (*verdict.effects, *verdict.calibration):
        for name, estimate in other.parameters.items():
            low, high = estimate.ci95
            off = (high - low) / (2 * _WITHIN_95)
            if other.name != effect.name and math.isfinite(off):
                moved = {**found[other.name], name: found[other.name][name] + off}
                yield {**found, other.name: moved}


class _Planner:
    """Puts a program together for one sensor."""

    def __init__(
        self,
        experiment: Experiment,
        sensor: Sensor,
        contests: Sequence[_Contest],
        named: frozenset[str],
    ) -> None:
        self._experiment = experiment
        self._sensor = sensor
        self._contests = contests
        self._named = named
        self._payload_kg = min(trial.payload_kg for trial in experiment.trials)

    def proposal(self) -> Proposal | None:
        """The best program, or None if it would tell no rival from what was named."""
        bounds = self._bounds()
        if self._sensor.quantity.slow:
            chosen = self._best_warming(warming_pieces(bounds))
        else:
            chosen = self._put_together(moving_pieces(bounds))
        if not chosen:
            return None
        parted = self._parted(self._imagined(chosen)).tolist()
        pairs = dict(zip((c.names for c in self._contests), parted, strict=True))
        separations = {other: apart for (one, other), apart in pairs.items() if one in self._named}
        if max(separations.values()) <= _TOLD_APART:
            return None
        summary = self._summary(separations, pairs)
        head = f"; {summary}\n; {self._way(chosen)}\n"
        text = head + self._text(chosen)
        return Proposal(text, summary, self._payload_kg, separations, pairs)

    def _bounds(self) -> Bounds:
        """What the motor may be asked for under the least favourable of the rivals."""
        every = [side for c in self._contests for side in (c.settings, c.other)]
        machine = self._experiment.machine
        nominal = PlantConstants.of(machine, self._payload_kg)
        plants = [_plant(nominal, side) for side in every]
        weakest_N = min(plant.pull_out_force_N for plant in (nominal, *plants))
        mass_kg = max(plant.mass_kg for plant in plants)
        return Bounds.of(machine, mass_kg, weakest_N / nominal.pull_out_force_N)

    # -- which pieces ------------------------------------------------------------

    def _put_together(self, pieces: Sequence[Piece]) -> list[Piece]:
        """The pieces that part the most for their time, equal ones side by side.

        A piece that is repeated tells more each time.
        """
        pieces = [piece for piece in pieces if self._holds(self._imagined([piece]))]
        if not pieces:
            return []
        trials = [self._imagined([piece]) for piece in pieces]
        lengths = np.array([trial.duration_s for trial in trials])
        squares = np.array([self._parted(trial) for trial in trials]) ** 2
        within_reach = (squares * (_LONGEST_S / lengths)[:, None]).max(axis=0)
        wanted = within_reach > _TOLD_APART**2
        squares = squares[:, wanted]
        chosen: list[int] = []
        so_far = np.zeros(squares.shape[1])
        while so_far.min(initial=math.inf) < _PARTED**2:
            worth = _worth(so_far + squares) - _worth(so_far)
            worth[lengths + lengths[chosen].sum() > _LONGEST_S] = 0.0
            best = int(np.argmax(worth / lengths))
            if not worth[best]:
                break
            chosen.append(best)
            so_far = so_far + squares[best]
        return [pieces[i] for i in sorted(chosen)]

    def _best_warming(self, pieces: Iterable[Piece]) -> list[Piece]:
        """The one that parts the most without growing too hot under any rival."""
        limit_C = self._experiment.machine.heat.rated_C
        told: list[tuple[float, Piece]] = []
        for piece in pieces:
            predictions = self._predictions(self._imagined([piece]))
            parted = predictions.parted()
            if predictions.most() < limit_C and parted.max() > _TOLD_APART:
                told.append((float(_worth(parted**2)), piece))
        return [max(told, key=lambda pair: pair[0])[1]] if told else []

    # -- what a program would show --------------------------------------------------

    def _parted(self, trial: Trial) -> Floats:
        return self._predictions(trial).parted()

    def _predictions(self, trial: Trial) -> _Predictions:
        return _Predictions(self._motor(trial), self._sensor.sigma, self._contests)

    def _holds(self, trial: Trial) -> bool:
        """Whether the axis keeps its tooth under every rival."""
        sides = {str(side): side for c in self._contests for side in (c.settings, c.other)}
        return all(map(self._motor(trial).keeps_up, sides.values()))

    def _motor(self, trial: Trial) -> ForwardModel:
        return ForwardModel(replace(self._experiment, trials=(trial,), tables=()))

    def _imagined(self, pieces: Sequence[Piece]) -> Trial:
        """The run that the pieces would be, its data still to come."""
        program = compile_text(self._text(pieces), "next.CMD")
        if program.loops_forever:
            times = self._read_so_far(_WARMING_S)
        else:
            end_s = plan(program).duration_s + _AFTER_S
            times = np.arange(math.floor(end_s * self._sensor.rate_hz)) / self._sensor.rate_hz
        reading = Reading(self._sensor, times, np.zeros(len(times)))
        return Trial("next.csv", program, None, self._payload_kg, (reading,))

    def _read_so_far(self, end_s: float) -> Floats:
        """When the sensor was read in its longest run, and then at the same pace, until `end_s`.

        A logger that takes its time once things are slow will take it again.
        """
        readings = (r for trial in self._experiment.trials for r in trial.readings)
        times = max(
            (r.time_s for r in readings if r.sensor == self._sensor), key=lambda t: float(t[-1])
        )
        pace_s = float(times[-1] - times[-2]) if len(times) > 1 else 1 / self._sensor.rate_hz
        later = np.arange(times[-1] + pace_s, end_s, pace_s)
        whole: Floats = np.concatenate([times, later])
        return whole[whole < end_s]

    # -- its text ------------------------------------------------------------------

    def _text(self, pieces: Sequence[Piece]) -> str:
        return text_of(self._experiment.machine, self._sensor.axis, _joined(pieces))

    def _summary(self, separations: dict[str, float], pairs: dict[tuple[str, str], float]) -> str:
        told = [f"{n} by {s:.3g} σ" for n, s in separations.items() if s > _TOLD_APART]
        alike = [name for name, s in separations.items() if s <= _TOLD_APART]
        twins = [
            f"{one} from {other}"
            for (one, other), s in pairs.items()
            if s <= _TOLD_APART and not {one, other} & {*self._named, *alike}
        ]
        summary = f"with {self._payload_kg:g} kg it should separate {', '.join(told)}"
        left = ", ".join([*alike, *twins])
        return summary + (f"; it does not tell {left}" if left else "")

    def _way(self, chosen: Sequence[Piece]) -> str:
        longest = max(piece.distance for piece in chosen)
        way = f"Goes forth and back by up to {longest:.3g} in from where it starts"
        return f"{way}, for {_WARMING_S / 60:g} min." if chosen[0].endless else f"{way}."


def _plant(plant: PlantConstants, settings: Settings) -> PlantConstants:
    """The constants of the equation of motion with the effects of `settings`."""
    for a in (with_values(catalogue()[name], values) for name, values in settings.items()):
        plant = a.effect.plant(plant, *a.values)
    return plant


class _Predictions:
    """What a run would show under each side of each contest."""

    def __init__(self, motor: ForwardModel, sigma: float, contests: Sequence[_Contest]) -> None:
        self._motor = motor
        self._sigma = sigma
        self._contests = contests
        self._seen: dict[str, Floats] = {}

    def under(self, settings: Settings) -> Floats:
        """In the sensor's unit."""
        key = repr(sorted((n, sorted(v.items())) for n, v in settings.items()))
        if key not in self._seen:
            (self._seen[key],) = self._motor(settings)
        return self._seen[key]

    def most(self) -> float:
        """The largest reading to expect."""
        sides = [side for c in self._contests for side in (c.settings, c.other)]
        return max(float(self.under(side).max()) for side in sides)

    def parted(self) -> Floats:
        """By how many σ the two sides of each contest differ.

        The size of an effect, and what was found beside it, are as well known as the data so
        far tell them; a constant offset tells nothing.
        """
        return np.array([self._apart(contest) for contest in self._contests])

    def _apart(self, contest: _Contest) -> float:
        found, other = self._change(contest.found), self._change(contest.other)
        beside = (self._change(moved) - found for moved in contest.beside)
        free = np.stack([contest.known * other, *beside], axis=1)
        return _distance(self._change(contest.settings) - other, free)

    def _change(self, settings: Settings) -> Floats:
        change = (self.under(settings) - self.under({})) / self._sigma
        without_offset: Floats = change - change.mean()
        return without_offset


def _joined(pieces: Sequence[Piece]) -> Iterator[Piece]:
    """Equal neighbours as one that is done so many more times."""
    for piece, same in groupby(pieces):
        yield replace(piece, times=piece.times * len(list(same)))


def _worth(squares: Floats) -> Floats:
    """How well everything is parted (contests along the last axis): the first σ count most."""
    worth: Floats = np.sum(np.minimum(squares, _PARTED**2), axis=-1)
    return worth


def _distance(apart: Floats, free: Floats) -> float:
    """The least √(|apart - free z|² + |z|²): the z are known to be 0 within 1 each."""
    shown = free.T @ apart
    told = np.linalg.solve(free.T @ free + np.eye(free.shape[1]), shown)
    return math.sqrt(max(float(apart @ apart - shown @ told), 0.0))
