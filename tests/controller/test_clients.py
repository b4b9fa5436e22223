"""Many hostile clients at once: the one that means well is served, and nothing is left open."""

import pytest

from helpers.clients import HTTP, KINDS, place_taken_from_a_silent_one, serving, stormed

_CLIENTS, _SECONDS = 30, 0.1


@pytest.fixture(scope="module")
def server():
    with serving("--idle", "0.5s", web=True) as found:
        yield found


@pytest.mark.parametrize("kind", KINDS)
def test_a_client_is_served_among_hostile_ones(server, kind):
    found = stormed(server, kind, _CLIENTS, _SECONDS)
    assert found.failures == ()
    assert found.answers >= 2
    if kind not in HTTP and kind != "many connects":
        assert found.fates.keys() <= {"told so", "waits"}
        assert found.fates["waits"] <= 8


def test_a_silent_client_loses_its_place(server):
    assert place_taken_from_a_silent_one(server, 20.0) < 20.0
