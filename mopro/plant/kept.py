"""Compiled kernels, kept in the user's cache; importing this costs what numba costs.

A kernel's whole text, with the terms of its effects, is written to a file named by its
hash, and numba keeps what it makes of the file beside it. What runs is always the text
made here: the file only tells numba when its own is out of date.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import inspect
import math
import os
import pickle
import platform
import sys
import tempfile
import textwrap
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba

from mopro.cachefolder import cache_folder
from mopro.effects.base import Term
from mopro.plant.kernel_text import CONSTANTS, Layout, kernel_parts

_ARRAY, _INDICES, _NUMBER = numba.float64[::1], numba.intp[::1], numba.float64
# The arguments of `integrate`, in the order of kernel_text.integrate_source.
_SIGNATURE = (
    _ARRAY, _INDICES, *[_ARRAY] * 7, *[_NUMBER] * 8, numba.boolean, *[_NUMBER] * 3,
    *[_ARRAY] * 11,
)  # fmt: skip
# What numba may meet in reading a damaged file of its own, or in writing one.
_UNUSABLE = (
    OSError, RuntimeError, ImportError, AttributeError, LookupError, TypeError, ValueError,
    EOFError, MemoryError, pickle.UnpicklingError,
)  # fmt: skip
# Any constant time of change: equal texts are one file, whoever wrote it and when.
_WRITTEN_S = 1_000_000_000

Integrate = Callable[..., int]


def built(layout: Layout) -> Integrate:
    """`integrate` of `layout`, compiled for the types that the emulator passes.

    Kept on disk unless a term has no text of its own, or there is nowhere to keep it. No
    `fastmath`, so that the bits are those of plain Python.
    """
    text, folder = module_text(layout), cache_folder("kernels")
    path = _written(text, folder) if text and folder else None
    if text and path:
        # The second time without what numba kept, which may be damaged.
        for _ in range(2):
            with contextlib.suppress(*_UNUSABLE):
                return _kept(text, path)
            _forget(path)
    return _in_memory(layout)


def _in_memory(layout: Layout) -> Integrate:
    names: dict[str, Any] = {"math": math, **CONSTANTS}
    names |= {name: numba.njit(nogil=True)(term) for name, term in layout.terms().items()}
    for name, part in kernel_parts(layout).items():
        exec(compile(part, f"<kernel {name}>", "exec"), names)
        names[name] = numba.njit(nogil=True)(names[name])
    return _ready(names["integrate"])


def _kept(text: str, path: Path) -> Integrate:
    """The text as a module, which numba can import again by its name."""
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    exec(compile(text, str(path), "exec"), module.__dict__)
    return _ready(module.integrate)


def _ready(integrate: Any) -> Integrate:
    integrate.compile(_SIGNATURE)
    made: Integrate = integrate
    return made


def _forget(path: Path) -> None:
    """Remove what numba kept of the kernel at `path`, where it can be."""
    for kept in path.parent.glob(f"__pycache__/{path.stem}.*"):
        with contextlib.suppress(OSError):
            kept.unlink()


def _written(text: str, folder: Path) -> Path | None:
    """The file that holds `text`, written now if there is none; None where it cannot be."""
    path = folder / f"mopro_kernel_{hashlib.sha256(text.encode()).hexdigest()[:24]}.py"
    try:
        if not path.is_file() or path.read_bytes() != text.encode():
            _write(text, path)
    except OSError:
        return None
    return path


def _write(text: str, path: Path) -> None:
    """Beside it and renamed, so that nobody ever sees half of it."""
    with tempfile.NamedTemporaryFile("wb", dir=path.parent, delete=False) as file:
        file.write(text.encode())
    os.utime(file.name, (_WRITTEN_S, _WRITTEN_S))
    os.replace(file.name, path)


def module_text(layout: Layout) -> str | None:
    """All of a kernel as one module, or None if a term's text is not to be had."""
    terms = {name: term_text(term, name) for name, term in layout.terms().items()}
    parts = []
    for name, part in (terms | kernel_parts(layout)).items():
        if part is None:
            return None
        options = "cache=True, nogil=True" if name == "integrate" else "nogil=True"
        parts.append(f"@numba.njit({options})\n{part}")
    made_by = f"mopro {version('mopro')}, numba {numba.__version__}, {platform.python_version()}"
    constants = "".join(f"{name} = {value!r}\n" for name, value in CONSTANTS.items())
    head = f"# {made_by}\nimport math\n\nimport numba\n\n{constants}"
    return "\n\n".join([head, *parts])


def term_text(term: Term, name: str) -> str | None:
    """The definition of `term` under `name`, or None if no text does the same.

    It must need nothing but its arguments and `math`, and compile to the code that the
    term runs, which a file changed since would not.
    """
    definition = _definition(term)
    if definition is None or not isinstance(term, FunctionType) or not _self_contained(term):
        return None
    definition.name, definition.decorator_list, definition.returns = name, [], None
    for argument in definition.args.args:
        argument.annotation = None
    text = ast.unparse(definition) + "\n"
    names: dict[str, Any] = {}
    # What is imported by the module is called in another way than other globals are.
    exec(compile(f"import math\n{text}", f"<{name}>", "exec"), names)
    return text if _same(names[name].__code__, term.__code__) else None


def _definition(term: Term) -> ast.FunctionDef | None:
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(term)))
    except (OSError, TypeError, SyntaxError):
        return None
    found = tree.body[0]
    return found if isinstance(found, ast.FunctionDef) else None


def _self_contained(term: FunctionType) -> bool:
    used = inspect.getclosurevars(term)
    only_math = all(value is math for value in used.globals.values())
    return only_math and not used.nonlocals and not term.__defaults__ and not term.__kwdefaults__


def _same(one: CodeType, other: CodeType) -> bool:
    facts = [(c.co_code, repr(c.co_consts), c.co_names, c.co_varnames) for c in (one, other)]
    return facts[0] == facts[1]
