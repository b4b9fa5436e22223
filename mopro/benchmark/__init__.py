"""Benchmark of `mopro reconcile`: experiments with hidden effects, their answers kept apart."""

import mopro.jit  # noqa: F401
