"""How long one integration step takes, plain and compiled, and a whole run against `import numpy`.

    python bench/kernel.py

Medians of several runs in one process (the machine's speed drifts: compare only within
one printout).
"""

import math
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from mopro.machine import load_machine
from mopro.plant import compiled, kernel

ROOT = Path(__file__).resolve().parents[1]
STEPS = 200_000
REPEATS = 7


def arguments(steps: int, as_lists: bool) -> tuple:
    """An axis that accelerates evenly for `steps` steps of 25 µs."""
    axis = load_machine("chow1992").axis
    knots = np.linspace(0.0, steps * 25e-6, steps // 20 + 1)
    rows = np.zeros(len(knots) - 1, dtype=np.int64)
    segment = [np.array([value]) for value in (0.0, 0.0, 0.0, 1000.0, 0.0)]
    outputs = [np.zeros(len(knots)) for _ in range(4)]
    arrays = [knots, rows, *segment]
    if as_lists:
        arrays, outputs = [a.tolist() for a in arrays], [o.tolist() for o in outputs]
    damping = axis.drive_damping_N_s_m / axis.moving_mass_kg
    pull_out = axis.pull_out_force_N / axis.moving_mass_kg
    constants = (axis.wave_number_1_m, pull_out, damping, 2.032e-6, True, 25e-6, math.inf, 0.0)
    return *arrays, *constants, *outputs


def nanoseconds_per_step(integrate, steps: int, as_lists: bool) -> float:
    integrate(*arguments(20, as_lists))
    times = []
    for _ in range(REPEATS):
        inputs = arguments(steps, as_lists)
        start = time.perf_counter()
        taken = integrate(*inputs)
        times.append((time.perf_counter() - start) / taken)
    return statistics.median(times) * 1e9


def seconds(*command: str) -> float:
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start


def main() -> None:
    plain = nanoseconds_per_step(kernel.integrate, STEPS // 20, True)
    fast = nanoseconds_per_step(compiled.integrate, STEPS, False)
    print(
        f"one step of one axis: plain {plain:.0f} ns, compiled {fast:.0f} ns, {plain / fast:.0f}:1"
    )
    run = (sys.executable, "-m", "mopro", "run", str(ROOT / "programs" / "LVDT3.CMD"), "--emulate")
    ratios = [
        seconds(*run) / seconds(sys.executable, "-c", "import numpy") for _ in range(REPEATS + 1)
    ]
    print(f"mopro run LVDT3.CMD / import numpy: {statistics.median(ratios[1:]):.1f}")


if __name__ == "__main__":
    main()
