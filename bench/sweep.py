"""Time of a sweep of LVDT3: runs a second by one process and by two, and where they go.

    python bench/sweep.py [POINTS]

One process and two take turns in one printout (compare only within it); wall and CPU time of
10,000 runs unless another number is given, results on the disk included. Beside them a loop that
shares nothing: what two processes can gain on this machine just then.
"""

import os
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path

from mopro.machine import load_machine
from mopro.plant.integration import Integration
from mopro.process.jobs import in_processes
from mopro.program.compile import compile_file
from mopro.sweeps import Sweep
from mopro.sweeps.designs import Design
from mopro.sweeps.executors import local
from mopro.sweeps.figures import figures_of
from mopro.sweeps.targets import Variant

ROOT = Path(__file__).resolve().parent.parent
TURNS = 3
SPINS = 10_000_000
PROFILED = 200


def sweep_of(points: int) -> Sweep:
    """A sweep of LVDT3 over `points` velocities, accelerations and payloads."""
    base = Variant(compile_file(ROOT / "programs" / "LVDT3.CMD"), load_machine("chow1992"), 0.0)
    vary = {"VEL1": "10:60", "ACC1": "0.2:1.2", "payload": "0:5lb"}
    return Sweep.of(base, vary.items(), Design("sobol", points))


def cpu_s() -> float:
    """CPU time (s) of this process and of those that it has ended."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


def timed(sweep: Sweep, jobs: int) -> tuple[float, float]:
    """Wall and CPU time (s) of the sweep by `jobs` processes."""
    with tempfile.TemporaryDirectory() as folder:
        begun_s, begun_cpu_s = time.perf_counter(), cpu_s()
        sweep.run(local(jobs), jobs, Path(folder) / "sweep.parquet")
        return time.perf_counter() - begun_s, cpu_s() - begun_cpu_s


def spin(count: int) -> int:
    """A loop in plain Python."""
    total = 0
    for number in range(count):
        total += number
    return total


def gained() -> float:
    """Speed-up of a loop that shares nothing, from one process to two (a ratio of times)."""
    times = []
    for jobs in (1, 2):
        begun_s = time.perf_counter()
        assert len(list(in_processes(spin, [SPINS] * 4, jobs))) == 4
        times.append(time.perf_counter() - begun_s)
    return times[0] / times[1]


def profiled(sweep: Sweep) -> None:
    """Print the time of a run, and the kernel's share of it."""
    variants = [sweep.subject.variant(task.values) for task in sweep.tasks[:PROFILED]]
    in_kernel, through = [0.0], Integration.through

    def measured(engine, *args):
        kernel = engine._kernel

        def called(*numbers):
            begun_s = time.process_time()
            result = kernel(*numbers)
            in_kernel[0] += time.process_time() - begun_s
            return result

        engine._kernel = called
        try:
            return through(engine, *args)
        finally:
            engine._kernel = kernel

    Integration.through = measured
    begun_s = time.process_time()
    for variant in variants:
        figures_of(variant, None, True)
    spent_s = time.process_time() - begun_s
    Integration.through = through
    print(
        f"a run {1e3 * spent_s / len(variants):.2f} ms of CPU time, of these "
        f"{1e3 * in_kernel[0] / len(variants):.2f} in the kernel"
    )


def main() -> None:
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    timed(sweep_of(200), 1)  # the kernel is compiled, or comes from the user's cache
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} before")
    profiled(sweep_of(PROFILED))
    sweep = sweep_of(max(points // TURNS, 1))
    wall = {1: 0.0, 2: 0.0}
    cpu = {1: 0.0, 2: 0.0}
    loop = []
    for _ in range(TURNS):
        loop.append(gained())
        for jobs in (1, 2):
            turn_s, turn_cpu_s = timed(sweep, jobs)
            wall[jobs] += turn_s
            cpu[jobs] += turn_cpu_s
    runs = TURNS * len(sweep.tasks)
    for jobs in (1, 2):
        print(
            f"{runs} runs by {jobs}: {wall[jobs]:.1f} s, {runs / wall[jobs]:.0f} runs/s, "
            f"CPU time {cpu[jobs]:.1f} s"
        )
    by_cpu = 2 * cpu[1] / cpu[2]
    print(f"two are {wall[1] / wall[2]:.2f} times as fast as one, by CPU time {by_cpu:.2f}")
    print(f"two loops that share nothing: {statistics.median(loop):.2f}")


if __name__ == "__main__":
    main()
