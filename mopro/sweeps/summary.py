"""The row of a point at which several machines were drawn."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mopro.sweeps.drawn import Draws
from mopro.sweeps.figures import OK, STALLED

# What a bound on a share is told with.
CONFIDENCE = 0.95
# The figures whose bands are told.
BANDS = (
    "time_s", "force_margin", "largest_lag_m", "settling_s", "end_temperature_C",
    "hour_temperature_C", "coil_energy_J",
)  # fmt: skip
_COUNTS = ("draws", "failed_draws", "stalled_draws")
_SHARES = ("stall_probability", "stall_at_most")
_BAND_COLUMNS = tuple(f"{figure}_{end}" for figure in BANDS for end in ("low", "high"))
# The columns that a row has beside those of the machine as stated, each with its type.
COLUMNS: dict[str, type] = {
    **dict.fromkeys(_COUNTS, int),
    **dict.fromkeys((*_SHARES, *_BAND_COLUMNS), float),
}


@dataclass(frozen=True)
class Share:
    """`count` of `total` machines drawn."""

    count: int
    total: int

    @property
    def observed(self) -> float:
        return self.count / self.total

    def at_most(self, confidence: float = CONFIDENCE) -> float:
        """The upper end of the one-sided interval of Clopper and Pearson (1934).

        With a count of 0 it is about 3 / total at 95 %, the rule of three.
        """
        from scipy.stats import beta

        if self.count == self.total:
            return 1.0
        return float(beta.ppf(confidence, self.count + 1, self.total - self.count))


def summary(rows: Sequence[dict[str, Any]], draws: Draws) -> dict[str, Any]:
    """The row of a point: that of the machine as stated, with how the machines drawn did.

    `rows`: of the machine as stated, then of those drawn.
    """
    stated, drawn = rows[0], rows[1:]
    stalled = Share(sum(row["outcome"] == STALLED for row in drawn), len(drawn))
    cells = {
        **stated,
        "task": name_of([row["task"] for row in rows], draws),
        "draws": len(drawn),
        "failed_draws": sum(row["outcome"] != OK for row in drawn),
        "stalled_draws": stalled.count,
        "stall_probability": stalled.observed,
        "stall_at_most": stalled.at_most(),
    }
    for figure in BANDS:
        cells[f"{figure}_low"], cells[f"{figure}_high"] = _band(
            [row[figure] for row in drawn], draws.band
        )
    return cells


def name_of(tasks: Sequence[str], draws: Draws) -> str:
    """The name of a point's row, by all that it depends on."""
    content = "|".join([*tasks, repr(draws.band)])
    return hashlib.sha256(content.encode()).hexdigest()[: len(tasks[0])]


def _band(figures: Sequence[float | None], share: float) -> tuple[float | None, float | None]:
    """The ends of the central `share` of the figures that there are."""
    known = [figure for figure in figures if figure is not None]
    if not known:
        return None, None
    low, high = np.quantile(known, [(1 - share) / 2, (1 + share) / 2]).tolist()
    return low, high
