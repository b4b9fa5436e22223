"""Cross-validation: parts of the data predicted from fits of the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mopro.engine.assumed import (
    FEWEST,
    LEAST_SAMPLES,
    LEAST_SHARE,
    MOST_CONDITION,
    MOST_FOLDS,
    ROUNDING,
    TINY,
)
from mopro.engine.candidate import Candidate, Role
from mopro.engine.fits.fit import Fit, least_squares_fit
from mopro.engine.fits.jacobian import bounded_step
from mopro.engine.residuals import Noise, Residuals, projected_out
from mopro.engine.series import Floats, Mask

# Samples up to which each fold's parameters are refitted. Beyond, a fold has enough samples to be
# a small change: one Gauss-Newton step from the fit of all data is close.
_FEW_SAMPLES = MOST_FOLDS * LEAST_SAMPLES


# What was held out: whole runs alone, or parts of runs too, which share the accidents of their run.
OTHER_RUNS, ONE_RUN = "other runs", "within one run"


@dataclass(frozen=True)
class HeldOut:
    """Parts that were not fitted: how well they are predicted with and without each effect.

    `on`: OTHER_RUNS if all of them are whole runs, else ONE_RUN. `residual`: whitened residual of
    the fit (samples); `before`: its mean square for the null model, `after` for the fit. `gains`:
    fall of the deviance of the held-out parts by each effect, by how well the others tell its
    numbers. These parts are whole runs but where one nearly alone tells of that effect; a flexible
    effect is judged without the run that supports it most, as it fits what one happens to do.
    """

    on: str
    before: float
    after: float
    gains: Mapping[str, float]
    residual: Floats

    def supports(self, effect: str) -> bool:
        """True if the held-out parts are predicted better with `effect` than without it."""
        return bool(self.gains[effect] > 0)


def held_out(
    residuals: Residuals, noise: Noise, null: Fit, fit: Fit, without: Mapping[str, Fit]
) -> HeldOut | None:
    """Each fold predicted from the others, by the null model, `fit`, and `fit` `without` each.

    None where there are too few samples for two.
    """
    runs = _whole_runs(residuals)
    shown = _by_parts(residuals, fit, runs, [c for c in fit.candidates if not c.flexible])
    divided = {c.name: _by_parts(residuals, fit, runs, [c]) for c in fit.candidates}
    folds = {own: list(_folds(residuals, fit, runs, own)) for own in {shown, *divided.values()}}
    if len(masks := folds[shown]) == 1:
        return None
    predicted = {own: _predicted(residuals, fit, folds[own]) for own in folds}
    sized = {effect for effect, p in fit.order if p.role is Role.AMPLITUDE}
    flexible = {c.name for c in fit.candidates if c.flexible} & sized
    recurring = {name for name in flexible if not any(divided[name])}

    def gain(name: str, other: Fit) -> float:
        own = divided[name]
        before = _scaled(other, folds[own], _predicted(residuals, other, folds[own]))
        after = _scaled(fit, folds[own], predicted[own])
        return _gain(noise, folds[own], before, after, recurring=name in recurring)

    return HeldOut(
        on=ONE_RUN if any(shown) else OTHER_RUNS,
        before=_mean_square(_predicted(residuals, null, masks)),
        after=_mean_square(predicted[shown]),
        gains={name: gain(name, other) for name, other in without.items()},
        residual=predicted[shown],
    )


@dataclass(frozen=True)
class _Scaled:
    """Residual (samples) of held-out parts, each scaled to what its prediction is known to.

    `log_scales` (parts): the logarithms of the determinants of the scales, which the deviance has
    more.
    """

    residual: Floats
    log_scales: Floats


def _scaled(fit: Fit, masks: Sequence[Mask], residual: Floats) -> _Scaled:
    """The residual of parts that were predicted by a fit of the others.

    A prediction is off by its noise and by what the others leave open of the parameters: of the
    covariance I + J C J', J the Jacobian in the part, C the covariance of the parameters by the
    other parts and by their ranges. So a part that alone tells of an effect has no veto against it,
    and is no witness either.
    """
    spans = np.array([p.high - p.low for _, p in fit.order])
    if not len(spans):
        return _Scaled(residual, np.zeros(len(masks)))
    scaled = fit.jacobian * spans
    inner = [scaled[mask].T @ scaled[mask] for mask in masks]
    left, log_scales = residual.copy(), np.zeros(len(masks))
    for number, mask in enumerate(masks):
        others = sum(inner[:number] + inner[number + 1 :], np.eye(len(spans)))
        root = _inverse_root(others)
        power, ways = np.linalg.eigh(root.T @ inner[number] @ root)
        open_ = power > ROUNDING
        power = power[open_]
        along = scaled[mask] @ (root @ ways[:, open_]) / np.sqrt(power)
        left[mask] += along @ ((1 / np.sqrt(1 + power) - 1) * (along.T @ left[mask]))
        log_scales[number] = np.log1p(power).sum()
    return _Scaled(left, log_scales)


def _inverse_root(matrix: Floats) -> Floats:
    """A matrix R with R R' the inverse of a positive `matrix`, where that can be told."""
    scale = 1 / np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    root: Floats = scale[:, None] * vectors / np.sqrt(np.maximum(values, 1 / MOST_CONDITION))
    return root


