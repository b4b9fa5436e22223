"""Run of the experiment that a verdict proposes, on the reference plant of its case."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mopro.blind.cases.stated import StatedEffects
from mopro.blind.making.make import data_file, data_name, measured, run_text
from mopro.blind.making.manifest import EXPERIMENT, Manifest
from mopro.blind.making.sizes import Plant
from mopro.blind.reference.motor import Nominal
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.blind.reference.sensors import Instrument
from mopro.blind.reference.uncatalogued import Disturbance, Foreign

FOLDER = "followed"
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
