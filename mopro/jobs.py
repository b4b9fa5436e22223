"""Work on several items at once, as `--jobs` asks for, with memory made sure of.

A thread that cannot begin for lack of memory leaves Python waiting for it without end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
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

    Raises MemoryError as in_threads, and DataError if a process was ended from outside.
    """
    try:
        yield from _in_order(ProcessPoolExecutor, function, items, jobs)
    except BrokenProcessPool as error:
        message = f"one of {jobs} processes was ended, as for lack of memory; try fewer --jobs"
        raise DataError(message, "no-memory") from error


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
