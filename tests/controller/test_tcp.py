"""The TCP end: one client at a time, nothing without bound, nobody from outside unasked."""

import contextlib
import socket
import threading

import pytest

from mopro.controller import Scenario, Station
from mopro.controller.serve import TcpEnd, is_loopback, open_end
from mopro.controller.station import MOST_INWARD
from mopro.emulator import Emulator
from mopro.errors import LinkError, PortError
from mopro.link import SerialPort, load_dialect
from mopro.link.token import statement
from mopro.machine import load_machine

TOKEN = "correct-horse-battery"
ROOM = 4096
LOOK_S = 5.0


class Clock:
    now_s = 100.0

    def __call__(self):
        return self.now_s


@contextlib.contextmanager
def end_of(**options):
    clock = Clock()
    end = TcpEnd("127.0.0.1", 0, clock=clock, **options)
    end.clock = clock
    try:
        yield end
    finally:
        end.close()


@contextlib.contextmanager
def connected(end):
    host, port = end.address.removeprefix("socket://").split(":")
    with socket.create_connection((host, int(port)), timeout=LOOK_S) as client:
        end.wait(LOOK_S, ROOM)
        yield client


def test_a_client_is_heard_and_answered():
    with end_of() as end, connected(end) as client:
        client.sendall(b"hello")
        assert end.wait(LOOK_S, ROOM) == b"hello"
        end.send(b"back")
        assert client.recv(10) == b"back"


def test_a_second_client_is_told_that_it_is_in_the_way():
    with end_of() as end, connected(end) as first, connected(end) as second:
        second.sendall(b":HI\r\n")
        end.wait(LOOK_S, ROOM)
        assert second.recv(100) == b"mopro serve: busy: another client is connected\r\n"
        assert second.recv(100) == b""
        first.sendall(b"still here")
        assert end.wait(LOOK_S, ROOM) == b"still here"


def test_a_client_that_has_been_silent_for_too_long_loses_its_place():
    with end_of(idle_s=60.0) as end, connected(end) as first:
        first.sendall(b"x")
        end.wait(LOOK_S, ROOM)
        end.clock.now_s += 59.0
        with connected(end) as early:
            early.sendall(b"x")
            end.wait(LOOK_S, ROOM)
            assert early.recv(100).startswith(b"mopro serve: busy")
        end.clock.now_s += 2.0
        with connected(end) as second:
            assert first.recv(100) == b""
            second.sendall(b"mine")
            heard = [end.wait(LOOK_S, ROOM), end.wait(0.0, ROOM)]
            assert b"".join(heard) == b"mine"


def test_no_more_is_read_than_there_is_room():
    with end_of() as end, connected(end) as client:
        client.sendall(b"0123456789")
        assert end.wait(LOOK_S, 4) == b"0123"
        assert end.wait(0.0, 0) == b""
        assert end.wait(LOOK_S, ROOM) == b"456789"


def test_a_client_that_floods_waits_at_its_own_end():
    """It cost 1.76 GB, and kept the next client out for hours."""
    with end_of() as end, connected(end) as client:
        client.setblocking(False)
        sent = 0
        with contextlib.suppress(BlockingIOError):
            for _ in range(10_000):
                sent += client.send(bytes(4096))
        own = client.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF)
        assert sent < own + 200_000


def station():
    return Station(load_dialect("checked"), Emulator(load_machine("chow1992")), scenario=Scenario())


def test_what_waits_for_the_line_is_bounded():
    line = station()
    assert line.room == MOST_INWARD
    line.hear(bytes(20_000_000), 0.0)
    assert line.room == 0
    line.say(MOST_INWARD * line.byte_s / 2)
    assert line.room == pytest.approx(MOST_INWARD / 2, abs=2)


# -- from outside ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("host", "inside"),
    [("127.0.0.1", True), ("127.3.2.1", True), ("::1", True), ("localhost", True),
     ("0.0.0.0", False), ("192.168.1.7", False), ("::", False), ("example.org", False)],
)  # fmt: skip
def test_which_addresses_are_of_this_machine_only(host, inside):
    assert is_loopback(host) is inside


def test_an_address_for_others_needs_to_be_allowed_and_a_token():
    with pytest.raises(PortError, match="add --allow-remote"):
        open_end("socket://0.0.0.0:0")
    with pytest.raises(PortError, match="without a token"):
        open_end("socket://0.0.0.0:0", allow_remote=True)
    with pytest.raises(PortError, match="add --allow-remote"):
        open_end("socket://0.0.0.0:0", token=TOKEN)
    open_end("socket://0.0.0.0:0", allow_remote=True, token=TOKEN).close()


def test_the_token_comes_before_everything_else():
    with end_of(token=TOKEN) as end, connected(end) as client:
        client.sendall(b"MOPRO TOKEN " + TOKEN[:5].encode())
        assert end.wait(LOOK_S, ROOM) == b""
        client.sendall(TOKEN[5:].encode() + b"\n")
        assert end.wait(LOOK_S, ROOM) == b""
        client.sendall(b"now")
        assert end.wait(LOOK_S, ROOM) == b"now"


