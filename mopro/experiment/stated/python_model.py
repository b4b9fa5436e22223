"""A model that is a program: its function, loaded from the file that the machine names."""

from __future__ import annotations

import importlib.util
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mopro.errors import DataError
from mopro.experiment.stated.entries import StatedEntries
from mopro.formula.evaluate import Floats
from mopro.inputs import no_file
from mopro.stated.simulation import Simulate

# What a program that is somebody's model may raise.
_OF_A_PROGRAM = (
    ArithmeticError, AssertionError, AttributeError, ImportError, LookupError, MemoryError,
    NameError, OSError, RuntimeError, SyntaxError, SystemExit, TypeError, ValueError,
)  # fmt: skip


def foreign_model(entries: StatedEntries, allowed: bool) -> Simulate | None:
    """The function of a model that is a program, run only if `allowed`; DataError."""
    if entries.machine.python is None or entries.foreign is None:
        return None
    file, name = entries.foreign, entries.machine.python[1]
    if not allowed:
        raise DataError(
            f"{entries.machine.name} is a program, {file}, and is run only with --allow-python: "
            "look at it first, if it is not yours",
            "not-allowed",
        )
    return _loaded(file, name)


def _loaded(file: Path, name: str) -> Simulate:
    spec = importlib.util.spec_from_file_location("mopro_foreign_model", file)
    wrong = no_file(file, str(file))
    if wrong or spec is None or spec.loader is None:
        raise DataError(wrong or f"{file}: expected a file of Python", "no-such-file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except _OF_A_PROGRAM as error:
        raise _failed(file, error) from error
    function = getattr(module, name, None)
    if not callable(function):
        raise DataError(f"{file} has no function {name}", "no-such-function")

    def simulate(numbers: Mapping[str, float], columns: Mapping[str, Floats]) -> Mapping[str, Any]:
        try:
            found: Mapping[str, Any] = function(numbers, columns)
        except _OF_A_PROGRAM as error:
            raise _failed(file, error) from error
        return found

    return simulate


def _failed(file: Path, error: BaseException) -> DataError:
    """The error of a model that is a program, with the line of it that was running."""
    own = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file)]
    place = f", line {own[-1]}" if own else ""
    return DataError(f"{file}{place}: {type(error).__name__}: {error}", "failed-model")
