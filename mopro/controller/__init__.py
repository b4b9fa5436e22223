"""The virtual controller: bytes in, bytes out, over the emulated machine; time is an argument."""

from mopro.controller.device import Device
from mopro.controller.faults import Scenario, load_scenario
from mopro.controller.loopback import LoopbackPort
from mopro.controller.station import Station
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
