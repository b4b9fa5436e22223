"""Each program of programs/ with --emulate and with --port, as processes; are they equal?

    python bench/link_equal.py [--dialect checked]

Serves on a pseudo-terminal and on TCP in turn. Looping programs are cut where they rest.
Compares the moves of `--json` exactly, and the last commanded positions in microsteps.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import mopro
from mopro.machine import load_machine

PROGRAMS = Path(__file__).resolve().parents[1] / "programs"
CUT = {"TEMP1": "4.3s", "TEMP2": "2.4333333333333333s"}


def run(folder: Path, program: Path, *where: str) -> tuple[Any, list[int]]:
    """The moves, and where the axes are told to be at the end, in microsteps."""
    out = folder / "run.npz"
    cut = ["--for", CUT[program.stem]] if program.stem in CUT else []
    command = [sys.executable, "-m", "mopro", "run", str(program), *where, *cut]
    done = subprocess.run(
        [*command, "--out", str(out), "--json"], capture_output=True, text=True, check=True
    )
    recording = mopro.read(out)
    step_m = load_machine("chow1992").microstep_m
    ends = [round(float(recording[f"command_{axis}_m"][-1]) / step_m) for axis in (1, 2)]
    return json.loads(done.stdout)["moves"], ends


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--dialect", default="checked")
    dialect = parser.parse_args().dialect
    failed = False
    with tempfile.TemporaryDirectory() as name:
        for listen in ("pty", "socket://127.0.0.1:0"):
            for program in sorted(PROGRAMS.glob("*.CMD")):
                command = [sys.executable, "-m", "mopro", "serve"]
                with subprocess.Popen(
                    [*command, "--listen", listen, "--dialect", dialect],
                    stdout=subprocess.PIPE,
                    text=True,
                ) as server:
                    assert server.stdout is not None, "asked for"
                    address = server.stdout.readline().strip()
                    there = run(Path(name), program, "--port", address, "--dialect", dialect)
                    server.terminate()
                here = run(Path(name), program, "--emulate")
                equal = ["equal" if a == b else "DIFFERS" for a, b in zip(there, here, strict=True)]
                failed |= there != here
                print(
                    f"{listen[:6]:6} {program.name:10} {len(here[0])} moves {equal[0]}, "
                    f"ends at {here[1]}: {equal[1]}",
                    flush=True,
                )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
