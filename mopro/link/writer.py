"""A stream of a run that is watched, with a thread of its own, so that it holds nobody up.

A stream may block for ever: a pipe whose reader stands still, a terminal after Ctrl-S, a disk that
is gone. Its thread then stays behind, and ends with the process.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Generic, TypeVar

from mopro.errors import DataError, MoproError

S = TypeVar("S")

# Writes that may wait: ten seconds of the trace of a run that is polled twenty times a second.
MOST = 1000
# Whoever hands something to a stream that keeps up waits so long (s) for it to be written, so that
# a failure is told at once.
_GRACE_S = 0.02
# A stream that has taken nothing for this time (s) is given up at its end.
PATIENCE_S = 2.0


class Writer(Generic[S]):
    """Does what is `put` to the stream that `opened` gives, in order, in a thread of its own.

    The thread opens and closes the stream. `name` is the stream's, for a person. At most `most`
    writes wait. An error ends the stream; it is raised by the constructor, the next `put` or
    `close`: DataError, or another MoproError or MemoryError as it came.
    """

    def __init__(self, name: str, opened: AbstractContextManager[S], most: int = MOST) -> None:
        self._name = name
        self._opened = opened
        self._most = most
        self._changed = threading.Condition()
        self._waiting: deque[Callable[[S], object]] = deque()
        self._taken = 0
        self._is_open = self._held = self._closing = self._ended = False
        self._error: MoproError | OSError | MemoryError | None = None
        threading.Thread(target=self._work, name=name, daemon=True).start()
        with self._changed:
            self._changed.wait_for(lambda: self._is_open or self._ended)
        self._raise_error()

    def put(self, write: Callable[[S], object]) -> None:
        """Have `write` done to the stream; nothing is raised while held."""
        is_full = len(self._waiting) >= self._most
        self._hand_over(write)
        if self._held:
            return
        self._raise_error()
        if is_full:
            raise self._blocked()

    def offer(self, write: Callable[[S], object]) -> None:
        """Have `write` done if the stream keeps up; nothing is raised."""
        if not self._held and not self._ended and len(self._waiting) < self._most:
            self._hand_over(write)

    def _hand_over(self, write: Callable[[S], object]) -> None:
        with self._changed:
            self._waiting.append(write)
            self._changed.notify_all()
            if len(self._waiting) == 1 and not self._held:
                self._changed.wait_for(lambda: not self._waiting or self._ended, _GRACE_S)

    def hold(self) -> None:
        """Write nothing before `close`: what is put waits."""
        with self._changed:
            self._held = True

    def close(self, patience_s: float = PATIENCE_S) -> None:
        """Write what waits, and close the stream.

        DataError too if it takes nothing for `patience_s` seconds.
        """
        with self._changed:
            self._held, self._closing = False, True
            self._changed.notify_all()
            taken = None
            while not self._ended and taken != self._taken:
                taken = self._taken
                self._changed.wait_for(self._gone_beyond(taken), patience_s)
            is_blocked = not self._ended
        self._raise_error()
        if is_blocked:
            raise self._blocked()

    def _gone_beyond(self, taken: int) -> Callable[[], bool]:
        return lambda: self._ended or self._taken != taken

    # -- in the thread ---------------------------------------------------------

    def _work(self) -> None:
        try:
            with self._opened as stream:
                with self._changed:
                    self._is_open = True
                    self._changed.notify_all()
                while self._has_work():
                    self._waiting[0](stream)
                    with self._changed:
                        self._waiting.popleft()
                        self._taken += 1
                        self._changed.notify_all()
        except (MoproError, OSError, MemoryError) as error:
            self._error = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    def _has_work(self) -> bool:
        """Wait for a write that may be done; False at the end."""
        with self._changed:
            self._changed.wait_for(
                lambda: (self._waiting and not self._held) or (self._closing and not self._waiting)
            )
            return bool(self._waiting)

    # -- words -----------------------------------------------------------------

    def _raise_error(self) -> None:
        error = self._error
        if isinstance(error, OSError):
            message = f"{self._name} cannot be written: {error.strerror or error}"
            raise DataError(message, "unwritable-output") from error
        if error is not None:
            raise error
        if self._ended and not self._closing:
            raise RuntimeError(f"the thread that writes {self._name} has ended")

    def _blocked(self) -> DataError:
        message = f"{self._name} cannot be written: nothing takes what is written there"
        return DataError(f"{message} (does the reader of a pipe stand still?)", "unwritable-output")
