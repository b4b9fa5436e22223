"""Steady-state tables for the diagnosis: the series of one, and which effects they show."""

from __future__ import annotations

import numpy as np

from mopro.diagnosis import Series
from mopro.effects import Effect
from mopro.experiment.model import SteadyTable
from mopro.experiment.predict.steady import rises
from mopro.machine import Machine


def series(table: SteadyTable) -> Series:
    """The table as the diagnosis reads it: one sensor, each row a part to hold out.

    A rise is the difference of two readings, so there is no offset to take out.
    """
    rows = len(table.rise_K)
    return Series(
        table.name, "temperature", "K", table.rise_K, table.noise_K,
        folds=np.arange(rows), nuisances=np.zeros((rows, 0)),
    )  # fmt: skip


def lasts(effect: Effect, machine: Machine) -> bool:
    """Whether it changes where a motion's temperature ends up, and not only how it gets there."""
    one = np.array([0.1])
    motion = SteadyTable("", one, one, one, 0 * one, one, None)
    largest = {effect.name: {p.name: p.plausible[1] for p in effect.parameters}}
    return bool((rises(motion, machine, largest) != rises(motion, machine, {})).any())
