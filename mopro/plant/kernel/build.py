"""Kernels composed for sets of effects, plain or compiled, each made once."""

from __future__ import annotations
import functools
from mopro.plant.kernel.integrate import integrate_of
from mopro.plant.kernel.motion import parts_of
from mopro.plant.kernel.terms import TermSet


def as_it_stands(f):
    return f


@functools.cache
def kernel(terms, nominal, compiled):
    prepare = as_it_stands
    if compiled:
        import numba
        from numba.extending import is_jitted
        import os

        jit = numba.njit(nogil=True, forceinline=bool(os.environ.get("FI")))
        prepare = lambda f: f if is_jitted(f) else jit(f)
    parts = parts_of(terms, nominal, prepare)
    f = integrate_of(parts, prepare)
    if compiled:
        f = numba.njit(nogil=True)(f)
    return f
