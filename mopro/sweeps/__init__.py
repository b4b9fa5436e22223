"""Sweeps: one program run many times, with settings and numbers of the machine varied.

    vary, design → tasks → rows, by processes or a scheduler → results

A task is pure and named by its content, so that it may be run anywhere, twice, and later.
"""

from mopro.sweeps.run import Sweep, sweep

__all__ = ["Sweep", "sweep"]
