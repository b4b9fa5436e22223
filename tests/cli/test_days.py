"""Times in the units in which bounds are told."""

import pytest

from mopro.motion import LONGEST_RUN_S
from mopro.units import parse_quantity, units_of

DAYS = LONGEST_RUN_S / 86400


@pytest.mark.parametrize("unit", units_of("time"))
def test_the_longest_run_may_be_stated_in_each_unit(mopro, unit):
    longest = LONGEST_RUN_S / parse_quantity(f"1{unit}", "time", "s")
    words = ("run", "P.CMD", "--emulate", "--for")
    assert mopro(*words, f"{longest:.0f}{unit}", text="WT1\n").returncode == 0
    done = mopro(*words, f"{longest * 1.01:.2f}{unit}")
    assert done.returncode == 2
    assert "must be at most" in done.stderr


def test_the_bound_in_days_is_a_time():
    assert parse_quantity(f"{DAYS:g}d", "time", "s") == LONGEST_RUN_S
