"""The serial link: programs to a controller and runs on it."""

from mopro.link.backend import SerialBackend
from mopro.link.dialect import Dialect, builtin_dialects, load_dialect
from mopro.link.halt import Signals
from mopro.link.session import Session
from mopro.link.transport import Port, SerialPort

__all__ = [
    "Dialect",
    "Port",
    "SerialBackend",
    "SerialPort",
    "Session",
    "Signals",
    "builtin_dialects",
    "load_dialect",
]
