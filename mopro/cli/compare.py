"""`mopro compare`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mopro.cli.main import EXIT_FAILED
from mopro.cli.options import OutputFile, allow_python_option
from mopro.cli.outputs import Named, claimed, drawn, keep_inputs, machine_file, page_bytes
from mopro.cli.say import print_table, say, say_json
from mopro.units import residual_unit

if TYPE_CHECKING:
    from mopro.experiment.carried import Carried
    from mopro.experiment.comparison import Comparison, Place, SeriesTest
    from mopro.experiment.opened import ExperimentFile, Opened

_MOST_ROWS = 40
_PLACES = (
    "run",
    "line",
    "phase",
    "axis",
    "direction",
    "sensor",
    "samples",
    "mean",
    "rms",
    "sigma",
    "",
)
_APPLIED = ("run", "sensor", "before", "after", "noise")
_CARRIED = ("number", "in the file", "fitted here", "95 %", "")
_SERIES = ("run", "sensor", "samples", "rms", "noise", "sigma", "χ² p", "whiteness p", "only noise")


@click.command()
@click.argument("experiment", type=click.Path())
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Of the random values for a coarse ADC's rounding.",
)
@click.option(
    "--apply",
    "applied",
    metavar="MACHINE",
    help="Compare with this machine instead, and show the gap of each run before and after.",
)
@click.option(
    "--plot",
    type=OutputFile(".png", ".svg", ".pdf"),
    help="A picture: measured over simulated, and the residual.",
)
@click.option("--report", type=OutputFile(".html"), help="A page with the series and residuals.")
@allow_python_option()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    experiment: str,
    seed: int,
    applied: str | None,
    plot: Path | None,
    report: Path | None,
    allow_python: bool,
    as_json: bool,
) -> int:
    """Show where simulation and data disagree: by run, line, phase, direction and axis.

    A residual is measured minus simulated, without each sensor's offset. Exits with 1 if the
    residuals exceed the sensors' noise. With --apply a machine that `mopro reconcile --out`
    repaired is tried on runs that it has not seen.

    Example: mopro compare unseen.toml --apply repaired.toml
    """
    from mopro.experiment.comparison import DISAGREEMENT
    from mopro.experiment.opened import experiment_file

    stated = experiment_file(experiment)
    inputs: list[Named] = [("EXPERIMENT", experiment), ("--apply", machine_file(applied))]
    inputs += [("EXPERIMENT", file) for file in stated.files]
    keep_inputs([("--plot", plot), ("--report", report)], inputs)
    loaded, comparison, before = _compared(stated, applied, allow_python, seed, (plot, report))
    gaps = [] if before is None else list(_gaps(before, comparison))
    held = () if before is None else loaded.carried()
    if as_json:
        answer = {"experiment": experiment, "machine": loaded.machine_name, **comparison.as_json()}
        if applied is not None:
            answer |= {"applied": gaps, "carried_over": [own.as_json() for own in held]}
        say_json(answer | ({} if loaded.rows is None else {"rows": loaded.rows.rows.as_json()}))
    else:
        _print(comparison, gaps)
        _print_carried(held)
        _tell(_worse(gaps, held))
    title = f"{experiment} on {loaded.machine_name}"
    # A list, so that both are drawn even if the first fails.
    both = [
        drawn(plot, lambda form: _figure_of(comparison, before, title, form)),
        drawn(report, lambda _: _page(loaded, comparison, before)),
    ]
    return EXIT_FAILED if comparison.verdict == DISAGREEMENT or not all(both) else 0


def _compared(
    stated: ExperimentFile,
    applied: str | None,
    allow_python: bool,
    seed: int,
    outputs: tuple[Path | None, ...],
) -> tuple[Opened, Comparison, Comparison | None]:
    """The experiment, its comparison, and that before the machine `applied`, if one is.

    The `outputs` are claimed meanwhile, so that a place that cannot be written is told before.
    """
    if applied is None:
        loaded = stated.opened(allow_python=allow_python)
    else:
        loaded = stated.before(applied, allow_python)
    said = _tell(loaded.notes)
    with claimed(*outputs):
        comparison = loaded.compare(seed)
        if applied is None:
            return loaded, comparison, None
        loaded, before = stated.opened(applied, allow_python), comparison
        _tell(note for note in loaded.notes if note not in said)
        return loaded, loaded.compare(seed), before


def _tell(notes: Iterable[str]) -> tuple[str, ...]:
    """Say the notes on standard error, and give them."""
    said = tuple(notes)
    for note in said:
        say(note, err=True)
    return said


def _figure_of(comparison: Comparison, before: Comparison | None, title: str, form: str) -> bytes:
    from mopro.plot import figure_bytes
    from mopro.plot.comparison import plot_comparison

    return figure_bytes(plot_comparison(comparison, title, before), form)


def _page(loaded: Opened, comparison: Comparison, before: Comparison | None) -> bytes:
    from mopro.viewer.comparison import comparison_page

    page = comparison_page(loaded, comparison, before)
    return page_bytes(page)


def _gaps(before: Comparison, after: Comparison) -> Iterator[dict[str, Any]]:
    """The gap of each series with the experiment's machine, and with the applied one."""
    for first, second in zip(before.series, after.series, strict=True):
        yield {
            "run": first.run,
            "sensor": first.sensor,
            "unit": first.unit,
            "before_rms": first.rms,
            "after_rms": second.rms,
            "noise_rms": first.noise_rms,
        }


