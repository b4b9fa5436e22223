"""Fits and simulations that run at once, in threads."""

from __future__ import annotations

import mmap
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

# Bytes of address space of a thread: its stack, twice. A thread that cannot begin for lack of
# memory leaves Python waiting for it without end. Halved, that may happen; doubled, more calls that
# had enough are refused.
_A_THREAD = 16 << 20


def in_threads(function: Callable[[T], R], items: Iterable[T], jobs: int) -> Iterator[R]:
    """`function` of each of `items`, in order, by `jobs` threads; by this one if that is 1.

    Raises MemoryError if there is no memory for the threads.
    """
    if jobs == 1:
        yield from map(function, items)
        return
    try:
        mmap.mmap(-1, jobs * _A_THREAD).close()
    except OSError as error:
        raise MemoryError from error
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(function, items)