@pytest.mark.parametrize("said", [b"wrong-horse-battery\n", b":ID\r\n", b"\n", b"x" * 2000])
def test_a_wrong_token_is_turned_away(said):
    with end_of(token=TOKEN) as end, connected(end) as client:
        client.sendall(said)
        end.wait(LOOK_S, ROOM)
        assert client.recv(100) == b"mopro serve: this is not the token\r\n"
        with contextlib.suppress(OSError):
            client.sendall(statement(TOKEN) + b"more")
        assert end.wait(LOOK_S, ROOM) == b""
        assert end.wait(0.0, ROOM) == b""


def test_what_comes_in_one_piece_with_the_token_is_not_lost():
    with end_of(token=TOKEN) as end, connected(end) as client:
        client.sendall(statement(TOKEN) + b"at once")
        assert end.wait(LOOK_S, ROOM) == b"at once"


@pytest.mark.parametrize("pieces", [1, 2, 3])
def test_a_token_that_nobody_asked_for_does_not_reach_the_controller(pieces):
    said = statement(TOKEN) + b"then this"
    with end_of() as end, connected(end) as client:
        heard = b""
        for part in range(pieces):
            first, last = (len(said) * (part + n) // pieces for n in (0, 1))
            client.sendall(said[first:last])
            heard += end.wait(LOOK_S, ROOM)
        assert heard == b"then this"


@pytest.mark.parametrize("said", [b":HI\r\n", b"MV 1\r\n", b"MOPRO\r\n"])
def test_what_only_looks_like_a_token_reaches_the_controller(said):
    with end_of() as end, connected(end) as client:
        client.sendall(said)
        assert end.wait(LOOK_S, ROOM) == said


def test_a_client_that_floods_for_too_long_loses_its_place():
    with end_of(idle_s=60.0) as end, connected(end) as first:
        first.sendall(bytes(100_000))
        for _ in range(61):
            end.clock.now_s += 1.0
            assert end.wait(LOOK_S, 100)
        with connected(end) as second:
            second.sendall(b"mine")
            heard = [end.wait(LOOK_S, ROOM), end.wait(0.0, ROOM)]
            assert b"".join(heard) == b"mine"


def test_guests_that_say_nothing_are_dropped():
    with end_of(token=TOKEN) as end, contextlib.ExitStack() as open_ones:
        guests = [open_ones.enter_context(connected(end)) for _ in range(12)]
        # No more than eight at once; the others are told so.
        assert [g.recv(100) for g in guests[:4]] == [b"mopro serve: busy: too many wait\r\n"] * 4
        end.clock.now_s += 6.0
        end.wait(0.0, ROOM)
        assert [g.recv(100) for g in guests[4:]] == [b""] * 8


def test_a_token_must_be_long_enough(mopro, monkeypatch):
    monkeypatch.setenv("MOPRO_TOKEN", "short")
    told = mopro("serve", "--listen", "socket://0.0.0.0:0", "--allow-remote")
    assert told.returncode == 2
    assert "16 to 128 printable ASCII characters" in told.stderr


def test_serve_refuses_an_address_for_others(mopro, monkeypatch):
    monkeypatch.delenv("MOPRO_TOKEN", raising=False)
    told = mopro("serve", "--listen", "socket://0.0.0.0:0")
    assert told.returncode == 2
    assert "other machines could reach this address and move the motor" in told.stderr


class TestTheClientsEnd:
    """`SerialPort` states the token where it is asked for it, and tells why it was refused."""

    LINE = load_dialect("checked").line

    @contextlib.contextmanager
    def port(self, end, token=None):
        """The port of a client that `end` serves meanwhile in a thread."""
        over = threading.Event()
        heard = []

        def serve():
            while not over.is_set():
                heard.append(end.wait(0.05, ROOM))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            port = SerialPort(end.address, self.LINE, token=token)
            port.heard = heard
            yield port
            port.close()
        finally:
            over.set()
            thread.join()

    def lost(self, port):
        def converse():
            while True:
                port.write(b":HI\r\n")
                port.read(port.now_s() + 1.0)

        with pytest.raises(LinkError) as caught:
            converse()
        return caught.value

    def test_the_token_is_stated(self):
        with end_of(token=TOKEN) as end, self.port(end, TOKEN) as port:
            port.write(b"then this")
            until_s = port.now_s() + LOOK_S
            while b"".join(port.heard) != b"then this" and port.now_s() < until_s:
                port.read(port.now_s() + 0.01)
            end.send(b"answer")
            assert port.read(port.now_s() + LOOK_S) == b"answer"

    def test_an_end_that_asks_for_none_hears_none(self):
        with end_of() as end, self.port(end, TOKEN) as port:
            port.write(b"then this")
            until_s = port.now_s() + LOOK_S
            while not any(port.heard) and port.now_s() < until_s:
                port.read(port.now_s() + 0.01)
        assert b"".join(port.heard) == b"then this"

    def test_without_the_token_the_reason_is_told(self):
        with end_of(token=TOKEN) as end, self.port(end) as port:
            error = self.lost(port)
        assert error.rule == "turned-away"
        assert "this is not the token; state it in the environment as MOPRO_TOKEN" in str(error)

    def test_a_busy_controller_is_told_from_a_lost_link(self):
        with end_of() as end, connected(end), self.port(end) as port:
            error = self.lost(port)
        assert error.rule == "turned-away"
        assert "busy: another client is connected" in str(error)
