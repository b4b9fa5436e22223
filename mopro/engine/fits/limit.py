"""Limits of fits: a set of effects that leaves more is not worth fitting to its minimum."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mopro.engine.residuals import Noise
from mopro.engine.series import Floats


@dataclass(frozen=True)
class Limit:
    """Largest deviance by `noise` that a fit may leave; largest sum of squares without a noise."""

    most: float = math.inf
    noise: Noise | None = None

    @staticmethod
    def of_deviance(most: float, noise: Noise) -> Limit:
        """A limit of the deviance, which is the sum of squares of white noise of stated size."""
        return Limit(most, None if noise.exact and all(noise.stated) else noise)

    def missed(self, residual: Floats) -> float:
        """Excess of a whitened residual (samples) over the limit; below 0 within it."""
        left = self.noise.deviance(residual) if self.noise else float(residual @ residual)
        return left - self.most

    def includes(self, other: Limit) -> bool:
        """True if a fit that cannot come down to this limit cannot come down to `other`."""
        return self.noise is other.noise and other.most <= self.most


NO_LIMIT = Limit()
