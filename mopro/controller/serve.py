"""Serves the virtual controller to other processes: pseudo-terminal, or TCP within bounds."""

from __future__ import annotations

import hmac
import ipaddress
import os
import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from mopro.controller.station import Station
from mopro.errors import PortError
from mopro.link.token import LONGEST, NOTICE, STATEMENT, VARIABLE

# -- a TCP port -------------------------------------------------------------------------------
# A TCP port for one client at a time, within bounds.
#
# A second client is told that it is in the way, and takes the place of one that has been
# silent for too long, or has sent more than the line carries for as long. With a token, a client
# must state it before anything reaches the controller. Little is buffered: whoever sends faster
# than the line carries has to wait.


IDLE_S = 60.0
_CHUNK = 4096
# A guest is one that is not the client: it has so long to state the token, or to hang up. One
# that is turned away is told so when it speaks, or after a while: at once would be too early, as
# what comes while a port is being opened may be lost there.
_GUEST_S = 5.0
_SILENT_S = 0.5
_MOST_GUESTS = 8
_SEND_S = 1.0
_LONGEST_STATEMENT = len(STATEMENT) + LONGEST + 2


@dataclass
class _Guest:
    """A connection that is not the client: it has to state the token, or is turned away.

    `why` is the reason for that, `informed` whether it has been sent it.
    """

    socket: socket.socket
    since_s: float
    why: bytes = b""
    informed: bool = False
    heard: bytes = b""


