"""Effects that the nominal model leaves out, one class in each file.

A package adds effects through the entry-point group `mopro.effects`, whose targets
are `Effect` subclasses; a machine's file, as formulas.
"""

from mopro.effects.effect import Active, Domain, Effect, Parameter, on_axis
from mopro.effects.registry import catalogue, catalogue_of

__all__ = ["Active", "Domain", "Effect", "Parameter", "catalogue", "catalogue_of", "on_axis"]
