"""Runs on the virtual controller that trouble ends at random moments, in simulated time.

Stops are counted at the controller, and its motion is looked up in its own memory.
"""

import errno
import io
import signal
import threading
from collections.abc import Callable
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from random import Random
from types import SimpleNamespace
from typing import ClassVar

import mopro
from helpers.bench_of_link import DIALECTS, bench
from mopro.controller.faults import Fault
from mopro.errors import MoproError
from mopro.link import SerialBackend
from mopro.link.dialect import STATES
from mopro.link.transport import TracedPort
from mopro.link.writer import Writer
from mopro.machine import load_machine

# The opening and the upload take about a second; the program goes on for much longer.
LAST_S = 8.0
# An axis brakes within 0.1 s, and a controller that hears nothing begins after 3 s.
BRAKED_S = 0.5
SILENCE_S = 3.0
# Bytes that the host has sent reach the controller within this.
IN_FLIGHT_S = 0.2
AFTERWARDS_S = 5.0
SIGNALS = ("SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGTSTP")
FAILURES = (
    "no stop received", "moved after a reported stop", "nothing told", "not braked", "not ended",
)  # fmt: skip


class Killed(BaseException):
    """The end of the host's process: nothing is sent any more."""


@dataclass
class Trial:
    """One run and what came of it; times in seconds on the line's clock.

    `failures` are of FAILURES; `told` is what the host said in the end.
    """

    kind: str
    seed: int
    begun: bool
    lived: bool
    stop_after_s: float | None
    told: str
    failures: tuple[str, ...]

    @property
    def ending(self) -> str:
        """The outcome in a word or two."""
        if "the run has ended" in self.told:
            return "after the end"
        if not self.begun:
            return "before the start"
        if not self.lived:
            return "braked by itself"
        return "stop not confirmed" if "NOT CONFIRMED" in self.told else "stop confirmed"


class TroubledPort:
    """A port on which `trouble` happens at `at_s`, and `times` - 1 times more at later calls.

    No read waits past that moment. A dead port sends and receives nothing.
    """

    def __init__(self, port, at_s, trouble=lambda: None, times=1):
        self.line, self._trouble, self._times = port, trouble, times
        self.at_s = at_s
        self.dead = False

    def now_s(self):
        return self.line.now_s()

    def write(self, data):
        if not self.dead:
            self.line.write(data)
        self._befall()

    def read(self, until_s):
        if self.dead:
            raise Killed
        waits = self._times > 0 and self.now_s() < self.at_s
        data = self.line.read(min(until_s, self.at_s) if waits else until_s)
        self._befall()
        return data

    def close(self):
        self.line.close()

    def plug_into(self, port):
        """Go on with another line, at the same time."""
        port._now_s = self.now_s()
        self.line = port

    def _befall(self):
        if self._times > 0 and self.now_s() >= self.at_s:
            self._times -= 1
            self._trouble()


class FullSink:
    """A recording that takes nothing any more from `is_full()` on."""

    def __init__(self, is_full=lambda: False):
        self._is_full = is_full

    def write(self, columns):
        if self._is_full():
            raise OSError(errno.ENOSPC, "No space left on device")

    def close(self):
        return


class FullLog(io.StringIO):
    """A trace that takes nothing any more from `is_full()` on."""

    name = "trace.log"

    def __init__(self, is_full):
        super().__init__()
        self._is_full = is_full

    def flush(self):
        if self._is_full():
            raise OSError(errno.ENOSPC, "No space left on device")


def raised(error: BaseException) -> Callable[[], None]:
    def trouble():
        raise error

    return trouble


def program_of(random):
    """Moves there and back for ever, one axis or both, in either profile."""
    lines = ["UU012500/1", f"VEL0 {random.choice(['4.0', '8.0', '12.0'])}", "ACC0 0.25"]
    lines += ["PARA0+"] if random.random() < 0.5 else []
    lines.append(":A")
    way = f"{random.uniform(0.5, 4.0):.3f}"
    if random.random() < 0.3:
        lines += [f"MR1 {way}", f"MR2 -{way}", "GO", "WX0", f"MR1 -{way}", f"MR2 {way}", "GO"]
        lines.append("WX0")
    else:
        axis = random.choice("12")
        lines += [f"MRI{axis} {way}", f"WX{axis}", f"WT{random.randint(1, 100)}"]
        lines += [f"MRI{axis} -{way}", f"WX{axis}"]
    return mopro.compile("\n".join([*lines, "JUMP A"]) + "\n", "trial.CMD")


