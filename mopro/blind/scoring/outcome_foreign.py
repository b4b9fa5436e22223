"""Outcome of a verdict on a case with something that no catalogue has."""

from __future__ import annotations

from collections.abc import Sequence

from mopro.blind.scoring.outcome import (
    FAMILY,
    NONE,
    PARTLY,
    RIGHT,
    UNEXPLAINED,
    WRONG,
    Document,
    family,
    matched_names,
    outcome,
    variables_said,
)

# A size is right within this many times its 95 % interval, or within this share of it.
_INTERVALS, _SHARE = 2.0, 0.10


def outcome_foreign(answer: Document, reply: Document, named: Sequence[Document]) -> str:
    """Right if something is unexplained and no name is false.

    Coloured noise is judged as nothing. Names that are together equivalent to all that is hidden
    are a family. A name is false if neither it nor its family is hidden,
    the same as what is foreign, or (beside something unexplained) akin to it. Without anything
    unexplained: family for a name that is the same, or beside which the verdict drafts a term of
    the right variable that does as well; partly if the effect beside is named, none.
    """
    if answer["coloured"]:
        return outcome(answer, reply, named)
    unexplained = reply["verdict"] == UNEXPLAINED
    matched = matched_names({e["name"] for e in answer["effects"]}, named)
    allowed = {*answer["same"], *(answer["akin"] if unexplained else ())}
    others = [e for e in named if e["name"] not in matched.values()]
    if sorted(e["name"] for e in named) in (answer.get("equivalent_sets") or []):
        return FAMILY
    if any(not allowed & {e["name"], *family(e)} for e in others):
        # Beside a verdict without anything unexplained a draft is a rival of what is named.
        rivalled = not unexplained and {*variables_said(reply)} & {*answer["variables"]}
        return FAMILY if rivalled else WRONG
    if unexplained:
        return RIGHT
    return FAMILY if others else (PARTLY if matched else NONE)


def size_is_right(answer: Document, named: Sequence[Document]) -> bool:
    """True if each hidden effect is named with the right size of its first parameter."""
    return all(_size_is_right(effect, named) for effect in answer["effects"])


def _size_is_right(hidden: Document, named: Sequence[Document]) -> bool:
    parameter, true = next(iter(hidden["parameters"].items()))
    said = next((e for e in named if e["name"] == hidden["name"]), {})
    estimate = (said.get("parameters") or {}).get(parameter)
    if estimate is None:
        return False
    value, (low, high) = estimate["value"], estimate.get("ci95") or (None, None)
    if abs(value - true) <= _SHARE * abs(true):
        return True
    if low is None or high is None:
        return False
    return bool(abs(true - (low + high) / 2) <= _INTERVALS * abs(high - low) / 2)
