"""What one run needs, made from program, machine and effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mopro.emulator.axis import EmulatedAxis
from mopro.emulator.command import CommandTable, Floats
from mopro.emulator.effects import Active, Stage, on_axis
from mopro.emulator.engine import Engine, Stepping, Strength, is_nominal
from mopro.emulator.heat import HeatHistory, HeatPieces
from mopro.emulator.plant import PlantNumbers
from mopro.emulator.stepped_heat import SteppedHeat
from mopro.emulator.trips import (
    PlatenEdge,
    Ranges,
    Trip,
    braked,
    frozen,
    heat_trip,
    limit_trip,
    switches_u,
)
from mopro.machine import Machine
from mopro.motion import Schedule, plan
from mopro.plant.kernel.terms import TermSet
from mopro.program import AXES, Program

# From this many integration steps on, importing a compiler pays; with effects the kernel is
# slower as plain Python, and takes longer to compile.
COMPILE_FROM_STEPS = 400_000
COMPILE_WITH_EFFECTS_FROM_STEPS = 250_000
_RINGING_S = 0.7
_TRIP_STEP_S = 1.0
_STRENGTH_STEP_S = 5.0
_FEW_CHANGES = 20

Heat = HeatHistory | SteppedHeat


@dataclass(frozen=True)
class Settings:
    """The emulator's own numbers; see Emulator."""

    machine: Machine
    payload_kg: float
    resolved: bool
    stepping: Stepping
    compiled: bool | None = None


@dataclass(frozen=True)
class Staging:
    """A run ready to go."""

    schedule: Schedule
    heat: Heat
    axes: list[EmulatedAxis]
    trip: Trip | None


def stage(
    program: Program, settings: Settings, active: tuple[Active, ...], for_s: float | None
) -> Staging:
    """Effects of the command, then heat, then dynamics, each seeing what came before."""
    machine = settings.machine
    schedule = planned(program, machine, active, for_s)
    switches = switches_u(schedule, machine.travel_u())
    trip = limit_trip(schedule, switches)
    if trip:
        schedule = braked(schedule, trip)
    strengths = {axis: _hold(schedule, axis, on_axis(active, axis)) for axis in AXES}
    heat = _heat(machine, schedule, active, strengths)
    too_hot = _too_hot(machine, schedule, heat)
    if too_hot:
        trip, schedule = too_hot, frozen(schedule, too_hot)
        strengths = {n: _switched_off(s, too_hot.time_s) for n, s in strengths.items()}
        heat = _heat(machine, schedule, active, strengths)
    if trip and trip.kind == "limit-switch":
        active = (*active, *_edges(machine, switches))
    axes = [_axis(n, settings, schedule, heat, on_axis(active, n), strengths[n]) for n in AXES]
    return Staging(schedule, heat, axes, trip)


def staged(schedule: Schedule, settings: Settings, active: tuple[Active, ...]) -> Staging:
    """The dynamics under `schedule` as it stands: whoever asks has the trips in hand."""
    strengths = {axis: _hold(schedule, axis, on_axis(active, axis)) for axis in AXES}
    heat = heat_of(schedule, settings.machine, active)
    axes = [_axis(n, settings, schedule, heat, on_axis(active, n), strengths[n]) for n in AXES]
    return Staging(schedule, heat, axes, None)


def heat_of(
    schedule: Schedule,
    machine: Machine,
    active: tuple[Active, ...],
    pieces: HeatPieces | None = None,
) -> Heat:
    """The forcer's temperature under `schedule`, which needs no equation of motion."""
    strengths = {axis: _hold(schedule, axis, on_axis(active, axis)) for axis in AXES}
    return _heat(machine, schedule, active, strengths, pieces)


def planned(
    program: Program, machine: Machine, active: Sequence[Active], for_s: float | None
) -> Schedule:
    """The schedule of `program` with the effects that change what is commanded."""
    for a in active:
        program = a.effect.program(program, *a.values)
    schedule = plan(program, for_s, machine.travel_u())
    for a in active:
        schedule = a.effect.schedule(schedule, *a.values)
    return schedule


def _hold(schedule: Schedule, axis: int, active: Sequence[Active]) -> Strength:
    """The share of current over time of an axis whose drive saves it at rest."""
    holds = [h for a in active if (h := a.effect.hold(*a.values))]
    if not holds:
        return Strength.full()
    after_s, share = holds[0]
    changes = [(0.0, 1.0)]
    rest_s = 0.0
    for move in [*[m for m in schedule.moves if axis in m.axes], None]:
        start_s = schedule.duration_s if move is None else move.start_s
        if start_s > rest_s + after_s:
            changes += [(rest_s + after_s, share), (start_s, 1.0 if move else share)]
        rest_s = start_s if move is None else move.end_s
    times, gain = map(np.array, zip(*changes, strict=True))
    return Strength(times, gain, np.ones(len(times)))


