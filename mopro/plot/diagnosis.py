"""One self-contained HTML page for a diagnosis: the evidence for and against."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from mopro.diagnosis import Verdict
from mopro.experiment.conclude.conclusion import Conclusion
from mopro.experiment.conclude.wording import (
    NO_PROPOSAL,
    calibration_words,
    effect_words,
    held_out_words,
    interval_words,
    parameters_shown,
    place_words,
    reservations,
    sentence,
    undecided_words,
    value_words,
)
from mopro.plot.page import heading, listing, page, paragraph, picture, table
from mopro.plot.residuals import plot_residuals, source_lines

# A page with more figures than these is no help; those of the worst gaps are kept.
_MOST_FIGURES = 16
_DPI = 90
_FOUND = (
    "effect", "parameter", "value", "95 % interval", "σ in all", "log10 Bayes factor", "held out",
)  # fmt: skip
_GAPS = ("run", "sensor", "before", "after", "held out", "machine file rerun", "noise")
_PLACES = ("run", "where", "sensor", "samples", "mean", "RMS", "σ of the sensor")
_TRIED = ("candidate", "standing", "σ in all", "why")
_UNDECIDED = "None of the catalogue's effects is believed."


def diagnosis_page(found: Conclusion) -> str:
    """The page: the verdict and its evidence, the gap, every candidate, and what comes next."""
    verdict = found.verdict
    return page(
        sentence(verdict),
        [
            paragraph(f"{_name(found)} on the machine {found.experiment.machine.name}."),
            *_effects(found),
            *_gap(found),
            *_where(found),
            *_figures(found),
            heading("What is left"),
            paragraph(_left(verdict)),
            heading("Every candidate"),
            table("All effects that were tried", _TRIED, _candidates(verdict)),
            *_next(found),
            *_making(found),
        ],
    )


def _name(found: Conclusion) -> str:
    return Path(found.experiment.source.name).name


def _effects(found: Conclusion) -> Iterator[str]:
    yield heading("What was found")
    if not found.verdict.fitted:
        yield paragraph(_UNDECIDED)
        return
    yield table("The effects that are believed", _FOUND, _effect_rows(found.verdict))
    yield from map(paragraph, calibration_words(found.verdict))
    yield from map(paragraph, undecided_words(found.verdict))
    yield from map(paragraph, reservations(found.verdict, found.runs))


def _effect_rows(verdict: Verdict) -> Iterator[list[str]]:
    for effect in verdict.fitted:
        for name, estimate in parameters_shown(effect).items():
            yield [
                effect_words(effect, verdict),
                name,
                value_words(estimate),
                interval_words(estimate),
                f"{effect.sigmas:.3g}",
                f"{effect.log10_bayes_factor:.3g}",
                held_out_words(effect, verdict),
            ]


def _gap(found: Conclusion) -> Iterator[str]:
    yield heading("The gap")
    rows = []
    for run, rerun in zip(found.verdict.gap.runs, found.rerun_rms, strict=True):
        figures = (run.before_rms, run.after_rms, run.held_out_rms, rerun, run.noise_rms)
        sizes = ["unknown" if f is None else f"{f:.3g} {run.unit}" for f in figures]
        if run.held_out_rms is None:
            sizes[2] = "nothing to hold out"
        rows.append([run.run, run.sensor, *sizes])
    yield table("RMS of measured less simulated", _GAPS, rows)


def _where(found: Conclusion) -> Iterator[str]:
    yield heading("Where simulation and data disagreed")
    if not found.where:
        yield paragraph("In no single place by more than noise explains.")
        return
    yield table(
        "The worst places first, before anything was added",
        _PLACES,
        (
            [
                place.run,
                place_words(place),
                place.sensor,
                str(place.count),
                f"{place.mean:+.3g} {place.unit}",
                f"{place.rms:.3g} {place.unit}",
                "unknown" if place.sigma is None else f"{place.sigma:.3g}",
            ]
            for place in found.where
        ),
    )


def _figures(found: Conclusion) -> Iterator[str]:
    yield heading("Run by run")
    worst = sorted(range(len(found.series)), key=lambda i: -_excess(found, i))[:_MOST_FIGURES]
    if len(worst) < len(found.series):
        yield paragraph(f"The {len(worst)} of {len(found.series)} series with the largest gaps.")
    for index in sorted(worst):
        series, run = found.series[index], found.verdict.gap.runs[index]
        signatures = {s.name: s.changes[index] for s in found.verdict.signatures}
        figure = plot_residuals(
            series, found.verdict.before[index], signatures, found.verdict.after[index]
        )
        named = f", with what {' and '.join(signatures)} would add over it" if signatures else ""
        lines = source_lines(series)
        marked = f"; source lines {', '.join(map(str, lines))}" if lines else ""
        yield heading(f"{series.run}, {series.sensor}", 3)
        yield picture(
            figure,
            f"Residual of {series.sensor} in {series.run}: {run.before_rms:.3g} {run.unit} RMS "
            f"before{named}; {run.after_rms:.3g} {run.unit} RMS after{marked}",
            _DPI,
        )


def _excess(found: Conclusion, index: int) -> float:
    run = found.verdict.gap.runs[index]
    return run.before_rms / (run.noise_rms or 1.0)


def _left(verdict: Verdict) -> str:
    remainder = verdict.remainder
    if remainder.significant:
        return f"More than noise ({remainder.scatter:.3g} σ RMS): {remainder.description}."
    if verdict.gap.noise_rms is None:
        return "The noise is unknown, so nothing can be said of what is left."
    return f"Noise: {remainder.scatter:.3g} σ RMS, and no shape in it."


def _candidates(verdict: Verdict) -> Iterator[list[str]]:
    """Those believed, what cannot be told from them, the rejected, and those too faint."""
    rival_of = {rival: e.name for e in verdict.fitted for rival in e.rivals}
    for effect in verdict.fitted:
        standing = "calibrated" if effect in verdict.calibration else "believed"
        yield [effect.name, standing, f"{effect.sigmas:.3g}", "pays for its parameters"]
    for rejected in sorted(verdict.rejected, key=lambda r: -r.gain):
        standing, reason = "rejected", rejected.reason
        if rejected.name in rival_of:
            standing = f"rival of {rival_of[rejected.name]}"
            reason = f"does as well in its place, and not beside it: {reason}"
        yield [rejected.name, standing, f"{math.sqrt(max(rejected.gain, 0.0)):.2g}", reason]
    for faint in verdict.below_resolution:
        most, needed = f"{faint.expected_sigmas:.2g}", f"{faint.needed_sigmas:.2g}"
        yield [
            faint.name,
            "below resolution",
            f"at most {most}",
            f"the largest to expect would come to {most} σ; {needed} σ are needed to be seen",
        ]


def _next(found: Conclusion) -> Iterator[str]:
    proposal = found.next_experiment
    if found.verdict.verdict != "ambiguous":
        return
    yield heading("The next experiment")
    if proposal is None:
        yield paragraph(NO_PROPOSAL)
        return
    yield paragraph(f"This program would tell the rivals apart: {proposal.summary}.")
    yield listing(proposal.text)
    rows = [[" / ".join(pair), f"{sigmas:.3g}"] for pair, sigmas in proposal.pairs.items()]
    yield table("How far it separates them", ("rivals", "σ"), rows)


def _making(found: Conclusion) -> Iterator[str]:
    experiment = found.experiment
    versions = ", ".join(f"{name} {version(name)}" for name in ("mopro", "numpy", "scipy"))
    yield heading("How it was made")
    yield table(
        "Origin",
        (),
        [
            ["experiment", _name(found)],
            ["machine", experiment.machine.name],
            ["samples", str(sum(map(len, found.series)))],
            ["made by", f"{versions}, Python {platform.python_version()}"],
        ],
    )
    for note in experiment.notes:
        yield paragraph(note)
    yield heading("The experiment's file", 3)
    yield listing(experiment.source.text)
    yield heading("The machine file with what was found", 3)
    yield listing(found.machine_text)
