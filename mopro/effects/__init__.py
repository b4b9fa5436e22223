"""Effects: everything that a model can lack, each one object of a file of its own.

An effect from outside joins through the entry-point group `mopro.effects`, whose targets
are `Effect` subclasses.
"""

from mopro.effects.base import Active, Domain, Effect, Parameter, on_axis
from mopro.effects.registry import catalogue

__all__ = ["Active", "Domain", "Effect", "Parameter", "catalogue", "on_axis"]
