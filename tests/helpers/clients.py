"""Many hostile clients at once towards `mopro serve`, and the one that means well."""

from __future__ import annotations

import contextlib
import http.client
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from urllib.parse import urlsplit

from mopro.errors import LinkError
from mopro.link import SerialPort, Session, load_dialect

_OPENED_S = 30.0
_LOOK_S = 0.01
_ANSWERED_S = 5.0
_BUSY = b"mopro serve: busy"


@dataclass
class Client:
    """A connection of a hostile client; `heard` is what the server has told it."""

    kind: str
    random: Random
    address: tuple[str, int]
    socket: socket.socket = field(init=False)
    heard: bytes = b""
    sent: int = 0
    open: bool = False
    refused: bool = False

    def connect(self) -> None:
        self.socket = socket.socket()
        self.socket.settimeout(_ANSWERED_S)
        try:
            self.socket.connect(self.address)
        except OSError:
            self.refused = True
            return
        self.socket.setblocking(False)
        self.open = True

    def step(self) -> None:
        """Send the next of what the kind sends, and take what has come."""
        if not self.open:
            return
        try:
            data = KINDS[self.kind](self)
            if data:
                self.sent += self.socket.send(data)
        except BlockingIOError:
            pass
        except OSError:
            self.open = False
        self.listen()

    def listen(self) -> None:
        try:
            data = self.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self.heard = (self.heard + data)[-400:]
        self.open = self.open and bool(data)

    def cut(self) -> None:
        """Break the connection off with a reset."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()
        self.open = False

    def again(self) -> bytes:
        self.cut()
        self.connect()
        return b"x"

    def broken_off(self) -> bytes:
        """Half a line, and then the connection breaks off; the next begins anew."""
        if self.sent and self.random.random() < 0.2:
            return self.again()
        return b"12:DL SCR"

    @property
    def fate(self) -> str:
        """Answer of the server, in a word or two."""
        if self.refused:
            return "refused"
        if _BUSY in self.heard or b"HTTP/1.1 4" in self.heard or b"HTTP/1.1 503" in self.heard:
            return "told so"
        return "waits" if self.open else "dropped"


# What a client of each kind sends at each step.
KINDS: dict[str, Callable[[Client], bytes]] = {
    "slow bytes": lambda client: client.random.choice([b"", b"", b"S"]),
    "half messages": lambda client: b"1:SR*" if not client.sent else b"",
    "endless lines": lambda client: b"A" * 4096,
    "binary noise": lambda client: client.random.randbytes(512),
    "breaks off": Client.broken_off,
    "many connects": Client.again,
    "silent": lambda client: b"",
}
HTTP: dict[str, Callable[[Client], bytes]] = {
    "half requests": lambda client: b"GET / HTTP/1.1\r\nHost: " if not client.sent else b"",
    "endless headers": lambda client: (
        b"X: " + b"y" * 4096 + b"\r\n" if client.sent else b"GET / HTTP/1.1\r\n"
    ),
    "large bodies": lambda client: (
        b"b" * 4096
        if client.sent
        else (b"POST /stop HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999\r\n\r\n")
    ),
    "without token": lambda client: b"GET /feed HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
}
KINDS |= HTTP


class Server:
    """`mopro serve` in a process of its own: its addresses, its memory, its open files."""

    def __init__(self, process: subprocess.Popen[str], address: str, page: str | None) -> None:
        self.process = process
        self.address = address
        self.page = page

    def place(self, of_page: bool = False) -> tuple[str, int]:
        """Host and port of the line, or of the page."""
        found = urlsplit(self.page if of_page and self.page else self.address)
        return str(found.hostname), int(found.port or 0)

    @property
    def files(self) -> int:
        """Number of its open file descriptors."""
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    @property
    def mb(self) -> float:
        """Its resident memory, in MB."""
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", text)[1]) / 1024  # type: ignore[index]

    @property
    def cpu_s(self) -> float:
        """The processor time that it has taken."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def serving(*options: str, web: bool = False) -> Iterator[Server]:
    """A server on TCP, with the fastest line that there is; ended by SIGINT."""
    command = [sys.executable, "-m", "mopro", "serve", "--listen", "socket://127.0.0.1:0"]
    command += ["--baud", "4000000", *options, *(["--web"] if web else [])]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    )
    try:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stdout.readline().strip()
        page = process.stderr.readline().partition("Page: ")[2].strip() if web else None
        yield Server(process, address, page)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=_OPENED_S)


