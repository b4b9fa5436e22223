"""Both ends of a line in memory, for the tests of link and controller."""

from dataclasses import dataclass, replace
from random import Random

import mopro
from mopro.controller import LoopbackPort, MemoryStore, Scenario, Station
from mopro.emulator import Emulator
from mopro.link import SerialBackend, Session, load_dialect
from mopro.link.flash import statements_of
from mopro.machine import load_machine
from mopro.recording import MemorySink

SHORT = "UU012500/1\nVEL1 8.0\nACC1 0.25\nMRI1 2.0\nWX1\nWT50\nMRI1 -1.0\nWX1\n"
OLD = "UU012500/1\nWT100\n"
DIALECTS = ("checked", "plain")


@dataclass
class Bench:
    station: Station
    session: Session

    @property
    def stored(self):
        return self.station.store.read("MAIN")

    def run(self, program, for_s=None, settle_s=0.0, **options):
        backend = SerialBackend(self.session, load_machine("chow1992"), **options)
        sink = MemorySink()
        run = backend.run(program, sink, for_s, settle_s)
        return sink.recording(backend.header(program), run)


class Impatient:
    """A port at which someone presses Ctrl-C at a given time."""

    def __init__(self, port, at_s):
        self.port = port
        self.at_s = at_s

    def __getattr__(self, name):
        return getattr(self.port, name)

    def read(self, until_s):
        data = self.port.read(until_s)
        if self.port.now_s() > self.at_s:
            self.at_s = float("inf")
            raise KeyboardInterrupt
        return data


class Hasty:
    """A port to a virtual controller that does all `speed` (2^n) times as fast, and says so."""

    def __init__(self, joined, speed):
        self.port, self.speed = joined.session.port, speed
        joined.station.device.speed = speed

    def __getattr__(self, name):
        return getattr(self.port, name)

    def now_s(self):
        return self.port.now_s() / self.speed

    def read(self, until_s):
        return self.port.read(until_s * self.speed)


def bench(dialect="checked", *faults, seed=1, plant=(), store=None, breaks=False, opened=True):
    language = load_dialect(dialect) if isinstance(dialect, str) else dialect
    scenario = Scenario(seed, faults, plant)
    emulator = Emulator(load_machine("chow1992"))
    station = Station(language, emulator, store or MemoryStore(), scenario)
    session = Session(LoopbackPort(station, breaks), language, Random(seed))
    session.give(120.0)
    if opened:
        session.open()
    return Bench(station, session)


def without(dialect, *statements):
    """A shipped dialect that lacks some statements."""
    language = load_dialect(dialect)
    known = {key: s for key, s in language.statements.items() if key not in statements}
    return replace(language, statements=known)


def old_in(store):
    store.write("MAIN", statements_of(mopro.compile(OLD)))
    return store


def with_line(dialect, **changes):
    return replace(dialect, line=replace(dialect.line, **changes))
