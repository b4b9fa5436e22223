"""Numbers that the model states with a tolerance, and what a fit leaves open without them.

Such a number is off by as much as its tolerance, and the fitted parameters make up for it: a
mass that is 2 % off leaves every force 2 % off where the data show only their quotients.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mopro.engine.assumed import LINEARITY_ERROR, UNIFORM
from mopro.engine.candidate import Candidate, Parameter, Role
from mopro.engine.fits.fit import Fit
from mopro.engine.fits.jacobian import gauss_newton_step
from mopro.engine.residuals import Residuals
from mopro.engine.series import Floats


def with_tolerances(residuals: Residuals, fit: Fit, catalogue: Sequence[Candidate]) -> Fit:
    """`fit`, and with it each toleranced number that it does not fit, after one step.

    The numbers are assumed constants, which may be anywhere in their tolerances. The step is that
    of Gauss and Newton with this prior, so that intervals of the answer are those of a joint fit,
    to first order. Two simulations tell the column of a tolerance. Its evidence is
    not that of `fit`: it is judged by an `Evidence` of its own.
    """
    others = {c.name: c for c in reversed(catalogue) if c.calibrates and c.name not in fit.names}
    open_ = [(c, p) for c in others.values() for p in _constants(c)]
    if not open_:
        return fit
    columns = [_column(residuals, fit, candidate, p) for candidate, p in open_]
    known = {c.name: {p.name: p.null for p in _constants(c)} for c in others.values()}
    wide = replace(
        fit,
        order=(*fit.order, *((c.name, p) for c, p in open_)),
        jacobian=np.column_stack([fit.jacobian, *columns]),
        settings={**fit.settings, **known},
    )
    return replace(wide, settings=_stepped(wide, len(open_)))


def _constants(candidate: Candidate) -> Iterator[Parameter]:
    """The numbers of the model that it states with a tolerance, as assumed constants."""
    for p in candidate.parameters:
        if p.tolerated is not None:
            low, high = p.tolerated
            yield replace(p, low=low, high=high, role=Role.CONSTANT, plausible=None)


def _column(residuals: Residuals, fit: Fit, candidate: Candidate, p: Parameter) -> Floats:
    """Change of the residual (samples) for one unit of a number, where the model states it.

    By central differences over a small share of its tolerance: over the whole, what is curved
    would look like information on a number that the others make up for.
    """
    off = {own.name: own.null for own in candidate.parameters}
    step = LINEARITY_ERROR * (p.high - p.low)
    low, high = (
        {**fit.settings, **candidate.settings({**off, p.name: p.null + side * step})}
        for side in (-0.5, 0.5)
    )
    column: Floats = residuals.change(low, high) / step
    return column


def _stepped(wide: Fit, constants: int) -> dict[str, dict[str, float]]:
    """The settings after a step in which the last so many parameters have their prior."""
    spans = np.array([p.high - p.low for _, p in wide.order[-constants:]])
    fitted = len(wide.order) - constants
    prior = np.hstack([np.zeros((constants, fitted)), np.diag(UNIFORM**-0.5 / spans)])
    joint = np.vstack([wide.jacobian, prior])
    step = gauss_newton_step(joint, np.concatenate([wide.residual, np.zeros(constants)]))
    moved = {name: dict(own) for name, own in wide.settings.items()}
    for (name, p), by in zip(wide.order, step.tolist(), strict=True):
        moved[name][p.name] += by
    return moved
