"""Verdicts under nine changes of the files that do not change the physics.

    python bench/invariance.py [--cases 2] [--seed 1] [--jobs 1] [--real FOLDER] [--only TEXT]
                               [--sources NAME ...] [--changes NAME ...] [--folder FOLDER ...]

Asked are --cases experiments of each source: the grids `machines` and `small` of `mopro blind`, and
with --real, a folder of measured sets by their names, the experiments of examples/ with their data
and single motions of an arm (joint 0). --folder: an experiment's own folder. Each is asked again
with values rounded below the noise, every second sample, other units, other zeros of time and
place, the axis turned, the runs in another order, a run given twice, and a run cut in two, where
that holds (`tests/helpers/invariance/changes.py`). Printed: a table of case and change (`=` the
same, `n` other names, `w` another word, `#` a number outside of the other's 95 % interval, `!`
refused, `-` skipped), the shares, each difference, and why what was skipped. Exits 1 if names
differ.
"""

from __future__ import annotations

import argparse
import random
import shutil
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.invariance.changes import CHANGES, Skipped
from helpers.invariance.compared import (
    NAMES,
    NUMBERS,
    REFUSED,
    WORD,
    Answer,
    answered,
    differences,
)
from helpers.invariance.copied import Copied

ROOT = Path(__file__).parents[1]
MARKS = {REFUSED: "!", NAMES: "n", WORD: "w", NUMBERS: "#"}
# Experiments of examples/ by the measured set that holds their data.
EXAMPLES = {
    "servo": "servo_backlash_sts3215",
    "pendulum": "single_pendulum_bearing_friction",
    "heater": "tclab_heater_coupling_lag",
    "telescope": "telescope_worm_periodic_error",
}
ARM = "robot_arm_so101_fifty_motions"
GRIDS = ("machines", "small")
SOURCES = (*GRIDS, *EXAMPLES, "arm")
# A count of its servo (rad) is a 4096th of a turn.
ARM_TEXT = f"""machine = "kinematic"
[inputs]
command = {{ column = "command_rad" }}
[[sensor]]
name = "position"
quantity = "angle"
column = "position_rad"
adc_step = {2 * np.pi / 4096}
noise_rms = "unknown"
[[run]]
data = "run.csv"
"""


@dataclass(frozen=True)
class Asked:
    """A case: its answer as it is, and by change what differs, or why it was skipped."""

    name: str
    answer: Answer
    differences: dict[str, dict[str, str]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)

    def told(self, change: str, other: Answer | str) -> None:
        """Note the answer on a changed copy, or why there is none, and print what differs."""
        if isinstance(other, str):
            self.skipped[change] = other
            return
        found = self.differences[change] = differences(self.answer, other, change)
        print(f"  {change} {self.mark(change)} [{other.took_s:.1f} s]", flush=True)
        for kind, words in found.items():
            print(f"    {kind}: {words}", flush=True)

    def mark(self, change: str) -> str:
        """The cell of the table."""
        if change in self.skipped:
            return "-"
        return "".join(MARKS[kind] for kind in self.differences[change]) or "="


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=2, help="of each source")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--real", type=Path, metavar="FOLDER", help="measured sets, by name")
    parser.add_argument("--folder", type=Path, nargs="+", default=[], help="experiments' folders")
    parser.add_argument("--sources", nargs="*", choices=SOURCES, default=SOURCES)
    parser.add_argument("--changes", nargs="+", choices=CHANGES, default=list(CHANGES))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made, ProcessPoolExecutor(options.jobs) as pool:
        paths = dict(_cases(options, Path(made)))
        every = [(n, p, options.seed, c) for n, p in paths.items() for c in ("", *options.changes)]
        done: list[Asked] = []
        for (name, _, _, change), told in zip(every, pool.map(asked, every), strict=True):
            if change:
                done[-1].told(change, told)
            else:
                assert isinstance(told, Answer)
                done.append(Asked(name, told))
                print(f"{name}: {told} [{told.took_s:.1f} s]", flush=True)
    return _summary(done, options.changes)


def asked(task: tuple[str, Path, int, str]) -> Answer | str:
    """The answer on a case under a change, "" for none; or why the change is skipped."""
    name, path, seed, change = task
    copied = Copied.of(path)
    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {change}".encode())])
    with tempfile.TemporaryDirectory() as folder:
        try:
            changed = CHANGES[change](copied, rng) if change else copied
        except Skipped as why:
            return str(why)
        return answered(changed.write(Path(folder) / "copy"))


def _cases(options: argparse.Namespace, made: Path) -> Iterator[tuple[str, Path]]:
    """The experiments' files, by a name for each."""
    for folder in options.folder:
        yield folder.name, folder / "experiment.toml"
    for grid in (own for own in GRIDS if own in options.sources):
        numbers = ["--seed", str(options.seed), "--sample", str(options.cases)]
        command = ["blind", "make", "--grid", grid, *numbers, "--out", str(made / grid)]
        subprocess.run([sys.executable, "-m", "mopro", *command], check=True, capture_output=True)
        for path in sorted((made / grid).glob("*/experiment.toml")):
            # A raw file of an instrument is no table whose columns could be changed.
            if not list(path.parent.glob("*.DAT")):
                yield f"{grid} {path.parent.name}", path
    if options.real is not None:
        yield from _measured(options, made)


def _measured(options: argparse.Namespace, made: Path) -> Iterator[tuple[str, Path]]:
    for name in (own for own in EXAMPLES if own in options.sources):
        folder = made / name
        shutil.copytree(ROOT / "examples" / name, folder)
        for file in (options.real / EXAMPLES[name]).glob("*.csv"):
            shutil.copy(file, folder)
        yield name, folder / "experiment.toml"
    motions = sorted((options.real / ARM).glob("*_joint0.csv")) if "arm" in options.sources else []
    chosen = random.Random(options.seed).sample(motions, min(options.cases, len(motions)))
    for file in chosen:
        folder = made / file.stem
        folder.mkdir()
        shutil.copy(file, folder / "run.csv")
        (folder / "experiment.toml").write_text(ARM_TEXT, "utf-8")
        yield f"arm {file.stem.removesuffix('_joint0')}", folder / "experiment.toml"


def _summary(cases: Sequence[Asked], changes: Sequence[str]) -> int:
    width = max(len(case.name) for case in cases) + 2
    print(f"\n{'case':{width}}" + "".join(f"{change:>9}" for change in changes))
    for case in cases:
        print(f"{case.name:{width}}" + "".join(f"{case.mark(c):>9}" for c in changes))
    other = Counter[str]()
    for kind in (NAMES, WORD, NUMBERS):
        cells = []
        for change in changes:
            own = [c.differences[change] for c in cases if change in c.differences]
            same = sum(kind not in found and REFUSED not in found for found in own)
            other[kind] += len(own) - same
            cells.append(f"{same} of {len(own)}")
        print(f"{f'same {kind}':{width}}" + "".join(f"{cell:>9}" for cell in cells))
    asked_for = sum(len(case.differences) for case in cases)
    print("  ".join(f"{kind}: {asked_for - other[kind]} of {asked_for}" for kind in other))
    reasons = Counter(f"{change}: {why}" for c in cases for change, why in c.skipped.items())
    print(f"skipped {reasons.total()}:")
    for why, count in reasons.most_common():
        print(f"  {count} {why}")
    return int(other[NAMES] > 0)


if __name__ == "__main__":
    sys.exit(main())
