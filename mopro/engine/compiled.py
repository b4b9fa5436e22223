"""Loops compiled by numba, where that is installed, on their first call."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

Loop = TypeVar("Loop", bound=Callable[..., Any])


def compiled(loop: Loop) -> Loop:
    """`loop`, compiled on its first call, or as it stands where there is no numba.

    What is compiled is kept where numba keeps it.
    """

    @functools.cache
    def built() -> Callable[..., Any]:
        try:
            import numba
        except ImportError:
            return loop
        made: Callable[..., Any] = numba.njit(cache=True, nogil=True)(loop)
        return made

    @functools.wraps(loop)
    def call(*arguments: Any) -> Any:
        return built()(*arguments)

    return call  # type: ignore[return-value]
