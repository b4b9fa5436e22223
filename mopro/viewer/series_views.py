"""Measured series as views: measured against simulated, and the residuals on one axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle
from typing import Any

import numpy as np

from mopro.engine.series import Series
from mopro.experiment.breaks import drawn
from mopro.experiment.comparison import Place
from mopro.experiment.sawyer.nominal import planned
from mopro.experiment.sawyer.system import Sawyer
from mopro.experiment.sawyer.trials import Experiment, Trial
from mopro.experiment.system import System
from mopro.experiment.wording import place_words
from mopro.recording.envelope import Floats
from mopro.text import visible
from mopro.units import residual_unit
from mopro.viewer.run import platen_json
from mopro.viewer.view import Lines, Mark, Panel, Scale, Trace, Track, View

# Values in all tracks of a page together, and in one of them, at most.
_MOST_VALUES = 2_400_000
_MOST_BUCKETS = 65_536
_FEWEST_BUCKETS = 256
_OF_INCHES = ("in", "mil", "in/s", "lbf")
_NOTE = "measured − simulated, without the fitted offset"
# Colours of the palette.
_MEASURED, _BEFORE, _AFTER = 0, 2, 4
_SIGNATURES = (0, 3, 5, 1)


@dataclass(frozen=True)
class Residuals:
    """Residuals of one series, in its unit: with each model, and signatures of effects.

    `by_model`: the name of the model (`before`, `after`) and its residual.
    """

    series: Series
    by_model: Mapping[str, Floats]
    signatures: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class Beside:
    """Surroundings of the plots of one run: its program's lines, marks and the platen."""

    program: Sequence[str] = ()
    marks: Sequence[Mark] = ()
    platen: dict[str, Any] | None = None


def series_views(found: Sequence[Residuals], beside: Mapping[str, Beside]) -> list[View]:
    """A view for each run, in the order of the first series of each."""
    channels = sum(2 * len(r.by_model) + len(r.signatures) + 2 for r in found)
    most = max(_FEWEST_BUCKETS, min(_MOST_BUCKETS, _MOST_VALUES // max(2 * channels, 1)))
    by_run: dict[tuple[str, bool], list[Residuals]] = {}
    for own in found:
        by_run.setdefault((own.series.run, own.series.time_s is None), []).append(own)
    return [
        _view(run, own, rows, most, beside.get(run, Beside()))
        for (run, rows), own in by_run.items()
    ]


def own_units(found: Sequence[Residuals]) -> dict[str, str]:
    """What the page's scripts are told: the system of units that the data are in."""
    inches = any(own.series.unit in _OF_INCHES for own in found)
    return {"units": "inch" if inches else "SI"}


def track_name(sensor: str) -> str:
    """The name of the track of a sensor's readings."""
    return visible(sensor)


def source_lines(series: Series) -> list[int]:
    """The source lines that run while `series` is measured, ascending.

    Empty for a logged command (line 0) and for a table.
    """
    lines = np.unique(np.asarray(series.labels.get("line", ()), dtype=np.int64))
    return [int(line) for line in lines if line > 0]


def _view(run: str, found: Sequence[Residuals], rows: bool, most: int, beside: Beside) -> View:
    return View(
        name=run,
        panels=[panel for own in found for panel in _panels(own)],
        tracks={track_name(own.series.sensor): _track(own, most) for own in found},
        rows=rows,
        program=beside.program,
        lines=_lines(found),
        marks=beside.marks,
        platen=beside.platen,
    )


def _track(own: Residuals, most: int) -> Track:
    series, scale = own.series, Scale.of(own.series.unit)
    shown = drawn(series)
    channels = {"measured": series.values}
    for model, residual in own.by_model.items():
        channels[f"simulated {model}"] = series.values - residual
        channels[f"residual {model}"] = residual
    for name, change in own.signatures.items():
        channels[f"signature {name}"] = change
    scaled = {name: shown.of(values) * scale.factor for name, values in channels.items()}
    if shown.command is not None:
        scaled["command"] = shown.command * scale.factor
    return Track.of(shown.time_s, scaled, most)


def _panels(own: Residuals) -> Iterator[Panel]:
    series = own.series
    rows, name = series.time_s is None, series.sensor
    several = len(own.by_model) > 1
    models = dict(zip(own.by_model, (_BEFORE, _AFTER), strict=False))
    marked = "points" if rows else "line"
    has_command = drawn(series).command is not None
    command = [Trace("command", "command", style="command")] if has_command else []
    yield Panel(
        f"{name}: measured and simulated", track_name(series.sensor), Scale.of(series.unit),
        [
            *command,
            Trace("measured", "measured", _MEASURED, "bars" if rows else "line"),
            *(Trace(f"simulated {model}", f"simulated {model}" if several else "simulated",
                    color, "points" if rows else "dashed") for model, color in models.items()),
        ],
    )  # fmt: skip
    yield Panel(
        f"{name}: residual", track_name(series.sensor), Scale.of(residual_unit(series.unit)),
        [
            Trace(f"residual {model}", model if several else "residual", color,
                  "bars" if rows and color == _BEFORE else marked)
            for model, color in models.items()
        ],
        series.sigma, "measured − simulated" if rows else _NOTE,
    )  # fmt: skip
    if own.signatures:
        yield _signatures(own)


def _signatures(own: Residuals) -> Panel:
    """The panel of what each effect adds to the reading, over the residual that they explain."""
    series = own.series
    rows, first = series.time_s is None, next(iter(own.by_model))
    return Panel(
        f"{series.sensor}: signatures of the effects", track_name(series.sensor),
        Scale.of(residual_unit(series.unit)),
        [
            Trace(f"residual {first}", f"residual {first}", _BEFORE, "bars" if rows else "command"),
            *(Trace(f"signature {effect}", effect, color, "points" if rows else "line")
              for effect, color in zip(own.signatures, cycle(_SIGNATURES))),
        ],
        note="what each adds to the reading",
    )  # fmt: skip


def _lines(found: Sequence[Residuals]) -> Lines | None:
    """The source lines by time, from the series that has the most samples."""
    with_lines = [r.series for r in found if r.series.time_s is not None and source_lines(r.series)]
    if not with_lines:
        return None
    series = max(with_lines, key=len)
    assert series.time_s is not None, "chosen for its times"
    return Lines.of(series.time_s, np.asarray(series.labels["line"]))


# -- beside the plots -------------------------------------------------------------------------
# Surroundings of an experiment's plots: programs, marks of disagreements, the platen.


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