def is_loopback(host: str) -> bool:
    """True if only programs of this machine can reach `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class TcpEnd:
    """The port; `idle_s` is how long a client may be silent while another one waits."""

    def __init__(
        self,
        host: str,
        port: int,
        token: str | None = None,
        idle_s: float = IDLE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        try:
            self._server = socket.create_server((host, port))
        except (OSError, OverflowError, UnicodeError) as error:
            message = f"socket://{host}:{port}: cannot be listened on: {error}"
            raise PortError(message, "no-port") from error
        # Accepted sockets inherit it: what is sent ahead of the line waits at the sender.
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _CHUNK)
        self._server.setblocking(False)
        self._token = None if token is None else token.encode("ascii")
        self._idle_s = idle_s
        self._clock = clock
        self._client: socket.socket | None = None
        self.client = 0
        self._heard_s = 0.0
        self._drained_s = 0.0
        self._ahead = b""
        self._opening: bytes | None = None
        self._guests: list[_Guest] = []
        self.address = f"socket://{host}:{self._server.getsockname()[1]}"

    def wait(self, seconds: float, room: int) -> bytes:
        """Bytes of the client, at most `room`; empty if none come within `seconds`."""
        self._look_after_guests()
        listened, client = [self._server, *(guest.socket for guest in self._guests)], self._client
        if client is not None and room > 0:
            listened.append(client)
        ready = select.select(listened, [], [], seconds)[0]
        if self._server in ready:
            self._accept()
        if client is not None and room > 0 and client not in ready:
            self._drained_s = self._clock()
        if client in ready and client is self._client:
            return self._received(room)
        for guest in [g for g in self._guests if g.socket in ready]:
            self._listen_to(guest)
        data, self._ahead = self._ahead, b""
        return data

    # -- who is the client -----------------------------------------------------

    def _accept(self) -> None:
        try:
            accepted, _ = self._server.accept()
        except OSError:  # gone again
            return
        accepted.setblocking(False)
        guest = _Guest(accepted, self._clock())
        self._guests.append(guest)
        self._turn_away(self._guests[:-_MOST_GUESTS])
        if self._token is None:
            self._admit(guest)

    def _listen_to(self, guest: _Guest) -> None:
        """Take the token of a guest; what one sends that is turned away is not looked at."""
        try:
            data = guest.socket.recv(_LONGEST_STATEMENT)
        except OSError:
            data = b""
        if not data:
            self._drop_guests([guest])
        elif guest.why:
            self._tell(guest)
        else:
            guest.heard += data
            self._check_token(guest)
            if guest.why:
                self._tell(guest)

    def _check_token(self, guest: _Guest) -> None:
        line, end, rest = guest.heard.partition(b"\n")
        if not end and len(line) < _LONGEST_STATEMENT:
            return
        stated = line.rstrip(b"\r").removeprefix(STATEMENT)
        if self._token is None or hmac.compare_digest(stated, self._token):
            self._admit(guest, rest)
        else:
            guest.why = b"this is not the token"

    def _admit(self, guest: _Guest, rest: bytes = b"") -> None:
        """Make `guest` the client, unless there is one that keeps its place.

        `rest` is what it has said behind the token.
        """
        now_s = self._clock()
        if self._client is not None:
            if now_s - min(self._heard_s, self._drained_s) < self._idle_s:
                guest.why = b"busy: another client is connected"
                return
            self.hang_up()
        self._guests.remove(guest)
        guest.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        guest.socket.settimeout(_SEND_S)
        self._client, self._heard_s, self._drained_s = guest.socket, now_s, now_s
        self.client += 1
        self._ahead, self._opening = rest, None if self._token else b""

    @staticmethod
    def _tell(guest: _Guest) -> None:
        """Tell `guest` why, and leave it to hang up: a reset would destroy what it was told."""
        if not guest.informed:
            guest.informed = True
            with suppress(OSError):
                guest.socket.send(NOTICE + guest.why + b"\r\n")
                guest.socket.shutdown(socket.SHUT_WR)

    def _turn_away(self, guests: list[_Guest]) -> None:
        """Drop guests at once, told why; what they have sent and nobody reads would be a reset."""
        for guest in guests:
            with suppress(OSError):
                guest.socket.recv(_CHUNK)
            guest.why = guest.why or b"busy: too many wait"
            self._tell(guest)
        self._drop_guests(guests)

    def _look_after_guests(self) -> None:
        now_s = self._clock()
        self._drop_guests([g for g in self._guests if now_s - g.since_s > _GUEST_S])
        for guest in self._guests:
            if guest.why and now_s - guest.since_s > _SILENT_S:
                self._tell(guest)

    def _drop_guests(self, guests: list[_Guest]) -> None:
        for guest in guests:
            guest.socket.close()
            self._guests.remove(guest)

    # -- the client ------------------------------------------------------------

    def _received(self, room: int) -> bytes:
        assert self._client is not None, "only a client is read"
        try:
            data = self._client.recv(min(room, _CHUNK))
        except OSError:
            data = b""
        if not data:
            self.hang_up()
        self._heard_s = self._clock()
        return self._without_token(data)

    def _without_token(self, data: bytes) -> bytes:
        """`data` without the statement of a token that nobody asked for."""
        if self._opening is None:
            return data
        self._opening += data
        line, end, rest = self._opening.partition(b"\n")
        stating = line[: len(STATEMENT)] == STATEMENT[: len(line)]
        if stating and not end and len(line) < _LONGEST_STATEMENT:
            return b""
        data = rest if stating and end and len(line) > len(STATEMENT) else self._opening
        self._opening = None
        return data

    def send(self, data: bytes) -> None:
        """Send to the client; one that takes nothing for a second is dropped."""
        if self._client is None or not data:
            return
        try:
            self._client.sendall(data)
        except OSError:
            self.hang_up()

    def hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        self.hang_up()
        self._drop_guests(list(self._guests))
        self._server.close()


# -- the server -------------------------------------------------------------------------------
# Serves the virtual controller to other processes in real time: pseudo-terminal or TCP.

# The finest slice of waiting: shorter, and a fast line would keep a core busy.
_SLICE_S = 0.001
_IDLE_S = 0.25
_TICK_S = 0.05
_MOST_UNSENT = 65536


class End(Protocol):
    """The far end of the line as the server holds it; `address` is for `--port`.

    `client` numbers those who have been at it, where that can be known.
    """

    address: str
    client: int

    def wait(self, seconds: float, room: int) -> bytes:
        """At most `room` bytes as soon as any come; empty if none do within `seconds`."""
        ...

    def send(self, data: bytes) -> None: ...

    def hang_up(self) -> None:
        """Drop the client, as a pulled plug does."""
        ...

    def close(self) -> None: ...


class PtyEnd:
    """A pseudo-terminal; a client that sets another baud rate than `baud` gets garbage."""

    def __init__(self, baud: int | None = None) -> None:
        import termios
        import tty

        self._termios = termios
        self.client = 0
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._unsent = b""
        self._baud = getattr(termios, f"B{baud}", None) if baud else None
        if self._baud is not None:
            attributes = termios.tcgetattr(self._slave)
            attributes[4] = attributes[5] = self._baud
            termios.tcsetattr(self._slave, termios.TCSANOW, attributes)
        os.set_blocking(self._master, False)
        self.address = os.ttyname(self._slave)

    def wait(self, seconds: float, room: int) -> bytes:
        if not select.select([self._master] if room > 0 else [], [], [], seconds)[0]:
            return b""
        return self._as_heard(os.read(self._master, min(room, _CHUNK)))

    def send(self, data: bytes) -> None:
        # A client that does not read fills the terminal's buffer, and then this one; what
        # is over is lost, as on a line without handshake.
        self._unsent = (self._unsent + self._as_heard(data))[-_MOST_UNSENT:]
        with suppress(BlockingIOError):
            self._unsent = self._unsent[os.write(self._master, self._unsent) :]

    def hang_up(self) -> None:
        return

    def close(self) -> None:
        os.close(self._master)
        os.close(self._slave)

    def _as_heard(self, data: bytes) -> bytes:
        """`data`, garbled if the client has set another rate."""
        if self._baud is None or self._termios.tcgetattr(self._slave)[4] == self._baud:
            return data
        return bytes(0x80 | (byte * 83) % 128 for byte in data)


def open_end(
    listen: str,
    baud: int | None = None,
    allow_remote: bool = False,
    token: str | None = None,
    idle_s: float = IDLE_S,
) -> End:
    """The end that `listen` names: `pty`, or `socket://ADDRESS:PORT` (PORT 0: any free one).

    An address that other machines can reach needs `allow_remote` and a `token`; `idle_s` is
    how long a client may be silent while another one waits. PortError if it cannot be.
    """
    if listen == "pty":
        try:
            return PtyEnd(baud)
        except (ImportError, AttributeError) as error:
            message = "this system has no pseudo-terminals: use --listen socket://127.0.0.1:0"
            raise PortError(message, "no-port") from error
    host, colon, port = listen.removeprefix("socket://").rpartition(":")
    if not listen.startswith("socket://") or not colon or not host or not port.isdecimal():
        raise PortError(f"{listen}: expected pty or socket://ADDRESS:PORT", "no-port")
    if not is_loopback(host):
        _check_remote(listen, allow_remote, token)
    return TcpEnd(host, int(port), token, idle_s)


def _check_remote(listen: str, allow_remote: bool, token: str | None) -> None:
    if not allow_remote:
        message = f"{listen}: other machines could reach this address and move the motor"
        raise PortError(f"{message}; if they shall, add --allow-remote", "remote")
    if token is None:
        message = f"{listen}: other machines could reach this address without a token"
        raise PortError(f"{message}; state one in the environment as {VARIABLE}", "remote")


def serve(
    station: Station,
    end: End,
    speed: float = 1.0,
    clock: Callable[[], float] = time.monotonic,
    going: Callable[[], bool] = lambda: True,
    tick: Callable[[float], None] | None = None,
) -> None:
    """Answer at `end` for as long as `going`, with time `speed` times the clock's.

    `tick` is called with the station's time twenty times a second or more.
    """
    idle_s = _IDLE_S if tick is None else _TICK_S
    station.device.speed = speed
    origin_s = clock()
    linked = True
    while going():
        now_s = (clock() - origin_s) * speed
        pause_s = (station.next_s() - now_s) / speed
        data = end.wait(min(max(pause_s, _SLICE_S), idle_s), station.room)
        now_s = (clock() - origin_s) * speed
        if data:
            station.meet(end.client)
            station.hear(data, now_s)
        end.send(station.say(now_s))
        if tick is not None:
            tick(now_s)
        if linked and not station.connected(now_s):
            end.hang_up()
        linked = station.connected(now_s)
