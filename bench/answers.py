"""Answers of `mopro reconcile` kept as files, and compared bit for bit with those kept before.

    python bench/answers.py FOLDER [--cases CASES] [--jobs 1] [--only TEXT]
    python bench/answers.py FOLDER --against BEFORE

Before a change that is to leave all answers as they are: asks for the verdict on each experiment of
examples/ and programs/, and on 40 cases of grid `full`, 14 of `machines` and 6 of `constants`,
which are made in CASES at first, and keeps its JSON without the times in FOLDER. One that is kept
already is not asked for again. With --against prints which answers of both folders differ, and in
which keys; exits 1 if one does.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
# Seed and number of the cases of each grid.
GRIDS = {"full": (4101, 40), "machines": (4102, 14), "constants": (4103, 6)}
# What differs from run to run.
TIMES = ("seconds",)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=Path, default=Path("answers-cases"))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="", metavar="TEXT", help="experiments with it in a name")
    parser.add_argument("--against", type=Path, metavar="BEFORE")
    options = parser.parse_args()
    if options.against is not None:
        sys.exit(compare(options.against, options.folder))
    options.folder.mkdir(parents=True, exist_ok=True)
    named = [(n, p) for n, p in experiments(options.cases) if options.only in n]
    with ThreadPoolExecutor(options.jobs) as pool:
        for name in pool.map(lambda own: ask(*own, options.folder), named):
            print(name, flush=True)


def experiments(cases: Path) -> Iterator[tuple[str, Path]]:
    """The experiments by a name for each; cases that are missing are made."""
    for path in sorted((ROOT / "examples").glob("*/*.toml")):
        if "[[run]]" in path.read_text():
            yield f"{path.parent.name}-{path.stem}", path
    yield "programs-thermal", ROOT / "programs" / "thermal" / "experiment.toml"
    for grid, (seed, count) in GRIDS.items():
        folder = cases / grid
        if not (folder / "answers.json").exists():
            _mopro("blind", "make", "--grid", grid, "--seed", str(seed), "--sample", str(count),
                   "--out", str(folder))  # fmt: skip
        for path in sorted(folder.glob("*/experiment.toml")):
            yield f"{grid}-{path.parent.name}", path


def ask(name: str, experiment: Path, folder: Path) -> str:
    """Keep the answer on an experiment, its exit code and what it said beside."""
    kept = folder / f"{name}.json"
    if kept.exists():
        return f"{name}: kept"
    done = _mopro("reconcile", experiment.name, "--json", "--allow-python", at=experiment.parent)
    answer = json.loads(done.stdout) if done.stdout.strip() else {}
    told = {key: value for key, value in answer.items() if key not in TIMES}
    told |= {"exit_code": done.returncode, "stderr": done.stderr}
    kept.write_text(json.dumps(told, indent=1))
    return f"{name}: {answer.get('verdict', 'no verdict')}"


def _mopro(*arguments: str, at: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-m", "mopro", *arguments]
    return subprocess.run(
        command, cwd=at, env=environment, capture_output=True, text=True, check=False
    )


def compare(before: Path, after: Path) -> int:
    """Print what differs between two folders of answers; 1 if something does.

    A key that only one of two answers has is none of them.
    """
    names = sorted({p.name for p in before.glob("*.json")} | {p.name for p in after.glob("*.json")})
    different = 0
    for name in names:
        keys = _different(before / name, after / name)
        different += bool(keys)
        if keys:
            print(f"{name}: {', '.join(keys)}")
    print(f"{len(names)} answers, {different} differ")
    return int(different > 0)


def _different(one: Path, other: Path) -> list[str]:
    if not (one.exists() and other.exists()):
        return ["only in one folder"]
    first, second = (json.loads(p.read_text()) for p in (one, other))
    return [k for k in first.keys() & second.keys() if _text(first, k) != _text(second, k)]


def _text(answer: dict[str, Any], key: str) -> str:
    return json.dumps(answer.get(key), sort_keys=True)


if __name__ == "__main__":
    main()
