"""Residuals of measured and simulated, by run, line, phase, direction, axis and sensor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from mopro.engine.residuals import Corrected, whiteness_p
from mopro.engine.series import Mask, Series
from mopro.engine.verdict import rms
from mopro.experiment.compare.allowed import allowed
from mopro.experiment.compare.noise import larger_noise, noise_notes, without_wild_samples
from mopro.experiment.compare.noise_tests import (
    chi2_p,
    mean_p,
    quantile_residual,
)
from mopro.experiment.sawyer.alignment import aligned
from mopro.experiment.sawyer.labels import PHASES, Labels, labels_of
from mopro.experiment.sawyer.model import Experiment, Floats, Reading, SteadyTable
from mopro.experiment.sawyer.nominal import planned, predict, predict_table
from mopro.units import residual_unit

# Chance of any false alarm in one comparison, over all its tests together (Bonferroni).
FALSE_ALARMS = 1e-3
NO_DISAGREEMENT, DISAGREEMENT = "no disagreement", "disagreement"
NOT_JUDGED = "not judged"
STEADY = "steady"
_TABLE = "table"

_SERIES_SHOWN = ("run", "sensor", "samples", "residual (RMS)", "noise", "σ", "only noise")
_PLACES_SHOWN = ("run", "line", "phase", "direction", "sensor", "mean", "RMS", "σ", "")

Predict = Callable[[Experiment], list[list[Floats]]]


@dataclass(frozen=True)
class Place:
    """The residual at one place of a run: mean and RMS in the sensor's unit.

    `sigma` is the RMS divided by the sensor's noise, `p_value` the smaller p-value of the
    chi-squared test and of the test of a zero mean; both are None where the noise is unknown.
    `axis` is None for a temperature. For a row of a table `line` is the row.
    """

    run: str
    line: int
    phase: str
    axis: int | None
    direction: int
    sensor: str
    unit: str
    count: int
    mean: float
    rms: float
    sigma: float | None
    p_value: float | None
    significant: bool

    def cells(self) -> list[str]:
        """One cell for each of _PLACES_SHOWN."""
        direction = f"{self.direction:+d}" if self.direction else "-"
        unit = residual_unit(self.unit)
        mean, size = f"{self.mean:+.3g} {unit}", f"{self.rms:.3g} {unit}"
        star = "*" if self.significant else ""
        where = [self.run, str(self.line), self.phase, direction, self.sensor]
        return [*where, mean, size, _shown(self.sigma), star]

    @staticmethod
    def of(
        residual: Floats, noise_rms: float | None, p_value: float | None, level: float, **where: Any
    ) -> Place:
        """The place of a `residual`, significant at `level`; `where` are its other fields."""
        size = rms(residual)
        return Place(
            count=len(residual),
            mean=float(residual.mean()),
            rms=size,
            sigma=None if noise_rms is None else size / noise_rms,
            p_value=p_value,
            significant=p_value is not None and p_value < level,
            **where,
        )


@dataclass(frozen=True)
class SeriesTest:
    """Tests of the whole residual of one sensor in one run.

    `size_p` is the p-value of the chi-squared test, `memory_p` that of Bartlett's test of
    whiteness; `rms` and `noise_rms` are in `unit`.
    """

    run: str
    sensor: str
    unit: str
    count: int
    rms: float
    noise_rms: float | None
    sigma: float | None
    size_p: float | None
    memory_p: float | None
    white: bool | None

    def cells(self) -> list[str]:
        """One cell for each of _SERIES_SHOWN."""
        unit = residual_unit(self.unit)
        noise = "-" if self.noise_rms is None else f"{self.noise_rms:.3g} {unit}"
        white = {True: "yes", False: "no", None: "unknown"}[self.white]
        size = f"{self.rms:.3g} {unit}"
        return [self.run, self.sensor, str(self.count), size, noise, _shown(self.sigma), white]

    @staticmethod
    def of(
        residual: Floats, noise_rms: float | None, size_p: float | None, memory_p: float | None,
        level: float, **which: Any,
    ) -> SeriesTest:  # fmt: skip
        """The tests of a `residual` at `level`; `which` are its other fields."""
        size, known = rms(residual), [p for p in (size_p, memory_p) if p is not None]
        return SeriesTest(
            count=len(residual),
            rms=size,
            noise_rms=noise_rms,
            sigma=None if noise_rms is None else size / noise_rms,
            size_p=size_p,
            memory_p=memory_p,
            white=min(known) >= level if known else None,
            **which,
        )


@dataclass(frozen=True)
class Compared:
    """Readings of one sensor in one run, and their residual in the same unit."""

    series: Series
    residual: Floats


@dataclass(frozen=True)
class Comparison:
    """Verdict, places (worst first) and series of a comparison; `compared` are their samples.

    `calibration`: the stated tolerances of sensors that the data call for. Chances are those of
    residuals without what these come to, sizes are those of residuals as they are. Wild samples
    count in neither: `notes` tell them, and noise that is white and larger than stated.
    """

    verdict: str
    where: tuple[Place, ...]
    series: tuple[SeriesTest, ...]
    compared: tuple[Compared, ...] = field(default=(), repr=False, compare=False)
    calibration: tuple[Corrected, ...] = ()
    notes: tuple[str, ...] = ()

    @staticmethod
    def of(
        where: Sequence[Place],
        series: Sequence[SeriesTest],
        compared: Sequence[Compared],
        calibration: Sequence[Corrected] = (),
        notes: Sequence[str] = (),
    ) -> Comparison:
        """The comparison of these places and series."""
        first = sorted(where, key=lambda p: (not p.significant, -(p.sigma or 0.0), -p.rms))
        return Comparison(
            _verdict_of(where, series), tuple(first), tuple(series), tuple(compared),
            tuple(calibration), tuple(notes),
        )  # fmt: skip

    def _repr_html_(self) -> str:
        """Verdict, series, and the places that differ most."""
        from mopro.markup import MOST_ROWS, fragment, paragraph, table

        parts = [
            table(_SERIES_SHOWN, (s.cells() for s in self.series), most=MOST_ROWS),
            paragraph("Residuals are measured − simulated; a star: more than noise."),
            table(_PLACES_SHOWN, (p.cells() for p in self.where), most=MOST_ROWS),
        ]
        return fragment(f"Comparison: {self.verdict}", parts)

    def as_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "where": [asdict(place) for place in self.where],
            "series": [asdict(series) for series in self.series],
            "calibration": [asdict(own) for own in self.calibration],
            "notes": list(self.notes),
        }


def in_larger_noise(
    data: Sequence[Series], z: Sequence[Floats], judge: Callable[[Sequence[Floats]], Comparison]
) -> Comparison:
    """The comparison by `judge` of scaled residuals `z` (one array a series, in its noise σ).

    Where it is a disagreement in the stated noise, and none in white noise as large as the
    differences of neighbouring samples, the latter comparison is returned, with a note.
    """
    stated, factors = judge(z), larger_noise(data, z)
    if stated.verdict != DISAGREEMENT or all(factor == 1 for factor in factors):
        return stated
    larger = judge([own / factor for own, factor in zip(z, factors, strict=True)])
    if larger.verdict == DISAGREEMENT:
        return stated
    return replace(larger, notes=(*larger.notes, *noise_notes(data, factors)))


def _shown(number: float | None) -> str:
    return "-" if number is None else f"{number:.3g}"


@dataclass(frozen=True)
class _Residual:
    """A reading minus its prediction in the sensor's unit (`values`) and in σ (`z`)."""

    run: str
    reading: Reading
    labels: Labels
    values: Floats
    z: Floats

    def compared(self) -> Compared:
        """The readings with what was commanded at their times, and their residual."""
        reading, sensor, labels = self.reading, self.reading.sensor, self.labels
        placed = (
            {"position": labels.command_m / sensor.unit_si} if sensor.quantity.sees_place else {}
        )
        series = Series(
            run=self.run, sensor=sensor.name, unit=sensor.unit, values=reading.values,
            sigma=sensor.sigma or None, time_s=reading.time_s,
            labels={"line": labels.line, **placed},
            position_unit=sensor.unit if placed else "m", tolerances=sensor.tolerances,
        )  # fmt: skip
        return Compared(series, self.values)

    def judged(self, off: Floats | None, generator: np.random.Generator) -> _Residual:
        """This residual with the σ of what is left without `off`."""
        if off is None:
            return self
        reading = self.reading
        left = aligned(self.values - off)
        z = quantile_residual(reading.values, reading.values - left, reading.sensor, generator)
        return replace(self, z=z)


