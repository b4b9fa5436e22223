"""Cross-validation: parts of the data predicted from fits of the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis.fit import Fit, least_squares_fit
from mopro.diagnosis.jacobian import gauss_newton_step
from mopro.diagnosis.model import Floats, Mask
from mopro.diagnosis.residual import Residuals, projected_out

# More folds cost more fits and tell hardly more.
_FEWEST_FOLDS, _MOST_FOLDS = 2, 12
# Samples up to which each fold's parameters are refitted; beyond, one Gauss-Newton step from the
# fit of all data is close, as one fold of many samples changes little.
_FEW_SAMPLES = 1000
# Share of the information on a parameter below which the other folds cannot predict this one,
# which is then cut in time.
_LEAST_INFORMATION = 0.1
# Chunks that such a fold is cut into.
_CHUNKS = 4
# Smallest information, in place of 0, where it divides.
_TINY = 1e-300


@dataclass(frozen=True)
class HeldOut:
    """Mean squares of the whitened residual of parts that were not fitted.

    `before`: of the null model; `after`: of the fit; `without`: of the fit without each effect.
    `residual`: that of the fit (samples).
    """

    before: float
    after: float
    without: dict[str, float]
    residual: Floats

    def supports(self, effect: str) -> bool:
        """True if the held-out parts are predicted better with `effect` than without it."""
        return self.after < self.without[effect]


def held_out(residuals: Residuals, null: Fit, fit: Fit, without: dict[str, Fit]) -> HeldOut | None:
    """Each fold predicted from the others, by the null model, `fit`, and `fit` `without` each.

    None where there is one fold only.
    """
    masks = folds(residuals)
    if len(masks) < _FEWEST_FOLDS:
        return None
    masks = list(_divided(residuals, masks, fit))
    after = _predicted(residuals, fit, masks)
    return HeldOut(
        before=_mean_square(_predicted(residuals, null, masks)),
        after=_mean_square(after),
        without={
            name: _mean_square(_predicted(residuals, other, masks))
            for name, other in without.items()
        },
        residual=after,
    )


def folds(residuals: Residuals) -> list[Mask]:
    """Masks (samples) of the folds: the moves of each run, or whole runs, as given.

    All sensors of a run hold out the same moves together. Moves are joined so that there are
    a dozen folds at most.
    """
    labels: list[NDArray[np.int64]] = []
    numbers: dict[tuple[str, int], int] = {}
    for series in residuals.data:
        own = np.zeros(len(series), int) if series.folds is None else np.asarray(series.folds)
        moves, inverse = np.unique(own, return_inverse=True)
        known = [numbers.setdefault((series.run, int(move)), len(numbers)) for move in moves]
        labels.append(np.array(known)[inverse])
    joined = np.concatenate(labels)
    if len(numbers) > _MOST_FOLDS:
        joined = joined % _MOST_FOLDS
    return [joined == label for label in np.unique(joined)]


def _divided(residuals: Residuals, masks: Sequence[Mask], fit: Fit) -> Iterator[Mask]:
    """The folds; one that holds nearly all information on a parameter is cut in time.

    An effect that shows in a single move can only be predicted from the rest of that move.
    Flexible effects do not count.
    """
    rigid = {candidate.name for candidate in fit.candidates if not candidate.flexible}
    columns = [i for i, (effect, _) in enumerate(fit.order) if effect in rigid]
    jacobian = fit.jacobian[:, columns]
    if not columns or len(jacobian) <= _FEW_SAMPLES:
        yield from masks
        return
    whole = np.maximum(np.sum(jacobian**2, axis=0), _TINY)
    for mask in masks:
        others = projected_out(residuals.nuisance_basis(~mask), jacobian[~mask])
        information = np.sum(others**2, axis=0) / whole
        least = int(np.argmin(information))
        if information[least] <= _LEAST_INFORMATION:
            yield from _chunks(mask, jacobian[:, least])
        else:
            yield mask


def _chunks(mask: Mask, slope: Floats) -> Iterator[Mask]:
    """`mask` cut in time into chunks of equal information on the parameter of `slope`."""
    samples = np.flatnonzero(mask)
    so_far = np.cumsum(slope[samples] ** 2)
    number_of = np.minimum(_CHUNKS * so_far / max(so_far[-1], _TINY), _CHUNKS - 1).astype(int)
    for number in np.unique(number_of):
        chunk = np.zeros_like(mask)
        chunk[samples[number_of == number]] = True
        yield chunk


def _mean_square(residual: Floats) -> float:
    return float(np.mean(residual**2))


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
    if fit.candidates:
        others = residuals.subset(~mask)
        settings = least_squares_fit(others, fit.candidates, [settings]).settings
    return residuals.subset(mask).at(settings)


def _by_step(residuals: Residuals, fit: Fit, mask: Mask) -> Floats:
    """Residual of the fold after one Gauss-Newton step to the fit of the other folds."""
    inner, outer = residuals.nuisance_basis(mask), residuals.nuisance_basis(~mask)
    own, others = fit.residual[mask], projected_out(outer, fit.residual[~mask])
    if not len(fit.order):
        return projected_out(inner, own)
    step = gauss_newton_step(projected_out(outer, fit.jacobian[~mask]), others)
    return projected_out(inner, own + fit.jacobian[mask] @ step)
