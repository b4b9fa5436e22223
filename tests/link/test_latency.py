"""A slow way to the controller: whatever takes less than the dialect's time limit is right."""

from collections import deque
from random import Random

import pytest

import mopro
from helpers.bench_of_link import DIALECTS, SHORT, bench
from mopro.link import Session, load_dialect
from mopro.link.flash import upload
from mopro.link.probe import probe


class SlowPort:
    """`port` at the end of a way that takes `delay_s` in each direction, in the port's time."""

    def __init__(self, port, delay_s):
        self._port, self._delay_s = port, delay_s
        self._going, self._coming = deque(), deque()
        self.now_s = port.now_s

    def write(self, data):
        self._going.append((self.now_s() + self._delay_s, data))

    def read(self, until_s):
        while True:
            while self._going and self._going[0][0] <= self.now_s():
                self._port.write(self._going.popleft()[1])
            if self._coming and self._coming[0][0] <= self.now_s():
                return self._coming.popleft()[1]
            if self.now_s() >= until_s:
                return b""
            due_s = [way[0][0] for way in (self._going, self._coming) if way]
            if data := self._port.read(min([until_s, *due_s])):
                self._coming.append((self.now_s() + self._delay_s, data))


def session_over(delay_s, dialect):
    joined = bench(dialect, opened=False)
    session = Session(SlowPort(joined.session.port, delay_s), load_dialect(dialect), Random(1))
    session.give(120.0)
    return session


# Up to half of the 1 s that both dialects wait for an answer, less the time of the bytes.
@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.03, 0.1, 0.2, 0.25, 0.4, 0.45])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_step_of_the_test_matches_as_without_a_delay(dialect, delay_s):
    """From 100 ms on the prompt after the attention was taken for the answer to the next line."""
    steps = list(probe(session_over(delay_s, dialect)))
    assert [step for step in steps if not step.matched] == []
    session = session_over(delay_s, dialect)
    session.open()
    upload(session, mopro.compile(SHORT), "MAIN", lambda done: None)
    assert session.retried == 0


@pytest.mark.parametrize("delay_s", [0.7, 1.5, 3.0])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_beyond_the_limit_a_step_does_not_match(dialect, delay_s):
    steps = list(probe(session_over(delay_s, dialect)))
    assert [step for step in steps if not step.matched]
