"""Time of `mopro lint programs/LVDT3.CMD`, in units of `import click, lark`.

Both are whole processes, taken in turn, in one run; the medians are compared. Python may
keep its bytecode and mopro its parser, as in an installation in use. With `--text` only
the text rules are asked; `--limit X` exits with 1 if the ratio is above X.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BASE = [sys.executable, "-c", "import click, lark"]
TEXT = "unused-label,unreachable,unused-allow,letter-o-axis"


def seconds(command: list[str]) -> float:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    start = time.perf_counter()
    subprocess.run(command, env=environment, capture_output=True, check=False)
    return time.perf_counter() - start


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=21)
    parser.add_argument("--text", action="store_true")
    parser.add_argument("--limit", type=float)
    chosen = parser.parse_args()
    lint = [sys.executable, "-m", "mopro", "lint", str(ROOT / "programs" / "LVDT3.CMD")]
    lint += ["--select", TEXT] if chosen.text else []
    pairs = [(seconds(BASE), seconds(lint)) for _ in range(chosen.runs + 1)][1:]
    base, whole = (statistics.median(times) for times in zip(*pairs, strict=True))
    ratio = whole / base
    print(f"import click, lark: {base * 1e3:.0f} ms; mopro lint: {whole * 1e3:.0f} ms; {ratio:.2f}")
    return int(chosen.limit is not None and ratio > chosen.limit)


if __name__ == "__main__":
    sys.exit(main())