class Legitimate:
    """A client that asks for the status, and that may stop the controller."""

    def __init__(self, server: Server) -> None:
        dialect = load_dialect("checked")
        self._session = Session(SerialPort(server.address, dialect.line), dialect, Random(1))
        self._session.give(600.0)
        self._session.open()
        self.answers = 0
        self.slowest_s = 0.0

    def ask(self, statement: str = "status") -> None:
        began_s = time.monotonic()
        self._session.ask(statement)
        self.slowest_s = max(self.slowest_s, time.monotonic() - began_s)
        self.answers += 1

    def close(self) -> None:
        self._session.port.close()


@dataclass
class Outcome:
    """Result of a trial of one kind of client."""

    kind: str
    clients: int
    fates: Counter[str]
    answers: int
    slowest_s: float
    stop_s: float
    files_more: int
    mb_more: float
    cpu: float
    failures: tuple[str, ...]


def stormed(server: Server, kind: str, many: int, seconds: float, seed: int = 0) -> Outcome:
    """`many` clients of `kind` at once for `seconds`, while one that means well is served."""
    own = Legitimate(server)
    own.ask()
    files, mb, cpu_s, began_s = server.files, server.mb, server.cpu_s, time.monotonic()
    clients = [
        Client(kind, Random(f"{kind} {seed} {n}"), server.place(kind in HTTP)) for n in range(many)
    ]
    failures: list[str] = []
    try:
        for client in clients:
            client.connect()
        while time.monotonic() - began_s < seconds:
            for client in clients:
                client.step()
            own.ask()
            time.sleep(_LOOK_S)
        fates = Counter(client.fate for client in clients)
        peak_mb = server.mb
        cpu = (server.cpu_s - cpu_s) / (time.monotonic() - began_s)
        stop_s = _stopped_from_page(server) if kind in HTTP else _stopped(own)
        own.ask("stop")
    except (LinkError, OSError) as error:
        return Outcome(kind, many, Counter(), own.answers, own.slowest_s, 0, 0, 0, 0, (str(error),))
    finally:
        for client in clients:
            client.socket.close()
    files_more = _settled(lambda: server.files - files)
    own.close()
    if files_more > 0:
        failures.append("open files")
    if own.slowest_s > _ANSWERED_S:
        failures.append("slow answer")
    return Outcome(
        kind,
        many,
        fates,
        own.answers,
        own.slowest_s,
        stop_s,
        files_more,
        peak_mb - mb,
        cpu,
        tuple(failures),
    )


def _stopped_from_page(server: Server) -> float:
    """The time in which the page's button takes effect, on a connection of its own."""
    began_s = time.monotonic()
    found = urlsplit(server.page)
    page = http.client.HTTPConnection(*server.place(of_page=True), timeout=_OPENED_S)
    origin = {"Origin": f"http://{found.netloc}"}
    page.request("POST", f"/stop?{found.query}", '""', origin)
    status = page.getresponse().status
    page.close()
    if status != 204:
        raise LinkError(f"the page's stop was answered by {status}")
    return time.monotonic() - began_s


def _stopped(own: Legitimate) -> float:
    """The time that a stop takes to be acknowledged."""
    began_s = time.monotonic()
    own.ask("stop")
    return time.monotonic() - began_s


def _settled(more: Callable[[], int]) -> int:
    """`more()` once it is 0, or after the time that a guest may stay."""
    end_s = time.monotonic() + 2 * _ANSWERED_S
    while more() > 0 and time.monotonic() < end_s:
        time.sleep(_LOOK_S)
    return more()


def place_taken_from_a_silent_one(server: Server, limit_s: float) -> float:
    """Seconds until a client is served where a silent one has the place; `limit_s` at most."""
    with socket.create_connection(server.place()):
        began_s = time.monotonic()
        while time.monotonic() - began_s < limit_s:
            with contextlib.suppress(LinkError):
                Legitimate(server).close()
                return time.monotonic() - began_s
    return limit_s
