"""Steady-state tables for the diagnosis: their series, and the effects that change them."""

from __future__ import annotations

import numpy as np

from mopro.effects import Effect
from mopro.engine.series import Series
from mopro.engine.tolerances import Tolerances
from mopro.experiment.sawyer.model import SteadyTable
from mopro.experiment.sawyer.steady import rises
from mopro.machine import Machine


def series(table: SteadyTable) -> Series:
    """The table as a Series of one sensor, each row a fold.

    A rise is the difference of two readings, so there is no offset to take out.
    """
    rows = len(table.rise_K)
    return Series(
        table.name, "temperature", "K", table.rise_K, table.noise_K,
        folds=np.arange(rows), nuisances=np.zeros((rows, 0)),
        tolerances=Tolerances(gain=table.gain_tolerance),
    )  # fmt: skip


def lasts(effect: Effect, machine: Machine) -> bool:
    """True if the effect changes the final temperature of a motion, not only the approach to it."""
    one = np.array([0.1])
    motion = SteadyTable("", one, one, one, 0 * one, one, None)
    largest = {effect.name: {p.name: p.plausible[1] for p in effect.parameters}}
    return bool((rises(motion, machine, largest) != rises(motion, machine, {})).any())
