"""Parts that are held out: predicted from fits of the others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.diagnosis.fit import Fit, fit
from mopro.diagnosis.model import Floats, Mask
from mopro.diagnosis.residual import Residuals, projected_out
from mopro.diagnosis.slopes import step_against

_FEWEST_FOLDS, _MOST_FOLDS = 2, 12
# Below so many samples a problem is refitted in earnest; above, the slopes at the fit
# tell what leaving a part out would have changed, as it is a small change.
_FEW = 1000
# A part is cut into so many pieces where the others have no more than such a share of what tells
# a parameter.
_LEAST_TOLD = 0.1
_PIECES = 4


@dataclass(frozen=True)
class HeldOut:
    """Misfit of parts that were not fitted: mean square of the whitened residual.

    `residual` is the misfit itself, sample by sample.
    """

    before: float
    after: float
    without: dict[str, float]
    residual: Floats

    def supports(self, effect: str) -> bool:
        """Whether the held-out parts fit better with `effect` than without it."""
        return self.after < self.without[effect]


def held_out(
    residuals: Residuals, null: Fit, found: Fit, without: dict[str, Fit]
) -> HeldOut | None:
    """Each part predicted by a fit of the others, with and without each effect.

    None where there is but one part, which nothing else could predict.
    """
    parts = folds(residuals)
    if len(parts) < _FEWEST_FOLDS:
        return None
    parts = list(_divided(residuals, parts, found))
    after = _predicted(residuals, found, parts)
    return HeldOut(
        before=_mean_square(_predicted(residuals, null, parts)),
        after=_mean_square(after),
        without={
            name: _mean_square(_predicted(residuals, other, parts))
            for name, other in without.items()
        },
        residual=after,
    )


def folds(residuals: Residuals) -> list[Mask]:
    """Masks of the parts: a run's moves, or whole runs, whichever are given.

    What several sensors saw of a part is held out together. Many small parts go together,
    so that there are a dozen at most.
    """
    labels: list[NDArray[np.int64]] = []
    known: dict[tuple[str, int], int] = {}
    for series in residuals.data:
        own = np.zeros(len(series), int) if series.folds is None else np.asarray(series.folds)
        folds, places = np.unique(own, return_inverse=True)
        numbers = [known.setdefault((series.run, int(fold)), len(known)) for fold in folds]
        labels.append(np.array(numbers)[places])
    joined = np.concatenate(labels)
    if len(known) > _MOST_FOLDS:
        joined = joined % _MOST_FOLDS
    return [joined == label for label in np.unique(joined)]


def _divided(residuals: Residuals, parts: Sequence[Mask], found: Fit) -> Iterator[Mask]:
    """`parts`, cut in time where the others tell next to nothing of a rigid effect's parameter.

    Of what shows in a single move no other move tells anything, but the rest of that one does.
    """
    rigid = {candidate.name for candidate in found.candidates if not candidate.flexible}
    columns = [i for i, (effect, _) in enumerate(found.order) if effect in rigid]
    slopes = found.jacobian[:, columns]
    if not columns or len(slopes) <= _FEW:
        yield from parts
        return
    whole = np.maximum(np.sum(slopes**2, axis=0), 1e-300)
    for part in parts:
        others = projected_out(residuals.nuisance_basis(~part), slopes[~part])
        told = np.sum(others**2, axis=0) / whole
        least = int(np.argmin(told))
        yield from _pieces(part, slopes[:, least]) if told[least] <= _LEAST_TOLD else [part]


def _pieces(part: Mask, slope: Floats) -> Iterator[Mask]:
    """`part` in stretches that tell as much of the parameter as each other."""
    places = np.flatnonzero(part)
    so_far = np.cumsum(slope[places] ** 2)
    numbers = np.minimum(_PIECES * so_far / max(so_far[-1], 1e-300), _PIECES - 1).astype(int)
    for number in np.unique(numbers):
        piece = np.zeros_like(part)
        piece[places[numbers == number]] = True
        yield piece


def _mean_square(residual: Floats) -> float:
    return float(np.mean(residual**2))


def _predicted(residuals: Residuals, found: Fit, parts: Sequence[Mask]) -> Floats:
    left = np.empty(len(residuals.measured))
    for part in parts:
        if len(left) <= _FEW:
            left[part] = _refitted(residuals, found, part)
        else:
            left[part] = _extrapolated(residuals, found, part)
    return left


def _refitted(residuals: Residuals, found: Fit, part: Mask) -> Floats:
    settings = found.settings
    if found.candidates:
        settings = fit(residuals.subset(~part), found.candidates, [settings]).settings
    return residuals.subset(part).at(settings)


def _extrapolated(residuals: Residuals, found: Fit, part: Mask) -> Floats:
    """By the fit's slopes: what the other parts alone would have moved its parameters."""
    inner, outer = residuals.nuisance_basis(part), residuals.nuisance_basis(~part)
    own, others = found.residual[part], projected_out(outer, found.residual[~part])
    if not len(found.order):
        return projected_out(inner, own)
    step = step_against(projected_out(outer, found.jacobian[~part]), others)
    return projected_out(inner, own + found.jacobian[part] @ step)
