"""Time of one integration step, plain and compiled, nominal and with ten sets of effects.

    python bench/kernel.py

Then the first use after an installation, in processes of their own with an empty cache: the
first kernel of some of the sets, numba's import included, and a whole run of ten minutes. Then a
whole run against `import numpy`. Medians in CPU time, of several runs in one process where
not said otherwise (the machine's speed drifts: compare only within one printout).
"""

import os
import resource
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
from mopro.plant.integration import Integration

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
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
FIRST = ((), ("coulomb_friction",), SETS[-1])


def integration(names: tuple[str, ...], compiled: bool) -> Integration:
    """The engine of the axis of PROGRAM with these effects at their defaults."""
    machine = load_machine("chow1992")
    active = active_effects(machine.with_effects({name: {} for name in names}), catalogue())
    run = simulate(plan(PROGRAM), machine, active, Stepping(STEP_S), compiled=compiled)
    return run._axes[1]._integration


def nanoseconds_per_step(names: tuple[str, ...], compiled: bool) -> float:
    """The median time of a step of STEP_S, from rest into even acceleration and on."""
    lasting_s = 0.8 if compiled else 0.05
    knots = np.arange(0.0, lasting_s, KNOT_S)
    integration(names, compiled).through(knots[:3])
    times = []
    for _ in range(REPEATS):
        moving = integration(names, compiled)
        start = time.process_time()
        moving.through(knots)
        times.append(time.process_time() - start)
    return statistics.median(times) / lasting_s * STEP_S * 1e9


def seconds(*command: str) -> float:
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - start


def first_use_s(*command: str) -> float:
    """The median CPU time (s) of `command` where no cache has been filled."""
    times = []
    for _ in range(REPEATS):
        with tempfile.TemporaryDirectory() as folder:
            environment = os.environ | {"XDG_CACHE_HOME": folder}
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(
                command, cwd=folder, env=environment, check=True, capture_output=True, timeout=120
            )
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return statistics.median(times)


def first_uses() -> None:
    """Print how long a kernel takes that no cache holds, and a run with one."""
    print("first use, s of CPU time of a whole process:")
    script = "import kernel; kernel.engine({!r}, {})"
    for names in FIRST:
        plain, fast = (
            first_use_s(sys.executable, "-c", f"import sys; sys.path.insert(0, {str(HERE)!r}); "
                        + script.format(names, compiled))
            for compiled in (False, True)
        )  # fmt: skip
        print(f"{fast - plain:8.2f}  {' + '.join(names) or 'nominal'}")
    program = str(ROOT / "programs" / "TEMP1.CMD")
    run = (sys.executable, "-m", "mopro", "run", program, "--emulate", "--for", "10min")
    print(f"{first_use_s(*run, '--out', 'recording.npz'):8.2f}  mopro run TEMP1.CMD --for 10min")


def main() -> None:
    print("plain and compiled, ns for one step of one axis:")
    for names in SETS:
        plain, fast = (nanoseconds_per_step(names, compiled) for compiled in (False, True))
        print(f"{plain:8.0f} {fast:6.0f}  {' + '.join(names) or 'nominal'}")
    first_uses()
    run = (sys.executable, "-m", "mopro", "run", str(ROOT / "programs" / "LVDT3.CMD"), "--emulate")
    ratios = [
        seconds(*run) / seconds(sys.executable, "-c", "import numpy") for _ in range(REPEATS + 1)
    ]
    print(f"mopro run LVDT3.CMD / import numpy: {statistics.median(ratios[1:]):.1f}")


if __name__ == "__main__":
    main()
