"""Memory made sure of before work that ends or halts the process where it lacks any."""

from __future__ import annotations

import mmap


def make_sure(size: int) -> None:
    """Return at once if `size` more bytes can be had now; else raise MemoryError."""
    try:
        mmap.mmap(-1, size).close()
    except OSError as error:
        raise MemoryError from error
