"""Free-form terms inside the simulator: forces and heat flows that no catalogue lists.

A diagnosis tries them beside the catalogue's effects. No machine file switches them on, but one may
state some of them as formulas (`written_terms`).
"""

from __future__ import annotations

from functools import cache

from mopro.effects.free_forces import FORCES
from mopro.effects.free_form import FreeFormTerm
from mopro.effects.free_heat import HEAT
from mopro.effects.local_forces import LOCAL
from mopro.effects.registry import Catalogue
from mopro.formula.written import FORCE, EffectParameter, Written, WrittenEffect
from mopro.machine.formulas import NAMES

__all__ = ["unlisted_terms", "with_unlisted", "written_terms"]


@cache
def unlisted_terms() -> tuple[FreeFormTerm, ...]:
    """All free-form terms, as effects."""
    return tuple(term() for term in (*FORCES, *LOCAL, *HEAT))


@cache
def written_terms() -> dict[str, WrittenEffect]:
    """By name those that a machine file can state as a formula of place and speed, c its size."""
    found = {}
    for term in unlisted_terms():
        names = {p.name for p in term.parameters}
        if term.enters == FORCE and term.text and names == {"c"}:
            written = Written.of(f"c * {term.text}")
            if written.formula.names <= {"c", *NAMES[FORCE]}:
                own = EffectParameter("c", term.parameters[0].unit)
                found[term.name] = WrittenEffect(term.name, FORCE, "", written, (own,))
    return found


def with_unlisted(catalogue: Catalogue) -> Catalogue:
    """`catalogue` with the free-form terms at its end."""
    return catalogue.beside(unlisted_terms())
