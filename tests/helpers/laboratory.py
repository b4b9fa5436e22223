"""A laboratory: programs, data and an experiment file in a folder of their own."""

import numpy as np

import mopro
from mopro.emulator import Emulator
from mopro.experiment import load_experiment
from mopro.instruments.quantity import POSITION
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.plant import measure
from mopro.recording import MemorySink

LASER = """
[[sensor]]
name = "laser"
quantity = "position"
axis = 1
column = "position_1_in"
rate_hz = 2000.0
noise_rms = 2e-5
"""

PROGRAMS = {
    "fast.CMD": "UU012500/1\nVEL1 15.0\nACC1 0.2\nMRI1 2.0\nWX1\nWT400\nMRI1 -2.0\nWX1\nWT400\n",
    "slow.CMD": "UU012500/1\nVEL1 4.0\nACC1 0.1\nMRI1 3.0\nWX1\nWT300\nMRI1 -1.0\nWX1\nWT400\n",
}


class Lab:
    def __init__(self, folder):
        self.folder = folder
        self._seed = 0

    def path(self, name):
        return self.folder / name

    def program(self, name, text=None):
        self.path(name).write_text(text or PROGRAMS[name])
        return name

    def write(self, name, text):
        self.path(name).write_text(text)
        return self.path(name)

    def measured(self, program, sensors, for_s=None, effects=None, payload_kg=0.0, noise=True):
        """Stamps and readings of each sensor, of a run with hidden effects."""
        emulator = Emulator(
            load_machine("chow1992"), payload_kg, rate_hz=max(4000.0, sensors[0].rate_hz),
            effects=effects,
        )  # fmt: skip
        sink = MemorySink()
        compiled = mopro.compile(self.path(program).read_text(), program)
        run = emulator.run(compiled, sink, for_s)
        recording = sink.recording(emulator.header(compiled), run)
        self._seed += 1
        generator = np.random.default_rng(self._seed) if noise else None
        readings = [
            measure(recording, s, emulator.machine, emulator.active, generator) for s in sensors
        ]
        return readings[0][0], [values for _, values in readings]

    def csv(self, name, columns):
        names = ",".join(columns)
        table = np.column_stack(list(columns.values()))
        np.savetxt(self.path(name), table, "%.10g", ",", header=names, comments="")
        return name

    def record(self, program, data, effects=None, sensors=None, **options):
        """Write the CSV of a run, as a laser on axis 1 sees it unless told otherwise."""
        sensors = sensors or [Sensor("laser", POSITION, "position_1_in", 2000.0, 1, 2e-5)]
        if not self.path(program).exists():
            self.program(program)
        time_s, values = self.measured(program, sensors, effects=effects, **options)
        columns = {s.column: v for s, v in zip(sensors, values, strict=True)}
        return self.csv(data, {"time_s": time_s, **columns})

    def experiment(self, runs, sensors=LASER, machine="chow1992"):
        """`runs` are the keys of each, as text."""
        entries = "".join(f"\n[[run]]\n{run}\n" for run in runs)
        return self.write("e.toml", f'machine = "{machine}"\n{sensors}{entries}')

    def two_runs(self, effects=None):
        """The fast and the slow program with data that fit them."""
        for name in ("fast", "slow"):
            self.record(f"{name}.CMD", f"{name}.csv", effects)
        return self.experiment(
            [f'program = "{name}.CMD"\ndata = "{name}.csv"' for name in ("fast", "slow")]
        )

    def load(self):
        return load_experiment(self.path("e.toml"))


_SETUP = "UU012500/1\nVEL1 15.0\nACC1 0.2\n"
_STROKES = {
    "fast": f"{_SETUP}MRI1 2.0\nWX1\nWT200\nMRI1 -2.0\nWX1\nWT200\n",
    "slow": "UU012500/1\nVEL1 6.0\nACC1 0.1\nMRI1 2.0\nWX1\nWT250\nMRI1 -1.0\nWX1\nWT250\n",
}
_COARSE_LASER = """
[[sensor]]
name = "laser"
quantity = "position"
axis = 1
column = "position_1_in"
rate_hz = 1000.0
noise_rms = {noise}
"""
DRAG = {"viscous_drag": {"b": 9.0}}


def laboratory(folder, effects, runs=("fast",), noise=2e-5, bump=0.0, machine="chow1992"):
    """An experiment in `folder`: what a laser of `noise` inches saw of runs with `effects`.

    `effects` may differ by run. A `bump` (in) is in no catalogue; it is at 1.0 in.
    """
    lab = Lab(folder)
    sensor = Sensor("laser", POSITION, "position_1_in", 1000.0, 1, noise)
    for run in runs:
        lab.program(f"{run}.CMD", _STROKES[run])
        own = effects.get(run, effects)
        time_s, (seen,) = lab.measured(f"{run}.CMD", [sensor], effects=own)
        _, (place,) = lab.measured(f"{run}.CMD", [sensor], noise=False)
        seen = seen + bump * np.exp(-(((place - 1.0) / 0.15) ** 2))
        lab.csv(f"{run}.csv", {"time_s": time_s, "position_1_in": seen})
    entries = [f'program = "{run}.CMD"\ndata = "{run}.csv"' for run in runs]
    lab.experiment(entries, _COARSE_LASER.format(noise=noise), machine)
    return lab.path("e.toml").rename(lab.path("experiment.toml"))
