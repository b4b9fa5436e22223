"""A controller that turns hostile: the run ends in time, with a stop sent and a report."""

import pytest

from helpers.hostile import KINDS, trial


@pytest.mark.parametrize("dialect", ["checked", "plain"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_run_on_a_hostile_controller_ends_in_time_with_a_stop(kind, dialect):
    """A line without an end kept it waiting for 64 KiB: 68 s at 9600 baud, past its deadline."""
    found = trial(kind, dialect, 1, last_s=0.2)
    assert found.failures == ()
    assert found.ending in ("stop not confirmed", "not begun", "ended early")
