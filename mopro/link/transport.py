"""Bytes to and from a port, with time; the only importer of serial."""

from __future__ import annotations

import errno
import re
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from socket import gaierror
from typing import Any, Protocol, TextIO

import serial
from serial.tools import list_ports

from mopro.errors import DataError, LinkError, PortError
from mopro.link.dialect import Line
from mopro.link.token import NOTICE, VARIABLE, statement
from mopro.link.writer import Writer

# How long one look at the port may block; deadlines are kept to within it.
_LOOK_S = 0.02
_WRITE_TIMEOUT_S = 2.0
_WHY = re.compile(re.escape(NOTICE) + rb"([ -~]{1,80})")
_REMEMBERED = 256
# pyserial tells an odd option of a URL by KeyError, an odd pattern of hwgrep:// by re.error.
_BAD_URL = (serial.SerialException, OSError, ValueError, KeyError, TypeError, re.error)
_PARITY = {"none": "N", "even": "E", "odd": "O"}

# A host and its port, without the kind of the port.
_ADDRESS = re.compile(r"(?:\w+:/{0,2})?([\w.-]+:\d+)")
_DEVICE = "expected a device, such as /dev/ttyUSB0 or COM3"
# How the URLs of pyserial are written.
_FORMS = {
    "socket": "socket://HOST:PORT, PORT from 1 to 65535",
    "rfc2217": "rfc2217://HOST:PORT, PORT from 1 to 65535",
    "loop": "loop://",
    "hwgrep": "hwgrep://PATTERN, a regular expression that a port of this machine matches",
    "spy": "spy://DEVICE",
    "alt": "alt://DEVICE?class=NAME, a class of pyserial",
}
_NO_WAY = "there is no way to that machine: look at the address, the cable and the network"
_OF_A_NETWORK = {
    errno.ECONNREFUSED: "nothing listens there: is the controller on, and is this its port number?",
    errno.ECONNRESET: "the other end hung up: does another program have the controller?",
    errno.ETIMEDOUT: "that machine does not answer: look at the address and the network",
    errno.EHOSTUNREACH: _NO_WAY,
    errno.EHOSTDOWN: _NO_WAY,
    errno.ENETUNREACH: _NO_WAY,
    errno.ENETDOWN: _NO_WAY,
    errno.EADDRNOTAVAIL: _NO_WAY,
}
_NO_LINE = f"it is a file, or a device without a serial line: {_DEVICE}"
_NO_DEVICE = "no device is behind it: is it plugged in, and switched on?"
_OF_A_DEVICE: dict[int | None, str] = {
    errno.EISDIR: f"it is a folder: {_DEVICE}",
    errno.ENOTTY: _NO_LINE,
    errno.EINVAL: _NO_LINE,
    errno.EIO: _NO_DEVICE,
    errno.ENODEV: _NO_DEVICE,
    errno.ENXIO: _NO_DEVICE,
}


class Port(Protocol):
    """One end of a line. `now_s` is its clock, in seconds from any origin."""

    def now_s(self) -> float: ...

    def write(self, data: bytes) -> None: ...

    def read(self, until_s: float) -> bytes:
        """Bytes as soon as any have come; empty if none came by `until_s`."""
        ...

    def close(self) -> None: ...


class SerialPort:
    """A port of this machine, or whatever pyserial's URLs reach; PortError if it cannot be."""

    def __init__(
        self, url: str, line: Line, baud: int | None = None, token: str | None = None
    ) -> None:
        options: dict[str, Any] = {
            "baudrate": baud or line.baud,
            "bytesize": line.data_bits,
            "parity": _PARITY[line.parity],
            "stopbits": line.stop_bits,
            "xonxoff": line.handshake == "xon-xoff",
            "rtscts": line.handshake == "rts-cts",
            "timeout": _LOOK_S,
            "write_timeout": _WRITE_TIMEOUT_S,
        }
        if "://" not in url:
            options["exclusive"] = True
        self.url = url
        try:
            self._serial = serial.serial_for_url(url, **options)
        except _BAD_URL as error:
            raise _port_error(url, error) from error
        self._heard = b""
        if token is not None and url.startswith("socket://"):
            self.write(statement(token))

    def now_s(self) -> float:
        return time.monotonic()

    def write(self, data: bytes) -> None:
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException as error:
            message = f"{self.url}: the line takes no more bytes (is a handshake line held?)"
            raise LinkError(message, "link-lost") from error
        except (serial.SerialException, OSError) as error:
            raise self._lost(error) from error

    def read(self, until_s: float) -> bytes:
        try:
            while True:
                data = bytes(self._serial.read(1))
                if data:
                    data += self._waiting()
                    self._heard = (self._heard + data)[-_REMEMBERED:]
                    return data
                if self.now_s() >= until_s:
                    return b""
        except (serial.SerialException, OSError, TypeError) as error:
            # pyserial raises TypeError where another thread or a signal closed the port.
            raise self._lost(error) from error

    def _waiting(self) -> bytes:
        """The bytes that are already received, fetched at once.

        A link that is lost behind them is told by the next read, not instead of them.
        """
        data = bytearray()
        with suppress(serial.SerialException, OSError, TypeError):
            while (count := self._serial.in_waiting) and len(data) < 65536:
                data += self._serial.read(count)
        return bytes(data)

    def close(self) -> None:
        with suppress(serial.SerialException, OSError):
            self._serial.close()

    def _lost(self, error: Exception) -> LinkError:
        if notice := _WHY.search(self._heard):
            why = notice[1].decode("ascii", "replace")
            hint = f"; state it in the environment as {VARIABLE}" if "token" in why else ""
            return LinkError(f"{self.url}: turned away: {why}{hint}", "turned-away")
        return LinkError(f"{self.url}: the link is lost: {error}", "link-lost")


