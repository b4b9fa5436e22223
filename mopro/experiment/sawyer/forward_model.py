"""Forward model for the diagnosis: predicts every reading from settings of effects.

Command and motion (domains C and D) and temperature (domain T) are simulated and cached;
measurement (domain M) is computed anew for each call, as it takes little time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from operator import attrgetter
from threading import Lock

import numpy as np
from cachetools import LRUCache, cachedmethod

from mopro.effects import Active, Domain, Effect, catalogue_of, on_axis
from mopro.effects.effect import AXIS, angle_in
from mopro.effects.registry import in_order
from mopro.effects.resolve import active_effects, with_values
from mopro.effects.unlisted import with_unlisted
from mopro.engine.candidate import RUN
from mopro.engine.series import Settings
from mopro.errors import ModelError, RunError
from mopro.experiment.sawyer.logged import schedule_of
from mopro.experiment.sawyer.trials import Experiment, Floats, Reading, Trial
from mopro.instruments.sensor import Sensor
from mopro.machine import Machine
from mopro.machine.run_effects import NO_DATA, known_absent
from mopro.motion import Schedule
from mopro.plant import (
    CommandTable,
    HeatIntervals,
    Simulation,
    Stepping,
    change_schedule,
    heat_intervals,
    measured_at,
    plan_with_effects,
    simulate,
)
from mopro.program import AXES
from mopro.recording.record import Columns

# RK4 with these steps is within 0.1 µm: the axis oscillates with a period of ten
# milliseconds, and the shortest ripple of the force is 0.25 mm long.
COARSE = Stepping(2.5e-4, 1e-4)
FINE = Stepping(2.5e-5)
# For changes of a prediction, which are told to 2 % (`assumed.LINEARITY_ERROR`), as a test holds
# for the catalogue. Halved, they take as long as predictions; doubled, ringing is off by more.
ROUGH = Stepping(5e-4, 1e-4)
# Ticks of the command so short, in periods of the axis, are as good as their average: it follows
# what they add by less than a hundredth. Halved, a tick of a millisecond makes a thousand steps a
# second more; doubled, one is off by more than a tenth of a micrometre.
_FAST_TICK = 0.1
# Most samples of the motion in a second; not more than steps. Cubic interpolation between them is
# within 0.03 µm at a step of acceleration.
DENSE_HZ = 4000.0
_CACHE_SIZE = 96
# Stall margins are taken at every step of the integration, so few samples are enough.
_MARGIN_RATE_HZ = 100.0
# A slow sample clock takes its last samples after the end of the data, by at most one percent.
_CLOCK_REACH = 1.01


class ForwardModel:
    """Predicts every reading of an experiment's runs, in their order; a `View` for effects.

    With `resolved` the drive's angle moves in whole microsteps, else smoothly.
    """

    def __init__(
        self,
        experiment: Experiment,
        stepping: Stepping = COARSE,
        resolved: bool = False,
    ) -> None:
        self.experiment = experiment
        self._stepping = stepping
        self._resolved = resolved
        axis = experiment.machine.axis
        period_s = math.tau * math.sqrt(axis.moving_mass_kg / axis.stiffness_N_m)
        self._averaged_s = _FAST_TICK * period_s if stepping.max_s > FINE.max_s else 0.0
        self._catalogue = with_unlisted(catalogue_of(experiment.machine))
        # Of each run, and last of one without data.
        self._own = [
            active_effects(experiment.machine, self._catalogue, data)
            for data in (*(trial.data for trial in experiment.trials), NO_DATA)
        ]
        self._absent = known_absent(experiment.machine.runs, experiment.trials)
        self._grouped = tuple(e for e in self._catalogue.values() if e.kernel_group)
        # Two threads may compute the same result; the lock guards the caches only.
        self._lock = Lock()
        self._motions: LRUCache[object, Columns] = LRUCache(_CACHE_SIZE)
        self._schedules: LRUCache[object, Schedule] = LRUCache(_CACHE_SIZE)
        self._intervals: LRUCache[object, HeatIntervals] = LRUCache(_CACHE_SIZE)
        self._temperatures: LRUCache[object, Floats] = LRUCache(_CACHE_SIZE)
        self._commands: LRUCache[object, CommandTable] = LRUCache(_CACHE_SIZE)
        self._times: LRUCache[object, Floats] = LRUCache(_CACHE_SIZE)

    def __call__(self, settings: Settings) -> list[Floats]:
        return [self._reading(run, reading, settings) for run, reading in self.readings()]

    @property
    def machine(self) -> Machine:
        return self.experiment.machine

    @property
    def runs(self) -> tuple[Trial, ...]:
        return self.experiment.trials

    def own(self, name: str) -> dict[str, float]:
        """Parameters of the effect `name` in the machine file; empty if no run has it from there.

        Of those that differ by run the first run's.
        """
        of_runs = (a for own in self._own for a in own if a.name == name)
        first = next(of_runs, None)
        if first is None:
            return {}
        return {p.name: v for p, v in zip(first.effect.parameters, first.values, strict=True)}

    def readings(self) -> list[tuple[int, Reading]]:
        """Every reading with the number of its run, in the order of the predictions."""
        trials = enumerate(self.experiment.trials)
        return [(run, reading) for run, trial in trials for reading in trial.readings]

    def positions(self) -> dict[int, tuple[int, Reading]]:
        """Readings that measure position, with their runs, by their index among all readings."""
        return {
            row: (run, reading)
            for row, (run, reading) in enumerate(self.readings())
            if reading.sensor.quantity.sees_place
        }

    def targets(self, settings: Settings) -> list[Floats]:
        """Readings in their units by sensors without distortion; errors in time remain."""
        return [
            self._reading(run, reading, settings, distorted=False)
            for run, reading in self.readings()
        ]

    def schedule(self, index: int) -> Schedule:
        """Schedule of run `index` with the machine's own effects only."""
        return self._schedule(index, self._own[index])

    def travel_m(self) -> tuple[float, float]:
        """Least and greatest position (m) at any position sensor."""
        places = [
            self._motion(run, _of_the_motion(self._own[run]))[f"position_{reading.sensor.axis}_m"]
            for run, reading in self.positions().values()
        ]
        return min(float(x.min()) for x in places), max(float(x.max()) for x in places)

    def active(self, index: int, settings: Settings) -> tuple[Active, ...]:
        """The machine's effects and those in `settings`, as they are in run `index`."""
        chosen = {a.name: a for a in self._own[index]}
        for name, values in settings.items():
            if values.get(RUN, -1) in (-1, index) and name not in self._absent[index]:
                chosen[name] = _active(self._catalogue[name], values, index)
        return in_order(chosen.values(), self._catalogue)

    def keeps_up(self, settings: Settings) -> bool:
        """True if every axis stays within a quarter pitch of its command in all its moves.

        Beyond that the restoring force falls, and the axis stalls.
        """
        runs = range(len(self.experiment.trials))
        return all(self._least_margin(run, self.active(run, settings)) > 0 for run in runs)

    def _least_margin(self, index: int, active: tuple[Active, ...]) -> float:
        simulation = self._simulation(index, self._padded(_of_the_motion(active)))
        try:
            simulation.follow(_MARGIN_RATE_HZ)
        except RunError:  # effects under which the motion diverges
            return 0.0
        outcomes = map(simulation.outcome, simulation.schedule.moves)
        return min((o.stall_margin for o in outcomes if o.stall_margin is not None), default=1.0)

    # -- one reading -----------------------------------------------------------

    def _reading(
        self, index: int, reading: Reading, settings: Settings, distorted: bool = True
    ) -> Floats:
        active, machine = self.active(index, settings), self.experiment.machine
        if not distorted:
            active = tuple(a for a in active if not a.effect.distorts)
        if reading.sensor.quantity.slow:
            columns = self._temperature(index, float(reading.time_s[-1]), active)
        else:
            columns = self._motion(index, _of_the_motion(active))
        return measured_at(columns, reading.sensor, machine, active, reading.time_s)

    def _temperature(self, index: int, end_s: float, active: tuple[Active, ...]) -> Columns:
        """Temperatures every second, as a thermocouple is slow compared with the motion."""
        machine, schedule = self.experiment.machine, self._schedule(index, active)
        intervals = self._heat_intervals(index, _commanding(active))
        simulation = simulate(schedule, machine, active, heat_intervals=intervals)
        grid = _every_second(end_s)
        return {"time_s": grid, "temperature_C": simulation.temperature_C(grid)}

    @cachedmethod(attrgetter("_intervals"), lock=attrgetter("_lock"))
    def _heat_intervals(self, index: int, commanding: tuple[Active, ...]) -> HeatIntervals:
        moves = self._schedule(index, commanding).moves
        return heat_intervals(self.experiment.machine, moves)

    # -- one motion --------------------------------------------------------------

    @cachedmethod(attrgetter("_motions"), lock=attrgetter("_lock"))
    def _motion(self, index: int, active: tuple[Active, ...]) -> Columns:
        """The true motion of run `index`: columns as a recording has them."""
        simulation = self._simulation(index, self._padded(active))
        sensors, times = self._motion_sensors(index), self._dense_times(index)
        columns: Columns = {"time_s": times}
        wanted = {s.recorded_column for s in sensors} | {f"position_{axis}_m" for axis in AXES}
        try:
            if all(sensor.quantity.sees_place for sensor in sensors):
                columns |= _places(simulation, times, {sensor.axis for sensor in sensors})
            else:
                columns |= _advanced(simulation, times, sorted(wanted))
        except ModelError:  # effects that leave no mass, say; those of the file are told
            if active == self.active(index, {}):
                raise
            columns |= dict.fromkeys(wanted, np.full(len(times), math.nan))
        columns["temperature_C"] = self._dense_temperature(index, _warming(active))
        return columns

    @cachedmethod(attrgetter("_temperatures"), lock=attrgetter("_lock"))
    def _dense_temperature(self, index: int, warming: tuple[Active, ...]) -> Floats:
        """The forcer's temperature at the samples of the motion of run `index`."""
        times = self._dense_times(index)
        columns = self._temperature(index, float(times[-1]), warming)
        return np.interp(times, columns["time_s"], columns["temperature_C"])

    @cachedmethod(attrgetter("_times"), lock=attrgetter("_lock"))
    def _dense_times(self, index: int) -> Floats:
        """The times (s) at which the motion of run `index` is sampled."""
        end_s = self.experiment.trials[index].duration_s if self._motion_sensors(index) else 0.0
        rate_hz = min(DENSE_HZ, 1 / self._stepping.max_s)
        return np.arange(math.ceil(end_s * _CLOCK_REACH * rate_hz) + 2) / rate_hz

    def _motion_sensors(self, index: int) -> list[Sensor]:
        """The sensors of run `index` that follow the motion."""
        readings = self.experiment.trials[index].readings
        return [r.sensor for r in readings if r.sensor.quantity.follows_motion]

    def _simulation(self, index: int, active: tuple[Active, ...]) -> Simulation:
        trial, commanding = self.experiment.trials[index], _commanding(active)
        return simulate(
            self._schedule(index, active), self.experiment.machine, active, self._stepping,
            payload_kg=trial.payload_kg, resolved=self._resolved, compiled=True,
            heat_intervals=self._heat_intervals(index, commanding),
            command_of=lambda axis: self._command(index, axis, commanding),
        )  # fmt: skip

    @cachedmethod(attrgetter("_commands"), lock=attrgetter("_lock"))
    def _command(self, index: int, axis: int, commanding: tuple[Active, ...]) -> CommandTable:
        """The command of an axis in run `index`, whose schedule has the same effects."""
        schedule, own = self._schedule(index, commanding), on_axis(commanding, axis)
        microstep_m = self.experiment.machine.microstep_m
        return CommandTable.of(schedule, axis, own, microstep_m, self._averaged_s)

    def _padded(self, active: tuple[Active, ...]) -> tuple[Active, ...]:
        """`active` with the rest of each kernel group that it has a part of, at neutral values."""
        groups = {a.effect.kernel_group for a in active} - {None}
        names = {a.name for a in active}
        padding = [
            Active(effect, tuple(p.null for p in effect.parameters), AXES)
            for effect in self._grouped
            if effect.kernel_group in groups and effect.name not in names
        ]
        return in_order((*active, *padding), self._catalogue)

    def _schedule(self, index: int, active: tuple[Active, ...]) -> Schedule:
        """Schedule of run `index`, at least as long as its data."""
        return self._lasting_schedule(index, _commanding(active))

    @cachedmethod(attrgetter("_schedules"), lock=attrgetter("_lock"))
    def _lasting_schedule(self, index: int, commanding: tuple[Active, ...]) -> Schedule:
        trial = self.experiment.trials[index]
        schedule = self._planned(trial, commanding)
        return replace(schedule, duration_s=max(schedule.duration_s, trial.duration_s))

    def _planned(self, trial: Trial, active: tuple[Active, ...]) -> Schedule:
        """Schedule of `trial`; only effects of the command domain change it."""
        machine = self.experiment.machine
        if trial.program is None:
            assert trial.command is not None, "a run has a program or a logged command"
            return change_schedule(schedule_of(trial.command, machine), active)
        for_s = trial.duration_s if trial.program.loops_forever or trial.partial else None
        return plan_with_effects(trial.program, machine, active, for_s)


