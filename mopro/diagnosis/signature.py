"""Signatures: the change that one extra simulation shows, and what it promises (score test)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis.fit import Fit
from mopro.diagnosis.model import Candidate, Floats, Leftover, Parameter, Role, Settings
from mopro.diagnosis.residual import Residuals, projected_out

_STARTS_KEPT = 2
_QUARTER_TURN = math.pi / 2
# A signature whose remains beside the others are a smaller share is rounding.
_INDEPENDENT = 1e-6
# A response may bend between sizes this many times apart.
_FAR = 3.0
# Predictions closer than this in chi-squared are one.
_THE_SAME = 1.0
# A probe without an amplitude is what it is; a shape not yet fitted may be off by this.
_MOST_OF_A_SHAPE = 3.0


@dataclass(frozen=True)
class Scored:
    """A candidate's promise: the drop in chi-squared that its signature predicts.

    `starts` are the settings that fit best along the signatures, `group` the probes that
    the first of them comes from, and `explained` is what it would take away.
    """

    candidate: Candidate
    gain: float
    starts: tuple[Settings, ...]
    explained: NDArray[np.float32]
    group: Group = ()

    def twin_of(self, other: Scored) -> bool:
        """Whether both would take the same away, within what noise hides."""
        return float(np.sum((self.explained - other.explained) ** 2)) < _THE_SAME


@dataclass(frozen=True)
class Probe:
    """Settings to try a candidate at, and the whitened change that they make.

    `moved` names what was set away from its null: an amplitude, and the angle it has.
    """

    values: Mapping[str, float]
    moved: tuple[str, str | None]
    change: Floats


# Probes whose changes add up: one for each amplitude and each quarter of an angle.
Group = tuple[Probe, ...]


def signatures(residuals: Residuals, base: Fit, candidate: Candidate) -> list[Group]:
    """One group of probes for each combination of the shapes' starts, at `base`."""

    def probe(values: dict[str, float], moved: tuple[str, str | None]) -> Probe:
        settings = {**base.settings, **candidate.settings(values)}
        return Probe(values, moved, base.residual - residuals.at(settings))

    return [tuple(probe(values, moved) for values, moved in group) for group in _groups(candidate)]


def _groups(
    candidate: Candidate,
) -> Iterator[list[tuple[dict[str, float], tuple[str, str | None]]]]:
    own = candidate.parameters
    amplitudes = [p for p in own if p.role is Role.AMPLITUDE]
    shapes = [p for p in own if p.role in (Role.SHAPE, Role.HELD)]
    phases = [p for p in own if p.role is Role.PHASE]
    null = {p.name: p.null for p in amplitudes} | {p.name: 0.0 for p in phases}
    for shape in product(*(p.starts for p in shapes)):
        form = null | {p.name: v for p, v in zip(shapes, shape, strict=True)}
        if not amplitudes:
            yield [(form, ("", None))]
        for sizes in _sizes(amplitudes):
            for turns in _turns(phases):
                yield [
                    (form | {name: size} | turned, (name, angle))
                    for name, size in sizes.items()
                    for turned, angle in turns
                ]


def _sizes(amplitudes: Sequence[Parameter]) -> list[dict[str, float]]:
    """A single amplitude is tried at each of its starts, several together at their first."""
    if len(amplitudes) == 1:
        return [{amplitudes[0].name: start} for start in amplitudes[0].starts]
    if not amplitudes or not all(p.starts for p in amplitudes):
        return []
    return [{p.name: p.starts[0] for p in amplitudes}]


def _turns(phases: Sequence[Parameter]) -> list[list[tuple[dict[str, float], str | None]]]:
    """A quarter turn from each start of an angle: what lies between adds up of the two."""
    if not phases:
        return [[({}, None)]]
    (phase,) = phases
    return [
        [({phase.name: start}, phase.name), ({phase.name: start + _QUARTER_TURN}, phase.name)]
        for start in phase.starts or (0.0,)
    ]


def score(base: Fit, tangent: Floats, candidate: Candidate, groups: Sequence[Group]) -> Scored:
    """How much of what `base` leaves the signatures take away, free in size.

    `tangent` is an orthonormal basis of what the effects of `base` can move themselves.
    """
    trials = [(*_trial(base.residual, tangent, candidate, group), group) for group in groups]
    trials.sort(key=lambda trial: -trial[0])
    kept = [trial for trial in trials[:_STARTS_KEPT] if trial[0] > 0]
    if not kept:
        return Scored(candidate, 0.0, (), np.zeros(0, dtype=np.float32))
    starts = tuple(candidate.settings(values) for _, values, _, _ in kept)
    gain, _, explained, group = kept[0]
    return Scored(candidate, gain, starts, explained.astype(np.float32), group)