def _switched_off(strength: Strength, time_s: float) -> Strength:
    kept = strength.times_s < time_s
    times = np.append(strength.times_s[kept], time_s)
    return Strength(times, np.append(strength.gain[kept], 0.0), np.ones(len(times)))


def _heat(
    machine: Machine,
    schedule: Schedule,
    active: Sequence[Active],
    strengths: Mapping[int, Strength],
    pieces: HeatPieces | None = None,
) -> Heat:
    effects = [a for a in active if a.effect.stage is Stage.HEAT]
    if not effects and all(s.always_full for s in strengths.values()):
        return HeatHistory(machine, schedule.moves, pieces)
    lasting_s = schedule.duration_s
    return SteppedHeat(machine, schedule.moves, effects, strengths, lasting_s, pieces)


def _too_hot(machine: Machine, schedule: Schedule, heat: Heat) -> Trip | None:
    times = np.arange(0.0, schedule.duration_s, _TRIP_STEP_S)
    return heat_trip(schedule, heat.temperature_C(times), times, machine.heat.rated_C)


def _edges(machine: Machine, switches: Ranges) -> list[Active]:
    """The platen's edges, beyond each axis' switches."""
    scale, beyond = machine.microstep_m, machine.limits.overtravel_m
    return [
        Active(PLATEN_EDGE, (low * scale - beyond, high * scale + beyond), (axis,))
        for axis, (low, high) in switches.items()
    ]


# One object for all runs, as kernels are kept by the effects that they hold.
PLATEN_EDGE = PlatenEdge()


def _axis(
    number: int,
    settings: Settings,
    schedule: Schedule,
    heat: Heat,
    active: tuple[Active, ...],
    strength: Strength,
) -> EmulatedAxis:
    plant = PlantNumbers.of(settings.machine, settings.payload_kg)
    for a in active:
        plant = a.effect.plant(plant, *a.values)
    command = _command(schedule, number, active)
    strength = _weakened(strength, heat, schedule.duration_s, active)
    moves = [m for m in schedule.moves if number in m.axes]
    terms = TermSet.of(active)
    return EmulatedAxis(
        number,
        plant,
        command,
        _engine(settings, schedule, plant, command, active, terms, strength),
        schedule.moves,
        settings.resolved,
        strength.times_s.tolist(),
        [jump for a in active for jump in a.effect.jumps(moves, *a.values)],
        terms.voltage is not None,
    )


def _command(schedule: Schedule, number: int, active: Sequence[Active]) -> CommandTable:
    table = CommandTable(schedule.tracks[number])
    for a in active:
        interval_s, interpolate = a.effect.tick_s(*a.values)
        if interval_s > 0:
            table = table.ticked(interval_s, interpolate, schedule.duration_s)
    return table


def _weakened(
    strength: Strength, heat: Heat, duration_s: float, active: Sequence[Active]
) -> Strength:
    """The strength with the force constant following the temperature, every few seconds."""
    with_heat = [a for a in active if a.effect.force_factor(np.zeros(1), *a.values) is not None]
    if not with_heat:
        return strength
    times = np.union1d(strength.times_s, np.arange(0.0, duration_s, _STRENGTH_STEP_S))
    constant: Floats = np.ones(len(times))
    for a in with_heat:
        factor = a.effect.force_factor(heat.temperature_C(times), *a.values)
        constant = constant if factor is None else constant * factor
    return Strength(times, strength.at(times)[0], constant)


def _engine(
    settings: Settings,
    schedule: Schedule,
    plant: PlantNumbers,
    command: CommandTable,
    active: Sequence[Active],
    terms: TermSet,
    strength: Strength,
) -> Engine:
    """Plain for short work, compiled for long: the same kernel, the same bits."""
    nominal = is_nominal(terms, strength)
    compiled = settings.compiled
    if compiled is None:
        # Under a strength that changes an axis is never quite at rest.
        restless = not nominal and len(strength.times_s) > _FEW_CHANGES
        steps = schedule.duration_s / settings.stepping.max_s
        compiled = (restless and steps >= COMPILE_WITH_EFFECTS_FROM_STEPS) or compiling_pays(
            schedule, settings.stepping.max_s, not nominal
        )
    return Engine(plant, command, settings.resolved, settings.stepping, active, strength, compiled)


def compiling_pays(schedule: Schedule, max_step_s: float, with_effects: bool = False) -> bool:
    """Whether importing a compiler, and running it for a set of effects, saves time."""
    active_s = sum(
        (move.profile.duration_s + _RINGING_S) * len(move.strokes) for move in schedule.moves
    )
    steps = min(active_s, schedule.duration_s * len(AXES)) / max_step_s
    return steps >= (COMPILE_WITH_EFFECTS_FROM_STEPS if with_effects else COMPILE_FROM_STEPS)
