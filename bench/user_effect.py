"""A user's effect in a machine file: found where it is hidden, absent where it is not.

python bench/user_effect.py [CASES] [drive|motor]: draws CASES machines with a friction that depends
on place and as many without, of which half have a plain dry friction; counts what `mopro reconcile`
names. The drive is a mass on a spring (docs/machines.md), the motor the one of 1992.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import mopro
from helpers.stated import DRIVE, FRICTION_OF_PLACE, drive_folder, write
from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.experiment.opened import open_experiment
from mopro.experiment.sawyer.entries import instrument
from mopro.machine.file import read_machine
from mopro.plant import measure
from mopro.source import Source

CASES = 20
NAME = "friction of place"
PROGRAM = "UU012500/1\nVEL1 15.0\nACC1 0.4\nMRI1 5.0\nWX1\nWT200\nMRI1 -8.0\nWX1\nWT200\n"
MOTOR = f"""\
machine = "chow1992"
{FRICTION_OF_PLACE}
[[sensor]]
name = "encoder"
kind = "encoder"

[[run]]
program = "run.CMD"
data = "run.csv"
"""
# Each machine: sizes of the friction of place (N/m) and of the plain one (N), the plain one's name.
KINDS = {
    "drive": ((4.0, 20.0), (0.2, 0.6), "dry_friction"),
    "motor": ((5.0, 60.0), (0.5, 5.0), "coulomb_friction"),
}


def drive(folder: Path, seed: int, of_place: float = 0.0, dry: float = 0.0) -> Path:
    """The experiment of a drive in `folder`."""
    return drive_folder(folder, DRIVE + FRICTION_OF_PLACE, seed=seed, of_place=of_place, dry=dry)


def motor(folder: Path, seed: int, of_place: float = 0.0, dry: float = 0.0) -> Path:
    """The experiment of a motor in `folder`, emulated from a file with the hidden numbers."""
    switched = f'[effects."{NAME}"]\nF1 = {of_place}\n' if of_place else ""
    switched += f"[effects.coulomb_friction]\nFc = {dry}\n" if dry else ""
    truth = f'name = "truth"\nextends = "chow1992"\n{FRICTION_OF_PLACE}\n{switched}'
    machine = read_machine(Source("truth.toml", truth))
    program = mopro.compile(PROGRAM, "run.CMD")
    recording = mopro.emulate(program, machine=machine, rate_hz=4000.0)
    sensor = instrument("encoder", 1)
    active = active_effects(machine, catalogue_of(machine))
    rng = np.random.default_rng(seed)
    time_s, place = measure(recording, sensor, machine, active, rng)
    write(folder / "run.csv", {"time_s": time_s, sensor.column: place})
    (folder / "run.CMD").write_text(PROGRAM, encoding="utf-8")
    (folder / "experiment.toml").write_text(MOTOR, encoding="utf-8")
    return folder / "experiment.toml"


def named(kind: str, seed: int, **hidden: float) -> set[str]:
    """The effects that are named where `hidden` is."""
    with tempfile.TemporaryDirectory() as folder:
        path = {"drive": drive, "motor": motor}[kind](Path(folder), seed, **hidden)
        verdict = open_experiment(path).conclude(1, lambda _: None, ()).verdict
    return {effect.name for effect in verdict.effects}


def main(cases: int, kind: str) -> None:
    sizes, plain_sizes, plain = KINDS[kind]
    rng = np.random.default_rng(19)
    counts: Counter[str] = Counter()
    for seed in range(100, 100 + cases):
        size = float(rng.uniform(*sizes))
        found = named(kind, seed, of_place=size)
        counts["found alone" if found == {NAME} else "found" if NAME in found else "missed"] += 1
        hidden = {"dry": float(rng.uniform(*plain_sizes))} if seed % 2 else {}
        absent = named(kind, seed, **hidden)
        right = absent == ({plain} if hidden else set())
        counts["falsely named" if NAME in absent else "absent" if right else "other wrong"] += 1
        print(seed, f"{size:.3g} N/m:", found, "| without:", hidden, absent, flush=True)
    print(kind, dict(counts))


if __name__ == "__main__":
    given = [argument for argument in sys.argv[1:] if argument in KINDS]
    numbers = [int(argument) for argument in sys.argv[1:] if argument.isdecimal()]
    for kind in given or KINDS:
        main(numbers[0] if numbers else CASES, kind)