def compare(
    experiment: Experiment,
    generator: np.random.Generator,
    prediction: Predict = predict,
) -> Comparison:
    """Compare all data of `experiment` with what `prediction` computes for it.

    `generator` draws the position of a reading within a converter's step (quantile_residual).
    """
    residuals = list(_residuals(experiment, prediction(experiment), generator))
    compared = [r.compared() for r in residuals]
    within = allowed([c.series for c in compared], [c.residual for c in compared])
    residuals = [r.judged(off, generator) for r, off in zip(residuals, within.off, strict=True)]
    left = [
        c.residual if off is None else aligned(c.residual - off)
        for c, off in zip(compared, within.off, strict=True)
    ]
    data, notes = without_wild_samples([c.series for c in compared], left)
    compared = [replace(c, series=series) for c, series in zip(compared, data, strict=True)]
    groups = [
        [rows[series.counted[rows]] for rows in _places(r.labels)]
        for r, series in zip(residuals, data, strict=True)
    ]
    tests = 2 * len(residuals) + 2 * sum(map(len, groups))
    level = FALSE_ALARMS / max(tests + sum(len(t.rise_K) for t in experiment.tables), 1)
    tables = [(t, predict_table(t, experiment.machine)) for t in experiment.tables]
    for table, predicted in tables:
        seen = Series(table.name, _TABLE, "C", table.rise_K, table.noise_K)
        compared.append(Compared(seen, table.rise_K - predicted))

    def judge(z: Sequence[Floats]) -> Comparison:
        trials = [replace(r, z=own) for r, own in zip(residuals, z, strict=True)]
        series = [
            _series(r, own.counted, level, within.chance.get(own.sensor, 1.0))
            for r, own in zip(trials, data, strict=True)
        ]
        places = zip(trials, groups, strict=True)
        where = [_place(r, rows, level) for r, own in places for rows in own if len(rows)]
        for table, predicted in tables:
            rows, whole = _table(table, predicted, level)
            where += rows
            series.append(whole)
        return Comparison.of(where, series, compared, within.told, notes)

    return in_larger_noise(data, [r.z for r in residuals], judge)


