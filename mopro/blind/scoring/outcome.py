"""Outcome of one verdict, judged by what was hidden: right, right family, wrong or missed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mopro.blind.cases.variables import said
from mopro.blind.making.sizes import RESOLUTION_SIGMA

RIGHT, FAMILY, PARTLY, WRONG = "right", "family", "partly", "wrong"
NONE, UNEXPLAINED, FAILED = "none", "unexplained", "failed"
GOOD = (RIGHT, FAMILY)

Document = Mapping[str, Any]


def family(effect: Document) -> list[str]:
    """The effects that the verdict cannot distinguish from a named one."""
    return list(effect.get("indistinguishable_from") or [])


def outcome(answer: Document, reply: Document, named: Sequence[Document]) -> str:
    """The outcome of a case with effects of the catalogue, a disturbance, or nothing hidden."""
    verdict = reply["verdict"]
    if answer["strange"]:
        return WRONG if named else (RIGHT if verdict == UNEXPLAINED else str(verdict))
    truths = {e["name"] for e in answer["effects"]}
    visible = {e["name"] for e in answer["effects"] if e["total_sigma"] >= RESOLUTION_SIGMA}
    offset = {"sensor_offset"} if any(answer["offsets"]) else set()
    matched = matched_names(truths, named)
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
    sets = [set(names) for names in reply.get("alternatives") or []]
    return bool(visible) and any(visible <= names <= truths for names in sets)


def matched_names(truths: set[str], named: Sequence[Document]) -> dict[str, str]:
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
