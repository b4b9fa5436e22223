"""The virtual controller: answers a dialect's bytes with the emulated machine behind it.

Time is an argument throughout; only `serve` reads a clock.
"""

from mopro.controller.device import Device
from mopro.controller.faults import Scenario, load_scenario
from mopro.controller.station import LoopbackPort, Station
from mopro.controller.store import FolderStore, MemoryStore

__all__ = [
    "Device",
    "FolderStore",
    "LoopbackPort",
    "MemoryStore",
    "Scenario",
    "Station",
    "load_scenario",
]
