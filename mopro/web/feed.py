"""Messages of a run to the pages that look at it; written in one thread, read in another."""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

# Messages that wait for a page; one that is further behind gets a snapshot instead.
_MOST_WAITING = 2000

Message = tuple[int, str, str]


class Feed:
    """Numbered messages (event and JSON); `snapshot` gives all that there is so far.

    What changes the state behind `snapshot` does so within `lock`.
    """

    def __init__(self, snapshot: Callable[[], dict[str, Any]]) -> None:
        self._snapshot = snapshot
        self._messages: deque[Message] = deque(maxlen=_MOST_WAITING)
        self._number = 0
        self.lock = threading.RLock()
        self.ended = threading.Event()
        self.looked_at = threading.Event()

    def tell(self, event: str, data: Any) -> None:
        """Add a message for all pages."""
        with self.lock:
            self._number += 1
            self._messages.append((self._number, event, _text(data)))

    def end(self, words: str) -> None:
        """Add the last message."""
        self.tell("end", words)
        self.ended.set()

    def begin(self) -> Message:
        """A snapshot as the first message of a page; those after its number follow it."""
        with self.lock:
            self.looked_at.set()
            return self._number, "snapshot", _text(self._snapshot())

    def after(self, number: int) -> list[Message]:
        """The messages after `number`, or a snapshot if some of them are gone."""
        with self.lock:
            if self._messages and self._messages[0][0] > number + 1:
                return [self.begin()]
            return [message for message in self._messages if message[0] > number]


def _text(data: Any) -> str:
    return json.dumps(data, allow_nan=False, separators=(",", ":"))
