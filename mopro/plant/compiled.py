"""The integrator compiled by numba; importing this costs what numba costs."""

from __future__ import annotations

from collections.abc import Callable

import numba

from mopro.plant import kernel

# Cached beside the kernel; no `fastmath`, so that the bits are those of plain Python.
integrate: Callable[..., int] = numba.njit(cache=True, nogil=True)(kernel.integrate)
