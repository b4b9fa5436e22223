"""Residuals of motions of a machine that are predicted by a file fitted to its other motions.

    python bench/carry_over.py FOLDER [--joint 0] [--fit 1 2 3] [--most 8] [--jobs 2] [--seed 1]

FOLDER holds `<motion>_joint<N>.csv` with columns time_s, command_rad, position_rad, such as
shared measured data of one arm under many motions. Each set of --fit motions (at most --most of
them, drawn with --seed) is diagnosed; its file predicts each of the other motions. Printed for each
number of motions: the median share of the RMS residual that is closed, absolutely and of what a
diagnosis of the unseen motion itself closes, how many files predict a motion worse than no repair,
and the sets of names with their count.
"""

from __future__ import annotations

import argparse
import random
import statistics
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from mopro.experiment.opened import experiment_file, open_experiment

# A count of a servo of 12 bits (rad).
STEP = 0.0015339807878856412
TEXT = f"""machine = "kinematic"
[inputs]
command = {{ column = "command_rad", unit = "rad" }}
[[sensor]]
name = "position"
quantity = "angle"
column = "position_rad"
unit = "rad"
adc_step = {STEP}
noise_rms = "unknown"
"""


@dataclass(frozen=True)
class Fitted:
    """A set of motions with the names that were told, and the file."""

    motions: tuple[str, ...]
    verdict: str
    names: tuple[str, ...]
    text: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--joint", type=int, default=0)
    parser.add_argument("--fit", type=int, nargs="+", default=[1])
    parser.add_argument("--most", type=int, default=8)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    files = sorted(options.folder.glob(f"*_joint{options.joint}.csv"))
    motions = [file.name.removesuffix(f"_joint{options.joint}.csv") for file in files]
    where = dict(zip(motions, files, strict=True))
    with ProcessPoolExecutor(options.jobs) as pool:
        alone = dict(zip(motions, pool.map(_fitted, [((m,), where) for m in motions]), strict=True))
        tasks = [(m, alone[m].text, where) for m in motions]
        own = dict(zip(motions, pool.map(_predicted, tasks), strict=True))
        for count in options.fit:
            sets = list(combinations(motions, count))
            random.Random(options.seed).shuffle(sets)
            chosen = sets[: options.most]
            fits = [alone[s[0]] for s in chosen] if count == 1 else list(
                pool.map(_fitted, [(s, where) for s in chosen])
            )  # fmt: skip
            pairs = [(fit, m) for fit in fits for m in motions if m not in fit.motions]
            sizes = pool.map(_predicted, [(m, fit.text, where) for fit, m in pairs])
            rows = [(*pair, *size) for pair, size in zip(pairs, sizes, strict=True)]
            _print(count, fits, rows, own)


def _fitted(task: tuple[tuple[str, ...], dict[str, Path]]) -> Fitted:
    motions, where = task
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), motions, where)
        conclusion = open_experiment(path).conclude()
    names = tuple(sorted(effect.name for effect in conclusion.verdict.effects))
    return Fitted(motions, conclusion.verdict.verdict, names, conclusion.machine_text)


def _predicted(task: tuple[str, str, dict[str, Path]]) -> tuple[float, float]:
    """RMS residual of a motion without a repair, and by a machine file."""
    motion, text, where = task
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), (motion,), where)
        applied = Path(folder) / "applied.toml"
        applied.write_text(text, "utf-8")
        stated = experiment_file(path)
        before = stated.before(str(applied)).compare().series[0].rms
        return before, stated.opened(str(applied)).compare().series[0].rms


def written(folder: Path, motions: tuple[str, ...], where: dict[str, Path]) -> Path:
    runs = "".join(f'\n[[run]]\ndata = "{m}.csv"\n' for m in motions)
    for motion in motions:
        (folder / f"{motion}.csv").write_bytes(where[motion].read_bytes())
    path = folder / "experiment.toml"
    path.write_text(TEXT + runs, "utf-8")
    return path


def _print(
    count: int,
    fits: list[Fitted],
    rows: list[tuple[Fitted, str, float, float]],
    own: dict[str, tuple[float, float]],
) -> None:
    print(f"\nfitted to {count} of {len(own)} motions, {len(fits)} sets")
    for fit in fits:
        print(f"  {' + '.join(fit.motions)}: {fit.verdict}: {', '.join(fit.names) or 'no name'}")
        for one, motion, before, after in rows:
            if one is fit:
                best = own[motion][1]
                share = (before - after) / (before - best) if before > best else float("nan")
                print(f"    {motion:24} {before:.5f} -> {after:.5f} (own {best:.5f}): {share:.0%}")
    closed = [(before - after) / before for _, _, before, after in rows]
    gaps = [(before - after, before - own[m][1]) for _, m, before, after in rows]
    shares = [gain / gap for gain, gap in gaps if gap > 0]
    worse = sum(after > before for _, _, before, after in rows)
    print(f"  closed: median {statistics.median(closed):.1%} of the residual, "
          f"{statistics.median(shares):.1%} of what the motion itself closes; worse: "
          f"{worse} of {len(rows)}")  # fmt: skip
    for names, number in Counter(fit.names for fit in fits).most_common():
        print(f"  {number} x {', '.join(names) or 'no name'}")


if __name__ == "__main__":
    main()
