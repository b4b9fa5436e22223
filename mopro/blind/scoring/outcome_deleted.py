"""Outcome of a verdict from which the true effect was left out."""

from __future__ import annotations

from collections.abc import Sequence

from mopro.blind.making.sizes import RESOLUTION_SIGMA
from mopro.blind.scoring.outcome import (
    FAMILY,
    NONE,
    RIGHT,
    UNEXPLAINED,
    WRONG,
    Document,
    family,
    variables_said,
)


def outcome_deleted(answer: Document, reply: Document, named: Sequence[Document]) -> str:
    """Family if the names, each or together, are equivalent to the deleted effect, else wrong.

    Without a name: right if what remains is said to depend on the right variable, or if nothing
    is visible and none is said; else unexplained or none, as the verdict is.
    """
    names = sorted(effect["name"] for effect in named)
    if names and names in (answer.get("equivalent_sets") or []):
        return FAMILY
    equivalent = set(answer["equivalent"])
    if any(not equivalent & {effect["name"], *family(effect)} for effect in named):
        return WRONG
    if named:
        return FAMILY
    if reply["verdict"] == NONE:
        return RIGHT if answer["visible_sigma"] < RESOLUTION_SIGMA else NONE
    return RIGHT if set(answer["variables"]) & set(variables_said(reply)) else UNEXPLAINED