class Ending:
    """One trial: both ends of a line in memory, and a kind of trouble at a random moment."""

    # Each takes the Ending and prepares its trouble.
    KINDS: ClassVar[dict[str, Callable[["Ending"], None]]]

    def __init__(self, kind: str, seed: int) -> None:
        self.kind, self.seed = kind, seed
        self.random = random = Random(f"{kind} {seed}")
        self.at_s = random.uniform(0.0, LAST_S)
        cut = kind == "line cut"
        faults = [Fault("disconnect", at_s=self.at_s)] if cut else []
        # The dialect plain has no heartbeat: nothing stops its controller without a line.
        self.lives = kind not in ("line cut", "host killed", "another controller")
        dialect = random.choice(DIALECTS) if kind not in ("line cut", "host killed") else "checked"
        self.brakes_alone = dialect == "checked"
        self.joined = bench(dialect, *faults, seed=seed, breaks=random.random() < 0.5, opened=False)
        self.device = self.joined.station.device
        self.heard: list[tuple[str, float]] = []
        self.line = self.joined.session.port
        self.port = TroubledPort(self.line, self.at_s)
        self.sink, self.log = FullSink(), None
        self.over = threading.Event()
        self.deadline_s = None
        self.for_s = 60.0
        self._count()
        self.KINDS[kind](self)
        self.joined.session.port = TracedPort(self.port, self.log) if self.log else self.port

    def _count(self) -> None:
        do = self.device.do

        def counted(statement, fields, now_s):
            self.heard.append((statement, now_s))
            return do(statement, fields, now_s)

        self.device.do = counted

    def times(self, *statements: str) -> list[float]:
        """The moments at which the controller was told one of `statements`."""
        return [at_s for said, at_s in self.heard if said in statements]

    @property
    def is_due(self) -> bool:
        return self.port.now_s() >= self.at_s

    def troubled(self, trouble: Callable[[], None], times: int = 1) -> None:
        self.port = TroubledPort(self.line, self.at_s, trouble, times)

    # -- the run and its account ---------------------------------------------------

    def run(self) -> Trial:
        program = program_of(self.random)
        backend = SerialBackend(
            self.joined.session, load_machine("chow1992"), deadline_s=self.deadline_s
        )
        ended = True
        try:
            told = backend.run(program, self.sink, self.for_s).trouble or ""
            told = told or self._closed()
            ended = bool(told)
        except (MoproError, OSError, MemoryError, KeyboardInterrupt, ArithmeticError) as error:
            told = "\n".join([str(error), *getattr(error, "__notes__", [])])
        except Killed:
            told = ""
        finally:
            self.over.set()
        return self._account(told, ended)

    def _closed(self) -> str:
        """What is said of a recording that cannot be closed; empty if it can."""
        try:
            self.sink.close()
        except MoproError as error:
            return f"the run has ended, but its recording is lost: {error}"
        return ""

    def _account(self, told: str, ended: bool) -> Trial:
        until_s = self.port.now_s() + IN_FLIGHT_S
        with suppress(MoproError):
            while self.port.now_s() < until_s:
                self.port.line.read(until_s)
        begun = bool(self.times("run", "run_for"))
        now_s = self.port.now_s()
        failures = ["not ended"] if begun and not ended else []
        if "the run has ended" in told:
            return Trial(self.kind, self.seed, begun, self.lives, None, told, tuple(failures))
        if self.lives:
            stops = [at_s for at_s in self.times("stop") if at_s >= self.at_s]
            failures += [] if stops else ["no stop received"]
            failures += [] if "stop" in told else ["nothing told"]
            delay_s = stops[0] - self.at_s if stops else None
        else:
            delay_s = None
            now_s = max(now_s, self.heard[-1][1] if self.heard else 0.0) + SILENCE_S + BRAKED_S
            self.device.move_on(now_s)
            failures += ["not braked"] if self.brakes_alone and self._moves_after(now_s) else []
        confirmed = "NOT CONFIRMED" not in told and "standstill was not seen" not in told
        if self.lives and confirmed and self._moves_after(now_s):
            failures.append("moved after a reported stop")
        return Trial(self.kind, self.seed, begun, self.lives, delay_s, told, tuple(failures))

    def _moves_after(self, now_s: float) -> bool:
        places = ("position", "measured")
        before = [self.device.do(name, {}, now_s) for name in places]
        moving = self.device.do("motion", {}, now_s)[0]
        after = [self.device.do(name, {}, now_s + AFTERWARDS_S) for name in places]
        return before != after or any(moving.values())


# -- the kinds of trouble ----------------------------------------------------------


def one_signal(name: str | None = None) -> Callable[[Ending], None]:
    def prepare(ending: Ending) -> None:
        number = getattr(signal, name or ending.random.choice(SIGNALS))
        ending.troubled(lambda: signal.raise_signal(number))

    return prepare


def several_signals(ending: Ending) -> None:
    def trouble():
        signal.raise_signal(getattr(signal, ending.random.choice(("SIGINT", *SIGNALS))))

    ending.troubled(trouble, ending.random.randint(2, 40))


