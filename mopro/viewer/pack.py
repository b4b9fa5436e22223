"""Arrays of numbers in a page: one block of bytes, deflated, as base64."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Offsets are multiples of the longest number's size, as typed arrays of a browser demand.
_ALIGNED = 8
_TYPES: dict[str, np.dtype[Any]] = {
    "f32": np.dtype("<f4"), "f64": np.dtype("<f8"), "i32": np.dtype("<i4"),
}  # fmt: skip
# Relative deviation from an even spacing below which times are told by start and step.
_EVEN = 1e-9

Reference = dict[str, Any]


class Pack:
    """Collects arrays; a reference tells where each is in the block."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, values: NDArray[Any], kind: str = "f32") -> Reference:
        """The reference of `values`, stored as `kind` (f32, f64, i32)."""
        data = np.ascontiguousarray(values, _TYPES[kind]).tobytes()
        reference = {"at": self._size, "count": len(values), "type": kind}
        padded = data + bytes(-len(data) % _ALIGNED)
        self._parts.append(padded)
        self._size += len(padded)
        return reference

    def put_times(self, time_s: NDArray[np.float64]) -> Reference:
        """The reference of ascending times: start, step and count where they are even."""
        count = len(time_s)
        if count > 1:
            step = float(time_s[-1] - time_s[0]) / (count - 1)
            even = time_s[0] + step * np.arange(count)
            if np.max(np.abs(time_s - even)) <= _EVEN * max(abs(float(time_s[-1])), step):
                return {"start": float(time_s[0]), "step": step, "count": count}
        return self.put(time_s, "f64")

    def text(self) -> str:
        """The block as base64 of its zlib stream."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode("ascii")
