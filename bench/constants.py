"""Sensitivity of verdicts to the constants of the diagnosis, each halved and doubled.

    mopro blind make --seed 1 --grid small --out cases
    python bench/constants.py cases [--sample 12] [--jobs 2] [--only STRONG --only FITTED]

Asks about each case with `mopro/assumed.py` as it stands and with one number changed,
each in a process of its own, and prints for each change the cases whose verdict or names differ.
What was simulated for a case before is read from a folder that goes with the case, so that a
change costs its new simulations only. Exits with 1 if a change moves more than 2 % of the cases
(and more than one).
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import subprocess
import sys
import tempfile
import types
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

MODULE = "mopro.assumed"
SOURCE = Path(__file__).parents[1] / "mopro" / "assumed.py"
# Rounding, below which nothing is decided.
ROUNDING = "# -- rounding "
FACTORS = (0.5, 2.0)
MOST_CHANGED = 0.02
PATIENCE_S = 600.0
# Verdict and names of the effects.
Answer = tuple[str, list[str]]
# A constant and a factor on it; "" leaves all as they stand.
Change = tuple[str, float]


def scaled(value: Any, factor: float) -> Any:
    """A constant times `factor`: a whole number stays one, of at least 1."""
    if isinstance(value, tuple):
        return tuple(scaled(each, factor) for each in value)
    return max(1, int(value * factor)) if isinstance(value, int) else value * factor


def names() -> Iterator[str]:
    """The constants that are stated; those that follow from them are not changed by themselves."""
    text = SOURCE.read_text(encoding="utf-8").split(ROUNDING)[0]
    assigned = [node for node in ast.parse(text).body if isinstance(node, ast.Assign)]
    own = {node.targets[0].id for node in assigned if isinstance(node.targets[0], ast.Name)}
    for node in assigned:
        used = {each.id for each in ast.walk(node.value) if isinstance(each, ast.Name)}
        if isinstance(node.targets[0], ast.Name) and not used & own:
            yield node.targets[0].id


def changed_module(name: str, factor: float) -> types.ModuleType:
    """The module of constants with one of them times `factor`, and what follows from it."""
    tree = ast.parse(SOURCE.read_text(encoding="utf-8"))
    for node in tree.body:
        target = node.targets[0] if isinstance(node, ast.Assign) else None
        if isinstance(node, ast.Assign) and isinstance(target, ast.Name) and target.id == name:
            call = ast.Call(ast.Name("_scaled", ast.Load()), [node.value, ast.Constant(factor)], [])
            node.value = call
    module = types.ModuleType(MODULE)
    module.__dict__["_scaled"] = scaled
    exec(compile(ast.fix_missing_locations(tree), str(SOURCE), "exec"), module.__dict__)
    return module


class Remembered:
    """A model whose predictions are kept in files, for all processes that ask about its case."""

    def __init__(self, model: Callable[[Any], list[Any]], about: str, folder: Path) -> None:
        self._model, self._about, self._folder = model, about, folder

    def __call__(self, settings: Any) -> list[Any]:
        import numpy as np

        text = json.dumps([self._about, settings], sort_keys=True)
        file = self._folder / (hashlib.sha256(text.encode()).hexdigest() + ".npz")
        if file.exists():
            with np.load(file) as kept:
                return [kept[name] for name in kept.files]
        predicted = self._model(settings)
        np.savez(file, *predicted)
        return predicted


def answer(change: Change, experiment: Path, folder: Path) -> Answer:
    """The answer about an experiment with one constant changed, in this process."""
    name, factor = change
    if name:
        sys.modules[MODULE] = changed_module(name, factor)
    from mopro.diagnosis import reconcile as plain
    from mopro.experiment.check.load import load_experiment
    from mopro.experiment.diagnose import diagnosis

    def reconcile(model: Any, *args: Any, finer: Any, coarse: Any, **how: Any) -> Any:
        about = f"resolved {model.resolved}"
        kept = Remembered(model, about, folder)
        fine = Remembered(finer, f"{about}, finer", folder)
        rough = Remembered(coarse, f"{about}, coarse", folder)
        return plain(kept, *args, finer=fine, coarse=rough, **how)

    vars(diagnosis)["reconcile"] = reconcile
    verdict = diagnosis.diagnose(load_experiment(experiment)).verdict
    return verdict.verdict, sorted(effect.name for effect in verdict.effects)


def asked(change: Change, experiment: Path, folder: Path) -> Answer:
    """As `answer`, in a process of its own."""
    name, factor = change
    child = [sys.executable, __file__, "--child", name, str(factor), str(experiment), str(folder)]
    done = subprocess.run(child, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    if done.returncode:
        raise SystemExit(f"{experiment}, {name} x {factor:g}: {done.stderr.strip()[-500:]}")
    word, own = json.loads(done.stdout)
    return word, own


def moved(experiment: Path, changes: Sequence[Change]) -> list[Change]:
    """The changes that alter the answer about one experiment."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        before = asked(("", 1.0), experiment, folder)
        return [change for change in changes if asked(change, experiment, folder) != before]


def main() -> int:
    if sys.argv[1:2] == ["--child"]:
        _, _, own, times, experiment, folder = sys.argv
        print(json.dumps(answer((own, float(times)), Path(experiment), Path(folder))))
        return 0
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("cases", type=Path, help="folder of `mopro blind make`")
    parser.add_argument("--sample", type=int, help="so many cases, evenly spread")
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument("--only", action="append", choices=list(names()))
    chosen = parser.parse_args()
    every = sorted(chosen.cases.glob("*/experiment.toml"))
    step = max(len(every) // (chosen.sample or len(every)), 1)
    experiments = every[::step]
    changes = [(name, factor) for name in chosen.only or names() for factor in FACTORS]
    by_case = []
    with ThreadPoolExecutor(chosen.jobs) as pool:
        found = pool.map(lambda each: moved(each, changes), experiments)
        for experiment, altered in zip(experiments, found, strict=True):
            print(f"{experiment.parent.name}: {len(altered)} of {len(changes)} changes", flush=True)
            by_case.append(altered)
    print(f"{len(experiments)} cases; {'constant':18} {'factor':>6} {'changed':>8}")
    worst = 0
    for name, factor in changes:
        pairs = zip(experiments, by_case, strict=True)
        which = [each.parent.name for each, altered in pairs if (name, factor) in altered]
        worst = max(worst, len(which))
        print(f"{name:28} {factor:6g} {len(which):8}  {', '.join(which)}")
    return int(worst > max(1, MOST_CHANGED * len(experiments)))


if __name__ == "__main__":
    sys.exit(main())
