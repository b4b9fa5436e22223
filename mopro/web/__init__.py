"""Pages on loopback that are fed as a run goes: the live run, and the virtual controller."""

from mopro.web.live import LiveRun, Paced
from mopro.web.panel import ControllerPanel
from mopro.web.server import Page, serving

__all__ = ["ControllerPanel", "LiveRun", "Paced", "Page", "serving"]
