"""Work on several items at once, as `--jobs` asks for, with memory made sure of.

A thread that cannot begin for lack of memory leaves Python waiting for it without end. A process of
a pool waits for work without end once the one that began it is gone, and takes a signal's exception
for the answer of one item.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import TypeVar

from mopro.errors import DataError
from mopro.memory import make_sure

T = TypeVar("T")
R = TypeVar("R")

# Bytes of address space of a thread: its stack, twice. Halved, a thread may not begin, and Python
# waits for it; doubled, more commands that had enough are refused.
_A_THREAD = 16 << 20


def in_threads(function: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """`function` of each of `items`, in order, by `jobs` threads; by this one if that is 1.

    Raises MemoryError if there is no memory for the threads.
    """
    return _in_order(ThreadPoolExecutor, function, items, jobs)


def in_processes(function: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """`function` of each of `items`, in order, by `jobs` processes; by this one if that is 1.

    They end with this one, and where it ends in between. Raises MemoryError as in_threads, and
    DataError if a process was ended from outside.
    """
    try:
        yield from _in_order(_Processes, function, items, jobs)
    except BrokenProcessPool as error:
        message = f"one of {jobs} processes was ended, as for lack of memory; try fewer --jobs"
        raise DataError(message, "no-memory") from error


class _Processes(ProcessPoolExecutor):
    """A pool whose processes end where the work is left unfinished."""

    def __init__(self, jobs: int) -> None:
        super().__init__(jobs, initializer=_end_when_told)
        self._others = set(multiprocessing.active_children())

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool | None:
        if kind is not None:
            self.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()
        return super().__exit__(kind, error, trace)


def _end_when_told() -> None:
    """Have a process of a pool end by signals, and with the process that began it."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a process of a pool has been begun by another one"
    parent.join()
    os._exit(1)


def _in_order(
    pool_of: Callable[[int], Executor],
    function: Callable[[T], R],
    items: Iterable[T],
    jobs: int,
) -> Iterator[R]:
    if jobs == 1:
        yield from map(function, items)
        return
    make_sure(jobs * _A_THREAD)
    with pool_of(jobs) as pool:
        yield from pool.map(function, items)
