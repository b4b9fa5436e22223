"""Flashing, with both ends in memory and the wire damaged."""

from collections import deque
from dataclasses import replace

import pytest

import mopro
from helpers.bench_of_link import DIALECTS, OLD, SHORT, bench, old_in
from mopro.controller import FolderStore, MemoryStore
from mopro.controller.faults import Fault
from mopro.errors import LinkError, VerifyError
from mopro.link import Session, load_dialect
from mopro.link.flash import differences, flash, statements_of, verify
from mopro.link.session import Refused

PROGRAM = mopro.compile(SHORT, "short.CMD")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_done_means_stored_as_sent(dialect):
    joined = bench(dialect)
    seen = []
    done = flash(joined.session, PROGRAM, "MAIN", lambda n, total: seen.append((n, total)))
    assert joined.stored == SHORT.splitlines()
    assert done.statements == 8
    assert seen[-1] == (24, 24)
    assert [n for n, _ in seen] == sorted(n for n, _ in seen)


@pytest.mark.parametrize("kind", ["drop", "double", "flip", "split", "merge"])
@pytest.mark.parametrize("direction", ["to_controller", "to_host"])
def test_a_checked_flash_gets_over_damaged_bytes(kind, direction):
    joined = bench("checked", Fault(kind, rate=0.05, direction=direction, times=3))
    flash(joined.session, PROGRAM, "MAIN")
    assert joined.stored == SHORT.splitlines()
    assert joined.station.injector.happened[kind] == 3


@pytest.mark.parametrize(
    "fault",
    [
        Fault("late", rate=0.3, delay_s=0.4),
        Fault("missing", rate=0.2, times=3),
        Fault("garbled", rate=0.2, times=3),
        Fault("busy", at_s=0.1, for_s=2.0),
        Fault("disconnect", at_s=0.1, for_s=0.8),
    ],
)
def test_a_checked_flash_gets_over_bad_replies(fault):
    joined = bench("checked", fault)
    flash(joined.session, PROGRAM, "MAIN")
    assert joined.stored == SHORT.splitlines()


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("at_s", [0.15, 0.2, 0.25])
@pytest.mark.parametrize("kind", ["disconnect", "reset", "busy"])
def test_what_breaks_off_leaves_the_old_or_the_new_program_and_can_be_done_again(
    dialect, at_s, kind
):
    for_s = 0.1 if kind == "reset" else 1e6
    joined = bench(dialect, Fault(kind, at_s=at_s, for_s=for_s), store=old_in(MemoryStore()))
    joined.session.give(10.0)
    try:
        flash(joined.session, PROGRAM, "MAIN")
    except LinkError:
        assert joined.stored in (OLD.splitlines(), SHORT.splitlines())
    else:
        assert kind == "reset"
    assert joined.session.port.now_s() < 11.0
    if kind == "reset":
        joined.session.open()
        flash(joined.session, PROGRAM, "MAIN")
        assert joined.stored == SHORT.splitlines()


def test_what_the_controller_holds_is_compared_not_believed():
    joined = bench()
    flash(joined.session, PROGRAM, "MAIN")
    joined.station.store.write("MAIN", SHORT.replace("MRI1 2.0", "MRI1 3.0").splitlines())
    with pytest.raises(VerifyError, match=r"statement 4 \(line 4 .*MRI1 2.0.*MRI1 3.0") as caught:
        verify(joined.session, PROGRAM, "MAIN")
    assert caught.value.rule == "read-back-differs"
    with pytest.raises(VerifyError, match="nothing under OTHER") as caught:
        verify(joined.session, PROGRAM, "OTHER")
    assert caught.value.rule == "empty"


def test_numbers_written_another_way_mean_the_same():
    stored = [line.replace("2.0", "2.000").lower() for line in SHORT.splitlines()]
    assert differences(PROGRAM, stored) == []
    assert differences(PROGRAM, stored[:-1]) == [(8, "WX1", "(nothing)")]
    assert differences(PROGRAM, [*stored[:-1], "garbage"])[0][0] == 8


def test_a_refusal_names_the_line():
    joined = bench()
    program = mopro.compile(SHORT + "ST1\n", "short.CMD", grammar="extended")
    with pytest.raises(Refused, match=r"short.CMD:9: .*`ST1`"):
        flash(joined.session, program, "MAIN")
    flash(joined.session, PROGRAM, "MAIN")
    assert joined.stored == SHORT.splitlines()


def test_a_program_too_long_for_the_controller_is_refused():
    wait = mopro.compile("WT1\n", "long.CMD")
    joined = bench()
    joined.session.give(3000.0)
    with pytest.raises(LinkError, match="more than 10000 statements"):
        flash(joined.session, replace(wait, ops=wait.ops * 10_001), "MAIN")
    assert joined.stored is None


