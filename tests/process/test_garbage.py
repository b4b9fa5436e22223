"""The search for garbage waits, and goes on however the work ends."""

import gc

import pytest

from mopro.process.garbage import garbage_left


@pytest.mark.parametrize("searched", [True, False])
def test_the_search_is_as_it_was_afterwards(searched):
    before = gc.isenabled()
    (gc.enable if searched else gc.disable)()
    try:
        with pytest.raises(KeyError, match="False"), garbage_left():
            raise KeyError(gc.isenabled())
        assert gc.isenabled() is searched
    finally:
        (gc.enable if before else gc.disable)()