def _port_error(url: str, error: Exception) -> PortError:
    """The error for a port that could not be opened, with its reason and remedy."""
    number, text = _number_of(error), str(error)
    url = url if url.strip() else repr(url)
    if number in (errno.ENOENT, errno.ENOTDIR) or "FileNotFoundError" in text:
        known = ", ".join(name for name, _ in available_ports()) or "none"
        message = f"{url}: there is no such port; ports of this machine: {known}"
        if place := _ADDRESS.fullmatch(url):
            message += f"; one of a network is written socket://{place[1]}"
        return PortError(message, "no-port")
    if number in (errno.EACCES, errno.EPERM) or "PermissionError" in text:
        message = f"{url}: no permission; on Linux, join the group that owns it (often dialout)"
        return PortError(message, "no-permission")
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in text:
        return PortError(f"{url}: another program has this port open", "port-in-use")
    return PortError(f"{url}: cannot be opened: {_why(url, number, error)}", "no-port")


def _why(url: str, number: int | None, error: Exception) -> str:
    """The reason why a port cannot be opened, and what to do, in words."""
    scheme, found, rest = url.partition("://")
    if not found:
        return _OF_A_DEVICE.get(number or 0, f"it is no serial port: {_DEVICE}")
    if scheme.lower() not in _FORMS:
        return f"there are no ports of {scheme}://: {_DEVICE}, or socket://HOST:PORT"
    if isinstance(error.__context__, gaierror):
        return f"there is no machine of that name: look at the name, and at the network ({rest})"
    timed_out = isinstance(error.__context__, TimeoutError)
    if said := _OF_A_NETWORK.get(errno.ETIMEDOUT if timed_out else number or 0):
        return said
    if said := _OF_A_DEVICE.get(number or 0):
        return said
    options = ", without these options" if "?" in rest else ""
    return f"expected {_FORMS[scheme.lower()]}{options}"


def _number_of(error: BaseException | None) -> int | None:
    """The system's number of an error, or of that which it stands for."""
    while error is not None:
        first = error.args[0] if error.args else None
        number = getattr(error, "errno", None) or first
        if isinstance(number, int):
            return number
        error = error.__context__
    return None


def available_ports() -> list[tuple[str, str]]:
    """Device and description of each serial port of this machine."""
    return sorted((port.device, port.description) for port in list_ports.comports())


class TracedPort:
    """A port that logs every byte with its time, as text and in hexadecimal.

    `log` is a context that opens a text file and closes it, as a file is itself; `name` is that of
    the file, unless it has one. Bytes are sent before they are logged, and nobody waits for the
    log. One that cannot be written raises one DataError, and ends.
    """

    def __init__(
        self,
        port: Port,
        log: AbstractContextManager[TextIO],
        note: Callable[[], str] = lambda: "",
        name: str = "the log",
    ) -> None:
        self._port = port
        self._start_s = port.now_s()
        self._writer: Writer[TextIO] | None = Writer(
            f"{getattr(log, 'name', name)}: the trace", log
        )
        self._write_log(
            "# seconds from opening; > to the controller, < from it; hexadecimal; text\n" + note()
        )

    def now_s(self) -> float:
        return self._port.now_s()

    def write(self, data: bytes) -> None:
        at_s = self.now_s()
        self._port.write(data)
        self._trace(">", data, at_s)

    def read(self, until_s: float) -> bytes:
        data = self._port.read(until_s)
        if data:
            self._trace("<", data, self.now_s())
        return data

    def hold(self) -> None:
        """Write nothing to the log before `close`."""
        if self._writer is not None:
            self._writer.hold()

    def close(self) -> None:
        """Close the port, and the log if it has not failed; DataError if it fails now."""
        self._port.close()
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def _trace(self, direction: str, data: bytes, at_s: float) -> None:
        rows = []
        for first in range(0, len(data), 16):
            row = data[first : first + 16]
            shown = row.decode("latin-1").translate(_SHOWN)
            rows.append(f"{at_s - self._start_s:12.6f} {direction} {row.hex(' '):<47}  {shown}\n")
        self._write_log("".join(rows))

    def _write_log(self, text: str) -> None:
        """Log `text` as long as that works; DataError when it fails."""
        if self._writer is None:
            return
        try:
            self._writer.put(lambda log: _append(log, text))
        except DataError:
            self._writer = None
            raise


def _append(log: TextIO, text: str) -> None:
    log.write(text)
    log.flush()


_SHOWN = {
    code: "." for code in range(256) if not chr(code).isascii() or not chr(code).isprintable()
}