@pytest.mark.parametrize("name", ["../X", "/etc/passwd", "A/B", "a b", "", "X" * 17, "1A"])
def test_a_client_cannot_name_a_path(tmp_path, name):
    store = FolderStore(tmp_path / "store")
    joined = bench("plain", store=store)
    for statement in ("begin", "list", "run"):
        with pytest.raises((Refused, ValueError)):
            joined.session.ask(statement, name=name)
        joined.session.recover()
    assert list((tmp_path / "store").iterdir()) == []


class Peer:
    """A port at whose other end is something else: says `chunk` at each read."""

    def __init__(self, chunk):
        self.chunk = chunk
        self.time_s = 0.0

    def now_s(self):
        return self.time_s

    def write(self, data):
        self.time_s += len(data) / 960

    def read(self, until_s):
        if not self.chunk:
            self.time_s = max(self.time_s, until_s)
            return b""
        self.time_s += len(self.chunk) / 960
        return self.chunk

    def close(self):
        return


class Greeter(Peer):
    """Says its piece once after each line that it gets."""

    def __init__(self, piece):
        super().__init__(b"")
        self.piece = piece

    def write(self, data):
        super().write(data)
        self.chunk = self.piece

    def read(self, until_s):
        said, self.chunk = super().read(until_s), b""
        return said


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize(
    ("peer", "rule", "says"),
    [
        (Peer(b""), "no-answer", "nothing answers"),
        (Peer(b"spam spam\r\n"), "flood", "does not stop sending"),
        (Peer(b"\xff" * 64), "flood", "does not stop sending"),
        (Greeter(b"login: "), "other-dialect", "login:"),
        (Greeter(b"\x80\xf8\x00\xe0\x9e"), "garbage", "baud rate"),
    ],
)
def test_who_is_there_is_told_within_the_deadline(dialect, peer, rule, says):
    peer.time_s = 0.0
    session = Session(peer, load_dialect(dialect))
    session.give(15.0)
    with pytest.raises(LinkError, match=says) as caught:
        session.open()
    assert caught.value.rule == rule
    assert peer.time_s < 16.0


class Slow:
    """A port whose bytes come `delay_s` later than those of `port`, in their order."""

    def __init__(self, port, delay_s=0.0):
        self.port, self.delay_s, self.coming = port, delay_s, deque()

    def now_s(self):
        return self.port.now_s()

    def write(self, data):
        self._take(self.now_s())
        self.port.write(data)

    def read(self, until_s):
        while not self.coming or self.coming[0][0] > self.now_s():
            if self.now_s() >= until_s:
                return b""
            self._take(min(until_s, self.coming[0][0]) if self.coming else until_s)
        return self.coming.popleft()[1]

    def _take(self, until_s):
        if data := self.port.read(until_s):
            self.coming.append((self.now_s() + self.delay_s, data))

    def close(self):
        return


def slow(dialect, delay_s, opening):
    """A session over a slow port, which is slow from the start or once it is open."""
    joined = bench(dialect, opened=False)
    joined.session.port = port = Slow(joined.session.port, delay_s if opening else 0.0)
    if not opening:
        joined.session.open()
    port.delay_s = delay_s
    joined.session.give(60.0)
    return joined.session


@pytest.mark.parametrize(
    ("dialect", "delay_s"),
    [
        *(("plain", d) for d in (1.6, 2.3, 3.1, 4.2)),
        *(("checked", d) for d in (1.6, 2.3, 3.1, 5.5)),
    ],
)
def test_a_controller_that_answers_late_is_not_told_as_another_dialect(dialect, delay_s):
    session = slow(dialect, delay_s, opening=True)

    def opened_and_flashed():
        session.open()
        flash(session, PROGRAM, "MAIN")

    with pytest.raises(LinkError, match=r"answers later than 1 s .* reply_timeout_s") as caught:
        opened_and_flashed()
    assert caught.value.rule == "late-answer"


@pytest.mark.parametrize("delay_s", [1.2, 1.6, 2.3, 3.1, 4.2, 5.5])
def test_answers_that_become_late_are_told_as_such(delay_s):
    with pytest.raises(LinkError, match="answers later than 1 s") as caught:
        flash(slow("plain", delay_s, opening=False), PROGRAM, "MAIN")
    assert caught.value.rule == "late-answer"


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("delay_s", [0.3, 0.9])
def test_a_controller_that_answers_in_time_is_flashed(dialect, delay_s):
    session = slow(dialect, delay_s, opening=False)
    assert flash(session, PROGRAM, "MAIN").statements == 8
    assert session.retried == 0


@pytest.mark.parametrize("delay_s", [0.4, 0.9, 1.2, 2.0, 3.0])
def test_no_message_has_the_words_of_python(delay_s):
    """Replies that overtake one another, prompts before echoes."""
    joined = bench("plain", Fault("late", rate=1.0, delay_s=delay_s), opened=False)
    with pytest.raises(LinkError) as caught:
        flash(joined.session, PROGRAM, "MAIN")
    assert "None" not in str(caught.value)


def test_statements_are_those_of_the_wire():
    assert statements_of(PROGRAM) == SHORT.splitlines()