def _active(effect: Effect, values: Mapping[str, float], index: int) -> Active:
    """`effect` with `values`, unstated ones at their defaults."""
    own = dict(values)
    for p in effect.parameters:
        if p.per_run and (angle := angle_in(index, p.name)) in own:
            own[p.name] = own[angle]
    axis = int(values.get(AXIS, 0))
    return with_values(effect, own, (axis,) if axis else AXES)


def _every_second(end_s: float) -> Floats:
    """Times to `end_s` that are close enough for a temperature."""
    return np.linspace(0.0, end_s, max(2, math.ceil(end_s) + 1))


def _commanding(active: Iterable[Active]) -> tuple[Active, ...]:
    """The effects of the command domain."""
    return tuple(a for a in active if a.effect.domain is Domain.COMMAND)


def _warming(active: Iterable[Active]) -> tuple[Active, ...]:
    """The effects that change the forcer's temperature: of commands, currents held, and heat."""
    domains = Domain.COMMAND, Domain.HEAT
    return tuple(a for a in active if a.effect.domain in domains or a.effect.hold(*a.values))


def _advanced(simulation: Simulation, times: Floats, wanted: Iterable[str]) -> Columns:
    """Columns of the motion; NaN under effects under which it is not finite."""
    try:
        columns = simulation.advance(times, float(times[-1]))
    except RunError:
        return {name: np.full(len(times), math.nan) for name in wanted}
    return {name: columns[name] for name in wanted}


def _places(simulation: Simulation, times: Floats, seen: Collection[int]) -> Columns:
    """Positions (m) of all axes if any is in `seen`; faster than all columns."""
    columns: Columns = {}
    for axis, track in simulation.schedule.tracks.items() if seen else ():
        # An axis without a sensor and without a move stays where it is.
        moving = axis in seen or track.segments
        place = simulation.positions_m(axis, times, float(times[-1])) if moving else 0.0 * times
        columns[f"position_{axis}_m"] = place
    return columns


def _of_the_motion(active: Iterable[Active]) -> tuple[Active, ...]:
    """The effects that change the true motion; those of heat only if a force depends on it."""
    moving = [a for a in active if a.effect.domain in (Domain.COMMAND, Domain.DYNAMICS)]
    heat = [a for a in active if a.effect.domain is Domain.HEAT]
    return tuple(moving + heat if any(a.effect.needs_temperature for a in active) else moving)