def exception(make: Callable[[], BaseException]) -> Callable[[Ending], None]:
    return lambda ending: ending.troubled(raised(make()))


def full_recording(ending: Ending) -> None:
    """A disk that is full from the first piece of the recording after the moment on."""
    ending.sink = FullSink(lambda: ending.is_due)


def full_trace(ending: Ending) -> None:
    ending.log = FullLog(lambda: ending.is_due)


def senseless_reply(ending: Ending) -> None:
    do = ending.device.do
    digits = ending.random.choice((16, 40, 400))

    def senseless(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        if statement == "sample" and now_s >= ending.at_s and not ending.times("stop"):
            return [rows[0] | {"position_1": "9" * digits}]
        return rows

    ending.device.do = senseless


def deadline(ending: Ending) -> None:
    """An end of the time allowed; its third is kept for the stop, so the stop is sent before."""
    ending.deadline_s = 1.0 + ending.at_s
    ending.at_s = 0.0


def host_killed(ending: Ending) -> None:
    def trouble():
        ending.port.dead = True
        raise Killed

    ending.troubled(trouble)


def odd_word(ending: Ending) -> None:
    """One status of a running program that says something else, with a checksum of its own."""
    do = ending.device.do
    word = ending.random.choice([state for state in STATES if state != "running"])
    said: list[float] = []

    def odd(statement, fields, now_s):
        rows = do(statement, fields, now_s)
        if statement == "status" and rows[0]["state"] == "running" and now_s >= ending.at_s:
            said.append(now_s)
            if len(said) == 1:
                ending.at_s = now_s
                return [rows[0] | {"state": word}]
        return rows

    ending.device.do = odd
    ending.port = TroubledPort(ending.line, ending.at_s, times=0)


def another_controller(ending: Ending) -> None:
    """The plug in another controller of the kind, with the same program or with none."""
    ending.for_s = 20.0
    other = bench(ending.joined.session.dialect, seed=ending.seed)
    stored, random = other.station.store, ending.random
    history = random.choice(["new", "ended", "stopped", "running"])

    def trouble():
        device, now_s = other.station.device, ending.port.now_s()
        program = ending.joined.station.store.read("SCRATCH")
        if program is not None and history != "new":
            stored.write("SCRATCH", program)
            # One that runs the same program, begun within 2 % of its time, cannot be told.
            began_s = min([now_s, *ending.times("run_for")]) - random.uniform(2.0, 9.0)
            began_s -= 30.0 if history == "ended" else 0.0
            device.do("run_for", {"name": "SCRATCH", "milliseconds": 20e3}, began_s)
            if history == "stopped":
                device.do("stop", {}, began_s + 1.0)
            device.move_on(now_s)
        ending.port.plug_into(other.session.port)

    ending.troubled(trouble)


class Blocked(io.StringIO):
    """A log or a recording that takes nothing from `is_due()` on until the trial is over."""

    name = "blocked.log"

    def __init__(self, is_due: Callable[[], bool], over: threading.Event) -> None:
        super().__init__()
        self._is_due, self._over = is_due, over

    def write(self, what: object) -> None:
        if self._is_due():
            self._over.wait(60.0)

    def flush(self) -> None:
        return


def blocked_trace(ending: Ending) -> None:
    ending.log = Blocked(lambda: ending.is_due, ending.over)


def blocked_recording(ending: Ending) -> None:
    stream = nullcontext(Blocked(lambda: ending.is_due, ending.over))
    writer: Writer[Blocked] = Writer("the recording", stream, most=1)
    ending.sink = SimpleNamespace(
        write=lambda columns: writer.put(lambda sink: sink.write(columns)),
        close=lambda: writer.close(0.1),
    )


Ending.KINDS = {
    "SIGINT": one_signal("SIGINT"),
    "another signal": one_signal(),
    "several signals": several_signals,
    "recording's disk full": full_recording,
    "trace's disk full": full_trace,
    "no memory": exception(MemoryError),
    "input or output error": exception(lambda: OSError(errno.EIO, "Input/output error")),
    "fault of the program": exception(lambda: ZeroDivisionError("a fault")),
    "senseless reply": senseless_reply,
    "deadline": deadline,
    "odd status word": odd_word,
    "another controller": another_controller,
    "blocked trace": blocked_trace,
    "blocked recording": blocked_recording,
    "line cut": lambda ending: None,
    "host killed": host_killed,
}


@contextmanager
def signals_at_default():
    """All signals as a person's shell leaves them, whoever started this process."""
    numbers = [getattr(signal, name) for name in ("SIGINT", *SIGNALS)]
    before = {number: signal.signal(number, signal.SIG_DFL) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def trial(kind: str, seed: int) -> Trial:
    """The trial of this kind and seed, the same in every process; in the main thread only."""
    with signals_at_default():
        return Ending(kind, seed).run()
