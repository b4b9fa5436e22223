"""The machine in software: a program in, a recording out, no clock touched."""

from mopro.emulator.backend import Emulator, emulate

__all__ = ["Emulator", "emulate"]
