"""The command under test."""

import functools

import pytest


@pytest.fixture
def lint(mopro):
    """`lint(*args, stdin=b"")` runs `mopro lint`; its words are bytes."""
    return functools.partial(mopro, "lint", words=False)
