"""Columns of numbers in NPZ archives, whose sizes are known before any memory is taken."""

from __future__ import annotations

import tokenize
import zipfile
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

_NUMBERS = "iuf"
# A column of numbers has the oldest format; the headers of the others may claim 4 GB.
_FORMAT = (1, 0)


class NoColumn(ValueError):
    """An array that is no column of numbers: of words, or of another shape."""


def members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """The arrays of an archive by name."""
    return {info.filename.removesuffix(".npy"): info for info in archive.infolist()}


def rows_of(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> int:
    """The length that a column states, before it is read.

    NoColumn for another array, ValueError for none, and what zipfile raises.
    """
    if info.flag_bits & 1:
        raise ValueError("it is encrypted")
    with archive.open(info) as file:
        shape, _, dtype = _header(file)
    if len(shape) != 1 or dtype.kind not in _NUMBERS or dtype.itemsize > 8:
        name = info.filename.removesuffix(".npy")[:60]
        message = f"{name!r} is no column of numbers: {dtype} of shape {shape}"
        raise (
            ValueError(f"{message}, which could run code") if dtype.hasobject else NoColumn(message)
        )
    return int(shape[0])


def column_of(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """The column; what it needs is what `rows_of` says."""
    with archive.open(info) as file:
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    return array


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    if version != _FORMAT:
        raise ValueError(f"an array of format {version}")
    try:
        header: tuple[tuple[int, ...], bool, np.dtype[Any]]
        header = np.lib.format.read_array_header_1_0(file)
    except (MemoryError, SyntaxError, tokenize.TokenError) as error:  # of its parser
        raise ValueError("an array whose header is no header") from error
    return header
