"""A port to a virtual controller in the same process, in simulated time."""

from __future__ import annotations

from mopro.controller.station import Station
from mopro.errors import LinkError


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
