"""The emulator back end: a program through schedule, plant and heat into a recording."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version

import numpy as np

from mopro.effects import Active, catalogue
from mopro.effects.resolve import active_effects
from mopro.errors import MoproError
from mopro.machine import Machine, load_machine
from mopro.machine.backend import DEFAULT_LOOP_S
from mopro.motion import PlannedMove, Schedule
from mopro.plant.axis import EmulatedAxis, Samples
from mopro.plant.command_table import Floats
from mopro.plant.engine import Stepping
from mopro.plant.platen import platen_result, yaw_rad
from mopro.plant.simulate import Settings, Staging, planned, stage, staged
from mopro.program import Program
from mopro.recording import Header, MemorySink, MoveOutcome, MoveReport, Recording, Run, Sink
from mopro.recording.record import Columns

DEFAULT_RATE_HZ = 2000.0
# RK4 at this step is within 0.03 nm of the exact response to LVDT3.
MAX_STEP_S = 50e-6
MOST_SAMPLES = 200_000_000
_PIECE = 65536

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
    at which an effect vanishes) share one. `settled` waits behind the end of a run until
    the tooth that holds each axis is certain; without it `lost_pitches` may not be final.
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
    settled: bool = True

    def __post_init__(self) -> None:
        _ = self.active

    @cached_property
    def active(self) -> tuple[Active, ...]:
        """The effects switched on, with their values."""
        own = active_effects(self.machine, catalogue())
        if not self.effects:
            return own
        return active_effects(self.machine.with_effects(self.effects), catalogue())

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

    def run(self, program: Program, sink: Sink, for_s: float | None = None) -> Run:
        """Run `program` and write its samples to `sink` piece by piece.

        It ends after `for_s` seconds at the latest; one that loops for ever ends after
        a minute unless told otherwise. Raises MotionError for motion that must be
        refused.
        """
        if for_s is None and program.loops_forever:
            for_s = DEFAULT_LOOP_S
        settings = self._settings()
        staging = stage(program, settings, self.active, for_s)
        schedule = staging.schedule
        samples = int(schedule.duration_s * self.rate_hz + 1e-6) + 1
        if samples > MOST_SAMPLES:
            message = f"{schedule.duration_s:g} s at {self.rate_hz:g} Hz are {samples} samples:"
            raise MoproError(f"{message} expected at most {MOST_SAMPLES}", "too-long")
        hottest_C = self.machine.heat.ambient_C
        for times, end_s in self._pieces(schedule, samples):
            columns = self._columns(staging, times, end_s)
            hottest_C = max(hottest_C, float(columns["temperature_C"].max()))
            sink.write(columns)
        for axis in staging.axes if self.settled else ():
            axis.settle()
        return self._report(staging, hottest_C)

    def _settings(self) -> Settings:
        return Settings(
            self.machine, self.payload_kg, self.resolved, Stepping(self.max_step_s), self.compiled
        )

    def _pieces(self, schedule: Schedule, samples: int) -> Iterator[tuple[Floats, float]]:
        """The sample times piece by piece, and how far each piece goes."""
        for first in range(0, samples, _PIECE):
            last = min(first + _PIECE, samples)
            times = np.arange(first, last) / self.rate_hz
            end_s = float(times[-1]) if last < samples else schedule.duration_s
            yield times, max(end_s, float(times[-1]))

    def _columns(self, staging: Staging, times: Floats, end_s: float) -> Columns:
        columns: Columns = {"time_s": times}
        samples = {axis.number: axis.advance(times, end_s) for axis in staging.axes}
        for n, of_axis in samples.items():
            columns |= _axis_columns(n, of_axis)
        columns["temperature_C"] = staging.heat.temperature_C(times)
        columns["line"] = _lines(staging.schedule, times)
        for n, of_axis in samples.items():
            if of_axis.voltage_a_V is not None and of_axis.voltage_b_V is not None:
                columns[f"voltage_a_{n}_V"] = of_axis.voltage_a_V
                columns[f"voltage_b_{n}_V"] = of_axis.voltage_b_V
        if self.machine.forcers is not None:
            lags = {n: s.command_m - s.position_m for n, s in samples.items()}
            columns["yaw_rad"] = yaw_rad(
                self.machine.forcers, self.machine.axis.wave_number_1_m, lags
            )
        return columns

    def _report(self, staging: Staging, hottest_C: float) -> Run:
        schedule, trip = staging.schedule, staging.trip
        by_number = {axis.number: axis for axis in staging.axes}
        return Run(
            program=schedule.program.name,
            machine=self.machine.name,
            duration_s=schedule.duration_s,
            loops_forever=schedule.program.loops_forever,
            complete=schedule.complete,
            moves=tuple(
                self._move_report(move, trip.time_s if trip else schedule.duration_s, by_number)
                for move in schedule.moves
            ),
            trip=trip.as_json() if trip else None,
            platen=platen_result(self.machine, schedule.moves, hottest_C),
        )

    def _move_report(
        self, move: PlannedMove, ended_s: float, axes: dict[int, EmulatedAxis]
    ) -> MoveReport:
        outcomes = [axes[number].outcomes.of(move) for number in move.axes]
        outcome = replace(MoveOutcome.worst(outcomes), complete=move.end_s <= ended_s)
        return MoveReport.of(move, outcome, self.machine.microstep_m)

    def plan(self, program: Program, for_s: float | None = None) -> Schedule:
        """What `program` commands on this machine; raises MotionError, as `plan` does."""
        return planned(program, self.machine, self.active, for_s)

    def begin(self, schedule: Schedule) -> Emulation:
        """The machine at rest at the start of `schedule`, for whoever moves time on himself."""
        return Emulation(self, schedule)


class Emulation:
    """One run on the emulated machine, as far as it has got.

    Only what has been commanded up to the time reached has been integrated, so that a
    caller may still change what comes after it: a stop, or a longer schedule. Limit
    switches and heat are the caller's to act upon.
    """

    def __init__(self, emulator: Emulator, schedule: Schedule) -> None:
        self._emulator = emulator
        self._staging = self._staged(schedule)

    def _staged(self, schedule: Schedule) -> Staging:
        return staged(schedule, self._emulator._settings(), self._emulator.active)

    def advance(self, times: Floats, end_s: float) -> Columns:
        """The samples at `times`; the machine goes on to `end_s` (see EmulatedAxis.advance)."""
        return self._emulator._columns(self._staging, times, end_s)

    def change(self, schedule: Schedule) -> None:
        """Go on under `schedule`, which is the same up to the time reached."""
        before, self._staging = self._staging, self._staged(schedule)
        for axis, old in zip(self._staging.axes, before.axes, strict=True):
            axis.take_over(old)

    def slip(self, axis: int, pitches: int) -> None:
        """Throw `axis` back by whole pitches, as a blow does."""
        self._staging.axes[axis - 1].slip(pitches)

    def position_m(self, axis: int) -> float:
        """Where `axis` is at the time reached."""
        return self._staging.axes[axis - 1].position_m

    def settle(self) -> None:
        """At the end of the command, let what rings come to rest; the accounts are final."""
        for axis in self._staging.axes:
            axis.settle()

    def outcome(self, move: PlannedMove) -> MoveOutcome:
        """How `move` went; final once its axes have begun another, or after `settle`."""
        axes = (axis for axis in self._staging.axes if axis.number in move.axes)
        return MoveOutcome.worst([axis.outcomes.of(move) for axis in axes])


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
) -> Recording:
    """Run `program` on an emulated machine and keep the recording in memory.

    `machine` is a built-in name, a machine file's path or a `Machine`; for the rest see
    `Emulator`. Raises MotionError, ModelError.
    """
    if isinstance(machine, str):
        machine = load_machine(machine)
    emulator = Emulator(machine, payload_kg, rate_hz, seed, resolved, max_step_s, effects, compiled)
    sink = MemorySink()
    run = emulator.run(program, sink, for_s)
    return sink.recording(emulator.header(program), run)


def _axis_columns(n: int, samples: Samples) -> Columns:
    return {
        f"command_{n}_m": samples.command_m,
        f"position_{n}_m": samples.position_m,
        f"velocity_{n}_m_s": samples.velocity_m_s,
        f"phase_a_{n}_A": samples.phase_a_A,
        f"phase_b_{n}_A": samples.phase_b_A,
        f"force_{n}_N": samples.force_N,
    }


def _lines(schedule: Schedule, times: Floats) -> np.ndarray[tuple[int], np.dtype[np.int32]]:
    """The running source line at each time; before anything takes time, the first one."""
    if not schedule.activity:
        return np.full(len(times), schedule.program.ops[0].span.line, dtype=np.int32)
    starts, lines = zip(*schedule.activity, strict=True)
    at = np.searchsorted(np.array(starts), times, side="right") - 1
    return np.array(lines, dtype=np.int32)[np.maximum(at, 0)]
