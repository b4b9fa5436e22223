"""A TCP port for one client at a time, within bounds.

A second client is told that it is in the way, and takes the place of one that has been
silent for too long. With a token, a client must state it before anything reaches the
controller. Little is buffered: a client that sends faster than the line carries has to wait.
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
from mopro.link.token import LONGEST, NOTICE, PROMPT

IDLE_S = 60.0
_CHUNK = 4096
# A guest is one that is not the client: it has so long to state the token, or to hang up.
_GUEST_S = 5.0
_MOST_GUESTS = 8
_SEND_S = 1.0


@dataclass
class _Guest:
    """A connection that is not the client: it is asked for the token, or was turned away."""

    socket: socket.socket
    until_s: float
    turned_away: bool = False
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
        self._heard_s = 0.0
        self._ahead = b""
        self._guests: list[_Guest] = []
        self.address = f"socket://{host}:{self._server.getsockname()[1]}"

    def wait(self, seconds: float, room: int) -> bytes:
        """Bytes of the client, at most `room`; empty if none come within `seconds`."""
        self._drop_guests([g for g in self._guests if g.until_s < self._clock()])
        listened, client = [self._server, *(guest.socket for guest in self._guests)], self._client
        if client is not None and room > 0:
            listened.append(client)
        ready = select.select(listened, [], [], seconds)[0]
        if self._server in ready:
            self._accept()
        for guest in [g for g in self._guests if g.socket in ready]:
            self._listen_to(guest)
        if self._ahead:
            data, self._ahead = self._ahead, b""
            return data
        # Not a guest that has only now become the client: its socket was read already.
        return self._received(room) if client in ready and client is self._client else b""

    # -- who is the client -----------------------------------------------------

    def _accept(self) -> None:
        try:
            accepted, _ = self._server.accept()
        except OSError:  # gone again
            return
        accepted.setblocking(False)
        guest = _Guest(accepted, self._clock() + _GUEST_S)
        self._guests.append(guest)
        self._drop_guests(self._guests[:-_MOST_GUESTS])
        if self._token is None:
            self._admit(guest)
        else:
            self._tell(guest, PROMPT)

    def _listen_to(self, guest: _Guest) -> None:
        """Take the token of a guest; what one sends that was turned away is not looked at."""
        try:
            data = guest.socket.recv(LONGEST + 2)
        except OSError:
            data = b""
        if not data:
            self._drop_guests([guest])
        elif not guest.turned_away:
            guest.heard += data
            self._check_token(guest)

    def _check_token(self, guest: _Guest) -> None:
        line, end, rest = guest.heard.partition(b"\n")
        if not end and len(line) <= LONGEST:
            return
        if self._token is not None and hmac.compare_digest(line.rstrip(b"\r"), self._token):
            self._admit(guest, rest)
        else:
            self._turn_away(guest, b"this is not the token")

    def _admit(self, guest: _Guest, rest: bytes = b"") -> None:
        """Make `guest` the client, unless there is one that has not been silent for too long.

        `rest` is what it has said behind the token.
        """
        if self._client is not None:
            if self._clock() - self._heard_s < self._idle_s:
                self._turn_away(guest, b"busy: another client is connected")
                return
            self.hang_up()
        self._guests.remove(guest)
        guest.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        guest.socket.settimeout(_SEND_S)
        self._client, self._heard_s, self._ahead = guest.socket, self._clock(), rest

    def _turn_away(self, guest: _Guest, why: bytes) -> None:
        """Tell `guest` why, and leave it to hang up: a reset would destroy what it was told."""
        guest.turned_away = True
        self._tell(guest, NOTICE + why + b"\r\n")
        with suppress(OSError):
            guest.socket.shutdown(socket.SHUT_WR)

    @staticmethod
    def _tell(guest: _Guest, data: bytes) -> None:
        with suppress(OSError):
            guest.socket.send(data)

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
