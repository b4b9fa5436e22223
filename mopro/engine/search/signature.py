"""Signatures: the change that one simulation with a candidate shows, and its score test."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mopro.engine.assumed import (
    LEAST_SHARE,
    LINEARITY_ERROR,
    PROPORTIONAL,
    ROUNDING,
    SAME,
    SECOND_GUESSES,
)
from mopro.engine.candidate import Candidate, Parameter, ResidualView, Role
from mopro.engine.fits import Fit
from mopro.engine.residuals import Residuals, projected_out
from mopro.engine.series import Floats, Settings

_QUARTER_TURN = math.pi / 2

# The amplitude that a probe sets away from its null ("" if there is none), and its angle.
Moved = tuple[str, str | None]


@dataclass(frozen=True)
class ScoreTest:
    """Score test of a candidate: the fall of chi-squared that its signature predicts.

    `predicted_reduction`: that fall, with the size of the effect free. `starts`: the settings
    with the largest predicted reductions, best first. `group`: the probes that the first of
    them comes from. `explained`: the part of the whitened residual (samples) that it would
    take away.
    """

    candidate: Candidate
    predicted_reduction: float
    starts: tuple[Settings, ...]
    explained: NDArray[np.float32]
    group: Group = ()

    def alike(self, other: ScoreTest) -> bool:
        """True if both would take away the same to within 2 % of it, or 1 in chi-squared."""
        if not self.starts or not other.starts:
            return False
        error = LINEARITY_ERROR * min(self.predicted_reduction, other.predicted_reduction)
        return float(np.sum((self.explained - other.explained) ** 2)) < max(SAME, error)


@dataclass(frozen=True)
class Probe:
    """Values of a candidate's parameters, and the whitened change that they make (samples).

    `moved` names what was set away from its null: an amplitude, and the angle it has.
    """

    values: Mapping[str, float]
    moved: Moved
    change: Floats

    @cached_property
    def square(self) -> float:
        """Sum of squares of the change."""
        return float(self.change @ self.change)


# Probes whose changes add up: one for each amplitude and each quarter turn of an angle.
Group = tuple[Probe, ...]


def signatures(residuals: Residuals, base: Fit, candidate: Candidate) -> list[Group]:
    """One group of probes for each combination of the shapes' starts, at `base`."""

    def probe(values: dict[str, float], moved: Moved) -> Probe:
        settings = {**base.settings, **candidate.settings(values)}
        return Probe(values, moved, -residuals.change(base.settings, settings))

    return [tuple(probe(values, moved) for values, moved in group) for group in _groups(candidate)]


def beside(residuals: Residuals, base: Fit, candidate: Candidate, known: Group) -> Group:
    """The probes of a known group of a candidate, simulated at `base`."""

    def probe(own: Probe) -> Probe:
        settings = {**base.settings, **candidate.settings(own.values)}
        return replace(own, change=-residuals.change(base.settings, settings))

    return tuple(map(probe, known))


def _groups(candidate: Candidate) -> Iterator[list[tuple[dict[str, float], Moved]]]:
    own = candidate.parameters
    amplitudes = [p for p in own if p.role is Role.AMPLITUDE]
    shapes = [p for p in own if p.role in (Role.SHAPE, Role.SEARCHED, Role.CONSTANT)]
    phases = [p for p in own if p.role is Role.PHASE]
    null = {p.name: p.null for p in amplitudes} | {p.name: 0.0 for p in phases}
    for shape in product(*(p.starts for p in shapes)):
        values = null | {p.name: v for p, v in zip(shapes, shape, strict=True)}
        if not amplitudes:
            yield [(values, ("", None))]
        for sizes in _sizes(amplitudes):
            for turns in _turns(phases):
                yield [
                    (values | {name: size} | turned, (name, angle))
                    for name, size in sizes.items()
                    for turned, angle in turns
                ]


def _sizes(amplitudes: Sequence[Parameter]) -> list[dict[str, float]]:
    """A single amplitude at each of its starts; several together at their first."""
    if len(amplitudes) == 1:
        return [{amplitudes[0].name: start} for start in amplitudes[0].starts]
    if not amplitudes or not all(p.starts for p in amplitudes):
        return []
    return [{p.name: p.starts[0] for p in amplitudes}]


