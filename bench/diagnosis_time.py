"""CPU seconds of a diagnosis by this checkout, and as a share of those of another one.

    python bench/diagnosis_time.py FOLDER --against CHECKOUT [--joint 0] [--repeat 1] MOTION...

FOLDER as for carry_over.py: the MOTIONs are the runs of one experiment. Both checkouts diagnose it
in turn, --repeat times, each by one thread in a process of its own; printed are the least user
times, their ratio, and whether verdict, names and forms are the same. The start of the program is
not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from carry_over import written

ROOT = Path(__file__).parents[1]
DIAGNOSIS = """
import json, resource, sys
from mopro.experiment.opened import open_experiment
begun = resource.getrusage(resource.RUSAGE_SELF).ru_utime
verdict = open_experiment(sys.argv[1]).conclude().verdict
used = resource.getrusage(resource.RUSAGE_SELF).ru_utime - begun
named = sorted(f"{effect.name} {effect.form}".strip() for effect in verdict.effects)
print(json.dumps([used, [verdict.verdict, *named]]))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("motions", nargs="+", metavar="MOTION")
    parser.add_argument("--against", type=Path, required=True, metavar="CHECKOUT")
    parser.add_argument("--joint", type=int, default=0)
    parser.add_argument("--repeat", type=int, default=1)
    options = parser.parse_args()
    motions = tuple(options.motions)
    where = {m: options.folder / f"{m}_joint{options.joint}.csv" for m in motions}
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), motions, where)
        rounds = [[_diagnosed(r, path) for r in (options.against.resolve(), ROOT)]
                  for _ in range(options.repeat)]  # fmt: skip
    (before, told_before), (after, told) = (min(own) for own in zip(*rounds, strict=True))
    alike = "the same answer" if told == told_before else f"another answer than {told_before}"
    print(f"{' + '.join(motions)}: {before:.1f} s -> {after:.1f} s, {after / before:.2f} of it, "
          f"{alike}: {', '.join(told)}")  # fmt: skip


def _diagnosed(checkout: Path, experiment: Path) -> tuple[float, list[str]]:
    """User seconds, and the verdict with the names of the effects, by a checkout's code."""
    environment = {**os.environ, "PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-c", DIAGNOSIS, str(experiment)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    used, told = json.loads(done.stdout)
    return used, told


if __name__ == "__main__":
    main()
