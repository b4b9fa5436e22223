"""Benchmark of `mopro reconcile`: experiments with hidden effects, their answers kept apart."""

# The reference plant imports nothing of mopro: its compilations make sure of memory from here on.
import mopro.process.jit  # noqa: F401
