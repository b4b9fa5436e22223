"""The emulator back end: a program through schedule, plant and heat into a recording."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version

import numpy as np

from mopro.effects import Active, catalogue_of
from mopro.effects.resolve import active_effects
from mopro.emulator.loop import loop_of
from mopro.errors import MoproError
from mopro.machine import Machine, load_machine
from mopro.machine.backend import DEFAULT_LOOP_S, OnProgress, Progress, no_one
from mopro.motion import LONGEST_RUN_S, Schedule
from mopro.plant import (
    MAX_STEP_S,
    MOST_SETTLING_S,
    Simulation,
    Stepping,
    plan_with_effects,
    platen_result,
    simulate,
)
from mopro.program import AXES, Program
from mopro.recording import Header, MemorySink, MoveReport, Recording, Run, Sink
from mopro.recording.envelope import Floats
from mopro.recording.record import Columns

DEFAULT_RATE_HZ = 2000.0
MOST_SAMPLES = 200_000_000
_CHUNK = 65536

Effects = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Emulator:
    """One emulated machine.

    `payload_kg` rides on the forcer; `rate_hz` is the recording's; `resolved` false
    lets the drive follow the command smoothly instead of in microsteps; `seed` is for
    what is random in a machine (nothing, in the nominal one) and is recorded. `effects`
    are switched on besides the machine's own: name to parameters, in the effects' units
    (SI); unstated ones have their defaults. `compiled` forces the kernel to be compiled
    or not; many short runs gain from it. A kernel is compiled once for each set of
    effects, whatever their numbers, so sets that differ in numbers only (down to those
    at which an effect vanishes) share one.
    Raises ModelError for effects that are not to be had.
    """

    machine: Machine
    payload_kg: float = 0.0
    rate_hz: float = DEFAULT_RATE_HZ
    seed: int = 0
    resolved: bool = True
    max_step_s: float = MAX_STEP_S
    effects: Effects | None = None
    compiled: bool | None = None

    def __post_init__(self) -> None:
        _ = self.active

    @cached_property
    def active(self) -> tuple[Active, ...]:
        """The effects switched on, with their values."""
        own = active_effects(self.machine, catalogue_of(self.machine))
        if not self.effects:
            return own
        return active_effects(self.machine.with_effects(self.effects), catalogue_of(self.machine))

    def header(self, program: Program) -> Header:
        versions = {name: version(name) for name in ("mopro", "numpy")}
        return Header(
            program=program.name,
            program_sha256=program.source.sha256,
            machine=self.machine.name,
            back_end="emulator",
            rate_hz=self.rate_hz,
            payload_kg=self.payload_kg,
            seed=self.seed,
            versions={"python": platform.python_version(), **versions},
            effects=[a.as_json() for a in self.active],
        )

    # Numbers that are not finite end a run, with a better message than numpy's warnings.
    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def run(
        self,
        program: Program,
        sink: Sink,
        for_s: float | None = None,
        settle_s: float = 0.0,
        on_progress: OnProgress = no_one,
    ) -> Run:
        """Run `program` and write its samples to `sink` chunk by chunk.

        It ends after `for_s` seconds at the latest; one that loops for ever ends after
        a minute unless told otherwise. The samples of a program that ends go on until
        `settle_s` after its last move, and beyond if an axis still slips then; the run's
        duration stays the program's. `on_progress` hears of each chunk. Raises MotionError for
        motion that must be refused, RunError if a value is not finite.
        """
        simulation, ended_s = self.prepared(program, for_s, settle_s)
        lasting_s = simulation.schedule.duration_s
        hottest_C = self.machine.heat.ambient_C
        for columns in self._recorded(simulation, settle_s):
            during = np.searchsorted(columns["time_s"], ended_s, side="right")
            hottest_C = float(columns["temperature_C"][:during].max(initial=hottest_C))
            sink.write(columns)
            on_progress(_progress(columns, lasting_s))
        simulation.settle()
        return self._report(simulation, ended_s, hottest_C)

    def prepared(
        self, program: Program, for_s: float | None = None, settle_s: float = 0.0
    ) -> tuple[Simulation, float]:
        """The machine at rest before `program`, and the time (s) at which the run will end.

        Its schedule goes on until `settle_s` after the last move. Arguments and errors are those
        of `run`.
        """
        if for_s is None and program.loops_forever:
            for_s = DEFAULT_LOOP_S
        planned = self.plan(program, for_s)
        self._check_length(planned.duration_s, settle_s)
        simulation = self._simulation(_lengthened(planned, settle_s), trips=True)
        return simulation, (
            simulation.schedule.duration_s if simulation.trip else planned.duration_s
        )

    def _recorded(self, simulation: Simulation, settle_s: float) -> Iterator[Columns]:
        """The samples of the schedule; with `settle_s` then on until no axis can slip."""
        schedule = simulation.schedule
        samples, done = int(schedule.duration_s * self.rate_hz + 1e-6) + 1, 0
        if (loop := loop_of(simulation, self.rate_hz)) is not None:
            yield from loop.chunks(_CHUNK)
            done = loop.samples
        for times, end_s in self._chunks(done, samples, schedule.duration_s):
            yield simulation.advance(times, end_s)
        if not settle_s or not schedule.complete:
            return
        more = math.ceil(settle_s * self.rate_hz)
        most = samples + int(MOST_SETTLING_S * self.rate_hz)
        while samples < most and not simulation.settled():
            for times, end_s in self._chunks(samples, samples + more, 0.0):
                yield simulation.advance(times, end_s)
            samples += more

    def _check_length(self, duration_s: float, settle_s: float) -> None:
        """MoproError for more than can be simulated or recorded."""
        if duration_s > LONGEST_RUN_S:
            message = f"the run takes {duration_s:.4g} s: expected at most {LONGEST_RUN_S:g}"
            raise MoproError(f"{message}; end it earlier with --for", "too-long")
        lasting_s = duration_s + settle_s
        samples = lasting_s * self.rate_hz
        if samples > MOST_SAMPLES:
            message = f"{lasting_s:g} s at {self.rate_hz:g} Hz are {samples:.4g} samples:"
            raise MoproError(f"{message} expected at most {MOST_SAMPLES}", "too-long")

    def _chunks(self, first: int, samples: int, end_s: float) -> Iterator[tuple[Floats, float]]:
        """The times of samples from `first` on, chunk by chunk, and how far each chunk goes."""
        for start in range(first, samples, _CHUNK):
            last = min(start + _CHUNK, samples)
            times = np.arange(start, last) / self.rate_hz
            yield times, max(end_s if last == samples else 0.0, float(times[-1]))

    def _report(self, simulation: Simulation, duration_s: float, hottest_C: float) -> Run:
        schedule, trip = simulation.schedule, simulation.trip
        ended_s = trip.time_s if trip else duration_s
        outcomes = (
            replace(simulation.outcome(move), complete=move.end_s <= ended_s)
            for move in schedule.moves
        )
        return Run(
            program=schedule.program.name,
            machine=self.machine.name,
            duration_s=duration_s,
            loops_forever=schedule.program.loops_forever,
            complete=schedule.complete,
            moves=tuple(
                MoveReport.of(move, outcome, self.machine.microstep_m)
                for move, outcome in zip(schedule.moves, outcomes, strict=True)
            ),
            trip=trip.as_json() if trip else None,
            platen=platen_result(self.machine, schedule.moves, hottest_C),
            stalls=tuple(
                sorted(
                    (stall for move in schedule.moves for stall in simulation.stalls(move)),
                    key=lambda stall: stall.time_s or 0.0,
                )
            ),
        )

    def plan(self, program: Program, for_s: float | None = None) -> Schedule:
        """Schedule of `program` on this machine; raises MotionError, as `plan` does."""
        return plan_with_effects(program, self.machine, self.active, for_s)

    def begin(self, schedule: Schedule) -> Simulation:
        """The machine at rest at the start of `schedule`, for a caller who moves time on.

        Does not check limit switches or overheating; the caller must.
        """
        return self._simulation(schedule, trips=False)

    def _simulation(self, schedule: Schedule, trips: bool) -> Simulation:
        return simulate(
            schedule,
            self.machine,
            self.active,
            Stepping(self.max_step_s),
            payload_kg=self.payload_kg,
            resolved=self.resolved,
            compiled=self.compiled,
            trips=trips,
        )


def _lengthened(schedule: Schedule, settle_s: float) -> Schedule:
    """`schedule` made to last until `settle_s` after its last move, if its program ends."""
    if not settle_s or not schedule.complete or not schedule.moves:
        return schedule
    moved_s = max(move.end_s for move in schedule.moves)
    return replace(schedule, duration_s=max(schedule.duration_s, moved_s + settle_s))


def _progress(columns: Columns, total_s: float) -> Progress:
    """The progress that the last sample of a chunk shows."""
    return Progress(
        float(columns["time_s"][-1]),
        total_s,
        int(columns["line"][-1]),
        {axis: float(columns[f"position_{axis}_m"][-1]) for axis in AXES},
    )


def emulate(
    program: Program,
    machine: str | Machine = "chow1992",
    *,
    payload_kg: float = 0.0,
    for_s: float | None = None,
    rate_hz: float = DEFAULT_RATE_HZ,
    seed: int = 0,
    resolved: bool = True,
    max_step_s: float = MAX_STEP_S,
    effects: Effects | None = None,
    compiled: bool | None = None,
    settle_s: float = 0.0,
) -> Recording:
    """Run `program` on an emulated machine and keep the recording in memory.

    `machine` is a built-in name, a machine file's path or a `Machine`; for the rest see
    `Emulator` and its `run`. Raises MotionError, ModelError; TypeError for an argument of another
    kind.
    """
    _check_arguments(program, machine, effects)
    if isinstance(machine, str):
        machine = load_machine(machine)
    emulator = Emulator(machine, payload_kg, rate_hz, seed, resolved, max_step_s, effects, compiled)
    sink = MemorySink()
    run = emulator.run(program, sink, for_s, settle_s)
    return sink.recording(emulator.header(program), run)


def _check_arguments(program: object, machine: object, effects: object) -> None:
    """TypeError for arguments that are easily mistaken, with what was expected in their place."""
    if not isinstance(program, Program):
        raise TypeError(
            f"emulate expects a Program, not {type(program).__name__}: mopro.compile(text) makes "
            "one of a text, mopro.compile_file(path) one of a file"
        )
    if not isinstance(machine, str | Machine):
        raise TypeError(
            f"machine is {type(machine).__name__}: expected a built-in name, the path of a machine "
            "file as text, or a Machine"
        )
    stated = effects.values() if isinstance(effects, Mapping) else [effects]
    if effects is not None and not all(isinstance(values, Mapping) for values in stated):
        raise TypeError(
            'effects are names with their parameters, such as {"viscous_drag": {"b": 9.0}}; '
            '{"viscous_drag": {}} has the defaults'
        )