def _turns(phases: Sequence[Parameter]) -> list[list[tuple[dict[str, float], str | None]]]:
    """Each start of an angle and a quarter turn on: angles between are their combinations."""
    if not phases:
        return [[({}, None)]]
    (phase,) = phases
    return [
        [({phase.name: start}, phase.name), ({phase.name: start + _QUARTER_TURN}, phase.name)]
        for start in phase.starts or (0.0,)
    ]


def score_test(base: Fit, candidate: Candidate, groups: Sequence[Group]) -> ScoreTest:
    """Fall of chi-squared below that of `base` if the signatures are added, free in size.

    Its Jacobian is projected out, so that the effects in it may adapt.
    """
    trials = [_trial(base, candidate, group) for group in groups]
    trials.sort(key=lambda trial: -trial.reduction)
    best = [trial for trial in trials[:SECOND_GUESSES] if trial.reduction > 0]
    if not best:
        # It may still lower chi-squared beside another effect.
        group = trials[0].group if trials else ()
        return ScoreTest(candidate, 0.0, (), np.zeros(0, dtype=np.float32), group)
    starts = tuple(candidate.settings(trial.values) for trial in best)
    changes = np.column_stack([probe.change for probe in best[0].group])
    explained = projected_out(base.tangent, changes @ best[0].sizes)
    return ScoreTest(
        candidate, best[0].reduction, starts, explained.astype(np.float32), best[0].group
    )


@dataclass(frozen=True)
class _Trial:
    """Predicted reduction by one group of probes, at these sizes of them: parameter values."""

    group: Group
    reduction: float
    values: Mapping[str, float]
    sizes: Floats


def _trial(base: Fit, candidate: Candidate, group: Group) -> _Trial:
    """The reduction by a group, from products alone: projecting each change out takes longer."""
    changes = [probe.change for probe in group]
    whole = np.array([[one @ other for other in changes] for one in changes])
    absorbed = np.array([change @ base.tangent for change in changes])
    gram = whole - absorbed @ absorbed.T
    product = np.array([change @ base.adapted for change in changes])
    seen = np.diag(gram) > ROUNDING * np.diag(whole)
    sizes = np.zeros(len(group))
    if seen.any():
        inverse = np.linalg.pinv(gram[np.ix_(seen, seen)], rcond=ROUNDING, hermitian=True)
        sizes[seen] = inverse @ product[seen]
    values, sizes = resized(candidate, group, sizes)
    return _Trial(group, float(2 * sizes @ product - sizes @ gram @ sizes), values, sizes)


def resized(candidate: Candidate, group: Group, sizes: Floats) -> tuple[dict[str, float], Floats]:
    """Parameter values at `sizes` times the probes, and the sizes that their ranges allow."""
    values = dict(group[0].values)
    by_name = {p.name: p for p in candidate.parameters}
    allowed = sizes.copy()
    if group[0].moved[0] == "":
        allowed = np.clip(sizes, 0.0, PROPORTIONAL)
    for name in dict.fromkeys(probe.moved[0] for probe in group if probe.moved[0]):
        own = [i for i, probe in enumerate(group) if probe.moved[0] == name]
        parameter, angle = by_name[name], group[own[0]].moved[1]
        probed = group[own[0]].values[name]
        size = float(np.hypot(*sizes[own])) if angle else float(sizes[own[0]])
        values[name] = parameter.within(parameter.multiplied(probed, size))
        if angle:
            turned = np.arctan2(sizes[own[1]], sizes[own[0]])
            values[angle] = math.remainder(group[own[0]].values[angle] + turned, math.tau)
        if size:
            allowed[own] *= parameter.factor(values[name], of=probed) / size
    return values, allowed


def alike(one: Probe, other: Probe) -> bool:
    """True if the changes of two probes are multiples of each other, as far as they are linear."""
    product = float(one.change @ other.change) ** 2
    return product > (1 - LINEARITY_ERROR**2) * one.square * other.square


