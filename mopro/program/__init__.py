"""The motion IR: what a program means, free of how it was written."""

from mopro.program.ir import AXES, Program
from mopro.program.lower import examine, lower

__all__ = ["AXES", "Program", "examine", "lower"]
