"""Streams of a run in threads of their own: order, failures, streams that take nothing."""

import errno
import threading
from contextlib import contextmanager

import pytest

from mopro.errors import DataError
from mopro.files import output
from mopro.link.writer import Writer


class Stream:
    """A list that blocks while `open_gate` is not set, and is full after `most` pieces."""

    def __init__(self, most=10**6):
        self.got, self.most = [], most
        self.gate = threading.Event()
        self.gate.set()
        self.closed = False

    def write(self, piece):
        self.gate.wait(60)
        if len(self.got) >= self.most:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.got.append(piece)

    @contextmanager
    def opened(self):
        yield self
        self.closed = True


def put(writer, piece):
    writer.put(lambda stream: stream.write(piece))


def test_what_is_put_is_written_in_order_and_the_stream_closed():
    stream = Stream()
    writer = Writer("the log", stream.opened())
    for piece in range(500):
        put(writer, piece)
    writer.close()
    assert stream.got == list(range(500))
    assert stream.closed


def test_a_failure_is_told_by_the_next_put_at_the_latest_and_by_the_end():
    writer = Writer("the log", Stream(most=3).opened())

    def five():
        for piece in range(5):
            put(writer, piece)

    with pytest.raises(DataError, match="the log cannot be written: No space left"):
        five()
    with pytest.raises(DataError, match="No space left"):
        writer.close()


def test_a_stream_that_takes_nothing_is_full_and_given_up_at_its_end():
    stream = Stream()
    stream.gate.clear()
    writer = Writer("the log", stream.opened(), most=4)
    for piece in range(4):
        put(writer, piece)
    with pytest.raises(DataError, match="nothing takes what is written there"):
        put(writer, 4)
    with pytest.raises(DataError, match="nothing takes"):
        writer.close(0.05)
    stream.gate.set()


def test_what_is_offered_to_a_full_stream_is_left_out():
    stream = Stream()
    stream.gate.clear()
    writer = Writer("the page", stream.opened(), most=2)
    for piece in range(9):
        writer.offer(lambda s, piece=piece: s.write(piece))
    stream.gate.set()
    writer.close()
    assert stream.got == [0, 1]


def test_nothing_is_written_or_raised_while_held():
    stream = Stream()
    writer = Writer("the log", stream.opened(), most=2)
    put(writer, 0)
    writer.hold()
    for piece in range(1, 9):
        put(writer, piece)
    assert stream.got == [0]
    writer.close()
    assert stream.got == list(range(9))


def test_a_stream_that_cannot_be_opened_is_told_at_once(tmp_path):
    with pytest.raises(DataError, match="it is a folder"):
        Writer("the log", output(tmp_path))