def _gain(
    noise: Noise, masks: Sequence[Mask], without: _Scaled, after: _Scaled, *, recurring: bool
) -> float:
    """Fall of the deviance of held-out parts by an effect; negative where it predicts worse.

    It must lower the deviance and the mean square; the part that is predicted worst with and
    without it, such as a move that is cut off, does not count in the latter. An effect that is to
    be `recurring` gains what it does without the part that gains most.
    """
    sums = (np.square(without.residual), np.square(after.residual))
    parts = [(float(sums[0][m].sum()), float(sums[1][m].sum()), m) for m in masks]
    if len(parts) > FEWEST:
        worst = max(range(len(parts)), key=lambda i: min(parts[i][:2]) / parts[i][2].sum())
        del parts[worst]
    gains = _deviances(noise, masks, without.residual) - _deviances(noise, masks, after.residual)
    gains += without.log_scales - after.log_scales
    gain = float(gains.sum() - max(gains.max(), 0.0) if recurring else gains.sum())
    fall = sum(before - left for before, left, _ in parts)
    return gain if fall > 0 else min(gain, fall)


def parts_of(residuals: Residuals, most: int = MOST_FOLDS) -> list[Mask]:
    """Masks (samples) of the parts of the data: the moves of each run, as given.

    All sensors of a run have the same parts, which are joined so that there are `most` at the most.
    """
    labels: list[NDArray[np.int64]] = []
    numbers: dict[tuple[str, int], int] = {}
    for series in residuals.data:
        own = np.zeros(len(series), int) if series.folds is None else np.asarray(series.folds)
        moves, inverse = np.unique(own, return_inverse=True)
        known = [numbers.setdefault((series.run, int(move)), len(numbers)) for move in moves]
        labels.append(np.array(known)[inverse])
    joined = np.concatenate(labels)
    if len(numbers) > most:
        joined = joined % most
    return [joined == label for label in np.unique(joined)]


def _whole_runs(residuals: Residuals) -> list[Mask]:
    """Masks (samples) of the runs, joined so that there are MOST_FOLDS at the most.

    Runs of one record are one: they share its accidents.
    """
    records = [series.record or series.run for series in residuals.data]
    number = {record: i % MOST_FOLDS for i, record in enumerate(dict.fromkeys(records))}
    lengths = map(len, residuals.data)
    labels = np.concatenate(
        [np.full(n, number[own]) for own, n in zip(records, lengths, strict=True)]
    )
    return [labels == label for label in np.unique(labels)]