def _verdict_of(where: Sequence[Place], series: Sequence[SeriesTest]) -> str:
    """Verdict of a comparison with these places and series."""
    if any(s.white is False for s in series) or any(p.significant for p in where):
        return DISAGREEMENT
    return NO_DISAGREEMENT if all(s.white for s in series) else NOT_JUDGED


def _residuals(
    experiment: Experiment, predicted: list[list[Floats]], generator: np.random.Generator
) -> Iterator[_Residual]:
    microstep_m = experiment.machine.microstep_m
    for trial, of_trial in zip(experiment.trials, predicted, strict=True):
        schedule = planned(trial, experiment.machine)
        for reading, expected in zip(trial.readings, of_trial, strict=True):
            values = aligned(reading.values - expected)
            z = quantile_residual(
                reading.values, reading.values - values, reading.sensor, generator
            )
            marks = labels_of(reading, schedule, microstep_m)
            yield _Residual(trial.name, reading, marks, values, z)


def _places(labels: Labels) -> Iterator[np.ndarray[Any, np.dtype[np.intp]]]:
    """Indices of the samples of each line, phase and direction, in the order of the lines."""
    codes = np.unique(labels.phase, return_inverse=True)[1]
    keys = (labels.line.astype(np.int64) * len(PHASES) + codes) * 3 + labels.direction
    group = np.unique(keys, return_inverse=True)[1]
    order = np.argsort(group, kind="stable")
    edges = np.flatnonzero(np.diff(group[order])) + 1
    yield from np.split(order, edges)


def _place(r: _Residual, rows: np.ndarray[Any, np.dtype[np.intp]], level: float) -> Place:
    sensor, first, z = r.reading.sensor, int(rows[0]), r.z[rows]
    return Place.of(
        r.values[rows],
        sensor.sigma,
        min(chi2_p(z), mean_p(z)),
        level,
        run=r.run,
        line=int(r.labels.line[first]),
        phase=str(r.labels.phase[first]),
        axis=sensor.axis if sensor.quantity.of_axis else None,
        direction=int(r.labels.direction[first]),
        sensor=sensor.name,
        unit=sensor.unit,
    )


def _series(r: _Residual, counted: Mask, level: float, chance: float) -> SeriesTest:
    sensor, z = r.reading.sensor, r.z[counted]
    size_p = min(chi2_p(z, fitted=1), chance)
    return SeriesTest.of(
        r.values[counted], sensor.sigma, size_p, whiteness_p(z), level,
        run=r.run, sensor=sensor.name, unit=sensor.unit,
    )  # fmt: skip


def _table(table: SteadyTable, predicted: Floats, level: float) -> tuple[list[Place], SeriesTest]:
    """Each row of a table as a Place, and the table as a whole; not judged without known noise."""
    residual, noise = table.rise_K - predicted, table.noise_K
    places = [
        Place.of(
            own, noise, None if noise is None else mean_p(own / noise), level, run=table.name,
            line=row, phase=STEADY, axis=None, direction=0, sensor=_TABLE, unit="C",
        )
        for row, own in enumerate(residual[:, None], start=1)
    ]  # fmt: skip
    size_p = None if noise is None else chi2_p(residual / noise)
    whole = SeriesTest.of(
        residual, noise, size_p, None, level, run=table.name, sensor=_TABLE, unit="C"
    )
    return places, whole
