"""Equivalence of the very set of effects that a verdict names, where the truth is no candidate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.making.equivalent import MARGIN, left_by_set
from mopro.blind.making.sizes import NoiselessRuns
from mopro.blind.reference.nominal import Nominal
from mopro.blind.reference.readings import ProgramRun
from mopro.blind.reference.sensors import Instrument
from mopro.blind.scoring.follow import hidden_plant
from mopro.blind.scoring.outcome import UNEXPLAINED, Document


def with_named_set(answer: Document, reply: Document, folder: Path, seed: int) -> Document:
    """`answer` with what the set that `reply` names leaves of the hidden response, `named_leaves`.

    Also with the set in `equivalent_sets` if it is equivalent, as each rival by itself when the
    case was made: by the response of the reference plant without noise, chi-squared below 10 with
    the parameters of the verdict or with the best ones. Only what leaves nothing unexplained is
    tried, and is not equivalent one by one; `folder` has the case's programs.
    """
    named = {
        effect["name"]: {
            name: parameter["value"] for name, parameter in effect.get("parameters", {}).items()
        }
        for effect in reply.get("effects") or []
    }
    runs = answer.get("runs")
    single = set(named) <= set(answer.get("equivalent") or [])
    if not runs or single or reply.get("verdict") == UNEXPLAINED:
        return answer
    noiseless = NoiselessRuns(
        [_run(folder, each) for each in runs],
        [Instrument(**i) for i in answer["instruments"]],
        Nominal(**answer["machine"]),
    )
    generator = np.random.default_rng([seed, 7, int(folder.name)])
    left = left_by_set(noiseless, hidden_plant(answer), named, generator)
    if left is None:
        return answer
    sets = [sorted(named)] if left < MARGIN else []
    return {**answer, "equivalent_sets": sets, "named_leaves": left}


def _run(folder: Path, told: Mapping[str, Any]) -> ProgramRun:
    text = (folder / told["program"]).read_text(encoding="ascii")
    return ProgramRun(text, told["payload_kg"], told["until_s"])
