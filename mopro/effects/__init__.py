"""Effects that the nominal model leaves out, one class in each file.

A package adds effects through the entry-point group `mopro.effects`, whose targets
are `Effect` subclasses.
"""

from mopro.effects.base import Active, Domain, Effect, Parameter, on_axis
from mopro.effects.registry import catalogue

__all__ = ["Active", "Domain", "Effect", "Parameter", "catalogue", "on_axis"]