def far_from_probes(score: ScoreTest) -> bool:
    """True if the amplitude of the best start is no more in proportion to the probed one."""
    amplitudes = [p for p in score.candidate.parameters if p.role is Role.AMPLITUDE]
    if len(amplitudes) != 1 or not score.starts:
        return False
    (own,) = amplitudes
    value = score.starts[0][score.candidate.name][own.name]
    probed = score.group[0].values[own.name]
    if own.null in (value, probed):
        return value != own.null
    return not 1 / PROPORTIONAL < abs(own.factor(value, of=probed)) < PROPORTIONAL


def probed_at(residuals: Residuals, base: Fit, candidate: Candidate, start: Settings) -> Group:
    """The signature of a candidate at the size and shape of `start`, beside `base`."""
    values = dict(start[candidate.name])
    amplitude = next(p.name for p in candidate.parameters if p.role is Role.AMPLITUDE)
    change = -residuals.change(base.settings, {**base.settings, **start})
    return (Probe(values, (amplitude, None), change),)


def unabsorbed(
    residuals: Residuals, at: Fit, base: Fit, candidate: Candidate, group: Group
) -> list[Group]:
    """`group` at a fiftieth of its size, if the model's free numbers make up for most of it.

    The error of proportion, a share of the whole, is then over a tenth of what they leave.
    """
    probe, parameters = group[0], {p.name: p for p in candidate.parameters}
    own = parameters.get(probe.moved[0])
    if not base.base or len(group) > 1 or own is None:
        return []
    left = projected_out(base.tangent, probe.change)
    if left @ left > (LINEARITY_ERROR / LEAST_SHARE) ** 2 * probe.square:
        return []
    values = {**probe.values, own.name: own.multiplied(probe.values[own.name], LINEARITY_ERROR)}
    return [probed_at(residuals, at, candidate, candidate.settings(values))]


def searched(residuals: Residuals, null: Fit, base: Fit, candidate: Candidate) -> list[Group]:
    """The starts that the candidate's own search finds in the residual of `base`, as probes.

    `null`: the fit without effects. None in the residual of a model that has run away, nor where a
    search finds no finite number.
    """
    if candidate.find_starts is None:
        return []
    amplitude = next((p for p in candidate.parameters if p.role is Role.AMPLITUDE), None)
    moved = amplitude.name if amplitude else ""

    def probe(values: Mapping[str, float]) -> Probe:
        settings = {**base.settings, **candidate.settings(values)}
        return Probe(dict(values), (moved, None), -residuals.change(base.settings, settings))

    def as_found_or_resized(start: Probe) -> Probe:
        """The start, fixed in size where the size that its signature asks for leaves more."""
        strength = float(start.change @ start.change)
        if amplitude is None or not strength:
            return start
        size = np.array([float(start.change @ base.residual) / strength])
        values = resized(candidate, (start,), size)[0]
        # The range may not allow any of the size that was asked for.
        if values[amplitude.name] == amplitude.null:
            return start
        other = probe(values)
        by_start, by_other = (base.residual - p.change for p in (start, other))
        lower = float(by_other @ by_other) < float(by_start @ by_start)
        return other if lower else replace(start, moved=("", None))

    view = _view(residuals, null, base)
    if not all(np.isfinite(own).all() for own in view.residuals):
        return []
    starts = (s for s in candidate.find_starts(view) if all(map(math.isfinite, s.values())))
    return [(as_found_or_resized(probe(values)),) for values in starts]


def _view(residuals: Residuals, null: Fit, base: Fit) -> ResidualView:
    predicted = residuals.predicted(base.settings)
    whitened = (residuals.measured - predicted) * residuals.weights

    def rss(settings: Settings) -> float:
        change = residuals.change(base.settings, {**base.settings, **settings})
        return float(np.sum((base.residual + change) ** 2))

    return ResidualView(
        residuals.data,
        residuals.split(residuals.white(projected_out(residuals.basis, whitened))),
        residuals.sigmas,
        residuals.split(predicted),
        residuals.split(base.tangent),
        base.settings_without(base.laws),
        rss,
        lambda settings: residuals.change(null.settings, {**null.settings, **settings}),
    )
