"""Time that `mopro optimize --draws` saves on hidden plants, and the stalls that it costs.

    python bench/optimised.py [--plants 3] [--seed 1] [--draws 50] [--points 240] [--risk 0.003]

A plant is the nominal motor with one or two effects drawn by the seed. What a laser sees of three
short programs is reconciled; the machine file, and nothing else, decides the velocity and the
acceleration of a stroke of 15 in and back, with a margin of 0.2. The source states no rule for
either: it is compared with the settings of its own programs (40 in/s with 250 in/s² in trapezoids)
and with the soonest point of the nominal motor under the same limit. Each is verified on the
hidden plant by runs whose effects vary by 1 % from run to run.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

import numpy as np

import mopro
from mopro.emulator import Emulator
from mopro.errors import DataError
from mopro.experiment.conclusion import Conclusion
from mopro.experiment.opened import open_experiment
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.machine.file import read_machine
from mopro.machine.model import Machine
from mopro.plant import measure
from mopro.recording import MemorySink
from mopro.source import Source
from mopro.sweeps.drawn import Draws, uncertain
from mopro.sweeps.figures import Figures, figures_of
from mopro.sweeps.optimum import Bound, Goal, Optimum, optimum
from mopro.sweeps.targets import Value, Variant
from mopro.sweeps.tasks import Subject
from mopro.sweeps.varied import all_varied

Effects = Mapping[str, Mapping[str, float]]
STROKE = "UU012500/1\nVEL1 40.0\nACC1 0.25\nMRI1 15.0\nWX1\nWT100\nMRI1 -15.0\nWX1\nWT100\n"
RUNS = {
    "fast": "UU012500/1\nVEL1 30.0\nACC1 0.4\nMRI1 4.0\nWX1\nWT200\nMRI1 -4.0\nWX1\nWT200\n",
    "slow": "UU012500/1\nVEL1 6.0\nACC1 0.1\nMRI1 2.0\nWX1\nWT250\nMRI1 -1.0\nWX1\nWT250\n",
    "hard": "UU012500/1\nVEL1 20.0\nACC1 0.6\nMRI1 -3.0\nWX1\nWT200\nMRI1 2.0\nWX1\nWT200\n",
}
LASER = Sensor("laser", POSITION, "position_1_in", 1000.0, 1, 2e-5)
TEXT = (
    'machine = "chow1992"\n[[sensor]]\nname = "laser"\nquantity = "position"\naxis = 1\n'
    'column = "position_1_in"\nrate_hz = 1000.0\nnoise_rms = 2e-5\n'
)
# What takes force from a stroke, and the range that it is drawn from.
HIDDEN = {
    "viscous_drag": ("b", 3.0, 15.0),
    "quadratic_drag": ("c", 3.0, 8.0),
    "coulomb_friction": ("Fc", 3.0, 10.0),
    "force_constant": ("e", -0.2, -0.05),
}
LIMIT, VARY = "margin>0.2", {"VEL1": "20:60", "ACC1": "0.2:1.5"}
VERIFYING_RUNS, SCATTER = 20, 0.01


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--points", type=int, default=240)
    parser.add_argument("--risk", type=float, default=0.003)
    options = parser.parse_args()
    goal = Goal("time_s", False, (Bound.read(LIMIT),), options.risk)
    nominal = _best(load_machine("chow1992"), goal, options.points, None)
    settings = {"source": (Fraction(40), Fraction("0.25")), "nominal": nominal.values}
    for nth in range(options.plants):
        generator = np.random.default_rng([options.seed, nth])
        hidden = _hidden(generator)
        print(f"plant {nth}: {hidden}", flush=True)
        for name, values in settings.items():
            print(f"  {name}: {_verified(hidden, values, generator)}", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            found = _reconciled(Path(folder), hidden, generator)
        print(f"  verdict: {found.verdict.verdict}, {[e.name for e in found.verdict.effects]}")
        print(f"  optimised: {_optimised(found, goal, options, hidden, generator)}", flush=True)


def _hidden(generator: np.random.Generator) -> Effects:
    names = generator.choice(list(HIDDEN), generator.integers(1, 3), replace=False)
    return {
        str(name): {HIDDEN[name][0]: round(float(generator.uniform(*HIDDEN[name][1:])), 4)}
        for name in names
    }


def _reconciled(folder: Path, hidden: Effects, generator: np.random.Generator) -> Conclusion:
    """The conclusion from what the laser sees of the three programs."""
    text = TEXT
    for name, program in RUNS.items():
        (folder / f"{name}.CMD").write_text(program)
        emulator = Emulator(load_machine("chow1992"), rate_hz=4000.0, effects=hidden)
        sink, compiled = MemorySink(), mopro.compile(program, f"{name}.CMD")
        recording = sink.recording(emulator.header(compiled), emulator.run(compiled, sink))
        seen = measure(recording, LASER, emulator.machine, emulator.active, generator)
        header = f"time_s,{LASER.column}"
        np.savetxt(
            folder / f"{name}.csv", np.column_stack(seen), "%.10g", ",", header=header, comments=""
        )
        text += f'[[run]]\nprogram = "{name}.CMD"\ndata = "{name}.csv"\n'
    (folder / "experiment.toml").write_text(text)
    return open_experiment(folder / "experiment.toml").conclude()


def _optimised(
    found: Conclusion,
    goal: Goal,
    options: argparse.Namespace,
    hidden: Effects,
    generator: np.random.Generator,
) -> str:
    """Text: the point optimised on the repaired file, and its runs on the hidden plant."""
    machine = read_machine(Source("machine.toml", found.machine_text))
    if machine.verdict == "unexplained":
        return "refused, unexplained"
    try:
        best = _best(machine, goal, options.points, Draws(options.draws, options.seed))
    except DataError as error:
        return f"refused: {error}"
    assert best.verified is not None or not best.kept
    bound = f", at most {best.verified.at_most:.3%} miss" if best.verified else ""
    kept = "kept" if best.kept else "not kept"
    return f"{kept}{bound}; {_verified(hidden, best.values, generator)}"


def _best(machine: Machine, goal: Goal, points: int, draws: Draws | None) -> Optimum:
    base = Variant(mopro.compile(STROKE, "STROKE.CMD"), machine, 0.0)
    varied = all_varied(VARY.items(), base.program, machine)
    numbers = () if draws is None else uncertain(base, varied)
    return optimum(Subject(base, varied, uncertain=numbers), goal, points, 1, draws=draws)


def _verified(hidden: Effects, values: tuple[Value, ...], generator: np.random.Generator) -> str:
    """Time, stalls and runs below the limit of verifying runs at these settings."""
    runs = [_run(_scattered(hidden, generator), values) for _ in range(VERIFYING_RUNS)]
    stalls = sum(run.outcome != "ok" for run in runs)
    low = sum(run.force_margin is None or run.force_margin < 0.2 for run in runs)
    at = ", ".join(f"{float(value):.4g}" for value in values)
    return (
        f"VEL1, ACC1 = {at}: {runs[0].time_s:.4f} s, {stalls} of {len(runs)} stall, "
        f"{low} below {LIMIT}"
    )


def _scattered(hidden: Effects, generator: np.random.Generator) -> Effects:
    def about(value: float) -> float:
        return float(value * (1 + SCATTER * generator.standard_normal()))

    return {name: {key: about(value) for key, value in own.items()} for name, own in hidden.items()}


def _run(hidden: Effects, values: tuple[Value, ...]) -> Figures:
    machine = load_machine("chow1992")
    base = Variant(mopro.compile(STROKE, "STROKE.CMD"), machine.with_effects(hidden), 0.0)
    subject = Subject(base, all_varied(VARY.items(), base.program, machine))
    return figures_of(subject.variant(values), None, True)


if __name__ == "__main__":
    main()