def _by_parts(
    residuals: Residuals, fit: Fit, runs: Sequence[Mask], asked: Sequence[Candidate]
) -> tuple[bool, ...]:
    """For each run whether it is held out by its parts, and not as a whole, to judge `asked`.

    The only run is, and one that nearly alone tells of a parameter of theirs: no other run predicts
    what the effect does there. Of an effect `of_run_time` another run must.
    """
    if len(runs) == 1:
        return (True,)
    told = [c for c in asked if not c.of_run_time]
    return tuple(_told_alone(residuals, fit, run, told) is not None for run in runs)


def _folds(
    residuals: Residuals, fit: Fit, runs: Sequence[Mask], by_parts: Sequence[bool]
) -> Iterator[Mask]:
    """Masks (samples) of what is held out: whole `runs`, and those `by_parts` part by part."""
    parts = parts_of(residuals)
    for run, divided in zip(runs, by_parts, strict=True):
        own = [part & run for part in parts if (part & run).any()]
        if not divided:
            yield run
        elif len(runs) == len(own) == 1:
            yield from _chunks(run, np.ones(len(run)))
        else:
            yield from _divided(residuals, own, fit)


def _divided(residuals: Residuals, masks: Sequence[Mask], fit: Fit) -> Iterator[Mask]:
    """The parts; one that nearly alone tells of a parameter is cut in time.

    An effect that shows in a single move can only be predicted from the rest of that move.
    """
    for mask in masks:
        few = len(mask) <= _FEW_SAMPLES
        rigid = [c for c in fit.candidates if not c.flexible]
        slope = None if few else _told_alone(residuals, fit, mask, rigid)
        yield from [mask] if slope is None else _chunks(mask, slope)


def _told_alone(
    residuals: Residuals, fit: Fit, mask: Mask, asked: Sequence[Candidate]
) -> Floats | None:
    """The slope (samples) of the parameter that next to nothing outside `mask` tells of, if any.

    Of the effects `asked`; of a flexible one a size, as the shape follows from any part.
    """
    flexible = {c.name: c.flexible for c in asked}
    columns = [
        i
        for i, (effect, p) in enumerate(fit.order)
        if effect in flexible and (p.role is Role.AMPLITUDE or not flexible[effect])
    ]
    if not columns:
        return None
    jacobian = fit.jacobian[:, columns]
    whole = np.maximum(np.sum(jacobian**2, axis=0), TINY)
    others = projected_out(residuals.nuisance_basis(~mask), jacobian[~mask])
    information = np.sum(others**2, axis=0) / whole
    least = int(np.argmin(information))
    return jacobian[:, least] if information[least] <= LEAST_SHARE else None


def _chunks(mask: Mask, slope: Floats) -> Iterator[Mask]:
    """`mask` cut in time into chunks of equal information on the parameter of `slope`."""
    samples = np.flatnonzero(mask)
    so_far = np.cumsum(slope[samples] ** 2)
    number_of = np.minimum(FEWEST * so_far / max(so_far[-1], TINY), FEWEST - 1).astype(int)
    for number in np.unique(number_of):
        chunk = np.zeros_like(mask)
        chunk[samples[number_of == number]] = True
        yield chunk


def _mean_square(residual: Floats) -> float:
    return float(np.mean(residual**2))


def _deviances(noise: Noise, masks: Sequence[Mask], residual: Floats) -> Floats:
    """Deviance of each held-out part, the size of the noise estimated in each of its series.

    A part that no set of effects predicts (a move that is cut off) hardly counts, as its
    deviance grows with the logarithm of its residual.
    """
    totals = np.zeros(len(masks))
    lengths = np.diff([*noise.starts, len(residual)])
    samples = np.repeat(noise.samples / lengths, lengths)
    least = np.repeat(noise.floor, lengths)
    series = np.repeat(np.arange(len(lengths)), lengths)
    for nth, mask in enumerate(masks):
        for number in np.unique(series[mask]):
            part = mask & (series == number)
            mean = max(float(np.mean(residual[part] ** 2)), TINY)
            variance = max(mean, float(least[part][0]))
            totals[nth] += float(samples[part].sum()) * (np.log(variance) + mean / variance)
    return totals


