"""The note on effects of a machine file that are off in a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mopro.cli.terminal.say import say

if TYPE_CHECKING:
    from mopro.machine import Machine


def tell_of_runs(machine: Machine) -> None:
    """Tell on standard error which effects are off in a simulation, which is a run of its own."""
    from mopro.machine.runs import left_out

    for line in left_out(machine.name, machine.runs):
        say(line, err=True)
