"""Judgement of a verdict on a machine beside the motor, and of the file that was written for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.cases.drawn_machine import Machine, left_by
from mopro.blind.cases.equivalent import MARGIN
from mopro.blind.cases.machine_texts import columns_of, per_si
from mopro.blind.scoring import outcome as outcomes
from mopro.blind.scoring.judge import IntervalCheck, Judgement, interval_checks, judgement
from mopro.blind.scoring.outcome import FAILED, FAMILY, RIGHT, WRONG, Document
from mopro.formula import factor_of

# Relative difference of a file's own residual from what the verdict says of it.
_EQUAL = 1e-9


def judge_machine(number: str, answer: Document, reply: Document, folder: Path) -> Judgement:
    """The judgement of `reply` by `answer` (from answers.json); the case's logs are in `folder`.

    A name is false if it is not hidden and the set of names, refitted by the reference plant,
    leaves chi-squared of 10 or more of the hidden response.
    """
    named = list(reply.get("effects") or [])
    result = outcomes.outcome(answer, reply, named)
    left = None
    if result == WRONG and answer["effects"]:
        left = _left(answer, named, folder)
        result = FAMILY if left < MARGIN else WRONG
    if answer["unlisted"] and result != FAILED:
        result = _of_unlisted(answer, reply)
    return judgement(
        number, answer, reply, named, (reply.get("gap") or {}).get("noise_rms"),
        outcome=result,
        covered=tuple(_coverage(answer, reply)) if _states_intervals(result, reply) else (),
        leaves=left,
        drafted=bool(reply.get("drafts")),
        **_of_file(answer, reply),
    )  # fmt: skip


def _of_unlisted(answer: Document, reply: Document) -> str:
    """The outcome where nobody listed what is hidden: right if a draft is of its variable."""
    if not {*outcomes.variables_said(reply)} & {*answer["variables"]}:
        return WRONG if reply.get("effects") else str(reply["verdict"])
    return WRONG if reply.get("effects") and reply["verdict"] == "named" else RIGHT


def _states_intervals(result: str, reply: Document) -> bool:
    """True if the intervals are those of a model that is right, as the verdict says."""
    return result == RIGHT and reply["verdict"] != "unexplained"


def machine_of(answer: Document) -> Machine:
    """The machine that `answer` states."""
    hidden = answer["machine"]
    return Machine(
        hidden["kind"], hidden["numbers"], tuple(hidden["free"]), hidden["off"],
        hidden["start"], hidden["zero"],
    )  # fmt: skip


def _left(answer: Document, named: list[Mapping[str, Any]], folder: Path) -> float:
    machine = machine_of(answer)
    runs = [columns_of(machine.kind, (folder / name).read_bytes()) for name in answer["runs"]]
    truth = {e["name"]: e["parameters"] for e in answer["effects"]} | answer["unlisted"]
    fitted = {e["name"]: {n: _si(p) for n, p in e["parameters"].items()} for e in named}
    return left_by(machine, runs, truth, fitted, answer["sigma"])


def _si(parameter: Mapping[str, Any]) -> float:
    return float(parameter["value"]) * factor_of(parameter["unit"])


def _coverage(answer: Document, reply: Document) -> Iterator[IntervalCheck]:
    """Each 95 % interval of an effect that is hidden, and of a free number."""
    truths = {e["name"]: e["parameters"] for e in answer["effects"]}
    for e in reply.get("effects") or []:
        true = truths.get(e["name"], {})
        yield from interval_checks(e["name"], e["parameters"], true, factor_of)
    numbers = answer["machine"]["numbers"]
    for check in interval_checks("base", reply.get("base") or {}, numbers, factor_of):
        yield replace(check, main=False)


def _of_file(answer: Document, reply: Document) -> dict[str, Any]:
    """Fields of a judgement on the repaired file: `same`, `unseen_before`, `unseen_after`."""
    own, unseen = (reply.get(key) or [] for key in ("applied", "unseen"))
    gaps = {(r["run"], r["sensor"]): r for r in (reply.get("gap") or {}).get("runs") or []}
    same = None
    if own:
        pairs = [(r["after_rms"], gaps[r["run"], r["sensor"]]["rerun_rms"]) for r in own]
        same = all(b is not None and abs(a - b) <= _EQUAL * abs(b) for a, b in pairs)
    if not unseen:
        return {"same": same}
    rms = [
        float(np.sqrt(np.mean([r[key] ** 2 for r in unseen])))
        for key in ("before_rms", "after_rms")
    ]
    noise = answer["sigma"] * per_si(answer["machine"]["kind"])
    return {"same": same, "unseen_before": rms[0] / noise, "unseen_after": rms[1] / noise}
