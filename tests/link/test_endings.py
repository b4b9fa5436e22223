"""Some trials of `bench/endings.py`: whatever ends a run, the controller is told to stop."""

import pytest

from helpers.endings import Ending, trial


@pytest.mark.parametrize("kind", Ending.KINDS)
@pytest.mark.parametrize("seed", [1000, 1001])
def test_trouble_at_a_random_moment_ends_in_a_stop(kind, seed):
    done = trial(kind, seed)
    assert not done.failures, done.told
    assert done.stop_after_s is not None or not done.lived or done.ending == "after the end"


def test_a_host_that_sends_no_stop_is_a_failure(monkeypatch):
    monkeypatch.setattr("mopro.link.watch.Watch.stop", lambda watch, within_s: False)
    assert "no stop received" in trial("SIGINT", 1001).failures
