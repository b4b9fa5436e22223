"""Runs on a controller that turns hostile at a random moment, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

import mopro
from helpers.bench_of_link import bench
from mopro.errors import MoproError
from mopro.link import SerialBackend, load_dialect
from mopro.machine import load_machine
from mopro.recording import MemorySink

DEADLINE_S = 30.0
SLACK_S = 0.5
FAILURES = ("no stop sent", "late", "another error")
_PROGRAM = "UU012500/1\nVEL0 4.0\nACC0 0.25\n:A\nMRI1 1.0\nWX1\nMRI1 -1.0\nWX1\nJUMP A\n"
_LAST_S = 6.0
_OTHER = {"checked": "plain", "plain": "checked"}


@dataclass(frozen=True)
class Trial:
    """One run and its end; `failures` are of FAILURES."""

    kind: str
    seed: int
    ending: str
    failures: tuple[str, ...]


class HostilePort:
    """A port whose other end says what `speak` makes of what it was told, from `at_s` on."""

    def __init__(
        self, port: object, byte_s: float, at_s: float, speak: Callable[[bytes], bytes]
    ) -> None:
        self._port, self._byte_s, self._speak = port, byte_s, speak
        self.at_s = at_s
        self._told = self._saying = b""
        self._ahead_s = 0.0
        self.heard: list[tuple[float, bytes]] = []

    def now_s(self) -> float:
        return self._port.now_s() + self._ahead_s

    def write(self, data: bytes) -> None:
        self.heard.append((self.now_s(), data))
        self._told = (self._told + data)[-4096:]
        if self.now_s() < self.at_s:
            self._port.write(data)

    def read(self, until_s: float) -> bytes:
        if self.now_s() < self.at_s:
            return self._port.read(min(until_s, self.at_s))
        if not self._saying:
            told, self._told = self._told, b""
            self._saying = self._speak(told)
        room = max(1, int((until_s - self.now_s()) / self._byte_s))
        data, self._saying = self._saying[:room], self._saying[room:]
        self._ahead_s += len(data) * self._byte_s if data else max(0.0, until_s - self.now_s())
        return data

    def close(self) -> None:
        self._port.close()


def _odd(random: Random, dialect: object) -> Callable[[bytes], bytes]:
    """Well-framed lines of anything, each under the number that was asked for last."""
    number = 0

    def speak(told: bytes) -> bytes:
        nonlocal number
        line = "".join(chr(random.randrange(32, 127)) for _ in range(random.randrange(1, 60)))
        if dialect.check is not None:
            asked = told.decode("latin-1").rsplit(dialect.line.end, 2)[-2:-1]
            head = asked[0].partition(":")[0] if asked else ""
            number = int(head) if head.isascii() and head.isdigit() else number
            line = dialect.check.wrap(line, number % dialect.check.numbers)
        return (line + dialect.line.reply_end).encode("latin-1") if told else b""

    return speak


def _foreign(random: Random, dialect: object) -> Callable[[bytes], bytes]:
    """The answers of a controller with another dialect."""
    station = bench(_OTHER[dialect.name], seed=random.randrange(99), opened=False).session.port
    other = load_dialect(_OTHER[dialect.name])

    def speak(told: bytes) -> bytes:
        if not told:
            return b""
        station.write(told)
        return station.read(station.now_s() + 0.2) or other.line.reply_end.encode("latin-1")

    return speak


KINDS: dict[str, Callable[[Random, object], Callable[[bytes], bytes]]] = {
    "odd replies": _odd,
    "endless line": lambda random, dialect: lambda told: b"A" * 512,
    "endless lines": lambda random, dialect: lambda told: b"OK\r\n" * 128,
    "another dialect": _foreign,
    "silence": lambda random, dialect: lambda told: b"",
    "echo": lambda random, dialect: lambda told: told,
    "NUL bytes": lambda random, dialect: lambda told: bytes(64),
    "binary noise": lambda random, dialect: lambda told: random.randbytes(64) if told else b"",
}  # fmt: skip


def trial(kind: str, dialect: str, seed: int, last_s: float = _LAST_S) -> Trial:
    """The trial of this kind, dialect and seed, the same in every process.

    The controller turns hostile within `last_s`.
    """
    random = Random(f"{kind} {dialect} {seed}")
    joined = bench(dialect, seed=seed, opened=False)
    language, session = load_dialect(dialect), joined.session
    at_s = random.uniform(0.0, last_s)
    port = HostilePort(session.port, session.byte_s, at_s, KINDS[kind](random, language))
    session.port = port
    backend = SerialBackend(session, load_machine("chow1992"), deadline_s=DEADLINE_S)
    failures = []
    try:
        told = backend.run(mopro.compile(_PROGRAM), MemorySink(), 60.0).trouble
        ending = "reported as done" if told is None else "ended early"
        if told is not None and "NOT CONFIRMED" in told:
            ending = "stop not confirmed"
    except MoproError:
        ending = "not begun"
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what is looked for
        ending = f"{type(error).__name__}: {error}"[:60]
        failures.append("another error")
    stop = language.statements["stop"].text.encode()
    if ending != "reported as done" and not any(stop in d for s, d in port.heard if s >= at_s):
        failures.append("no stop sent")
    if port.now_s() > DEADLINE_S + SLACK_S:
        failures.append("late")
    return Trial(kind, seed, ending, tuple(failures))
