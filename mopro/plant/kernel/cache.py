"""Compiled kernels on disk: keyed by all that they depend on, and checked before they are used.

A file holds the key, a digest of what follows, and what numba makes of a compiled function.
One that is truncated, damaged or of another key is as good as none. The folder is the user's
own (see cachefolder.py).
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType
from typing import Any

from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

# Untyped in numba.
rebuild: Callable[..., Any] = CompileResult._rebuild
dumped: Callable[[Any], bytes] = dumps

_SIZE = hashlib.sha256().digest_size
# What reading a result may meet whose digest is right, but which this numba did not write.
_UNREADABLE = (
    pickle.UnpicklingError, EOFError, ImportError, AttributeError, LookupError, TypeError,
    ValueError, RuntimeError,
)  # fmt: skip


class UnknownCodeError(Exception):
    """A function depends on something whose content cannot be told."""


def fingerprint(function: Callable[..., Any]) -> str:
    """All that `function` does, as a text: its code and all that it refers to.

    The same in every process. Raises UnknownCodeError if it needs anything but numbers,
    strings, tuples, `math`, Python's own functions and functions that need nothing else.
    """
    return repr(_facts(function, ()))


def _facts(value: object, above: tuple[object, ...]) -> object:
    """`value` as numbers and strings; `above` are the functions being described."""
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return value
    if isinstance(value, tuple):
        return "tuple", *(_facts(item, above) for item in value)
    if isinstance(value, CodeType):
        return _code_facts(value, above)
    if isinstance(value, FunctionType):
        if value in above:
            return "function", above.index(value)
        return _function_facts(value, (*above, value))
    if value is math:
        return "module", "math"
    if isinstance(value, BuiltinFunctionType | type) and value.__module__ in ("math", "builtins"):
        return value.__module__, value.__qualname__
    raise UnknownCodeError(repr(value))


def _function_facts(function: FunctionType, above: tuple[object, ...]) -> object:
    cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
    names = sorted(_names(function.__code__) & function.__globals__.keys())
    used = tuple((name, _facts(function.__globals__[name], above)) for name in names)
    facts = (_facts(part, above) for part in (function.__code__, function.__defaults__, cells))
    return "function", *facts, used


def _names(code: CodeType) -> set[str]:
    """The names of globals and attributes in `code` and the functions inside of it."""
    inner = [_names(part) for part in code.co_consts if isinstance(part, CodeType)]
    return set(code.co_names).union(*inner)


def _code_facts(code: CodeType, above: tuple[object, ...]) -> object:
    constants = tuple(_facts(constant, above) for constant in code.co_consts)
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return "code", code.co_code, code.co_argcount, code.co_flags, constants, names


class KernelCache:
    """The file of one compiled function, as numba asks for it (see numba.core.caching).

    `key` stands for all that the function depends on.
    """

    def __init__(self, path: Path, key: str) -> None:
        self._path = path
        self._key = hashlib.sha256(key.encode()).digest()

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(self._path.parent)

    def load_overload(self, sig: object, target_context: Any) -> Any:
        """The compiled function, or None if the file is not to be had or not to be trusted."""
        try:
            content = self._path.read_bytes()
        except OSError:
            return None
        key, digest, data = content[:_SIZE], content[_SIZE : 2 * _SIZE], content[2 * _SIZE :]
        if key != self._key or digest != hashlib.sha256(data).digest():
            return None
        # Compiled code refers to what numba loads on its first compilation only.
        target_context.refresh()
        try:
            return rebuild(target_context, *pickle.loads(data))
        except _UNREADABLE:
            return None

    def save_overload(self, sig: object, data: Any) -> None:
        """Write the compiled function, beside its place and then renamed; or nothing at all."""
        payload = dumped(data._reduce())
        content = self._key + hashlib.sha256(payload).digest() + payload
        try:
            self._path.parent.mkdir(exist_ok=True)
            _write(self._path, content)
        except OSError:
            return

    def flush(self) -> None:
        """Forget the file."""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)


def _write(path: Path, content: bytes) -> None:
    with tempfile.NamedTemporaryFile("wb", dir=path.parent, delete=False) as file:
        try:
            file.write(content)
            file.flush()
            os.replace(file.name, path)
        except OSError:
            os.unlink(file.name)
            raise
