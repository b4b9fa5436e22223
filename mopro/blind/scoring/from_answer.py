"""The hidden plant of a case, built again from its answer.

The experiment that a verdict proposes is run on it, and a set of names is tried on its runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.cases.equivalent import MARGIN, left_by_set
from mopro.blind.cases.hidden_sizes import NoiselessRuns, Plant
from mopro.blind.cases.make import data_file, data_name, measured, run_text
from mopro.blind.cases.manifest import EXPERIMENT, Manifest
from mopro.blind.cases.stated_effects import StatedEffects
from mopro.blind.reference.motor import Nominal
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument
from mopro.blind.reference.uncatalogued import Disturbance, Foreign
from mopro.blind.scoring.outcome import UNEXPLAINED, Document

# Recorded time of a proposed program that heats the motor in an endless loop.
_HEATING_S = 3600.0


def add_proposed_run(
    seed: int,
    number: str,
    answer: Mapping[str, Any],
    text: str,
    folder: Path,
    copy: Path,
    payload_kg: float = 0.0,
) -> Path:
    """Write a copy of the case in `folder` with the program `text` as one more run.

    Returns the experiment file in the folder `copy`. Raises ValueError for a program that
    cannot be run or makes the plant stall, DataError if `copy` holds files of an
    experiment that were not made here.
    """
    instruments = [Instrument(**i) for i in answer["instruments"]]
    hot = instruments[0].quantity == "temperature"
    run = ProgramRun(text, payload_kg, _HEATING_S if hot else None)
    generator = np.random.default_rng([seed, 4, int(number)])
    plant = hidden_plant(answer)
    foreign = Foreign(**answer["foreign"]) if answer.get("foreign") else None
    data = measured(plant, run, instruments, answer["offsets"], generator, foreign)
    if plant.stalled:
        raise ValueError("the proposed program makes the hidden plant stall")
    contents = {name: (folder / name).read_bytes() for name in answer["files"]}
    name = data_name("proposed", instruments)
    contents["proposed.CMD"] = text.encode("utf-8")
    contents[name] = data_file(name, instruments, *data)
    contents[EXPERIMENT] += ("\n" + run_text("proposed", payload_kg, instruments)).encode()
    Manifest.read(copy).replace("", contents)
    return copy / EXPERIMENT


def hidden_plant(answer: Mapping[str, Any]) -> Plant:
    """The plant with the effects and the disturbance that `answer` states."""
    effects = {e["name"]: e["parameters"] for e in answer["effects"]}
    if answer.get("stated"):
        return StatedEffects(**answer["stated"]).plant(effects)
    disturbance = Disturbance(**answer["strange"]) if answer["strange"] else None
    # Answers without a machine are older than --machine and belong to the default one.
    nominal = Nominal(**answer.get("machine", {}))
    foreign = Foreign(**answer["foreign"]) if answer.get("foreign") else None
    return ReferencePlant(effects, disturbance, nominal, foreign)


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
