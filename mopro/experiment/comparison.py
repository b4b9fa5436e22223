"""Residuals of measured and simulated, by run, line, phase, direction, axis and sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from mopro.engine.residuals import Corrected, whiteness_p
from mopro.engine.series import Floats, Series
from mopro.engine.verdict import rms
from mopro.experiment.allowed import Allowed, allowed
from mopro.experiment.scaled_residuals import (
    chi2_p,
    larger_noise,
    mean_p,
    noise_notes,
    without_wild_samples,
)
from mopro.experiment.system import Predicted, Spot, System
from mopro.units import residual_unit

# Chance of any false alarm in one comparison, over all its tests together (Bonferroni).
FALSE_ALARMS = 1e-3
NO_DISAGREEMENT, DISAGREEMENT = "no disagreement", "disagreement"
NOT_JUDGED = "not judged"
STEADY = "steady"

_SERIES_SHOWN = ("run", "sensor", "samples", "residual (RMS)", "noise", "σ", "only noise")
_PLACES_SHOWN = ("run", "line", "phase", "direction", "sensor", "mean", "RMS", "σ", "")


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


def compare(system: System, seed: int = 0) -> Comparison:
    """Compare all data of an experiment with what its machine's file predicts.

    `seed`: of the position of a reading within a converter's step (quantile_residual).
    """
    generator = np.random.default_rng(seed)
    every = list(system.predicted(generator))
    within, left, z = _judged(every)
    data, notes = without_wild_samples([p.series for p in every], left)
    if notes:
        # An offset and a tolerance that were fitted to wild samples are off.
        every = [replace(p, series=own) for p, own in zip(every, data, strict=True)]
        within, left, z = _judged(every)
    residuals = [p.residual for p in every]
    spots = [list(p.spots(p.series)) for p in every]
    tests = sum(_tests_of(p.series) * (1 + len(own)) for p, own in zip(every, spots, strict=True))
    level = FALSE_ALARMS / max(tests, 1)
    compared = [Compared(p.series, own) for p, own in zip(every, residuals, strict=True)]

    def judge(z: Sequence[Floats]) -> Comparison:
        judged = list(zip(data, residuals, z, spots, strict=True))
        series = [
            _series(s, r, own, level, within.chance.get(s.sensor, 1.0)) for s, r, own, _ in judged
        ]
        where = [_place(s, r, own, spot, level) for s, r, own, here in judged for spot in here]
        return Comparison.of(where, series, compared, within.corrected, notes)

    return in_larger_noise(data, z, judge)


def _judged(every: Sequence[Predicted]) -> tuple[Allowed, list[Floats], list[Floats]]:
    """Fitted tolerances of the sensors, the residuals without them, and these in σ of the noise."""
    residuals = [p.residual for p in every]
    z = [p.scaled(own) for p, own in zip(every, residuals, strict=True)]
    within, left = allowed([p.series for p in every], residuals), residuals[:]
    for i, (p, correction) in enumerate(zip(every, within.corrections, strict=True)):
        if correction is not None:
            left[i] = p.aligned(p.series, residuals[i] - correction)
            z[i] = p.scaled(left[i])
    return within, left, z


def _tests_of(series: Series) -> int:
    """Tests of a series, and of each of its spots: of size, and of order in time if it has that."""
    return 1 if series.time_s is None else 2


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


def _verdict_of(where: Sequence[Place], series: Sequence[SeriesTest]) -> str:
    """Verdict of a comparison with these places and series."""
    if any(s.white is False for s in series) or any(p.significant for p in where):
        return DISAGREEMENT
    return NO_DISAGREEMENT if all(s.white for s in series) else NOT_JUDGED


def _place(series: Series, residual: Floats, z: Floats, spot: Spot, level: float) -> Place:
    """The place of a spot; `z` is what is left of the residual, in standard deviations."""
    rows = spot.rows
    p_value = None if series.sigma is None else min(chi2_p(z[rows]), mean_p(z[rows]))
    return Place.of(
        residual[rows], series.sigma, p_value, level,
        run=series.run, line=spot.line, phase=spot.phase, axis=spot.axis,
        direction=spot.direction, sensor=series.sensor, unit=series.unit,
    )  # fmt: skip


def _series(series: Series, residual: Floats, z: Floats, level: float, chance: float) -> SeriesTest:
    own, ordered = z[series.counted], series.time_s is not None
    known = series.sigma is not None
    size_p = min(chi2_p(own, fitted=int(ordered)), chance) if known else None
    memory_p = whiteness_p(own) if known and ordered else None
    return SeriesTest.of(
        residual[series.counted], series.sigma, size_p, memory_p, level,
        run=series.run, sensor=series.sensor, unit=series.unit,
    )  # fmt: skip


def worst(places: Sequence[Place], most: int) -> tuple[Place, ...]:
    """The significant places; where no noise is known, the largest."""
    known = [place for place in places if place.significant]
    return tuple(known or [p for p in places if p.sigma is None])[:most]
