"""A TCP port for one client at a time, within bounds.

A second client is told that it is in the way, and takes the place of one that has been
silent for too long, or has sent more than the line carries for as long. With a token, a client
must state it before anything reaches the controller. Little is buffered: whoever sends faster
than the line carries has to wait.
"""

from __future__ import annotations

import hmac
import ipaddress
import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from mopro.errors import PortError
from mopro.link.token import LONGEST, NOTICE, STATEMENT

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

    `why` is the reason for that, `told` whether it has heard it.
    """

    socket: socket.socket
    since_s: float
    why: bytes = b""
    told: bool = False
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
        if not guest.told:
            guest.told = True
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
