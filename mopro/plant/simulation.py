"""Entry to the plant: simulates a schedule on a machine.

    schedule → trips → scaling of the drive → temperature → equation of motion → columns

each made from what stands before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mopro.effects import Active, Domain, catalogue_of, on_axis
from mopro.effects.resolve import active_effects
from mopro.engine.series import unless_run_away
from mopro.errors import Diagnostic, ModelError, RunError
from mopro.machine import Machine
from mopro.machine.constants import PlantConstants
from mopro.motion import PlannedMove, Schedule, Stopping
from mopro.plant.axis import EmulatedAxis, NotFinite, Samples
from mopro.plant.command_table import CommandTable, Floats
from mopro.plant.drive_scaling import DriveScaling, hold_scaling, with_heat
from mopro.plant.heat import HeatHistory, HeatIntervals
from mopro.plant.integration import Integration, Stepping, is_nominal
from mopro.plant.kernel.effect_terms import TermSet
from mopro.plant.platen import yaw_rad
from mopro.plant.repetition import Course, Repetition, repetition
from mopro.plant.stepped_heat import SteppedHeat, coil_energy_J
from mopro.plant.trips import Ranges, Trip, heat_trip, limit_trip, line_at, platen_edges, switches_u
from mopro.program import AXES
from mopro.recording import MoveOutcome, Stall
from mopro.recording.record import Columns
from mopro.source import Source, Span


def columns_of(
    times: Floats,
    samples: Mapping[int, Samples],
    temperature_C: Floats,
    schedule: Schedule,
    machine: Machine,
) -> Columns:
    """All columns at `times` from the `samples` of each axis, in their order."""
    columns: Columns = {"time_s": times}
    for n, of_axis in samples.items():
        columns |= _axis_columns(n, of_axis)
    columns["temperature_C"] = temperature_C
    columns["line"] = _lines(schedule, times)
    for n, of_axis in samples.items():
        if of_axis.voltage_a_V is not None and of_axis.voltage_b_V is not None:
            columns[f"voltage_a_{n}_V"] = of_axis.voltage_a_V
            columns[f"voltage_b_{n}_V"] = of_axis.voltage_b_V
    if machine.forcers is not None:
        lags = {n: s.command_m - s.position_m for n, s in samples.items()}
        columns["yaw_rad"] = yaw_rad(machine.forcers, machine.axis.wave_number_1_m, lags)
    return columns


def _axis_columns(n: int, samples: Samples) -> Columns:
    return {
        f"command_{n}_m": samples.command_m,
        f"position_{n}_m": samples.position_m,
        f"velocity_{n}_m_s": samples.velocity_m_s,
        f"phase_a_{n}_A": samples.phase_a_A,
        f"phase_b_{n}_A": samples.phase_b_A,
        f"force_{n}_N": samples.force_N,
    }


def _lines(schedule: Schedule, times: Floats) -> NDArray[np.int32]:
    """The running source line at each time; before anything takes time, the first one."""
    if not schedule.activity:
        return np.full(len(times), schedule.program.ops[0].span.line, dtype=np.int32)
    starts, lines = zip(*schedule.activity, strict=True)
    at = np.searchsorted(np.array(starts), times, side="right") - 1
    return np.array(lines, dtype=np.int32)[np.maximum(at, 0)]


# RK4 at this step is within 0.03 nm of the exact response to LVDT3.
MAX_STEP_S = 50e-6
STEPPING = Stepping(MAX_STEP_S)
# Integration steps above which compiling takes less time than it saves; with effects the
# kernel is slower in plain Python, and takes longer to compile.
COMPILE_FROM_STEPS = 400_000
COMPILE_WITH_EFFECTS_FROM_STEPS = 250_000
# A motion repeats itself if its state comes back so closely (m): four times what the rounding of
# times does to it, which decides on which side of a microstep's edge a sample falls.
REPEATED_M = 1e-8
_RINGING_S = 0.7
_TRIP_STEP_S = 1.0
_SHOWN_AFTER_S = 0.5
_FEW_CHANGES = 20
# Samples that `follow` has in memory at once.
_CHUNK = 65536

Heat = HeatHistory | SteppedHeat
Scalings = Mapping[int, DriveScaling]
# The command of an axis by its number.
CommandOf = Callable[[int], CommandTable]


def simulate(
    schedule: Schedule,
    machine: Machine,
    active: Sequence[Active] | None = None,
    stepping: Stepping = STEPPING,
    *,
    payload_kg: float = 0.0,
    resolved: bool = True,
    compiled: bool | None = None,
    trips: bool = False,
    heat_intervals: HeatIntervals | None = None,
    command_of: CommandOf | None = None,
) -> Simulation:
    """`machine` at rest at the start of `schedule`, to be taken through time.

    `active` are the effects switched on, those of the machine's file unless given;
    `payload_kg` rides on the forcer; `resolved` false lets the drive follow the command
    smoothly instead of in microsteps; `compiled` forces the kernel to be compiled or not.
    With `trips`, limit switches and overheating end the run; without, they are the
    caller's to act upon. `heat_intervals` are those of the schedule's moves, and
    `command_of(axis)` its `CommandTable.of`, from a caller who simulates the same moves
    many times. Raises ModelError for unusable effects.
    """
    if active is None:
        active = active_effects(machine, catalogue_of(machine))
    settings = PlantSettings(machine, payload_kg, resolved, stepping, compiled)
    if trips:
        return Simulation(settings, _prepare_tripped_run(schedule, machine, tuple(active)))
    run = prepare_run(schedule, machine, tuple(active), heat_intervals)
    return Simulation(settings, replace(run, command_of=command_of))


@dataclass(frozen=True)
class PlantSettings:
    """Arguments of `simulate` that are the same for every schedule."""

    machine: Machine
    payload_kg: float
    resolved: bool
    stepping: Stepping
    compiled: bool | None = None


@dataclass(frozen=True)
class PreparedRun:
    """Inputs of a run, known before its equation of motion is integrated.

    `command_of`: the command of each axis, if it is known.
    """

    schedule: Schedule
    active: tuple[Active, ...]
    scalings: Scalings
    heat: Heat
    trip: Trip | None = None
    command_of: CommandOf | None = None


class Simulation:
    """One run on one machine, as far as it has got; `schedule` is what it follows.

    Only what is commanded up to the time reached has been integrated, so that a caller may
    still change what comes after it: a stop, or a longer schedule. `trip` is what ends the
    run before its program does.
    """

    def __init__(self, settings: PlantSettings, run: PreparedRun) -> None:
        self._settings = settings
        self._run = run
        self._made: dict[int, EmulatedAxis] = {}

    @property
    def schedule(self) -> Schedule:
        return self._run.schedule

    @property
    def trip(self) -> Trip | None:
        return self._run.trip

    @property
    def _axes(self) -> dict[int, EmulatedAxis]:
        return {axis: self._axis(axis) for axis in AXES}

    def _axis(self, number: int) -> EmulatedAxis:
        """Made when it first moves: a temperature needs no equation of motion."""
        if number not in self._made:
            self._made[number] = _axis(number, self._settings, self._run)
        return self._made[number]

    def advance(self, times: Floats, end_s: float) -> Columns:
        """The columns of a recording at `times`; the machine goes on to `end_s`.

        Times ascend and lie between the time reached before and `end_s`. Raises RunError if
        a value is not finite.
        """
        with self._finite():
            samples = {n: axis.advance(times, end_s) for n, axis in self._axes.items()}
        temperature_C = self.temperature_C(times)
        columns = columns_of(times, samples, temperature_C, self.schedule, self._settings.machine)
        for name, values in columns.items():
            if not np.isfinite(values).all():
                time_s = float(times[np.argmin(np.isfinite(values))])
                raise self._not_finite(f"{name} is not finite", time_s)
        return columns

    def follow(self, rate_hz: float, end_s: float | None = None) -> None:
        """Advance to `end_s` (default: the schedule's end), sampled at `rate_hz`.

        For those who ask how the moves went and for no column.
        """
        end_s = self.schedule.duration_s if end_s is None else end_s
        samples = int(end_s * rate_hz + 1e-6) + 1
        with self._finite():
            for first in range(0, samples, _CHUNK):
                last = min(first + _CHUNK, samples)
                times = np.arange(first, last) / rate_hz
                until_s = max(end_s if last == samples else 0.0, float(times[-1]))
                for axis in self._axes.values():
                    axis.follow(times, until_s)

    def positions_m(self, axis: int, times: Floats, end_s: float) -> Floats:
        """As `advance`, but the positions of one axis only, without outcomes of its moves.

        NaN where they are not finite.
        """
        return unless_run_away(self._axis(axis).positions_m(times, end_s))

    def temperature_C(self, times: Floats) -> Floats:
        """The forcer's temperature at `times`, which need not have been reached.

        NaN where it has run away.
        """
        return self._run.heat.temperature_C(times)

    def position_m(self, axis: int) -> float:
        """The position of `axis` at the time reached."""
        return self._axis(axis).position_m

    def change(self, schedule: Schedule) -> None:
        """Go on under `schedule`, which is the same up to the time reached."""
        before, self._made = self._made, {}
        self._run = prepare_run(schedule, self._settings.machine, self._run.active)
        for axis, old in before.items():
            self._axis(axis).take_over(old)

    def slip(self, axis: int, pitches: int) -> None:
        """Displace `axis` back by whole pitches at once."""
        self._axis(axis).slip(pitches)

    def settle(self) -> None:
        """Let all axes come to rest at the end of the command; all outcomes are final then.

        Raises RunError, as `advance` does.
        """
        with self._finite():
            for axis in self._axes.values():
                axis.settle()

    @contextmanager
    def _finite(self) -> Iterator[None]:
        """RunError for a motion that is not finite; numpy does not warn of it as well."""
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                yield
        except NotFinite as error:
            raise self._not_finite(str(error), error.time_s) from error

    def _not_finite(self, what: str, time_s: float) -> RunError:
        """The error that names the time, the line that was running, and the likely cause."""
        program = self.schedule.program
        line = line_at(self.schedule, time_s)
        span = next((op.span for op in program.ops if op.span.line == line), Span(line, 1, 2))
        names = ", ".join(a.name for a in self._run.active)
        cause = f"the values of {names}" if names else "its mass, force, pitch and damping"
        hint = f"check the machine {self._settings.machine.name}: {cause}"
        message = f"{what} from {time_s:.6g} s on: the machine is unstable"
        return RunError(program.source, [Diagnostic("not-finite", message, span, hint=hint)])

    def settled(self) -> bool:
        """True unless an axis whose command is at rest may still leave its tooth."""
        return all(axis.settled() for axis in self._axes.values())

    def outcome(self, move: PlannedMove) -> MoveOutcome:
        """Outcome of `move`; final once its axes have begun another, or after `settle`."""
        return MoveOutcome.worst([self._axis(n).outcomes.of(move) for n in move.axes])

    def settling_s(self, move: PlannedMove) -> float | None:
        """Time (s) after `move` from which its axes stay within SETTLED_M of their command.

        None for a move after which they do not, before the next one or the time reached.
        """
        times = [self._axis(n).outcomes.settling_s(move) for n in move.axes]
        return None if any(map(math.isnan, times)) else max(times)

    def repetition(self, rate_hz: float) -> Repetition | None:
        """The stretches of samples at `rate_hz` that a program's loop repeats, if it does.

        Whether the motion does, `repeats` tells.
        """
        schedule = self.schedule
        if not schedule.program.loops_forever or not schedule.activity:
            return None
        times_s, lines = map(np.array, zip(*schedule.activity, strict=True))
        driving = [course for axis in self._axes.values() for course in axis.courses]
        courses = [Course(times_s, lines[:, None]), *driving]
        found = repetition(schedule.moves, courses, rate_hz)
        if found is not None and self._settings.compiled is None:
            # A few stretches are all that is simulated, if the motion repeats itself.
            for axis in self._axes.values():
                axis.compile_after(COMPILE_WITH_EFFECTS_FROM_STEPS)
        return found

    def state(self) -> Floats:
        """The state of all axes at the time reached; see `repeats`."""
        return np.concatenate([axis.state() for axis in self._axes.values()])

    def repeats(self, before: Floats, period_s: float) -> bool:
        """True if the state is the one `before`, a period ago, and stays so period by period.

        What still decays would add up as long as it does.
        """
        slowest_s = max(axis.decay_s for axis in self._axes.values())
        near = REPEATED_M * min(1.0, period_s / slowest_s)
        return bool((np.abs(self.state() - before) < near).all())

    def skip(self, period_s: float, count: int, to_s: float) -> None:
        """Go on to `to_s`, `count` periods on, in which all axes do as in the one before now.

        For a caller who knows so from `repetition` and `repeats`.
        """
        for axis in self._axes.values():
            axis.skip(period_s, count, to_s)

    def coil_energy_J(self, end_s: float) -> float:
        """The energy (J) that the coils turn into heat from the start until `end_s` (eq. 3.12)."""
        run = self._run
        return coil_energy_J(self._settings.machine, run.heat.intervals, run.scalings, end_s)

    def stalls(self, move: PlannedMove) -> list[Stall]:
        """A stall for each axis of `move` that slipped; final when its outcome is."""
        return [
            Stall(self._stalled_s(n, move), move.span.line, n, outcome.lost_pitches)
            for n in move.axes
            if (outcome := self._axis(n).outcomes.of(move)).slipped
        ]

    def _stalled_s(self, axis: int, move: PlannedMove) -> float:
        """The time (s) at which `axis` slipped; the end of the move if between no two samples."""
        slip_s = self._axis(axis).outcomes.slip_s(move)
        return slip_s if math.isfinite(slip_s) else move.end_s


def prepare_run(
    schedule: Schedule,
    machine: Machine,
    active: tuple[Active, ...],
    intervals: HeatIntervals | None = None,
) -> PreparedRun:
    """The run of `schedule` as it stands: does not check limit switches or overheating."""
    scalings = {axis: hold_scaling(schedule, axis, on_axis(active, axis)) for axis in AXES}
    heat = _heat(machine, schedule, active, scalings, intervals)
    return PreparedRun(schedule, active, scalings, heat)


def _prepare_tripped_run(
    schedule: Schedule, machine: Machine, active: tuple[Active, ...]
) -> PreparedRun:
    """The run of `schedule`, ended by limit switches or overheating."""
    switches = switches_u(schedule, machine.travel_u())
    trip = limit_trip(schedule, switches)
    if trip:
        schedule = _braked(schedule, trip)
    run = replace(prepare_run(schedule, machine, active), trip=trip)
    too_hot = _too_hot(machine, schedule, run.heat)
    if too_hot:
        run = _switched_off(run, too_hot, machine)
    return _with_edges(run, machine, switches)


def _braked(schedule: Schedule, trip: Trip) -> Schedule:
    stopped = schedule.stopped(trip.time_s, Stopping.BRAKE)
    return replace(stopped, duration_s=stopped.duration_s + _SHOWN_AFTER_S)


def _too_hot(machine: Machine, schedule: Schedule, heat: Heat) -> Trip | None:
    times = np.arange(0.0, schedule.duration_s, _TRIP_STEP_S)
    return heat_trip(schedule, heat.temperature_C(times), times, machine.heat.rated_C)


def _switched_off(run: PreparedRun, trip: Trip, machine: Machine) -> PreparedRun:
    """The run ended where the drive switches off; the command stays where it was."""
    shown_s = min(run.schedule.duration_s, trip.time_s + _SHOWN_AFTER_S)
    stopped = run.schedule.stopped(trip.time_s, Stopping.CUT)
    schedule = replace(stopped, duration_s=shown_s)
    scalings = {n: s.switched_off(trip.time_s) for n, s in run.scalings.items()}
    heat = _heat(machine, schedule, run.active, scalings)
    return PreparedRun(schedule, run.active, scalings, heat, trip)


def _with_edges(run: PreparedRun, machine: Machine, switches: Ranges) -> PreparedRun:
    """The run with the platen's edges, if it reaches them."""
    if run.trip is None or run.trip.kind != "limit-switch":
        return run
    return replace(run, active=(*run.active, *platen_edges(machine, switches)))


def _heat(
    machine: Machine,
    schedule: Schedule,
    active: Sequence[Active],
    scalings: Scalings,
    intervals: HeatIntervals | None = None,
) -> Heat:
    """The forcer's temperature, which needs no equation of motion."""
    effects = [a for a in active if a.effect.domain is Domain.HEAT]
    if not effects and all(s.always_full for s in scalings.values()):
        return HeatHistory(machine, schedule.moves, intervals)
    lasting_s = schedule.duration_s
    return SteppedHeat(machine, schedule.moves, effects, scalings, lasting_s, intervals)


def _axis(
    number: int,
    settings: PlantSettings,
    run: PreparedRun,
) -> EmulatedAxis:
    schedule, active = run.schedule, on_axis(run.active, number)
    plant = PlantConstants.of(settings.machine, settings.payload_kg)
    for a in active:
        plant = a.effect.plant(plant, *a.values)
    if plant.mass_kg <= 0:
        message = f"axis {number} has a mass of {plant.mass_kg:g} kg with payload and effects"
        raise _unusable(settings.machine, message, active)
    if run.command_of is None:
        command = CommandTable.of(schedule, number, active, settings.machine.microstep_m)
    else:
        command = run.command_of(number)
    scaling = with_heat(run.scalings[number], run.heat.temperature_C, schedule.duration_s, active)
    moves = [m for m in schedule.moves if number in m.axes]
    terms = TermSet.of(active)
    return EmulatedAxis(
        number,
        plant,
        command,
        _integration(settings, schedule, plant, command, active, terms, scaling),
        schedule.moves,
        settings.resolved,
        scaling.times_s.tolist(),
        [jump for a in active for jump in a.effect.jumps(moves, *a.values)],
        terms.voltage is not None,
    )


def _unusable(machine: Machine, message: str, active: Sequence[Active]) -> ModelError:
    """The error of a machine that no run can be begun on, at one of its `active` effects."""
    named = {e.name: e.span for e in machine.effects}
    span = next((named[a.name] for a in active if a.name in named), Span(1, 1, 2))
    source = machine.source or Source(machine.name, "")
    return ModelError(source, [Diagnostic("unstable", message, span)])


def _integration(
    settings: PlantSettings,
    schedule: Schedule,
    plant: PlantConstants,
    command: CommandTable,
    active: Sequence[Active],
    terms: TermSet,
    scaling: DriveScaling,
) -> Integration:
    """Plain for short work, compiled for long: the same kernel, the same bits."""
    nominal = is_nominal(terms, scaling)
    compiled = settings.compiled
    if compiled is None:
        # Under a scaling that changes an axis is never quite at rest.
        restless = not nominal and len(scaling.times_s) > _FEW_CHANGES
        steps = schedule.duration_s / settings.stepping.max_s
        compiled = (restless and steps >= COMPILE_WITH_EFFECTS_FROM_STEPS) or compiling_pays(
            schedule, settings.stepping.max_s, not nominal
        )
    after = 0 if compiled else math.inf
    return Integration(plant, command, settings.resolved, settings.stepping, active, scaling, after)


def compiling_pays(schedule: Schedule, max_step_s: float, with_effects: bool = False) -> bool:
    """True if compiling the kernel for a set of effects takes less time than it saves."""
    active_s = sum(
        (move.profile.duration_s + _RINGING_S) * len(move.strokes) for move in schedule.moves
    )
    steps = min(active_s, schedule.duration_s * len(AXES)) / max_step_s
    return steps >= (COMPILE_WITH_EFFECTS_FROM_STEPS if with_effects else COMPILE_FROM_STEPS)