def _trial(
    left: Floats, tangent: Floats, candidate: Candidate, group: Group
) -> tuple[float, dict[str, float], Floats]:
    """The gain, the settings that it comes from, and what they would take away."""
    changes = np.array([probe.change for probe in group]).T
    apart = projected_out(tangent, changes)
    strengths, whole = np.linalg.norm(apart, axis=0), np.linalg.norm(changes, axis=0)
    seen = strengths > _INDEPENDENT * np.maximum(whole, 1e-300)
    sizes = np.zeros(len(group))
    if len(group) == 1 and seen[0]:
        sizes[0] = float(apart[:, 0] @ left) / float(strengths[0]) ** 2
    elif seen.any():
        sizes[seen] = np.linalg.lstsq(apart[:, seen], left, rcond=1e-6)[0]
    values, sizes = resized(candidate, group, sizes)
    explained = apart @ sizes
    return float(2 * explained @ left - explained @ explained), values, explained


def resized(candidate: Candidate, group: Group, sizes: Floats) -> tuple[dict[str, float], Floats]:
    """The start that `sizes` times the probes come to, and the sizes that its range allows."""
    values = dict(group[0].values)
    by_name = {p.name: p for p in candidate.parameters}
    allowed = sizes.copy()
    if group[0].moved[0] == "":
        allowed = np.clip(sizes, 0.0, _MOST_OF_A_SHAPE)
    for name in {probe.moved[0] for probe in group} - {""}:
        own = [i for i, probe in enumerate(group) if probe.moved[0] == name]
        parameter, angle = by_name[name], group[own[0]].moved[1]
        probed = group[own[0]].values[name]
        size = float(np.hypot(*sizes[own])) if angle else float(sizes[own[0]])
        values[name] = parameter.within(parameter.grown(probed, size))
        if angle:
            turned = np.arctan2(sizes[own[1]], sizes[own[0]])
            values[angle] = math.remainder(group[own[0]].values[angle] + turned, math.tau)
        if size:
            allowed[own] *= parameter.size(values[name], of=probed) / size
    return values, allowed


def far_from_probes(scored: Scored) -> bool:
    """Whether the best start is of quite another size than what was simulated for it."""
    amplitudes = [p for p in scored.candidate.parameters if p.role is Role.AMPLITUDE]
    if len(amplitudes) != 1 or not scored.starts:
        return False
    (own,) = amplitudes
    value, probed = (
        values[own.name] for values in (scored.starts[0][scored.candidate.name],
                                        scored.group[0].values)
    )  # fmt: skip
    if own.null in (value, probed):
        return value != own.null
    return not 1 / _FAR < abs(own.size(value, of=probed)) < _FAR


def probed_at(residuals: Residuals, at: Fit, candidate: Candidate, start: Settings) -> Group:
    """The signature of a candidate at the size and shape of `start`."""
    values = dict(start[candidate.name])
    amplitude = next(p.name for p in candidate.parameters if p.role is Role.AMPLITUDE)
    change = at.residual - residuals.at({**at.settings, **start})
    return (Probe(values, (amplitude, None), change),)


def sought(residuals: Residuals, base: Fit, candidate: Candidate) -> list[Group]:
    """What the candidate's own search finds in what `base` leaves, each as a probe."""
    if candidate.seek is None:
        return []
    predicted = residuals.predicted(base.settings)
    whole = (residuals.measured - predicted) * residuals.weights
    left = Leftover(
        residuals.data,
        residuals.split(projected_out(residuals.basis, whole)),
        residuals.sigmas,
        residuals.split(predicted),
        base.settings,
        lambda settings: float(np.sum(residuals.at({**base.settings, **settings}) ** 2)),
    )
    amplitude = next((p for p in candidate.parameters if p.role is Role.AMPLITUDE), None)
    moved = amplitude.name if amplitude else ""

    def probe(values: Mapping[str, float]) -> Probe:
        settings = {**base.settings, **candidate.settings(values)}
        return Probe(dict(values), (moved, None), base.residual - residuals.at(settings))

    def nearer(found: Probe) -> Probe:
        """As it was found, not to be resized, where the size that it asks for leaves more."""
        strength = float(found.change @ found.change)
        if amplitude is None or not strength:
            return found
        size = np.array([float(found.change @ base.residual) / strength])
        values = resized(candidate, (found,), size)[0]
        # Its range may allow none of what it asks for.
        if values[amplitude.name] == amplitude.null:
            return found
        other = probe(values)
        by_found, by_other = (base.residual - p.change for p in (found, other))
        closer = float(by_other @ by_other) < float(by_found @ by_found)
        return other if closer else replace(found, moved=("", None))

    return [(nearer(probe(values)),) for values in candidate.seek(left)]
