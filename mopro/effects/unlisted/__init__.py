"""Free-form terms inside the simulator: forces and heat flows that no catalogue lists.

A diagnosis tries them beside the catalogue's effects. No machine file switches them on.
"""

from __future__ import annotations

from functools import cache

from mopro.effects.registry import Catalogue
from mopro.effects.unlisted.forces import FORCES
from mopro.effects.unlisted.heat import HEAT
from mopro.effects.unlisted.local import LOCAL
from mopro.effects.unlisted.term import FreeFormTerm

__all__ = ["unlisted_terms", "with_unlisted"]


@cache
def unlisted_terms() -> tuple[FreeFormTerm, ...]:
    """All free-form terms, as effects."""
    return tuple(term() for term in (*FORCES, *LOCAL, *HEAT))


def with_unlisted(catalogue: Catalogue) -> Catalogue:
    """`catalogue` with the free-form terms at its end."""
    return catalogue.beside(unlisted_terms())
