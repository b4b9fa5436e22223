"""One verdict against what was hidden: right, right family, wrong, missed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mopro.benchmark.reference.nominal import INCH_M
from mopro.benchmark.sizes import BELOW

RIGHT, FAMILY, PARTLY, WRONG = "right", "family", "partly", "wrong"
NONE, UNEXPLAINED, FAILED = "none", "unexplained", "failed"
GOOD = (RIGHT, FAMILY)
_ANGLES = ("phi", "phi2", "phi3")


@dataclass(frozen=True)
class Covered:
    """Whether a 95 % interval holds the truth; `main` is the effect's first parameter.

    A reply says its unit, a sensor's for its zero; the sealed answers are in metres.
    """

    effect: str
    parameter: str
    inside: bool
    main: bool


@dataclass(frozen=True)
class Judgement:
    """What became of one case.

    `outcome`: right (every effect by its name), family (by a family it belongs to),
    partly (some, no wrong one), wrong (a name that is not in the data), none,
    unexplained or failed. `said` is what was named, families after a slash.
    """

    number: str
    group: str
    sensor: str
    truth: tuple[str, ...]
    least_sigma: float
    outcome: str
    said: tuple[str, ...]
    verdict: str
    described: bool
    covered: tuple[Covered, ...]
    gap_before: float | None
    gap_after: float | None
    seconds: float | None
    note: str = ""

    @property
    def good(self) -> bool:
        return self.outcome in GOOD


def judge(number: str, answer: Mapping[str, Any], reply: Mapping[str, Any]) -> Judgement:
    """`answer` from the sealed file, `reply` from reconcile (`seconds` added)."""
    named = [e for e in reply.get("effects") or [] if not _nuisance(e, answer)]
    sizes = [e["total_sigma"] for e in answer["effects"]]
    gap = reply.get("gap") or {}
    noise = gap.get("noise_rms")
    return Judgement(
        number=number,
        group=answer["group"],
        sensor=answer["sensor"],
        truth=tuple(e["name"] for e in answer["effects"]),
        least_sigma=min(sizes, default=0.0),
        outcome=_outcome(answer, reply, named),
        said=tuple("/".join([e["name"], *_family(e)]) for e in named),
        verdict=str(reply.get("verdict", FAILED)),
        described=bool((reply.get("remainder") or {}).get("description")),
        covered=tuple(c for e in named for c in _coverage(e, answer)),
        gap_before=_ratio(gap.get("before_rms"), noise),
        gap_after=_ratio(gap.get("after_rms"), noise),
        seconds=reply.get("seconds"),
        note=" ".join(str(reply.get("stderr") or "").split("\n")[:1]),
    )


def _family(effect: Mapping[str, Any]) -> list[str]:
    return list(effect.get("indistinguishable_from") or [])


def _nuisance(effect: Mapping[str, Any], answer: Mapping[str, Any]) -> bool:
    """An offset that really is in the data, though nobody would call it an effect."""
    hidden = {e["name"] for e in answer["effects"]}
    return effect["name"] == "sensor_offset" not in hidden and any(answer["offsets"])


def _outcome(
    answer: Mapping[str, Any], reply: Mapping[str, Any], named: list[Mapping[str, Any]]
) -> str:
    verdict = reply.get("verdict", FAILED)
    if verdict not in ("named", "ambiguous", NONE, UNEXPLAINED):
        return FAILED
    if answer["strange"]:
        return WRONG if named else (RIGHT if verdict == UNEXPLAINED else str(verdict))
    truths = {e["name"] for e in answer["effects"]}
    visible = {e["name"] for e in answer["effects"] if e["total_sigma"] >= BELOW}
    matched = _matched(truths, named)
    if len(matched) < len(named):
        return WRONG
    if verdict == UNEXPLAINED:
        return UNEXPLAINED
    if not visible <= set(matched):
        return PARTLY if matched else NONE
    if not visible and not named:
        return RIGHT
    return RIGHT if all(name == effect for name, effect in matched.items()) else FAMILY


def _matched(truths: set[str], named: list[Mapping[str, Any]]) -> dict[str, str]:
    """Truth to the effect that was named for it, exact names first, each used once."""
    matched = {e["name"]: e["name"] for e in named if e["name"] in truths}
    for effect in named:
        if effect["name"] in matched:
            continue
        free = [name for name in _family(effect) if name in truths and name not in matched]
        if free:
            matched[free[0]] = effect["name"]
    return matched


def _coverage(effect: Mapping[str, Any], answer: Mapping[str, Any]) -> list[Covered]:
    truths = {e["name"]: e["parameters"] for e in answer["effects"]}
    true = truths.get(effect["name"], {})
    first = next(iter(true), None)
    found = []
    for name, said in (effect.get("parameters") or {}).items():
        interval = said.get("ci95")
        if name in true and interval and None not in interval:
            scale = INCH_M if said.get("unit") == "in" else 1.0
            inside = _inside(true[name], [scale * end for end in interval], name in _ANGLES)
            found.append(Covered(effect["name"], name, inside, name == first))
    return found


def _inside(value: float, interval: list[float], angle: bool) -> bool:
    low, high = sorted(interval)
    if angle:
        low, value = low - high, (value - high) % (2 * math.pi) - 2 * math.pi
        return value >= low or abs(value + 2 * math.pi) < 1e-12
    return low <= value <= high


def _ratio(rms: float | None, noise: float | None) -> float | None:
    return rms / noise if rms is not None and noise else None
