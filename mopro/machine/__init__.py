"""The machine that runs a program: its numbers, and what every back end must offer."""

from mopro.machine.backend import Backend
from mopro.machine.file import builtin_machines, load_machine
from mopro.machine.model import Machine, StatedEffect, StatedValue

__all__ = [
    "Backend",
    "Machine",
    "StatedEffect",
    "StatedValue",
    "builtin_machines",
    "load_machine",
]
