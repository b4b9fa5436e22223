"""Judgement of one verdict: outcome, intervals, residuals and time; and of it once followed up."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mopro.blind.reference.motor import INCH_M
from mopro.blind.reference.sensors import Instrument
from mopro.blind.scoring import outcome as outcomes
from mopro.blind.scoring.outcome import Document, family

_ANGLES = ("phi", "phi2", "phi3")


@dataclass(frozen=True)
class IntervalCheck:
    """One 95 % interval: `inside` if it contains the true value.

    `main` marks the effect's first parameter, its size. The true values are in SI; an
    interval in inches (a sensor's zero) is converted.
    """

    effect: str
    parameter: str
    inside: bool
    main: bool


@dataclass(frozen=True)
class Judgement:
    """The judgement of one case.

    `outcome` is right (every effect by its name), family (by a family that holds it), partly
    (some effects and no wrong one), wrong (a name that is not in the data), none, unexplained
    or failed. `truth` are the hidden effects, `least_sigma` the total size of the smallest,
    `said` the effects named, each with its family after slashes. `gap_before` and
    `gap_after` are the rms residual over the noise, `seconds` the time that the case took.
    `variables` are those that the verdict states for what remains, `right_variable` if one of
    them is right. `visible_sigma` is the size of all effects without an offset of each series.
    `foreign` is the kind of what no catalogue has, `coloured` if it is noise of the stated size.
    `size_is_right` if each hidden effect is named with its size. `leaves` is the chi-squared that
    the named effects leave of the hidden response, None where it was not asked. `drafted` if a
    free-form term was told. Of the file that was written: `same` if it leaves of its own data what
    the verdict says, and the rms residual over the noise of a run that it has not seen, before and
    after; None where no file was asked for.
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
    covered: tuple[IntervalCheck, ...]
    gap_before: float | None
    gap_after: float | None
    seconds: float | None
    note: str = ""
    variables: tuple[str, ...] = ()
    right_variable: bool = False
    visible_sigma: float = 0.0
    foreign: str = ""
    coloured: bool = False
    size_is_right: bool = False
    leaves: float | None = None
    drafted: bool = False
    same: bool | None = None
    unseen_before: float | None = None
    unseen_after: float | None = None

    @property
    def good(self) -> bool:
        """Every visible effect has its right name or family."""
        return self.outcome in outcomes.GOOD


def judge(number: str, answer: Document, reply: Document) -> Judgement:
    """The judgement of `reply` (from reconcile, with `seconds`) by `answer` (from answers.json)."""
    zeros = [e for e in reply.get("calibration") or [] if e["name"] == "sensor_offset"]
    reported = [*(reply.get("effects") or []), *zeros]
    named = [e for e in reported if not _is_true_offset(e, answer)]
    truths = {e["name"]: e["parameters"] for e in answer["effects"]}
    return judgement(
        number, answer, reply, named, _noise_rms(answer, reply),
        outcome=outcomes.outcome(answer, reply, named),
        covered=tuple(
            check for e in named for check in interval_checks(
                e["name"], e.get("parameters") or {}, truths.get(e["name"], {}),
                lambda unit: INCH_M if unit == "in" else 1.0,
            )
        ),
        visible_sigma=float(answer.get("visible_sigma") or 0.0),
        foreign=str((answer.get("foreign") or {}).get("name", "")),
        coloured=bool(answer.get("coloured")),
        size_is_right=outcomes.size_is_right(answer, named),
        leaves=answer.get("named_leaves"),
    )  # fmt: skip


def judgement(
    number: str,
    answer: Document,
    reply: Document,
    named: Sequence[Document],
    noise: float | None,
    **own: Any,
) -> Judgement:
    """The judgement with all that is read off `answer` and `reply`, and the fields in `own`.

    `noise` is the rms of the noise in the data, in the unit of the gap.
    """
    gap, variables = reply.get("gap") or {}, outcomes.variables_said(reply)
    return Judgement(
        number=number,
        group=answer["group"],
        sensor=answer["sensor"],
        truth=tuple(e["name"] for e in answer["effects"]) or tuple(answer.get("unlisted") or ()),
        least_sigma=min((e["total_sigma"] for e in answer["effects"]), default=0.0),
        said=tuple("/".join([e["name"], *family(e)]) for e in named),
        verdict=str(reply.get("verdict", outcomes.FAILED)),
        described=bool((reply.get("remainder") or {}).get("description")),
        gap_before=_ratio(gap.get("before_rms"), noise),
        gap_after=_ratio(gap.get("after_rms"), noise),
        seconds=reply.get("seconds"),
        note=" ".join(str(reply.get("stderr") or "").split("\n")[:1]),
        variables=variables,
        right_variable=bool({*variables} & {*(answer.get("variables") or [])}),
        **own,
    )


def _is_true_offset(effect: Document, answer: Document) -> bool:
    """An offset of a sensor that is in the data but is not listed as a hidden effect."""
    hidden = {e["name"] for e in answer["effects"]}
    return effect["name"] == "sensor_offset" not in hidden and any(answer["offsets"])


def interval_checks(
    name: str,
    parameters: Mapping[str, Any],
    true: Mapping[str, float],
    unit_si: Callable[[str], float],
) -> Iterator[IntervalCheck]:
    """Each 95 % interval of the `parameters` of the effect `name` whose `true` value (SI) is known.

    `unit_si` is the SI value of a unit. The first of the true values is the size of the effect.
    """
    first = next(iter(true), None)
    for key, estimate in parameters.items():
        interval = estimate.get("ci95")
        if key in true and interval and None not in interval:
            scale = unit_si(estimate.get("unit") or "")
            inside = _inside(true[key], [scale * end for end in interval], key in _ANGLES)
            yield IntervalCheck(name, key, inside, key == first)


def _inside(value: float, interval: list[float], angle: bool) -> bool:
    low, high = sorted(interval)
    if angle:
        low, value = low - high, (value - high) % (2 * math.pi) - 2 * math.pi
        return value >= low or abs(value + 2 * math.pi) < 1e-12
    return bool(low <= value <= high)


def _noise_rms(answer: Document, reply: Document) -> float | None:
    """RMS of the noise in the data: that of the reply's gap, unless the case states another."""
    if "noise_factor" not in answer:
        return (reply.get("gap") or {}).get("noise_rms")
    sigmas = [Instrument(**instrument).sigma for instrument in answer["instruments"]]
    return math.sqrt(sum(sigma**2 for sigma in sigmas) / len(sigmas))


def _ratio(rms: float | None, noise: float | None) -> float | None:
    """`rms` over the noise; None if either is not known."""
    return rms / noise if rms is not None and noise else None


# -- an ambiguous verdict, followed up ----------------------------------------------------------

# A proposed experiment predicted to separate two effects by this much should distinguish them.
DISTINGUISHED_SIGMA = 6.0


@dataclass(frozen=True)
class Alternative:
    """An effect `name` that the verdict cannot distinguish from the hidden effect `truth`.

    `sigma` is the difference of the two that the proposed experiment is predicted to show.
    """

    truth: str
    name: str
    sigma: float


@dataclass(frozen=True)
class FollowUp:
    """An ambiguous case, judged `before` and `after` its proposed experiment was run.

    `promised` is the predicted difference (σ) of each two effects of a family, by `pair_key`.
    """

    before: Judgement
    promised: Mapping[str, float]
    after: Judgement

    @property
    def named(self) -> bool:
        """Each hidden effect is named and no family is left."""
        return self.after.outcome == outcomes.RIGHT and self.after.verdict == "named"

    @property
    def all_distinguishable(self) -> bool:
        """The prediction for each alternative is at least 6 σ, and there is an alternative."""
        alternatives = self.alternatives()
        return bool(alternatives) and all(a.sigma >= DISTINGUISHED_SIGMA for a in alternatives)

    def excluded(self) -> list[bool]:
        """For each alternative predicted to differ by 6 σ: whether it is excluded afterwards.

        A wrong verdict excludes none.
        """
        families = [set(names.split("/")) for names in self.after.said]
        return [
            self.after.good and not any({a.truth, a.name} <= family for family in families)
            for a in self.alternatives()
            if a.sigma >= DISTINGUISHED_SIGMA
        ]

    def alternatives(self) -> list[Alternative]:
        """The other effects of each family that holds a hidden effect."""
        families = [set(names.split("/")) for names in self.before.said]
        return [
            Alternative(truth, name, self.promised.get(pair_key(truth, name), 0.0))
            for truth in self.before.truth
            for family in families
            if truth in family
            for name in sorted(family - {truth})
        ]


def pair_key(one: str, other: str) -> str:
    """Key of two effects, the same in either order."""
    return " / ".join(sorted((one, other)))
