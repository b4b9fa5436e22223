"""The motor as a model that the diagnosis can run: settings of effects to every reading.

What a program commands and how the axis answers (stages C and D) is simulated and kept;
what a sensor makes of it (stage M) is worked out anew each time, as it costs next to
nothing.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from mopro.diagnosis import Settings
from mopro.emulator.effects import Active, Effect, Stage, catalogue, on_axis
from mopro.emulator.effects.base import Scene
from mopro.emulator.effects.resolve import active_effects
from mopro.emulator.lag import first_order
from mopro.emulator.measured import TEMPERATURE, Sensor, interpolated
from mopro.emulator.setup import Settings as EmulatorSettings
from mopro.emulator.setup import Staging, planned, staged
from mopro.experiment.logged import schedule_of
from mopro.experiment.model import Experiment, Floats, Reading, Trial
from mopro.motion import Schedule
from mopro.program import AXES

# RK4 at this step is within 0.02 µm, and twice as quick as what a run takes.
COARSE_STEP_S = 1e-4
FINE_STEP_S = 2.5e-5
# Between samples of the true motion a cubic is within 0.03 µm at a jump of acceleration.
DENSE_HZ = 4000.0
_KEPT = 96

# What the diagnosis adds to an effect's own parameters: on which axis alone it acts (0 for
# all), in which run alone (-1 for all), and an angle that is another one in each run.
AXIS, RUN = "axis", "run"

# Effects of one group cost little: a kernel for all of them saves compiling others.
_TOGETHER = (
    ("viscous_drag", "quadratic_drag", "umbilical_spring", "constant_force"),
    ("phase_gain_imbalance", "quadrature_error", "phase_current_offset", "current_third_harmonic"),
)


def angle_in(run: int) -> str:
    """The name of an angle's parameter in run number `run`."""
    return f"phi_{run + 1}"


@dataclass(frozen=True)
class Motion:
    """The true motion of one run: positions (m) of each axis at `time_s`, and the heat."""

    time_s: Floats
    position_m: Mapping[int, Floats]
    staging: Staging


class Motor:
    """Predicts every reading of an experiment's runs, in their order.

    `resolved` tells whether the drive's angle moves in whole microsteps; a fine sensor
    sees the difference.
    """

    def __init__(
        self,
        experiment: Experiment,
        max_step_s: float = COARSE_STEP_S,
        resolved: bool = False,
    ) -> None:
        self.experiment = experiment
        self._max_step_s = max_step_s
        self._resolved = resolved
        self._own = active_effects(experiment.machine, catalogue())
        self._motions: OrderedDict[object, Motion] = OrderedDict()
        self._lock = Lock()

    def __call__(self, settings: Settings) -> list[Floats]:
        return [
            self._reading(index, trial, reading, settings)
            for index, trial in enumerate(self.experiment.trials)
            for reading in trial.readings
        ]

    def schedule(self, index: int) -> Schedule:
        """What run number `index` commands without further effects."""
        return self._motion(index, _of_the_motion(self._own)).staging.schedule

    def way_m(self) -> tuple[float, float]:
        """The least and the greatest position that any sensor was to see."""
        places = [
            self._motion(index, _of_the_motion(self._own)).position_m[reading.sensor.axis]
            for index, trial in enumerate(self.experiment.trials)
            for reading in trial.readings
            if reading.sensor.quantity != TEMPERATURE
        ]
        return min(float(x.min()) for x in places), max(float(x.max()) for x in places)

    def active(self, index: int, settings: Settings) -> tuple[Active, ...]:
        """The machine's effects and those in `settings`, as they are in run `index`."""
        chosen = {a.name: a for a in self._own}
        for name, values in settings.items():
            if values.get(RUN, -1) in (-1, index):
                chosen[name] = _active(catalogue()[name], values, index)
        order = list(catalogue())
        return tuple(sorted(chosen.values(), key=lambda a: order.index(a.name)))

    # -- one reading -----------------------------------------------------------

    def _reading(self, index: int, trial: Trial, reading: Reading, settings: Settings) -> Floats:
        active = self.active(index, settings)
        motion = self._motion(index, _of_the_motion(active))
        if reading.sensor.quantity == TEMPERATURE:
            return self._temperature(index, reading, active)
        return _position(motion, reading, active, self.experiment.machine.heat.ambient_C)

    def _temperature(self, index: int, reading: Reading, active: tuple[Active, ...]) -> Floats:
        """Sensed on a grid of its own, as a thermocouple is slow against the motion."""
        heat = self._staging(index, active).heat
        end_s = float(reading.time_s[-1])
        grid = np.linspace(0.0, end_s, max(2, math.ceil(end_s) + 1))
        seen = _followed(float(grid[1]), heat.temperature_C(grid), reading.sensor, active)
        return interpolated(grid, seen, reading.time_s)

    # -- one motion --------------------------------------------------------------

    def _motion(self, index: int, active: tuple[Active, ...]) -> Motion:
        """Kept for the latest settings; two threads may both work out the same one."""
        key = index, tuple((a.name, a.values, a.axes) for a in active)
        with self._lock:
            if key in self._motions:
                self._motions.move_to_end(key)
                return self._motions[key]
        motion = self._moved(index, active)
        with self._lock:
            self._motions[key] = motion
            while len(self._motions) > _KEPT:
                self._motions.popitem(last=False)
        return motion

    def _moved(self, index: int, active: tuple[Active, ...]) -> Motion:
        trial = self.experiment.trials[index]
        staging = self._staging(index, _padded(active))
        sensors = [reading.sensor for reading in trial.readings]
        axes = _axes(sensors, active)
        end_s = trial.duration_s if axes else 0.0
        times = np.arange(math.ceil(end_s * DENSE_HZ) + 2) / DENSE_HZ
        positions = {
            axis.number: axis.advance(times, float(times[-1])).position_m
            for axis in staging.axes
            if axis.number in axes
        }
        return Motion(times, positions, staging)

    def _staging(self, index: int, active: tuple[Active, ...]) -> Staging:
        trial, machine = self.experiment.trials[index], self.experiment.machine
        how = EmulatorSettings(machine, trial.payload_kg, self._resolved, self._max_step_s, True)
        schedule = self._planned(trial, active)
        lasting = max(schedule.duration_s, trial.duration_s)
        return staged(replace(schedule, duration_s=lasting), how, active)

    def _planned(self, trial: Trial, active: tuple[Active, ...]) -> Schedule:
        machine = self.experiment.machine
        if trial.program is None:
            assert trial.command is not None, "a run has a program or a logged command"
            schedule = schedule_of(trial.command, machine)
            for a in active:
                schedule = a.effect.schedule(schedule, *a.values)
            return schedule
        for_s = trial.duration_s if trial.program.loops_forever or trial.partial else None
        return planned(trial.program, machine, active, for_s)


