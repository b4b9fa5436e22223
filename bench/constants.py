"""Sensitivity of verdicts to the constants of the diagnosis, each halved and doubled.

    mopro blind make --seed 1 --grid small --out cases
    python bench/constants.py cases [--sample 12] [--jobs 2] [--only STRONG --only FITTED]

Asks about each case with `mopro/engine/assumed.py` as it stands and with one number changed,
each in a process of its own, and prints for each change the cases whose verdict or names differ,
and those that only tell another one of the same alternatives first. What was simulated for a case
before is read from a folder that goes with the case, so that a change costs its new simulations
only. Exits with 1 if a change alters the answers about more than 2 % of the cases (and more than
one). Interrupted, it prints the table of the cases asked about so far.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import multiprocessing
import os
import sys
import tempfile
import types
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

MODULE = "mopro.engine.assumed"
SOURCE = Path(__file__).parents[1] / "mopro" / "assumed.py"
# Rounding, below which nothing is decided.
ROUNDING = "# -- rounding "
FACTORS = (0.5, 2.0)
MOST_CHANGED = 0.02
PATIENCE_S = 600.0
# What every process needs and no constant changes: loaded once, where the others are forked from.
PRELOADED = ["numba", "numpy", "scipy.fft", "scipy.linalg", "scipy.optimize", "scipy.signal",
             "scipy.special", "scipy.stats"]  # fmt: skip
# How two answers about a case differ.
ORDER, ANSWER = "order", "answer"
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
        # Another process may be about to read it.
        beside = file.with_suffix(f".{os.getpid()}.npz")
        np.savez(beside, *predicted)
        beside.replace(file)
        return predicted


@dataclass(frozen=True)
class Answer:
    """An answer about a case: the verdict, the effects named, the sets that do as well."""

    verdict: str
    named: tuple[str, ...]
    alternatives: frozenset[tuple[str, ...]]

    def differs_from(self, other: Answer) -> str:
        """ORDER if each names one of the other's alternatives, else ANSWER; "" if both are one."""
        if self.verdict == other.verdict and self.named == other.named:
            return ""
        mutual = self.named in other.alternatives and other.named in self.alternatives
        return ORDER if mutual and self.verdict == other.verdict else ANSWER


def answer(change: Change, experiment: Path, folder: Path) -> Answer:
    """The answer about an experiment with one constant changed, in a process that has none yet."""
    name, factor = change
    if name:
        sys.modules[MODULE] = changed_module(name, factor)
    from mopro.engine import reconcile as plain
    from mopro.experiment import conclusion
    from mopro.experiment.opened import open_experiment

    def reconcile(simulate: Any, *, finer: Any, coarse: Any, **how: Any) -> Any:
        about = f"resolved {simulate.resolved}"
        kept = Remembered(simulate, about, folder)
        fine = Remembered(finer, f"{about}, finer", folder)
        rough = Remembered(coarse, f"{about}, coarse", folder)
        return plain(kept, finer=fine, coarse=rough, **how)

    vars(conclusion)["reconcile"] = reconcile
    _, verdict = conclusion.diagnose(open_experiment(experiment).system)
    named = tuple(sorted(effect.name for effect in verdict.effects))
    return Answer(verdict.verdict, named, frozenset(verdict.alternatives))


def moved(experiment: Path, changes: Sequence[Change], jobs: int) -> dict[Change, str]:
    """The changes that alter the answer about one experiment, and what they alter."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    with (
        tempfile.TemporaryDirectory() as temporary,
        ProcessPoolExecutor(jobs, context, max_tasks_per_child=1) as pool,
    ):
        ask = partial(answer, experiment=experiment, folder=Path(temporary))
        before = pool.submit(ask, ("", 1.0)).result(PATIENCE_S)
        after = list(pool.map(ask, changes, timeout=PATIENCE_S * len(changes)))
        pairs = zip(changes, after, strict=True)
        return {change: what for change, own in pairs if (what := own.differs_from(before))}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("cases", type=Path, help="folder of `mopro blind make`")
    parser.add_argument("--sample", type=int, help="so many cases, evenly spread")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--only", action="append", choices=list(names()))
    chosen = parser.parse_args()
    every = sorted(chosen.cases.glob("*/experiment.toml"))
    step = max(len(every) // (chosen.sample or len(every)), 1)
    experiments = every[::step]
    changes = [(name, factor) for name in chosen.only or names() for factor in FACTORS]
    by_case = []
    try:
        for experiment in experiments:
            by_case.append(moved(experiment, changes, chosen.jobs))
            print(f"{experiment.parent.name}: {len(by_case[-1])} of {len(changes)}", flush=True)
    except KeyboardInterrupt:
        experiments = experiments[: len(by_case)]
    print(f"{len(experiments)} cases; {'constant':18} {'factor':>6} {'changed':>8} {'order':>6}")
    worst = 0
    for change in changes:
        cases = {each.parent.name: own for each, own in zip(experiments, by_case, strict=True)}
        which = [number for number, own in cases.items() if own.get(change) == ANSWER]
        order = sum(own.get(change) == ORDER for own in cases.values())
        worst = max(worst, len(which))
        print(f"{change[0]:28} {change[1]:6g} {len(which):8} {order:6}  {', '.join(which)}")
    return int(worst > max(1, MOST_CHANGED * len(experiments)))


if __name__ == "__main__":
    sys.exit(main())
