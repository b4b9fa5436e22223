"""Design of the experiment that distinguishes the alternatives of a verdict.

Each test motion is simulated under every alternative. For a position sensor the motions
that separate the alternatives best per second are joined into one program; for a
thermometer the best motion is repeated without end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from mopro.effects import catalogue_of
from mopro.effects.registry import Catalogue
from mopro.effects.resolve import with_values
from mopro.engine.series import Settings
from mopro.engine.verdict import Named, Verdict
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.test_motions import (
    Bounds,
    Excitation,
    heating_excitations,
    moving_excitations,
    text_of,
)
from mopro.experiment.sawyer.trials import Experiment, Floats, Reading, Trial
from mopro.experiment.separation import (
    AMPLE_SIGMAS,
    LEAST_SIGMAS,
    distance,
    family_pairs,
    from_named,
    score,
    separation_words,
    size_error,
)
from mopro.experiment.system import Proposal
from mopro.instruments.quantity import QUANTITIES
from mopro.instruments.sensor import Sensor
from mopro.machine.constants import PlantConstants
from mopro.motion import plan
from mopro.program.compile import compile as compile_text

# A pair that no program within this separates by more than the least is given up.
_LONGEST_S = 90.0
_HEATING_S = 3600.0
# Recorded after the last move, until the axis has settled.
_AFTER_S = 0.3
# Half width of a 95 % interval in standard deviations.
_NORMAL_95 = 1.96


@dataclass(frozen=True)
class _Pair:
    """Two effects of a family, with the settings of the whole model under `one` and `other`.

    `size_error` is the relative standard error of the effect's size. `fit` are the settings of
    the verdict; each of `shifted` is `fit` with one parameter outside the family moved by its
    standard error.
    """

    names: tuple[str, str]
    one: Settings
    other: Settings
    size_error: float
    fit: Settings
    shifted: tuple[Settings, ...]


def propose(experiment: Experiment, verdict: Verdict) -> Proposal | None:
    """Design the program that best separates the named effects from their alternatives.

    None if no motion separates any of them by more than LEAST_SIGMAS.
    """
    pairs = [pair for effect in verdict.effects for pair in _pairs(verdict, effect)]
    named = frozenset(effect.name for effect in verdict.effects)
    sensors = [r.sensor for t in experiment.trials for r in t.readings]
    for quantity in QUANTITIES.values():
        sensor = next((s for s in sensors if s.quantity == quantity), None)
        if sensor is not None and pairs:
            proposal = _ProgramDesigner(experiment, sensor, pairs, named).proposal()
            if proposal is not None:
                return proposal
    return None


def _pairs(verdict: Verdict, effect: Named) -> list[_Pair]:
    """All pairs of `effect` and its alternatives."""
    error, shifted = size_error(effect), tuple(_shifted(verdict, effect))
    return [
        _Pair((name, other), settings, others, error, verdict.settings, shifted)
        for (name, settings), (other, others) in family_pairs(verdict, effect)
    ]


def _shifted(verdict: Verdict, effect: Named) -> Iterator[Settings]:
    """The fit with each parameter of the effects other than `effect` moved by its standard error.

    Yields one set of settings for each parameter with a bounded interval.
    """
    fit = verdict.settings
    for other in (*verdict.effects, *verdict.calibration):
        for name, estimate in other.parameters.items():
            low, high = estimate.ci95
            error = (high - low) / (2 * _NORMAL_95)
            if other.name != effect.name and math.isfinite(error):
                moved = {**fit[other.name], name: fit[other.name][name] + error}
                yield {**fit, other.name: moved}


class _ProgramDesigner:
    """Composes a program for one sensor."""

    def __init__(
        self,
        experiment: Experiment,
        sensor: Sensor,
        pairs: Sequence[_Pair],
        named: frozenset[str],
    ) -> None:
        self._experiment = experiment
        self._sensor = sensor
        self._pairs = pairs
        self._named = named
        self._payload_kg = min(trial.payload_kg for trial in experiment.trials)

    def proposal(self) -> Proposal | None:
        """The best program, or None if it separates no alternative from the named effect."""
        bounds = self._bounds()
        if self._sensor.quantity.slow:
            chosen = self._best_heating(heating_excitations(bounds))
        else:
            chosen = self._combined(moving_excitations(bounds))
        if not chosen:
            return None
        sigmas = self._separations(self._imagined(chosen)).tolist()
        pairs = dict(zip((pair.names for pair in self._pairs), sigmas, strict=True))
        separations = from_named(pairs, self._named)
        if max(separations.values()) <= LEAST_SIGMAS:
            return None
        summary = f"with {self._payload_kg:g} kg {separation_words(pairs, self._named)}"
        head = f"; {summary}\n; {self._travel_line(chosen)}\n"
        text = head + self._text(chosen)
        return Proposal(text, summary, self._payload_kg, separations, pairs)

    def _bounds(self) -> Bounds:
        """Limits of the motion under the least favourable alternative."""
        every = [side for pair in self._pairs for side in (pair.one, pair.other)]
        machine = self._experiment.machine
        nominal = PlantConstants.of(machine, self._payload_kg)
        effects = catalogue_of(machine)
        plants = [_plant(nominal, side, effects) for side in every]
        weakest_N = min(plant.pull_out_force_N for plant in (nominal, *plants))
        mass_kg = max(plant.mass_kg for plant in plants)
        return Bounds.of(machine, mass_kg, weakest_N / nominal.pull_out_force_N)

    # -- choice of the test motions ------------------------------------------------

    def _combined(self, motions: Sequence[Excitation]) -> list[Excitation]:
        """The motions that separate the most per second, equal ones side by side.

        A motion may be chosen repeatedly: its squared separations add up.
        """
        motions = [motion for motion in motions if self._holds(self._imagined([motion]))]
        if not motions:
            return []
        trials = [self._imagined([motion]) for motion in motions]
        lengths = np.array([trial.duration_s for trial in trials])
        squares = np.array([self._separations(trial) for trial in trials]) ** 2
        within_reach = (squares * (_LONGEST_S / lengths)[:, None]).max(axis=0)
        wanted = within_reach > LEAST_SIGMAS**2
        squares = squares[:, wanted]
        chosen: list[int] = []
        so_far = np.zeros(squares.shape[1])
        while so_far.min(initial=math.inf) < AMPLE_SIGMAS**2:
            gain = score(so_far + squares) - score(so_far)
            gain[lengths + lengths[chosen].sum() > _LONGEST_S] = 0.0
            best = int(np.argmax(gain / lengths))
            if not gain[best]:
                break
            chosen.append(best)
            so_far = so_far + squares[best]
        return [motions[i] for i in sorted(chosen)]

    def _best_heating(self, motions: Iterable[Excitation]) -> list[Excitation]:
        """The motion that separates the most and stays below the rated temperature."""
        limit_C = self._experiment.machine.heat.rated_C
        scored: list[tuple[float, Excitation]] = []
        for motion in motions:
            predictions = self._predictions(self._imagined([motion]))
            separations = predictions.separations()
            if predictions.most() < limit_C and separations.max() > LEAST_SIGMAS:
                scored.append((float(score(separations**2)), motion))
        return [max(scored, key=lambda each: each[0])[1]] if scored else []

    # -- simulation of a program ----------------------------------------------------

    def _separations(self, trial: Trial) -> Floats:
        return self._predictions(trial).separations()

    def _predictions(self, trial: Trial) -> _Predictions:
        return _Predictions(self._model(trial), self._sensor.sigma, self._pairs)

    def _holds(self, trial: Trial) -> bool:
        """True if no axis stalls under any alternative."""
        sides = {str(side): side for pair in self._pairs for side in (pair.one, pair.other)}
        return all(map(self._model(trial).keeps_up, sides.values()))

    def _model(self, trial: Trial) -> ForwardModel:
        return ForwardModel(replace(self._experiment, trials=(trial,), tables=()))

    def _imagined(self, motions: Sequence[Excitation]) -> Trial:
        """The run of the motions as a Trial, with zeros in place of its data."""
        program = compile_text(self._text(motions), "next.CMD")
        if program.loops_forever:
            times = self._read_so_far(_HEATING_S)
        else:
            end_s = plan(program).duration_s + _AFTER_S
            times = np.arange(math.floor(end_s * self._sensor.rate_hz)) / self._sensor.rate_hz
        reading = Reading(self._sensor, times, np.zeros(len(times)))
        return Trial("next.csv", program, None, self._payload_kg, (reading,))

    def _read_so_far(self, end_s: float) -> Floats:
        """Sample times (s) of the sensor's longest run, continued at its last interval to `end_s`.

        A logger that slows down in one run is expected to do the same in the next.
        """
        readings = (r for trial in self._experiment.trials for r in trial.readings)
        times = max(
            (r.time_s for r in readings if r.sensor == self._sensor), key=lambda t: float(t[-1])
        )
        pace_s = float(times[-1] - times[-2]) if len(times) > 1 else 1 / self._sensor.rate_hz
        later = np.arange(times[-1] + pace_s, end_s, pace_s)
        whole: Floats = np.concatenate([times, later])
        return whole[whole < end_s]

    # -- text ----------------------------------------------------------------------

    def _text(self, motions: Sequence[Excitation]) -> str:
        return text_of(self._experiment.machine, self._sensor.axis, _joined(motions))

    def _travel_line(self, chosen: Sequence[Excitation]) -> str:
        longest = max(motion.distance for motion in chosen)
        travel = f"Moves forth and back by up to {longest:.3g} in from its starting position"
        return f"{travel}, for {_HEATING_S / 60:g} min." if chosen[0].endless else f"{travel}."


def _plant(plant: PlantConstants, settings: Settings, effects: Catalogue) -> PlantConstants:
    """Constants of the equation of motion with the effects of `settings`."""
    for a in (with_values(effects[name], values) for name, values in settings.items()):
        plant = a.effect.plant(plant, *a.values)
    return plant


class _Predictions:
    """Predicted readings of a run under both effects of each pair; `sigma` in the sensor's unit."""

    def __init__(self, model: ForwardModel, sigma: float, pairs: Sequence[_Pair]) -> None:
        self._model = model
        self._sigma = sigma
        self._pairs = pairs
        self._seen: dict[str, Floats] = {}

    def under(self, settings: Settings) -> Floats:
        """The readings with `settings`, in the sensor's unit."""
        key = repr(sorted((n, sorted(v.items())) for n, v in settings.items()))
        if key not in self._seen:
            (self._seen[key],) = self._model(settings)
        return self._seen[key]

    def most(self) -> float:
        """Largest predicted reading over all alternatives."""
        sides = [side for pair in self._pairs for side in (pair.one, pair.other)]
        return max(float(self.under(side).max()) for side in sides)

    def separations(self) -> Floats:
        """Difference of the two effects of each pair, in σ.

        A constant offset, the size of the effect and the other fitted parameters, within their
        standard errors, are free to reduce it.
        """
        return np.array([self._separation(pair) for pair in self._pairs])

    def _separation(self, pair: _Pair) -> float:
        fit, other = self._change(pair.fit), self._change(pair.other)
        shifts = (self._change(shifted) - fit for shifted in pair.shifted)
        free = np.stack([pair.size_error * other, *shifts], axis=1)
        return distance(self._change(pair.one) - other, free)

    def _change(self, settings: Settings) -> Floats:
        change = (self.under(settings) - self.under({})) / self._sigma
        without_offset: Floats = change - change.mean()
        return without_offset


def _joined(motions: Sequence[Excitation]) -> Iterator[Excitation]:
    """Merge equal neighbours into one motion with the sum of their repetitions."""
    for motion, same in groupby(motions):
        yield replace(motion, times=motion.times * len(list(same)))