def _predicted(residuals: Residuals, fit: Fit, masks: Sequence[Mask]) -> Floats:
    """Whitened residual of all samples, each fold's from a fit of the others."""
    residual = np.empty(len(residuals.measured))
    predict = _by_refit if len(residual) <= _FEW_SAMPLES else _by_step
    for mask in masks:
        residual[mask] = predict(residuals, fit, mask)
    return residual


def _by_refit(residuals: Residuals, fit: Fit, mask: Mask) -> Floats:
    """Residual of the fold after a fit of the other folds."""
    settings = fit.settings
    base = [_frozen(own, fit, _of_the_fold(fit, fit.jacobian, mask)) for own in fit.base]
    if fit.candidates or any(own.parameters for own in base):
        others = residuals.subset(~mask)
        settings = least_squares_fit(others, fit.candidates, [settings], base=base).settings
    none = np.zeros((len(mask), 0))
    return _extrapolated(residuals, residuals.at(settings), none, none[:2], mask)


def _by_step(residuals: Residuals, fit: Fit, mask: Mask) -> Floats:
    """Residual of the fold after one Gauss-Newton step to the fit of the other folds."""
    fitted = ~_of_the_fold(fit, fit.jacobian, mask)
    jacobian, room = fit.jacobian[:, fitted], _room(fit)[:, fitted]
    return _extrapolated(residuals, fit.residual, jacobian, room, mask)


def _room(fit: Fit) -> Floats:
    """Steps (2 x parameters) that lead to the lower and the upper end of each parameter's range.

    An angle has none.
    """
    ranges = [(-np.inf, np.inf) if p.role is Role.PHASE else (p.low, p.high) for _, p in fit.order]
    return np.array(ranges).reshape(-1, 2).T - fit.values


def _of_the_fold(fit: Fit, jacobian: Floats, mask: Mask) -> Mask:
    """The columns of the model's free numbers that the other folds tell next to nothing of."""
    base = {c.name for c in fit.base}
    outside, whole = (np.sum(jacobian[rows] ** 2, axis=0) for rows in (~mask, slice(None)))
    unknown = outside <= LEAST_SHARE * whole
    answer: Mask = np.array([name in base for name, _ in fit.order], dtype=bool) & unknown
    return answer


def _frozen(base: Candidate, fit: Fit, frozen: Mask) -> Candidate:
    """`base` with the numbers of the `frozen` columns fixed where `fit` has them."""
    names = {p.name for (_, p), own in zip(fit.order, frozen, strict=True) if own}
    fixed = {name: fit.settings[base.name][name] for name in sorted(names)}
    parameters = tuple(p for p in base.parameters if p.name not in names)
    return replace(base, parameters=parameters, fixed={**base.fixed, **fixed})


def _extrapolated(
    residuals: Residuals, residual: Floats, jacobian: Floats, room: Floats, mask: Mask
) -> Floats:
    """`residual` of the fold, parameters and nuisances fitted to the others (one linear step).

    `room`: the least and the greatest step (2 x parameters) of each parameter. A nuisance that
    the other folds tell nothing of, as that of a run that is held out as a whole, is fitted in the
    fold.
    """
    basis = residuals.basis
    outside = np.sum(basis[~mask] ** 2, axis=0)
    known, own = basis[:, outside >= LEAST_SHARE], basis[:, outside < LEAST_SHARE]
    columns = np.hstack([jacobian, known])
    left = residual[mask]
    if columns.shape[1]:
        others, _ = np.linalg.qr(own[~mask]) if own.shape[1] else (own[~mask], None)
        fitted = projected_out(others, columns[~mask])
        free = np.tile([[-np.inf], [np.inf]], known.shape[1])
        ends = np.hstack([room, free])
        step = bounded_step(fitted, projected_out(others, residual[~mask]), ends)
        left = left + columns[mask] @ step
    if own.shape[1]:
        inner, _ = np.linalg.qr(own[mask])
        left = projected_out(inner, left)
    return left
