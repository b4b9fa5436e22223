"""Ending a run safely: the stop goes out first, the report second, no signal in between.

`Signals` turns the first signal that would end the process into one exception, and only
notes those that follow. `StopOnError` encloses the whole conversation of a run: every
exception that leaves it has been answered with a stop.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Protocol

from mopro.errors import Interrupted, MoproError
from mopro.link.session import Session

# Neither ends nor suspends a process (the first four), cannot be caught, or is raised by the
# processor itself, which would raise it again for ever after a handler.
_NOT_ENDING = (
    *("SIGCHLD", "SIGCONT", "SIGURG", "SIGWINCH", "SIGKILL", "SIGSTOP"),
    *("SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL"),
)
# Suspend a process in the background that uses its terminal; where they are ignored it may write.
_OF_THE_BACKGROUND = ("SIGTTIN", "SIGTTOU")
# After a run signals are held back until its report is printed, but not for longer (s): whoever
# reads the report may stand still.
_REPORTED_WITHIN_S = 5.0
_KEYBOARD = "interrupted from the keyboard"
# Exceptions that a run reports as its trouble; all others are faults of a program, and raised.
_REPORTED = (MoproError, OSError, MemoryError, KeyboardInterrupt)


class Signals:
    """Signals that end this process, held back while this is entered, in the main thread.

    All that would end or suspend the process, and with it the watch over the motor: they are only
    noted, but for the first one within `raised()`: it is raised there, as Interrupted. May be
    entered again inside itself. Signals that are ignored stay so.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._before: dict[int, Any] = {}
        self._noted: int | None = None
        self._raised = self._armed = False
        self._asked: str | None = None

    def ask(self, reason: str) -> bool:
        """End the run from another thread, by a signal to this process, with `reason`.

        False if nothing is entered that could be ended.
        """
        ending = [n for n in tuple(self._before) if n not in _numbers(_OF_THE_BACKGROUND)]
        if not ending:
            return False
        number = ending[0]
        self._asked = self._asked or reason
        if sys.platform == "win32":
            interrupt_main(number)
        else:  # also wakes the thread that waits
            signal.pthread_kill(threading.main_thread().ident or 0, number)
        return True

    def __enter__(self) -> Signals:
        self._depth += 1
        if self._depth == 1:
            self._noted, self._raised = None, False
            self._install()
        return self

    def __exit__(self, *error: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            while self._before:
                signal.signal(*self._before.popitem())

    def _install(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        for number in sorted(signal.valid_signals() - _numbers(_NOT_ENDING)):
            before = signal.getsignal(number)
            if before not in (signal.SIG_IGN, None):
                self._before[number] = before
                ignored = number in _numbers(_OF_THE_BACKGROUND)
                signal.signal(number, signal.SIG_IGN if ignored else self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._noted = self._noted or number
        self._raise_noted()

    def _raise_noted(self) -> None:
        if self._armed and self._noted is not None and not self._raised:
            self._raised, self._armed = True, False
            reason = _KEYBOARD if self._noted == signal.SIGINT else f"ended by {_name(self._noted)}"
            raise Interrupted(self._asked or reason)

    @contextmanager
    def raised(self) -> Iterator[None]:
        """A part in which the first signal is raised, also one that came before it."""
        try:
            self._armed = True
            self._raise_noted()
            yield
        finally:
            self._armed = False

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """A part within `raised()` that is completed before a signal is raised."""
        armed, self._armed = self._armed, False
        try:
            yield
        finally:
            self._armed = armed
        self._raise_noted()

    def release(self) -> None:
        """Let the next signal be raised, wherever it comes."""
        self._noted, self._raised, self._armed = None, False, True

    @contextmanager
    def released_in_time(self) -> Iterator[None]:
        """A part, after a run, in which signals are raised again once it has lasted for long."""
        late = threading.Timer(_REPORTED_WITHIN_S, self.release)
        late.daemon = True
        late.start()
        try:
            yield
        finally:
            late.cancel()
            self._armed = False


def _numbers(names: Iterable[str]) -> set[int]:
    """The signals of these names that this system has."""
    return {int(getattr(signal, name)) for name in names if hasattr(signal, name)}


def _name(number: int) -> str:
    """The signal's name, or its number where it has none, as most of the real-time ones."""
    names = {int(known): known.name for known in signal.Signals}
    return names.get(number, f"signal {number}")


class TimeBudget:
    """The time that a run may take on the port's clock, some of it kept for the stop.

    `total_s` counts from `start_s` on and covers all of it; None is without end, and then
    the stop has `stop_s`.
    """

    _SHARE = 1 / 3

    def __init__(
        self, session: Session, total_s: float | None, stop_s: float, start_s: float | None
    ) -> None:
        self._session = session
        start_s = session.port.now_s() if start_s is None else start_s
        self._end_s = math.inf if total_s is None else start_s + total_s
        kept_s = stop_s if total_s is None else min(stop_s, total_s * self._SHARE)
        self._stop_s = stop_s
        session.bound(self._end_s - kept_s)

    def for_stop(self) -> float:
        """Open the time kept for the stop; gives how long that is from now, in seconds."""
        self._session.bound(self._end_s)
        return max(0.0, min(self._stop_s, self._end_s - self._session.port.now_s()))

    def close(self) -> None:
        """Leave the session without a bound."""
        self._session.bound(math.inf)


class Stoppable(Protocol):
    """A run as `StopOnError` needs it; `begun` is true once motion may have started."""

    begun: bool

    def stop(self, within_s: float) -> bool: ...

    def stop_report(self) -> str: ...


class StopOnError:
    """Context of a run that answers every exception with a stop.

    After that, `reason` says what ended a run that had begun, for a report; an exception
    before the start, or of an unforeseen kind, goes on with the outcome of the stop as a
    note. Enter `Signals.raised()` inside: outside of it no signal is raised any more.
    """

    def __init__(self, run: Stoppable, stop_s: Callable[[], float]) -> None:
        self._run = run
        self._stop_s = stop_s
        self.reason: str | None = None

    def __enter__(self) -> StopOnError:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        if error is None:
            return False
        self._run.stop(self._stop_s())
        if self._run.begun and isinstance(error, _REPORTED):
            self.reason = _reason_of(error)
            return True
        error.add_note(self._run.stop_report())
        return False


def _reason_of(error: BaseException) -> str:
    """The cause of a run's end, for a person."""
    if isinstance(error, KeyboardInterrupt):
        return str(error) or _KEYBOARD
    if isinstance(error, MemoryError):
        return "this computer has no memory left"
    return str(error)
