"""Recordings of every program, with no effect and with each effect alone, held against others.

    python bench/recordings.py --write DIR      in one checkout
    python bench/recordings.py --against DIR    in another

Each recording is of 500 Hz, with what a sensor of each quantity shows of it, effects at their
defaults. Prints for each program the largest difference of positions (m), and that of any other
column as a share of its largest value, with the effect and the column that they are in. Exits
with 1 where a position differs by more than 1e-12 m.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import mopro
from mopro.effects import catalogue
from mopro.effects.resolve import active_effects
from mopro.errors import MoproError
from mopro.instruments.quantity import POSITION, TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.plant import measure
from mopro.program.compile import compile_file

ROOT = Path(__file__).resolve().parents[1] / "programs"
RATE_HZ, ENDLESS_S, MOST_M = 500.0, 20.0, 1e-12
PLACES, OTHERS = "positions, m", "others"
# name -> quantity, axis and column of a sensor
SENSORS = {
    "position": (POSITION, 1, "position_1_m"),
    "position2": (POSITION, 2, "position_2_m"),
    "temperature": (TEMPERATURE, 1, "temperature_C"),
}


def programs() -> list[Path]:
    """The six programs of the thesis and its fourteen experiments."""
    return [*sorted(ROOT.glob("*.CMD")), *sorted((ROOT / "experiments").glob("*.CMD"))]


def columns(path: Path, effect: str | None) -> dict[str, np.ndarray]:
    """Every second sample of a recording with `effect` alone, and what sensors show of it."""
    program, machine = compile_file(path), load_machine("chow1992")
    effects = {effect: {}} if effect else None
    for_s = ENDLESS_S if program.loops_forever else None
    try:
        recording = mopro.emulate(
            program, effects=effects, rate_hz=RATE_HZ, compiled=True, for_s=for_s
        )
    except MoproError as error:
        return {"error": np.array(str(error))}
    active = active_effects(machine.with_effects(effects or {}), catalogue())
    found = {name: np.asarray(values)[::2] for name, values in recording.columns.items()}
    for name, (quantity, axis, column) in SENSORS.items():
        sensor = Sensor(name, quantity, column, RATE_HZ / 2, axis)
        found[f"measured_{name}"] = measure(recording, sensor, machine, active)[1]
    return found


def differences(path: Path, effect: str | None, folder: Path) -> Iterator[tuple[str, float, str]]:
    """Of each column: whether it is a position (m) or another, the difference, effect and name.

    Infinite where a column is missing, longer, or not the same text or whole number.
    """
    now = columns(path, effect)
    with np.load(folder / f"{path.stem}-{effect}.npz") as before:
        for name in sorted({*now, *before} - {"moves"}):
            one, other = now.get(name), before.get(name)
            kind = PLACES if "position" in name or name.startswith("command") else OTHERS
            if one is None or other is None or one.shape != other.shape:
                difference = np.inf
            elif one.dtype.kind != "f":
                difference = 0.0 if (one == other).all() else np.inf
            else:
                scale = 1.0 if kind == PLACES else float(np.max(np.abs(other), initial=1e-300))
                difference = float(np.max(np.abs(one - other), initial=0.0)) / scale
            yield kind, difference, f"{effect} {name}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, metavar="DIR")
    parser.add_argument("--against", type=Path, metavar="DIR")
    told = parser.parse_args()
    sets = [None, *sorted(catalogue())]
    worst = {PLACES: 0.0, OTHERS: 0.0}
    for path in programs():
        if told.write:
            told.write.mkdir(exist_ok=True)
            for effect in sets:
                np.savez(told.write / f"{path.stem}-{effect}.npz", **columns(path, effect))
        if told.against:
            # An effect that the other checkout does not have has nothing to be held against.
            both = [s for s in sets if (told.against / f"{path.stem}-{s}.npz").exists()]
            found = [d for effect in both for d in differences(path, effect, told.against)]
            for kind in worst:
                _, difference, where = max((d for d in found if d[0] == kind), key=lambda d: d[1])
                print(f"{path.name:12} {kind:12} {difference:.2e}  {where}", flush=True)
                worst[kind] = max(worst[kind], difference)
    if told.against:
        print(*(f"worst {kind}: {difference:.2e}" for kind, difference in worst.items()), sep="\n")
    return int(worst[PLACES] > MOST_M)


if __name__ == "__main__":
    sys.exit(main())
