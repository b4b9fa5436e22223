"""Sensitivity of verdicts to the constants of the diagnosis, each halved and doubled.

    mopro blind make --seed 1 --grid small --out cases
    python bench/constants.py cases [--sample 12] [--only STRONG --only FITTED]

Asks about each case with `mopro/diagnosis/constants.py` as it stands and with one number changed,
each in a process of its own, and prints for each change the cases whose verdict or names differ.
Exits with 1 if a change moves more than 2 % of the cases (and more than one).
"""

from __future__ import annotations

import argparse
import ast
import json
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MODULE = "mopro.diagnosis.constants"
SOURCE = Path(__file__).parents[1] / "mopro" / "diagnosis" / "constants.py"
# Rounding, below which nothing is decided.
ROUNDING = "# -- rounding "
FACTORS = (0.5, 2.0)
MOST_CHANGED = 0.02
PATIENCE_S = 600.0
Answers = dict[str, tuple[str, list[str]]]


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


def answer(name: str, factor: float, experiments: list[str]) -> Answers:
    """Verdict and names of each experiment with one constant changed, in this process."""
    if name:
        sys.modules[MODULE] = changed_module(name, factor)
    from mopro.experiment.check.load import load_experiment
    from mopro.experiment.diagnose.diagnosis import diagnose

    answers: Answers = {}
    for experiment in experiments:
        verdict = diagnose(load_experiment(Path(experiment))).verdict
        answers[experiment] = (verdict.verdict, sorted(effect.name for effect in verdict.effects))
    return answers


def asked(name: str, factor: float, experiments: list[str]) -> Answers:
    """As `answer`, in a process of its own, one for each experiment."""
    answers: Answers = {}
    for experiment in experiments:
        child = [sys.executable, __file__, "--child", name, str(factor), experiment]
        done = subprocess.run(
            child, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        if done.returncode:
            raise SystemExit(f"{experiment}, {name} x {factor:g}: {done.stderr.strip()[-500:]}")
        answers |= {key: (word, own) for key, (word, own) in json.loads(done.stdout).items()}
    return answers


def main() -> int:
    if sys.argv[1:2] == ["--child"]:
        _, _, own, times, *files = sys.argv
        print(json.dumps(answer(own, float(times), files)))
        return 0
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("cases", type=Path, help="folder of `mopro blind make`")
    parser.add_argument("--sample", type=int, help="so many cases, evenly spread")
    parser.add_argument("--only", action="append", choices=list(names()))
    chosen = parser.parse_args()
    every = sorted(map(str, chosen.cases.glob("*/experiment.toml")))
    step = max(len(every) // (chosen.sample or len(every)), 1)
    experiments = every[::step]
    before = asked("", 1.0, experiments)
    print(f"{len(experiments)} cases; {'constant':18} {'factor':>6} {'changed':>8}", flush=True)
    worst = 0
    for name in chosen.only or names():
        for factor in FACTORS:
            after = asked(name, factor, experiments)
            changed = [each for each in experiments if after[each] != before[each]]
            worst = max(worst, len(changed))
            which = ", ".join(Path(each).parent.name for each in changed)
            print(f"{name:28} {factor:6g} {len(changed):8}  {which}", flush=True)
    return int(worst > max(1, MOST_CHANGED * len(experiments)))


if __name__ == "__main__":
    sys.exit(main())
