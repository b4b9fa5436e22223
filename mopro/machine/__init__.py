"""The machine that runs a program: its numbers, and what every back end must offer."""

from mopro.machine.backend import Backend
from mopro.machine.file import load_machine
from mopro.machine.model import Machine

__all__ = ["Backend", "Machine", "load_machine"]
