"""Readings that stand at the end of their sensor's range."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from mopro.engine.series import Floats
from mopro.noise import ends_of


def end_notes(
    name: str, unit: str, time_s: Floats, values: Floats, simulated: Callable[[], Floats]
) -> Iterator[str]:
    """Notes on the ends at which readings (n,) at `time_s` stay, and the motion does not.

    `simulated` gives what the sensor was to show of it (n,), in any unit.
    """
    for end in ends_of(values):
        # It brings SciPy's signals and statistics, which take a third of a second.
        from mopro.instruments.agreement import expected

        shown = simulated()
        known = np.isfinite(shown).all()
        told = expected(time_s, shown, time_s, values, False, ~end.at) if known else None
        if end.is_passed(values, told):
            at_s = time_s[end.at]
            yield (
                f"{name}: {end.words(unit)} They are from {at_s[0]:.6g} to {at_s[-1]:.6g} s,"
                f" and all readings in [{values.min():.6g}, {values.max():.6g}]."
                " If so, leave them out: empty their cells"
            )
