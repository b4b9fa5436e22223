"""The figures of one run, without its recording: a row of a sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mopro.effects.effect import Domain
from mopro.emulator import Emulator
from mopro.errors import LocatedError, ModelError, MoproError, MotionError
from mopro.motion import Schedule
from mopro.plant import Simulation
from mopro.recording import Stall
from mopro.sweeps.targets import Variant

OK, STALLED, TRIPPED, REFUSED = "ok", "stalled", "tripped", "refused"
# As long as `mopro run` records after the last move.
SETTLE_S = 0.5
_HOUR_S = 3600.0
# Moves of an hour whose heat is worked out; more take seconds a row.
MOST_MOVES = 200_000
_LONGEST_WHY = 300


@dataclass(frozen=True)
class Figures:
    """How a run went; None for what it does not have.

    `outcome`: ok, stalled, tripped (a limit switch, overheating) or refused, and `why`. `time_s`
    is the program's. Over all moves: the least `force_margin` (1 - |F|/F0), the largest lag, the
    longest settling (see plant.SETTLED_M; None if a move does not settle), the first stall and
    the pitches lost. Temperatures only of a machine with an effect on heat: at the end of the
    run, and after an hour of runs one after the other. `coil_energy_J` is the coils' heat.
    """

    outcome: str
    why: str | None = None
    time_s: float | None = None
    force_margin: float | None = None
    stall_s: float | None = None
    stall_line: int | None = None
    lost_pitches: int | None = None
    largest_lag_m: float | None = None
    settling_s: float | None = None
    end_temperature_C: float | None = None
    hour_temperature_C: float | None = None
    coil_energy_J: float | None = None


def figures_of(variant: Variant, for_s: float | None, compiled: bool | None) -> Figures:
    """The figures of a run; a run that is not to be had is a row that says why."""
    try:
        return _figures(variant, for_s, compiled)
    except MoproError as error:
        return Figures(REFUSED, _reason(error)[:_LONGEST_WHY])


def _reason(error: MoproError) -> str:
    if not isinstance(error, LocatedError):
        return str(error)
    first = error.diagnostics[0]
    place = "" if isinstance(error, ModelError) else f"line {first.span.line}: "
    return place + first.message


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _figures(variant: Variant, for_s: float | None, compiled: bool | None) -> Figures:
    program, machine, payload_kg = variant
    if fault := machine.fault():
        raise MoproError(fault)
    emulator = Emulator(machine, payload_kg, compiled=compiled)
    simulation, ended_s = emulator.prepared(program, for_s, SETTLE_S)
    simulation.follow(emulator.rate_hz)
    simulation.settle()
    moves = simulation.schedule.moves
    outcomes = [simulation.outcome(move) for move in moves]
    stalls = [stall for move in moves for stall in simulation.stalls(move)]
    settling = [simulation.settling_s(move) for move in moves]
    first = min(stalls, key=lambda stall: stall.time_s or 0.0, default=None)
    outcome, why = _outcome(simulation, first)
    heated = any(a.effect.domain is Domain.HEAT for a in emulator.active)
    return Figures(
        outcome,
        why,
        time_s=ended_s,
        force_margin=min(
            (o.stall_margin for o in outcomes if o.stall_margin is not None), default=None
        ),
        stall_s=first.time_s if first else None,
        stall_line=first.line if first else None,
        lost_pitches=max((o.lost_pitches for o in outcomes), key=abs, default=0),
        largest_lag_m=max((o.max_lag_m for o in outcomes if o.max_lag_m is not None), default=None),
        settling_s=None if None in settling else max(filter(None, settling), default=0.0),
        end_temperature_C=_temperature_C(simulation, ended_s) if heated else None,
        hour_temperature_C=_after_an_hour_C(emulator, variant, for_s) if heated else None,
        coil_energy_J=simulation.coil_energy_J(ended_s),
    )


def _outcome(simulation: Simulation, stall: Stall | None) -> tuple[str, str | None]:
    """What ended the run first, in a word and in words."""
    trip = simulation.trip
    if stall is not None and (trip is None or (stall.time_s or 0.0) <= trip.time_s):
        lost = f"lost {stall.lost_pitches:+d} pitches" if stall.lost_pitches else "slipped"
        return STALLED, f"axis {stall.axis} {lost} at line {stall.line}"
    if trip is not None:
        of_axis = "" if trip.axis is None else f" of axis {trip.axis}"
        return TRIPPED, f"{trip.kind}{of_axis} at line {trip.line}"
    return OK, None


def _temperature_C(simulation: Simulation, at_s: float) -> float | None:
    found = float(simulation.temperature_C(np.array([at_s]))[0])
    return found if math.isfinite(found) else None


def _after_an_hour_C(emulator: Emulator, variant: Variant, for_s: float | None) -> float | None:
    """The temperature after an hour of runs; None where there would be too many moves."""
    program = variant.program
    if not program.loops_forever:
        hour = _repeated(emulator.plan(program, for_s))
    else:
        try:
            hour = emulator.plan(program, _HOUR_S)
        except MotionError:  # more statements than a run may have
            return None
    return None if hour is None else _temperature_C(emulator.begin(hour), _HOUR_S)


def _repeated(once: Schedule) -> Schedule | None:
    """The moves of `once`, again and again for an hour; their places are not used."""
    if not once.duration_s:
        return replace(once, duration_s=_HOUR_S)
    rounds = math.ceil(_HOUR_S / once.duration_s)
    if rounds * len(once.moves) > MOST_MOVES:
        return None
    moves = tuple(
        replace(move, start_s=move.start_s + n * once.duration_s)
        for n in range(rounds)
        for move in once.moves
    )
    return replace(once, moves=moves, duration_s=_HOUR_S)
