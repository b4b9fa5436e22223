"""A kernel for one set of effects, plain or compiled: the same text, the same bits."""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mopro.plant.kernel_text import CONSTANTS, CURRENT_LOOP_S, Layout, kernel_parts

__all__ = ["CURRENT_LOOP_S", "AssembledKernel", "Layout", "assemble"]

_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class AssembledKernel:
    """`integrate` and `rates` as kernel_text.py writes them; `rates` is always plain."""

    integrate: Callable[..., int]
    rates: Callable[..., tuple[float, ...]]
    layout: Layout
    compiled: bool


def assemble(layout: Layout, compiled: bool) -> AssembledKernel:
    """The kernel of `layout`, plain or compiled; each is made once.

    Keyed by the effects' classes in their order, so two sets never share a kernel. A
    compiled one lets other threads run and is kept in the user's cache.
    """
    with _ONE_AT_A_TIME:
        return _compiled(layout) if compiled else _plain(layout)


@functools.cache
def _plain(layout: Layout) -> AssembledKernel:
    names: dict[str, Any] = {"math": math, **CONSTANTS, **layout.terms()}
    for name, part in kernel_parts(layout).items():
        exec(compile(part, f"<kernel {name}>", "exec"), names)
    return AssembledKernel(names["integrate"], names["rates"], layout, False)


@functools.cache
def _compiled(layout: Layout) -> AssembledKernel:
    from mopro.plant.kept import built

    return AssembledKernel(built(layout), _plain(layout).rates, layout, True)