def _print_gaps(gaps: Sequence[dict[str, object]]) -> None:
    if gaps:
        keys = ("before_rms", "after_rms", "noise_rms")
        rows = [
            [
                str(gap["run"]),
                str(gap["sensor"]),
                *(_size(gap[key], str(gap["unit"])) for key in keys),
            ]
            for gap in gaps
        ]
        print_table(_APPLIED, rows, _MOST_ROWS)


def _print_carried(held: Sequence[Carried]) -> None:
    rows = [[f"{own.effect}.{own.parameter}", *_values(own), own.word] for own in held]
    if rows:
        print_table(_CARRIED, rows, _MOST_ROWS)


def _worse(gaps: Sequence[dict[str, Any]], held: Sequence[Carried]) -> Iterator[str]:
    """A question for each series predicted worse than before, where a number differs."""
    from mopro.experiment.carried import DIFFERS

    if not any(own.word == DIFFERS for own in held):
        return
    for gap in gaps:
        if gap["after_rms"] > gap["before_rms"]:
            yield (
                f"{gap['sensor']} in {gap['run']} is worse than before the repair: is a zero or a "
                "phase another here, as after homing anew? Reconcile this run by itself"
            )


def _values(own: Carried) -> list[str]:
    """The number in the file, as fitted here, and its interval."""
    from mopro.experiment.wording import interval_words, value_words

    here = own.here
    if here is None:
        return [f"{own.filed:.4g} {own.unit}".rstrip(), "-", "-"]
    filed = value_words(replace(here, value=own.filed))
    return [filed, value_words(here), interval_words(here)]


def _size(value: object, unit: str, form: str = ".3g") -> str:
    """A residual, or the noise in it, of a sensor that reads in `unit`."""
    return "-" if value is None else f"{value:{form}} {residual_unit(unit)}"


def _print(comparison: Comparison, gaps: Sequence[dict[str, object]]) -> None:
    print_table(_SERIES, map(_series_cells, comparison.series), _MOST_ROWS)
    print_table(_PLACES, map(_place_cells, comparison.where), _MOST_ROWS)
    for own in comparison.calibration:
        values = ", ".join(f"{name} = {value:.3g} {unit}" for name, (value, unit, _) in
                           own.values.items())  # fmt: skip
        say(f"Within the stated {own.name} of {own.sensor}: {values}.")
    for note in comparison.notes:
        say(f"{note[0].upper()}{note[1:]}.")
    say(f"{comparison.verdict}{_reason(comparison)}")
    _print_gaps(gaps)


def _reason(comparison: Comparison) -> str:
    """Reason for the verdict, to be appended to it."""
    places = sum(place.significant for place in comparison.where)
    if places:
        return f" in {places} of {len(comparison.where)} places"
    if any(series.white is False for series in comparison.series):
        return ": the residual of a whole run is too large, or not white"
    if any(series.white is None for series in comparison.series):
        return f": the noise of {_quiet(comparison)} is unknown; state it in the [[sensor]]"
    return ""


def _quiet(comparison: Comparison) -> str:
    """The first series whose noise is unknown."""
    return next(s.sensor for s in comparison.series if s.white is None)


def _place_cells(place: Place) -> list[str]:
    return [
        place.run,
        str(place.line),
        place.phase,
        "-" if place.axis is None else str(place.axis),
        "-" if not place.direction else f"{place.direction:+d}",
        place.sensor,
        str(place.count),
        _size(place.mean, place.unit, "+.3g"),
        _size(place.rms, place.unit),
        _figure(place.sigma),
        "*" if place.significant else "",
    ]


def _series_cells(series: SeriesTest) -> list[str]:
    return [
        series.run,
        series.sensor,
        str(series.count),
        _size(series.rms, series.unit),
        _size(series.noise_rms, series.unit),
        _figure(series.sigma),
        _figure(series.size_p),
        _figure(series.memory_p),
        {True: "yes", False: "no", None: "unknown"}[series.white],
    ]


def _figure(number: float | None) -> str:
    return "-" if number is None else f"{number:.3g}"
