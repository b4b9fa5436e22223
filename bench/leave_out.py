"""Tests of the engine that fail if a pass of the diagnosis is left out, for each of its passes.

    python bench/leave_out.py [PASS ...] [--most 3]

Runs the tests of the whole chain of passes (TESTS) once for each pass, without it wherever it
stands, and prints the tests that fail, at most --most of a pass. Exits 1 if a pass can be left out
without any: then it has no test, or does nothing.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from mopro.engine.passes import PASSES, Loop, Pass

ROOT = Path(__file__).parents[1]
TESTS = ("tests/engine",)
# A plugin of pytest that takes the pass out before any test asks for a verdict.
PLUGIN = """\
import os
from dataclasses import replace
from mopro.engine import diagnosis
import pytest

from mopro.engine.passes import Loop

def without(passes, name):
    for each in passes:
        if isinstance(each, Loop):
            each = replace(each, passes=tuple(without(each.passes, name)))
        if getattr(each, "__name__", "") != name:
            yield each

passes = tuple(without(diagnosis.PASSES, os.environ["LEFT_OUT"]))
diagnosis.reconcile.__kwdefaults__["passes"] = passes
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="PASS")
    parser.add_argument("--most", type=int, default=3)
    options = parser.parse_args()
    names = options.names or list(dict.fromkeys(named(PASSES)))
    needless = [name for name in names if not told(name, options.most)]
    if needless:
        sys.exit(f"no test fails without {', '.join(needless)}")


def named(passes: Sequence[Pass]) -> Iterator[str]:
    """The names of all passes, those in loops included."""
    for each in passes:
        if isinstance(each, Loop):
            yield from named(each.passes)
        else:
            yield each.__name__


def told(name: str, most: int) -> bool:
    """Print the tests that fail without a pass; False if there are none."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "left_out.py").write_text(PLUGIN, "utf-8")
        environment = {**os.environ, "LEFT_OUT": name, "PYTHONPATH": f"{folder}:{ROOT}"}
        arguments = ["-p", "left_out", "-q", "-n", "2", f"--maxfail={most}", *TESTS]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *arguments],
            cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
    if done.returncode not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED,
                               pytest.ExitCode.INTERRUPTED):  # fmt: skip
        sys.exit(f"{name}: the tests did not run: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    failed = re.findall(r"^FAILED (\S+)", done.stdout, re.MULTILINE)
    print(f"{name}: {', '.join(failed) or 'nothing fails'}", flush=True)
    return bool(failed)


if __name__ == "__main__":
    main()
