"""The virtual controller with its serial line: bytes in, bytes out, at the line's rate.

The caller is the other end: it states the time at which bytes go in and are asked for.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from mopro.controller.device import Device
from mopro.controller.faults import Fault, FaultInjector, Scenario
from mopro.controller.protocol import Protocol
from mopro.controller.store import MemoryStore, Store
from mopro.emulator import Emulator
from mopro.errors import LinkError
from mopro.link.dialect import Dialect

# Bytes that wait for the line: towards the controller, and from it (the listing of the
# longest program is shorter). What is beyond is lost, as on a line without handshake.
MOST_INWARD = 8192
MOST_OUTWARD = 1 << 20


class Wire:
    """One direction of the line; each byte takes `byte_s` seconds, at most `most` wait."""

    def __init__(self, byte_s: float, most: int) -> None:
        self._byte_s = byte_s
        self._most = most
        self._free_s = -math.inf
        self._queue: deque[tuple[float, int]] = deque()

    def put(self, data: bytes, now_s: float) -> None:
        for byte in data[: self.room]:
            self._free_s = max(self._free_s, now_s) + self._byte_s
            self._queue.append((self._free_s, byte))

    @property
    def room(self) -> int:
        """Number of further bytes that may wait."""
        return self._most - len(self._queue)

    @property
    def next_s(self) -> float:
        """The time (s) at which the next byte arrives; inf if none is on its way."""
        return self._queue[0][0] if self._queue else math.inf

    def take(self) -> tuple[float, int]:
        return self._queue.popleft()

    def clear(self) -> None:
        self._queue.clear()


class Station:
    """The virtual controller with its line; `baud` is the dialect's unless given."""

    def __init__(
        self,
        dialect: Dialect,
        emulator: Emulator,
        store: Store | None = None,
        scenario: Scenario | None = None,
        baud: int | None = None,
        grammar: str = "attested",
    ) -> None:
        scenario = scenario or Scenario()
        self.injector = FaultInjector(scenario)
        self.store = store if store is not None else MemoryStore()
        self.device = Device(emulator, self.store, scenario.plant, grammar)
        self.byte_s = dialect.line.bits_per_byte / (baud or dialect.line.baud)
        self._dialect = dialect
        self._protocol = Protocol(dialect, self.device)
        self._inward = Wire(self.byte_s, MOST_INWARD)
        self._outward = Wire(self.byte_s, MOST_OUTWARD)
        self._late: list[tuple[float, bytes]] = []
        self._reached_s = -math.inf
        self._down_until_s = -math.inf
        self._line_end = ord(dialect.line.end[-1]), ord(dialect.line.reply_end[-1])

    def connected(self, now_s: float) -> bool:
        return not self.injector.active("disconnect", now_s)

    @property
    def room(self) -> int:
        """Number of further bytes that the line takes towards the controller."""
        return self._inward.room

    def meet(self, client: int) -> None:
        """Take what comes from now on as that of `client`."""
        self._protocol.client = client

    def hear(self, data: bytes, now_s: float) -> None:
        """Take bytes that the other end sends at `now_s`."""
        if self.connected(now_s):
            self._inward.put(data, now_s)
        else:
            self.injector.count("disconnect")

    def next_s(self) -> float:
        """The time (s) of the next event on the line; inf if there is none."""
        return min(self._inward.next_s, self._outward.next_s, self._late_s())

    def _late_s(self) -> float:
        return min((at_s for at_s, _ in self._late), default=math.inf)

    def say(self, now_s: float) -> bytes:
        """Advance to `now_s`; returns the bytes that have arrived at the other end by then."""
        while (due_s := min(self._inward.next_s, self._late_s())) <= now_s:
            self._process(due_s)
        self._reset_up_to(now_s)
        out = bytearray()
        while self._outward.next_s <= now_s:
            due_s, byte = self._outward.take()
            if self.connected(due_s):
                out += bytes(self.injector.byte("to_host", byte, self._line_end[1]))
        return bytes(out)

    def suffer(self, fault: Fault, now_s: float) -> None:
        """Have a fault of the wire or the controller happen just after `now_s`."""
        self.injector.add(replace(fault, at_s=math.nextafter(now_s, math.inf)))

    def _process(self, due_s: float) -> None:
        """Process the late replies or the incoming byte due at `due_s`."""
        self._reset_up_to(due_s)
        for late in [late for late in self._late if late[0] <= due_s]:
            self._late.remove(late)
            self._outward.put(late[1], due_s)
        if self._inward.next_s > due_s:
            return
        due_s, byte = self._inward.take()
        if due_s < self._down_until_s or not self.connected(due_s):
            return
        echo = self._dialect.conversation.echo
        self._protocol.echo = echo and not self.injector.active("echo_off", due_s)
        self._protocol.busy = self.injector.active("busy", due_s)
        for arrived in self.injector.byte("to_controller", byte, self._line_end[0]):
            echoed, reply = self._protocol.feed(arrived, due_s)
            self._outward.put(echoed, due_s)
            delay_s, reply = self.injector.reply(reply)
            if delay_s:
                self._late.append((due_s + delay_s, reply))
            else:
                self._outward.put(reply, due_s)

    def _reset_up_to(self, now_s: float) -> None:
        for reset_s in self.injector.resets(self._reached_s, now_s):
            self.injector.count("reset")
            self.device.reset(reset_s)
            self._protocol.restart()
            self._outward.clear()
            down = [f.for_s for f in self.injector.scenario.faults if f.at_s == reset_s]
            self._down_until_s = reset_s + (down[0] if math.isfinite(down[0]) else 0.0)
        self._reached_s = max(self._reached_s, now_s)


# -- a port in memory -------------------------------------------------------------------------
# A port to a virtual controller in the same process, in simulated time.


class LoopbackPort:
    """The host's end of a station's line; its clock advances only while the host waits.

    With `breaks`, a disconnect raises LinkError from then on, as a socket or a USB adapter
    does; without, it is silence, as of a serial plug that is pulled.
    """

    def __init__(self, station: Station, breaks: bool = False) -> None:
        self.station = station
        self._breaks = breaks
        self._broken = False
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def write(self, data: bytes) -> None:
        self._check()
        self.station.hear(data, self._now_s)

    def read(self, until_s: float) -> bytes:
        while True:
            self._check()
            data = self.station.say(self._now_s)
            if data:
                return data
            next_s = self.station.next_s()
            if next_s > until_s:
                self._now_s = max(self._now_s, until_s)
                return b""
            self._now_s = max(self._now_s, next_s)

    def _check(self) -> None:
        self._broken = self._broken or not self.station.connected(self._now_s)
        if self._breaks and self._broken:
            raise LinkError("the link is lost: the other end hung up", "link-lost")

    def close(self) -> None:
        return
