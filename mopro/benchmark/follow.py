"""The experiment that a verdict proposes, run on the hidden plant."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mopro.benchmark.made import EXPERIMENT, Made
from mopro.benchmark.make import data_file, data_name, measured, run_text
from mopro.benchmark.reference.experiment import Plant, Strange, Trial
from mopro.benchmark.reference.nominal import Nominal
from mopro.benchmark.reference.sensors import Instrument

FOLDER = "followed"
# A proposed program that warms the motor for ever is recorded for so long.
_LASTS_S = 3600.0


def proposed(
    seed: int,
    number: str,
    answer: Mapping[str, Any],
    text: str,
    folder: Path,
    copy: Path,
    payload_kg: float = 0.0,
) -> Path:
    """A copy of the case with the program `text` as one more run; its experiment file.

    Raises ValueError for a program that cannot be run or makes the plant stall, DataError
    where `copy` holds files of an experiment that were not made here.
    """
    instruments = [Instrument(**i) for i in answer["instruments"]]
    hot = instruments[0].quantity == "temperature"
    trial = Trial(text, payload_kg, _LASTS_S if hot else None)
    generator = np.random.default_rng([seed, 4, int(number)])
    plant = hidden_plant(answer)
    data = measured(plant, trial, instruments, answer["offsets"], generator)
    if plant.stalled:
        raise ValueError("the proposed program makes the hidden plant lose its lock")
    contents = {name: (folder / name).read_bytes() for name in answer["files"]}
    name = data_name("proposed", instruments)
    contents["proposed.CMD"] = text.encode("utf-8")
    contents[name] = data_file(name, instruments, *data)
    contents[EXPERIMENT] += ("\n" + run_text("proposed", payload_kg, instruments)).encode()
    Made.read(copy).replace("", contents)
    return copy / EXPERIMENT


def hidden_plant(answer: Mapping[str, Any]) -> Plant:
    """The plant with what the answer says is hidden in it."""
    effects = {e["name"]: e["parameters"] for e in answer["effects"]}
    strange = Strange(**answer["strange"]) if answer["strange"] else None
    # Answers of before machines could be chosen are of the source's own.
    return Plant(effects, strange, Nominal(**answer.get("machine", {})))