def _active(effect: Effect, values: Mapping[str, float], index: int) -> Active:
    """`effect` with `values`, unstated ones at their defaults."""
    own = dict(values)
    if (angle := angle_in(index)) in own:
        own["phi"] = own[angle]
    numbers = tuple(float(own.get(p.name, p.default)) for p in effect.parameters)
    axis = int(values.get(AXIS, 0))
    return Active(effect, numbers, (axis,) if axis else AXES)


def _of_the_motion(active: Iterable[Active]) -> tuple[Active, ...]:
    """Those of `active` that the true motion depends on; heat only if a force does on it."""
    kept = [a for a in active if a.effect.stage in (Stage.COMMAND, Stage.DYNAMICS)]
    warm = [a for a in active if a.effect.stage is Stage.HEAT]
    forces = [a for a in kept if a.effect.force_factor(np.zeros(1), *a.values) is not None]
    growing = [a for a in active if a.name == "platen_expansion"]
    return tuple(kept + warm if forces or growing else kept)


def _padded(active: tuple[Active, ...]) -> tuple[Active, ...]:
    """`active` with the rest of each group that it has a part of, at their neutral values."""
    names = {a.name for a in active}
    padding = [
        Active(effect, tuple(p.null for p in effect.parameters), AXES)
        for group in _TOGETHER
        if names.intersection(group)
        for effect in (catalogue()[name] for name in group if name not in names)
    ]
    order = list(catalogue())
    return tuple(sorted((*active, *padding), key=lambda a: order.index(a.name)))


def _axes(sensors: Sequence[Sensor], active: Sequence[Active]) -> set[int]:
    """The axes whose motion is wanted: those seen, or both if one may show in the other."""
    seen = {s.axis for s in sensors if s.quantity != TEMPERATURE}
    return set(AXES) if seen else set()


def _position(motion: Motion, reading: Reading, active: tuple[Active, ...], air_C: float) -> Floats:
    """What the sensor shows at its stamps, in its unit."""
    sensor = reading.sensor
    chain = on_axis(active, sensor.axis)
    measuring = [a for a in chain if a.effect.stage is Stage.MEASUREMENT]
    x = motion.position_m[sensor.axis]
    if measuring:
        (other,) = set(AXES) - {sensor.axis}
        scene = Scene(
            time_s=motion.time_s,
            own_velocity_m_s=np.zeros(len(x)),
            other_m=motion.position_m[other],
            temperature_C=motion.staging.heat.temperature_C(motion.time_s),
            air_C=air_C,
        )
        for a in measuring:
            x = a.effect.geometry(x, scene, *a.values)
        for a in measuring:
            x = a.effect.reading(x, scene, *a.values)
        x = _followed(1 / DENSE_HZ, x, sensor, measuring)
    taken = reading.time_s
    for a in measuring:
        taken = a.effect.sampled_at(taken, *a.values)
    seen = interpolated(motion.time_s, x, taken)
    for a in measuring:
        seen = a.effect.electronics(seen, taken, *a.values)
    return seen / sensor.unit_si


def _followed(interval_s: float, x: Floats, sensor: Sensor, active: Sequence[Active]) -> Floats:
    """Evenly sampled `x` as slowly as the sensor follows it."""
    for a in active:
        lag_s = a.effect.bandwidth_s(sensor.quantity, *a.values)
        x = first_order(interval_s, x, lag_s) if lag_s > 0 else x
    return x
