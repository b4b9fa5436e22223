"""The page of a comparison: measured against simulated, with one machine or two."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from mopro.experiment.comparison import Comparison, Place, SeriesTest
from mopro.experiment.opened import Opened
from mopro.experiment.wording import place_words
from mopro.markup import listing, paragraph, section, table
from mopro.units import residual_unit
from mopro.viewer.page import document
from mopro.viewer.series_views import Residuals, beside_of, own_units, series_views

_SERIES = ("run", "sensor", "samples", "RMS", "noise", "σ", "χ² p", "whiteness p", "only noise")
_PLACES = ("run", "where", "sensor", "samples", "mean", "RMS", "σ", "significant")
_GAPS = ("run", "sensor", "before", "after", "noise")
_MOST_PLACES = 200
_TESTS = "Tests of the residual"
_WHITE = {True: "yes", False: "no", None: "unknown"}


def comparison_page(
    opened: Opened, comparison: Comparison, before: Comparison | None = None
) -> str:
    """The page of the `comparison` of an experiment.

    With `before`, that on the experiment's own machine, both residuals are on one axis. Raises
    MotionError.
    """
    source = opened.system.source
    found = _residuals(comparison, before)
    return document(
        f"{Path(source.name).name} on {opened.machine_name}: {comparison.verdict}",
        map(paragraph, opened.notes),
        series_views(found, beside_of(opened.system, comparison.where)),
        [
            *([_gaps(before, comparison)] if before else []),
            section("Series", [table(_SERIES, map(_series, comparison.series), _TESTS)]),
            _places(comparison.where),
            section("The experiment's file", [listing(source.text)], opened=False),
        ],
        own_units(found),
    )  # fmt: skip


def _residuals(comparison: Comparison, before: Comparison | None) -> list[Residuals]:
    if before is None:
        return [Residuals(c.series, {"simulated": c.residual}) for c in comparison.compared]
    return [
        Residuals(two.series, {"before": one.residual, "after": two.residual})
        for one, two in zip(before.compared, comparison.compared, strict=True)
    ]


def _gaps(before: Comparison, after: Comparison) -> str:
    rows = (
        [one.run, one.sensor, _size(one.rms, one.unit), _size(two.rms, one.unit),
         _size(one.noise_rms, one.unit)]
        for one, two in zip(before.series, after.series, strict=True)
    )  # fmt: skip
    return section("The gap", [table(_GAPS, rows, "RMS of the residual (measured − simulated)")])


def _series(test: SeriesTest) -> list[str]:
    numbers = (test.sigma, test.size_p, test.memory_p)
    return [
        test.run, test.sensor, str(test.count), _size(test.rms, test.unit),
        _size(test.noise_rms, test.unit), *map(_number, numbers), _WHITE[test.white],
    ]  # fmt: skip


def _places(places: Sequence[Place]) -> str:
    shown = places[:_MOST_PLACES]
    more = len(places) - len(shown)
    rest = [paragraph(f"and {more} more")] if more else []
    return section("Places", [table(_PLACES, _rows(shown), "The largest residual first"), *rest])


def _rows(places: Sequence[Place]) -> Iterator[list[str]]:
    for place in places:
        yield [
            place.run, place_words(place), place.sensor, str(place.count),
            f"{place.mean:+.3g} {residual_unit(place.unit)}", _size(place.rms, place.unit),
            _number(place.sigma), "yes" if place.significant else "",
        ]  # fmt: skip


def _size(value: float | None, unit: str) -> str:
    """A residual or a noise in words."""
    return "unknown" if value is None else f"{value:.3g} {residual_unit(unit)}"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
