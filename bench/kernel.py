"""Time of one integration step, plain and compiled, nominal and with ten sets of effects.

    python bench/kernel.py

Then a whole run against `import numpy`. Medians of several runs in one process, in CPU time
(the machine's speed drifts: compare only within one printout).
"""

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import mopro
from mopro.effects import catalogue
from mopro.effects.resolve import active_effects
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.plant import Stepping, simulate
from mopro.plant.engine import Engine

ROOT = Path(__file__).resolve().parents[1]
STEP_S, KNOT_S, REPEATS = 25e-6, 5e-4, 7
PROGRAM = mopro.compile("UU012500/1\nVEL1 10.0\nACC1 20.0\nMRI1 8\nWX1\n")
SETPOINTS = (
    "phase_gain_imbalance", "quadrature_error", "phase_current_offset", "current_third_harmonic",
)  # fmt: skip
SETS = (
    (),
    ("viscous_drag",),
    ("quadratic_drag",),
    ("coulomb_friction",),
    ("umbilical_spring", "constant_force"),
    ("detent_force",),
    ("phase_gain_imbalance",),
    SETPOINTS,
    ("current_loop_lag",),
    ("voltage_saturation",),
    ("viscous_drag", "coulomb_friction", "detent_force", "current_loop_lag", "voltage_saturation"),
)


def engine(names: tuple[str, ...], compiled: bool) -> Engine:
    """The engine of the axis of PROGRAM with these effects at their defaults."""
    machine = load_machine("chow1992")
    active = active_effects(machine.with_effects({name: {} for name in names}), catalogue())
    run = simulate(plan(PROGRAM), machine, active, Stepping(STEP_S), compiled=compiled)
    return run._axes[1]._engine


def nanoseconds_per_step(names: tuple[str, ...], compiled: bool) -> float:
    """The median time of a step of STEP_S, from rest into even acceleration and on."""
    lasting_s = 0.8 if compiled else 0.05
    knots = np.arange(0.0, lasting_s, KNOT_S)
    engine(names, compiled).through(knots[:3])
    times = []
    for _ in range(REPEATS):
        moving = engine(names, compiled)
        start = time.process_time()
        moving.through(knots)
        times.append(time.process_time() - start)
    return statistics.median(times) / lasting_s * STEP_S * 1e9


def seconds(*command: str) -> float:
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start


def main() -> None:
    print("plain and compiled, ns for one step of one axis:")
    for names in SETS:
        plain, fast = (nanoseconds_per_step(names, compiled) for compiled in (False, True))
        print(f"{plain:8.0f} {fast:6.0f}  {' + '.join(names) or 'nominal'}")
    run = (sys.executable, "-m", "mopro", "run", str(ROOT / "programs" / "LVDT3.CMD"), "--emulate")
    ratios = [
        seconds(*run) / seconds(sys.executable, "-c", "import numpy") for _ in range(REPEATS + 1)
    ]
    print(f"mopro run LVDT3.CMD / import numpy: {statistics.median(ratios[1:]):.1f}")


if __name__ == "__main__":
    main()
