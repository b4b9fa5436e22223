"""Machine files, the numbers of a machine, and the protocol of a back end."""

from mopro.machine.backend import DEFAULT_LOOP_S, Backend
from mopro.machine.file import builtin_machines, load_machine
from mopro.machine.model import Machine, StatedEffect, StatedValue

__all__ = [
    "DEFAULT_LOOP_S",
    "Backend",
    "Machine",
    "StatedEffect",
    "StatedValue",
    "builtin_machines",
    "load_machine",
]
