"""The page of a diagnosis: residuals before and after, verdict, evidence, gap and candidates."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from mopro.engine.verdict import Verdict
from mopro.experiment.conclusion import Conclusion
from mopro.experiment.glance import NEXT_EXPERIMENT
from mopro.experiment.system import Proposal
from mopro.experiment.wording import (
    AFTER,
    BEFORE,
    candidate_rows,
    effect_words,
    held_out_words,
    interval_words,
    note_words,
    parameters_shown,
    place_words,
    remainder_words,
    trace_rows,
    value_words,
)
from mopro.markup import MOST_LINES, heading, listing, paragraph, section, table
from mopro.units import residual_unit
from mopro.viewer.glance import strip
from mopro.viewer.page import document
from mopro.viewer.series_views import Residuals, beside_of, own_units, series_views, source_lines

_EFFECTS = (
    "effect", "parameter", "value", "95 % interval", "σ in all", "log10 Bayes factor", "held out",
)  # fmt: skip
_GAPS = ("run", "sensor", BEFORE, AFTER, "held out", "machine file rerun", "noise",
         "source lines")  # fmt: skip
_PLACES = ("run", "where", "sensor", "samples", "mean", "RMS", "σ of the sensor")
_TRIED = ("candidate", "status", "σ in all", "reason")
_PASSES = ("pass", "effects after it", "EBIC", "why")
_UNDECIDED = "No effect of the catalogue is supported by the data."


def conclusion_page(conclusion: Conclusion) -> str:
    """The page: the answer at a glance, the series, and the evidence."""
    verdict, glance = conclusion.verdict, conclusion.glance
    found = _residuals(conclusion)
    return document(
        glance.sentence,
        [strip(glance), paragraph(f"{_name(conclusion)} on the machine {conclusion.system.name}.")],
        series_views(found, beside_of(conclusion.system, conclusion.where)),
        [
            section("Effects found", _effects(conclusion)),
            section("The gap", _gap(conclusion)),
            section("Where simulation and data disagreed", _where(conclusion)),
            section("Remaining residual", [paragraph(_remainder(verdict))]),
            section("All candidates", _all_candidates(verdict), opened=False),
            section("How the answer came about", _passes(verdict), opened=False),
            *_next(conclusion),
            section("Provenance", _provenance(conclusion), opened=False),
        ],
        own_units(found),
    )


def _residuals(conclusion: Conclusion) -> list[Residuals]:
    verdict = conclusion.verdict
    return [
        Residuals(
            series,
            {BEFORE: verdict.before[index], AFTER: verdict.after[index]},
            {s.name: s.changes[index] for s in verdict.signatures},
        )
        for index, series in enumerate(conclusion.system.series)
    ]


def _name(conclusion: Conclusion) -> str:
    return Path(conclusion.system.source.name).name


def _effects(conclusion: Conclusion) -> Iterator[str]:
    if conclusion.verdict.fitted:
        yield table(_EFFECTS, _effect_rows(conclusion.verdict), "Effects supported by the data")
    else:
        yield paragraph(_UNDECIDED)
    yield from map(paragraph, note_words(conclusion.verdict))
    yield from map(paragraph, conclusion.reservations())


def _passes(verdict: Verdict) -> Iterator[str]:
    yield table(_PASSES, trace_rows(verdict), "Passes that decided something")


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


def _gap(conclusion: Conclusion) -> Iterator[str]:
    rows = []
    verdict, series = conclusion.verdict, conclusion.system.series
    for run, rerun, own in zip(verdict.gap.runs, conclusion.repaired.rms, series, strict=True):
        figures = (run.before_rms, run.after_rms, run.held_out_rms, rerun, run.noise_rms)
        sizes = ["unknown" if f is None else f"{f:.3g} {residual_unit(run.unit)}" for f in figures]
        if run.held_out_rms is None:
            sizes[2] = "nothing to hold out"
        lines = ", ".join(map(str, source_lines(own))) or "–"
        rows.append([run.run, run.sensor, *sizes, lines])
    yield table(_GAPS, rows, "RMS of the residual (measured − simulated)")


def _where(conclusion: Conclusion) -> Iterator[str]:
    if not conclusion.where:
        yield paragraph("No single place differs by more than the noise explains.")
        return
    yield table(
        _PLACES,
        (
            [
                place.run,
                place_words(place),
                place.sensor,
                str(place.count),
                f"{place.mean:+.3g} {residual_unit(place.unit)}",
                f"{place.rms:.3g} {residual_unit(place.unit)}",
                "unknown" if place.sigma is None else f"{place.sigma:.3g}",
            ]
            for place in conclusion.where
        ),
        f"The largest first, {BEFORE}",
    )


def _remainder(verdict: Verdict) -> str:
    remainder = verdict.remainder
    if remainder.significant:
        return f"More than noise ({remainder.scatter:.3g} σ RMS): {remainder_words(verdict)}."
    if verdict.gap.noise_rms is None:
        return "The noise is unknown, so the remaining residual cannot be judged."
    return f"White noise: {remainder.scatter:.3g} σ RMS."


def _all_candidates(verdict: Verdict) -> Iterator[str]:
    yield table(_TRIED, candidate_rows(verdict), "All effects that were tried")


def _next(conclusion: Conclusion) -> Iterator[str]:
    if conclusion.next_experiment is not None:
        yield section(NEXT_EXPERIMENT, _proposal(conclusion.next_experiment))


def _proposal(proposal: Proposal) -> Iterator[str]:
    yield paragraph(f"{proposal.summary[:1].upper()}{proposal.summary[1:]}.")
    yield listing(proposal.text, MOST_LINES)
    rows = [[" / ".join(pair), f"{sigmas:.3g}"] for pair, sigmas in proposal.pairs.items()]
    yield table(("alternatives", "σ"), rows, "Separation of the alternatives")


def _provenance(conclusion: Conclusion) -> Iterator[str]:
    system = conclusion.system
    versions = ", ".join(f"{name} {version(name)}" for name in ("mopro", "numpy", "scipy"))
    yield table(
        (),
        [
            ["experiment", _name(conclusion)],
            ["machine", system.name],
            ["samples", str(sum(map(len, system.series)))],
            ["made by", f"{versions}, Python {platform.python_version()}"],
        ],
        "Origin",
    )
    for note in system.notes:
        yield paragraph(note)
    yield heading("The experiment's file", 3)
    yield listing(system.source.text)
    yield heading("The machine file with the effects found", 3)
    yield listing(conclusion.machine_text)
