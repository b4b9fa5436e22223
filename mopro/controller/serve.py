"""Serves the virtual controller to other processes in real time: pseudo-terminal or TCP."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from mopro.controller.station import Station
from mopro.controller.tcp import IDLE_S, TcpEnd, is_loopback
from mopro.errors import PortError
from mopro.link.token import VARIABLE

# The finest slice of waiting: shorter, and a fast line would keep a core busy.
_SLICE_S = 0.001
_IDLE_S = 0.25
_TICK_S = 0.05
_CHUNK = 4096
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
