"""The answer of the engine, from the final fit: effects, alternatives, gaps, what is not seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from mopro.engine.candidate import Candidate
from mopro.engine.fits import Fit, HeldOut
from mopro.engine.residuals import Corrected, Remainder
from mopro.engine.search.alternatives import Alternative, alike
from mopro.engine.search.hypotheses import Hypotheses
from mopro.engine.search.screening import Screening
from mopro.engine.series import Floats, Settings
from mopro.engine.sizes import Sizes
from mopro.engine.state import State
from mopro.engine.verdict import (
    Alike,
    BelowResolution,
    Draft,
    Estimate,
    Explained,
    Gap,
    Named,
    Rejected,
    RunGap,
    Signature,
    Verdict,
    Where,
    rms,
)

_NO_EVIDENCE = "lowers chi-squared by less than the penalty of its parameters"
_NO_LOWER = "is predicted to lower chi-squared, but no fitted set with it has a lower EBIC"


def conclude(state: State) -> Verdict:
    """The verdict on the final state, with all that the evidence says for and against."""
    hypotheses, fit, held, others = state.hypotheses, state.fit, state.held, state.alternatives
    sizes = Sizes.of(state)
    believed = [(c, _named(state, c, sizes)) for c in fit.candidates]
    calibrated = hypotheses.evidence.calibrated
    effects = tuple(effect for c, effect in believed if not calibrated(fit, c))
    dropped = frozenset(r.name for r in state.rejected)
    unseen, rejected = _not_found(hypotheses, state.screening, fit, dropped)
    alone, held_alone = _without_drafts(state)
    gap, rival = (
        _gap(hypotheses, alone, held_alone),
        [] if state.rival is None else sorted(state.rival.names),
    )
    notes = state.remainder.note, rival and f"{' + '.join(rival)} would do as well"
    return Verdict(
        verdict=_verdict_of(effects, state.remainder, [*others, *filter(None, [state.rival])]),
        effects=effects,
        rejected=(*state.rejected, *rejected),
        below_resolution=unseen,
        where=tuple(Where(r.run, r.sensor, r.before_rms, r.noise_rms) for r in gap.runs),
        gap=gap,
        remainder=state.remainder,
        settings=sizes.settings,
        before=tuple(hypotheses.residuals.in_units(hypotheses.null.residual)),
        after=tuple(hypotheses.residuals.in_units(alone.residual)),
        signatures=tuple(_signature(hypotheses, fit, name) for name in sorted(fit.names)),
        calibration=tuple(effect for c, effect in believed if calibrated(fit, c)),
        sensors=tuple(map(_of_sensor, _corrected(hypotheses, sizes.fit))),
        explained=_explained(hypotheses, alone, held_alone),
        alternatives=tuple(tuple(sorted(other.names)) for other in others),
        base={p: e for c in fit.base for p, e in sizes.estimates(c).items()},
        base_before=hypotheses.null.settings,
        drafts=_drafts(state, sizes),
        notes=(*state.notes, *(note for note in notes if note)),
        nuisances=tuple(_nuisances(hypotheses, sizes.settings)),
        correlations=sizes.correlations(),
        without_drafts=None if sizes.fit.key == fit.key else alone.settings,
        odd_run=state.odd,
        trace=state.trace,
        held_out_on=None if held is None else held.on,
        alike=_alike(state),
    )


def _without_drafts(state: State) -> tuple[Fit, HeldOut | None]:
    """The answer as it is without the drafts, what a machine can have, and held-out parts of it."""
    fit, hypotheses = state.fit, state.hypotheses
    beside = fit if state.drafted is None else hypotheses.beside_single_runs(fit, state.drafted)
    if beside is fit:
        return fit, state.held
    settings = beside.settings_without(beside.names - fit.names)
    alone = replace(fit, settings=settings, residual=hypotheses.residuals.at(settings))
    if (held := hypotheses.held_out(beside)) is None:
        return alone, None
    residual = held.residual + alone.residual - beside.residual
    return alone, replace(held, residual=residual, after=float(np.mean(residual**2)))


def _alike(state: State) -> tuple[Alike, ...]:
    """The sets that predict the same, where what is left is noise, and that are no alternatives."""
    if state.remainder.significant or not state.fit.candidates:
        return ()
    known = {other.names for other in state.alternatives}
    return tuple(
        Alike(other.names, other.delta_ebic, other.settings)
        for other in alike(state.hypotheses, state.fit)
        if other.names not in known
    )


def _verdict_of(
    effects: Sequence[Named], remainder: Remainder, others: Sequence[Alternative | Fit]
) -> str:
    """`unexplained`, `none`, `named`, or `ambiguous` where another set lacks an effect."""
    if remainder.significant:
        return "unexplained"
    if not effects:
        return "none"
    return "named" if all(e.name in o.names for o in others for e in effects) else "ambiguous"


def _named(state: State, candidate: Candidate, sizes: Sizes) -> Named:
    hypotheses, fit, name = state.hypotheses, sizes.fit, candidate.name
    rivals: dict[str, Alternative] = {}
    for other in state.alternatives:
        if name not in other.names:
            for rival in sorted(other.names - state.fit.names):
                rivals.setdefault(rival, other)
    without = hypotheses.without(fit, name)
    rest = sizes.evidence.ebic(without)
    if not math.isfinite(rest):
        # Without it, the period of another one grew to a bend, which explains nothing.
        rest = sizes.evidence.ebic(hypotheses.null)
    return Named(
        name=name,
        form=candidate.form,
        parameters=sizes.estimates(candidate),
        indistinguishable_from=list(rivals),
        rivals={rival: other.delta_ebic for rival, other in rivals.items()},
        alternatives={rival: other.settings for rival, other in rivals.items()},
        log10_bayes_factor=(rest - sizes.evidence.ebic(fit)) / (2 * math.log(10)),
        sigmas=_sigmas(hypotheses, fit, without),
        held_out=sizes.held is not None and sizes.held.supports(name),
        run=candidate.run,
    )


def _sigmas(hypotheses: Hypotheses, fit: Fit, without: Fit) -> float:
    """Root of the fall of chi-squared by an effect, in standard deviations of the noise."""
    return math.sqrt(max(without.rss - fit.rss, 0.0) / hypotheses.scale(fit))


def _drafts(state: State, sizes: Sizes) -> tuple[Draft, ...]:
    """The free-form terms beside the answer or, without any, of what does as well."""
    hypotheses, drafted, held = state.hypotheses, state.drafted or state.rival, state.drafted_held
    if drafted is None:
        return ()
    if sizes.fit.key != drafted.key:
        sizes = Sizes.by(state, drafted, held)
    return tuple(
        Draft(
            name=c.name,
            enters=c.law.enters,
            of=c.law.of,
            law=c.law.formula(drafted.settings[c.name]),
            unit=c.law.unit,
            run=c.law.run,
            sigmas=_sigmas(hypotheses, drafted, hypotheses.without(drafted, c.name)),
            held_out=held is not None and held.supports(c.name),
            parameters=sizes.estimates(c),
        )
        for c in drafted.candidates
        if c.law is not None
    )


def _explained(hypotheses: Hypotheses, fit: Fit, held: HeldOut | None) -> Explained:
    """Share of the excess over the noise that the listed effects take away.

    None where there is no excess.
    """
    noise = hypotheses.noise_rss(fit)
    before = hypotheses.null.rss - noise
    if before <= 0:
        return Explained(None, None)

    def share(rss: float, before: float) -> float:
        return min(max(1 - max(rss - noise, 0.0) / before, 0.0), 1.0)

    held_share = None
    if held is not None:
        samples = len(fit.residual)
        held_before = held.before * samples - noise
        held_share = share(held.after * samples, held_before) if held_before > 0 else None
    return Explained(share(fit.rss, before), held_share)


def _corrected(hypotheses: Hypotheses, fit: Fit) -> tuple[Corrected, ...]:
    return hypotheses.residuals.corrected(fit.residual, fit.jacobian)


def _of_sensor(own: Corrected) -> Named:
    """A sensor's fitted tolerance as a correction of the model; its form is the sensor's name.

    Sizes that are known to within their own tolerance need no held-out part.
    """
    return Named(
        name=own.name,
        form=own.sensor,
        parameters={name: Estimate(*value, at_bound=False) for name, value in own.values.items()},
        indistinguishable_from=[],
        rivals={},
        alternatives={},
        log10_bayes_factor=own.log_bayes / math.log(10),
        sigmas=own.sigmas,
        held_out=False,
    )


def _nuisances(hypotheses: Hypotheses, settings: Settings) -> list[Floats]:
    """Coefficients of the nuisances of each series, in its unit, by least squares."""
    raw = hypotheses.residuals.of_exact_sensors(settings)
    return [
        np.asarray(np.linalg.lstsq(s.nuisance_shapes(), own, rcond=None)[0], dtype=float)
        for s, own in zip(hypotheses.residuals.data, raw, strict=True)
    ]


def _not_found(
    hypotheses: Hypotheses, screening: Screening, fit: Fit, dropped: frozenset[str]
) -> tuple[tuple[BelowResolution, ...], list[Rejected]]:
    """The candidates not in `fit`, nor `dropped` by a pass: those nobody could see, the others.

    An effect is below the resolution of the sensors if the largest plausible one would lower
    chi-squared by less than its penalty.
    """
    unseen: dict[str, BelowResolution] = {}
    rejected: dict[str, Rejected] = {}
    for score in screening.beside(fit, hypotheses.null):
        candidate = score.candidate
        if candidate.law or candidate.name in dropped:
            continue
        expected = screening.expected_sigmas(hypotheses.null, candidate)
        needed = math.sqrt(hypotheses.evidence.added_penalty(fit, [candidate]))
        if expected is not None and expected < needed:
            unseen.setdefault(candidate.name, BelowResolution(candidate.name, expected, needed))
        else:
            reason = _NO_LOWER if score.predicted_reduction >= needed**2 else _NO_EVIDENCE
            answer = Rejected(candidate.name, score.predicted_reduction, reason)
            rejected.setdefault(candidate.name, answer)
    return tuple(unseen.values()), list(rejected.values())


def _signature(hypotheses: Hypotheses, fit: Fit, name: str) -> Signature:
    """Change of the prediction of each series by an effect, nuisances projected out."""
    reduced = hypotheses.without(fit, name)
    change = hypotheses.switched_off(fit, frozenset({name})).residual - fit.residual
    return Signature(name, tuple(hypotheses.residuals.in_units(change)), reduced.rss - fit.rss)


def _counted(hypotheses: Hypotheses, whitened: Floats) -> list[Floats]:
    """The samples of each series that count, in its unit."""
    parts = hypotheses.residuals.in_units(whitened)
    return [own[s.counted] for s, own in zip(hypotheses.residuals.data, parts, strict=True)]


def _gap(hypotheses: Hypotheses, fit: Fit, held: HeldOut | None) -> Gap:
    """RMS residuals of each series, and over all series in the unit of the first."""
    data = hypotheses.residuals.data
    counted = [s.unit == data[0].unit for s in data]
    stated = [s.sigma for s in compress(data, counted) if s.sigma is not None]
    before, after = (_counted(hypotheses, own.residual) for own in (hypotheses.null, fit))
    held_out = None if held is None else _counted(hypotheses, held.residual)
    of_runs = [None] * len(data) if held_out is None else [rms(own) for own in held_out]

    def of(series: Sequence[Floats]) -> float:
        return rms(np.concatenate(list(compress(series, counted))))

    return Gap(
        unit=data[0].unit,
        before_rms=of(before),
        after_rms=of(after),
        noise_rms=rms(np.array(stated)) if stated else None,
        held_out_rms=None if held_out is None else of(held_out),
        runs=tuple(
            RunGap(s.run, s.sensor, s.unit, rms(b), rms(a), h, s.sigma)
            for s, b, a, h in zip(data, before, after, of_runs, strict=True)
        ),
    )
