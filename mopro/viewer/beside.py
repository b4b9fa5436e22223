"""Surroundings of an experiment's plots: programs, marks of disagreements, the platen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mopro.experiment.comparison import Place
from mopro.experiment.sawyer.model import Experiment, Trial
from mopro.experiment.sawyer.nominal import planned
from mopro.experiment.sawyer.system import Sawyer
from mopro.experiment.system import System
from mopro.experiment.wording import place_words
from mopro.viewer.model import Mark
from mopro.viewer.platen import platen_json
from mopro.viewer.series import Beside, track_name


def beside_of(system: System, places: Sequence[Place]) -> dict[str, Beside]:
    """By run; a stated machine has neither programs nor a platen."""
    if not isinstance(system, Sawyer):
        return {}
    experiment = system.experiment
    return {trial.name: _beside(experiment, trial, places) for trial in experiment.trials}


def _beside(experiment: Experiment, trial: Trial, places: Sequence[Place]) -> Beside:
    machine = experiment.machine
    seen = {
        reading.sensor.axis: (track_name(reading.sensor.name), "measured")
        for reading in trial.readings
        if reading.sensor.quantity.sees_place
    }
    return Beside(
        trial.program.source.lines if trial.program else (),
        list(_marks(trial, places)),
        platen_json(machine, planned(trial, machine), seen) if seen else None,
    )


def _marks(trial: Trial, places: Sequence[Place]) -> Iterator[Mark]:
    for place in places:
        if place.run == trial.name and place.significant and place.line > 0:
            size = "" if place.sigma is None else f", {place.sigma:.3g} σ"
            words = f"{place.sensor}: {place_words(place)}: {place.rms:.3g} {place.unit} RMS{size}"
            yield Mark("gap", words, place.line)
