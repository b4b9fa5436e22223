"""Outcome of one verdict, judged by what was hidden: right, right family, wrong or missed.

Of effects of the catalogue, of something that no catalogue has, of an effect that was left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from mopro.blind.cases.hidden_sizes import RESOLUTION_SIGMA

RIGHT, FAMILY, PARTLY, WRONG = "right", "family", "partly", "wrong"
NONE, UNEXPLAINED, FAILED = "none", "unexplained", "failed"
GOOD = (RIGHT, FAMILY)
_VERDICTS = ("named", "ambiguous", NONE, UNEXPLAINED)
# A size is right within this many times its 95 % interval, or within this share of it.
_INTERVALS, _SHARE = 2.0, 0.10

Document = Mapping[str, Any]


def family(effect: Document) -> list[str]:
    """The effects that the verdict cannot distinguish from a named one."""
    return list(effect.get("indistinguishable_from") or [])


def outcome(answer: Document, reply: Document, named: Sequence[Document]) -> str:
    """The outcome of a `reply` that names the effects `named`, for the case of `answer`."""
    if reply.get("verdict") not in _VERDICTS:
        return FAILED
    if "without" in answer:
        return _outcome_deleted(answer, reply, named)
    return (_outcome_foreign if answer.get("foreign") else _outcome_listed)(answer, reply, named)


def _outcome_listed(answer: Document, reply: Document, named: Sequence[Document]) -> str:
    """The outcome of a case with effects of the catalogue, a disturbance, or nothing hidden."""
    verdict = reply["verdict"]
    if answer["strange"]:
        return WRONG if named else (RIGHT if verdict == UNEXPLAINED else str(verdict))
    truths = {e["name"] for e in answer["effects"]}
    visible = {e["name"] for e in answer["effects"] if e["total_sigma"] >= RESOLUTION_SIGMA}
    offset = {"sensor_offset"} if any(answer["offsets"]) else set()
    matched = _matched_names(truths, named)
    if len(matched) < len(named):
        return FAMILY if _is_alternative(visible, truths | offset, reply) else WRONG
    if verdict == UNEXPLAINED:
        return UNEXPLAINED
    if not visible <= set(matched):
        if _is_alternative(visible, truths | offset, reply):
            return FAMILY
        return PARTLY if matched else NONE
    if not visible and not named:
        return RIGHT
    return RIGHT if all(name == effect for name, effect in matched.items()) else FAMILY


def _is_alternative(visible: set[str], truths: set[str], reply: Document) -> bool:
    """True if one of the sets of effects that explain the data as well is the hidden one."""
    alternatives = [set(names) for names in reply.get("alternatives") or []]
    return bool(visible) and any(visible <= names <= truths for names in alternatives)


def _matched_names(truths: set[str], named: Sequence[Document]) -> dict[str, str]:
    """The effect named for each truth; exact names first, then families, each used once."""
    matched = {e["name"]: e["name"] for e in named if e["name"] in truths}
    for effect in named:
        if effect["name"] in matched:
            continue
        free = [name for name in family(effect) if name in truths and name not in matched]
        if free:
            matched[free[0]] = effect["name"]
    return matched


def variables_said(reply: Document) -> tuple[str, ...]:
    """The variables of which the reply says that the remaining residual depends on them."""
    drafts = [draft.get("of") for draft in reply.get("drafts") or []]
    found = [(reply.get("remainder") or {}).get("variable"), *drafts]
    return tuple(dict.fromkeys(said(str(variable)) for variable in found if variable))


def said(variable: str) -> str:
    """`variable` in the form of the table: without spaces at its ends, one space within."""
    return re.sub(r"\s+", " ", variable.strip())


# -- something that no catalogue has ------------------------------------------------------------


def _outcome_foreign(answer: Document, reply: Document, named: Sequence[Document]) -> str:
    """Right if something is unexplained and no name is false.

    Coloured noise is judged as nothing. Names that are together equivalent to all that is hidden
    are a family. A name is false if neither it nor its family is hidden,
    the same as what is foreign, or (beside something unexplained) akin to it. Without anything
    unexplained: family for a name that is the same, or beside which the verdict drafts a term of
    the right variable that does as well; partly if the effect beside is named, none.
    """
    if answer["coloured"]:
        return _outcome_listed(answer, reply, named)
    unexplained = reply["verdict"] == UNEXPLAINED
    matched = _matched_names({e["name"] for e in answer["effects"]}, named)
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


# -- an effect that was left out of the candidates ----------------------------------------------


def _outcome_deleted(answer: Document, reply: Document, named: Sequence[Document]) -> str:
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
