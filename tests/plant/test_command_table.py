"""Rows of a table that hold at given times."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mopro.plant.command_table import rows_along

MOMENTS = st.lists(st.integers(-3, 30).map(lambda i: i / 4), max_size=12).map(sorted)


@given(MOMENTS, MOMENTS)
def test_the_row_along_ascending_times_is_the_last_that_began(
    starts: list[float], times: list[float]
) -> None:
    rows = rows_along(np.array(starts), np.array(times))
    assert rows.tolist() == [sum(start <= time for start in starts) - 1 for time in times]
