"""Kernels compiled by numba; importing this costs what numba costs."""

from __future__ import annotations

import functools
import hashlib
import platform
from collections.abc import Callable
from importlib.metadata import version
from types import CellType, FunctionType
from typing import Any

import numba
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target
from numba.extending import is_jitted

from mopro.plant.kernel.cache import KernelCache, UnknownCodeError, fingerprint
from mopro.plant.kernel.effect_terms import TermSet
from mopro.plant.kernel.equation_of_motion import parts_of, start_of
from mopro.plant.kernel.integrate import Integrate, integrate_of
from mopro.process.cachefolder import cache_folder
from mopro.process.jit import njit

_ARRAY, _TABLE = numba.float64[::1], numba.float64[:, ::1]
_INDICES = numba.intp[::1]
# No `fastmath`, so that the bits are those of plain Python. A division by zero gives infinity or
# NaN instead of an exception. No wrappers but the one that Python calls: they take longer to
# compile than the function.
_OUTER = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_INNER = {**_OUTER, "forceinline": True, "no_cpython_wrapper": True}
# Untyped in numba.
_type_of: Callable[[object], Any] = numba.typeof


def compiled(terms: TermSet, nominal: bool, plain: Integrate) -> Integrate:
    """`integrate` of a set of effects, for the types that the engine passes.

    Taken from the user's cache or left there, unless the code of a term refers to something
    whose content cannot be told, or there is no cache. `plain` is the same function in Python.
    """
    try:
        return _compiled(terms, nominal, plain, allocates=False)
    except NumbaError:
        return _compiled(terms, nominal, plain, allocates=True)


def _compiled(terms: TermSet, nominal: bool, plain: Integrate, allocates: bool) -> Integrate:
    """As above; a kernel that allocates memory, as for a list, takes longer to compile.

    Only that needs numba's runtime (NRT), without which a third less code is made: uses of
    arrays are not counted. Raises NumbaError if a kernel is to allocate, but may not.
    """
    signature = _signature(terms)
    key, name = _identity(plain, str(signature))

    def prepare(function: Callable[..., Any]) -> Any:
        if is_jitted(function) or not isinstance(function, FunctionType):
            return function
        if function.__closure__ is None:
            return _shared(function, allocates)
        inner = tuple(CellType(prepare(cell.cell_contents)) for cell in function.__closure__)
        return njit(**_INNER, _nrt=allocates)(_renamed(function, name, inner))

    integrate = njit(**_OUTER, _nrt=allocates)(
        _renamed(integrate_of(parts_of(terms, nominal, prepare), prepare), name)
    )
    folder = cache_folder()
    if key and folder:
        integrate._cache = KernelCache(folder / "kernels" / f"{name}.kernel", key)
    integrate.compile(signature)
    made: Integrate = integrate
    return made


def _identity(function: Callable[..., Any], signature: str = "") -> tuple[str | None, str]:
    """All that compiled code of `function` depends on, if it can be told, and a name for that."""
    try:
        key = repr((*_surroundings(), signature, fingerprint(function)))
    except UnknownCodeError:
        return None, "uncached"
    return key, hashlib.sha256(key.encode()).hexdigest()[:24]


@functools.cache
def _shared(function: FunctionType, allocates: bool) -> Any:
    """A function that is the same in every kernel, compiled once in a process."""
    name = _identity(function, str(allocates))[1]
    return njit(**_INNER, _nrt=allocates)(_renamed(function, name))


def _renamed(function: Any, name: str, closure: tuple[CellType, ...] | None = None) -> FunctionType:
    """A copy whose compiled symbols are of this kernel, or of this shared function, alone.

    `closure`: what it refers to, if not the same.

    numba numbers symbols anew in each process, so those of two cached kernels could meet.
    """
    copy = FunctionType(
        function.__code__,
        function.__globals__,
        function.__name__,
        function.__defaults__,
        closure or function.__closure__,
    )
    copy.__qualname__ = f"{function.__name__}_{name}"
    return copy


def _signature(terms: TermSet) -> Any:
    """The types of the arguments of `integrate`, in their order."""
    numbers = tuple((0.0,) * len(effect.parameters) for effect in terms.effects)
    plant, limits, state = (0.0,) * 8, (0.0,) * 3, start_of(terms)
    types = [_type_of(value) for value in (plant, limits, True, numbers, state)]
    return (_ARRAY, _INDICES, _TABLE, _INDICES, _TABLE, *types, _TABLE, _TABLE)


@functools.cache
def _surroundings() -> tuple[object, ...]:
    """Options, versions and processor that compiled code depends on beside its source."""
    processor = cpu_target.target_context.codegen().magic_tuple()
    versions = [version(name) for name in ("mopro", "numba", "llvmlite", "numpy")]
    return *_INNER.items(), platform.python_version(), *versions, *processor
