"""The emulator back end: a program through schedule, plant and heat into a recording."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from importlib.metadata import version

import numpy as np

from mopro.emulator import kernel
from mopro.emulator.axis import EmulatedAxis, Integrate, Plant
from mopro.emulator.command import Floats
from mopro.emulator.heat import HeatHistory
from mopro.errors import MoproError
from mopro.machine import Machine, load_machine
from mopro.motion import PlannedMove, Schedule, plan
from mopro.program import AXES, Program
from mopro.recording import Header, MemorySink, MoveReport, Recording, Run, Sink
from mopro.recording.record import Columns
from mopro.units import length_unit_name

DEFAULT_RATE_HZ = 2000.0
DEFAULT_LOOP_S = 60.0
# RK4 at this step is within 0.03 nm of the exact response to LVDT3.
MAX_STEP_S = 50e-6
MOST_SAMPLES = 200_000_000
_PIECE = 65536

# From this many integration steps on, importing a compiler pays.
_COMPILE_FROM_STEPS = 400_000
_RINGING_S = 0.7


@dataclass(frozen=True)
class Emulator:
    """One emulated machine.

    `payload_kg` rides on the forcer; `rate_hz` is the recording's; `resolved` false
    lets the drive follow the command smoothly instead of in microsteps; `seed` is for
    what is random in a machine (nothing, in the nominal one) and is recorded.
    """

    machine: Machine
    payload_kg: float = 0.0
    rate_hz: float = DEFAULT_RATE_HZ
    seed: int = 0
    resolved: bool = True
    max_step_s: float = MAX_STEP_S

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
        )

    def run(self, program: Program, sink: Sink, for_s: float | None = None) -> Run:
        """Run `program` and write its samples to `sink` piece by piece.

        It ends after `for_s` seconds at the latest; one that loops for ever ends after
        a minute unless told otherwise. Raises MotionError for motion that must be
        refused.
        """
        if for_s is None and program.loops_forever:
            for_s = DEFAULT_LOOP_S
        schedule = plan(program, for_s, self._travel_u())
        samples = int(schedule.duration_s * self.rate_hz + 1e-6) + 1
        if samples > MOST_SAMPLES:
            message = f"{schedule.duration_s:g} s at {self.rate_hz:g} Hz are {samples} samples:"
            raise MoproError(f"{message} expected at most {MOST_SAMPLES}", "too-long")
        axes = self._axes(schedule)
        heat = HeatHistory(self.machine, schedule.moves)
        for times, end_s in self._pieces(schedule, samples):
            sink.write(self._columns(schedule, axes, heat, times, end_s))
        for axis in axes:
            axis.settle()
        return self._report(schedule, axes)

    def _travel_u(self) -> dict[int, tuple[float, float]]:
        """Limit switches where the forcer meets the platen's edges, from the middle (assumed)."""
        platen, side = self.machine.platen, self.machine.heat.forcer_side_m
        reach = [
            (size - side) / 2 / self.machine.microstep_m
            for size in (platen.length_m, platen.width_m)
        ]
        return {axis: (-way, way) for axis, way in zip(AXES, reach, strict=True)}

    def _axes(self, schedule: Schedule) -> list[EmulatedAxis]:
        plant = Plant.of(self.machine, self.payload_kg, self.resolved, self.max_step_s)
        integrate = self._integrator(schedule)
        return [EmulatedAxis(n, plant, schedule.tracks[n], schedule.moves, integrate) for n in AXES]

    def _integrator(self, schedule: Schedule) -> Integrate:
        """Plain for short work, compiled for long: the same kernel, the same bits."""
        active_s = sum(
            (move.profile.duration_s + _RINGING_S) * len(move.strokes) for move in schedule.moves
        )
        active_s = min(active_s, schedule.duration_s * len(AXES))
        if active_s / self.max_step_s < _COMPILE_FROM_STEPS:
            return kernel.integrate
        from mopro.emulator import compiled

        return compiled.integrate

    def _pieces(self, schedule: Schedule, samples: int) -> Iterator[tuple[Floats, float]]:
        """The sample times piece by piece, and how far each piece goes."""
        for first in range(0, samples, _PIECE):
            last = min(first + _PIECE, samples)
            times = np.arange(first, last) / self.rate_hz
            end_s = float(times[-1]) if last < samples else schedule.duration_s
            yield times, max(end_s, float(times[-1]))

    def _columns(
        self,
        schedule: Schedule,
        axes: list[EmulatedAxis],
        heat: HeatHistory,
        times: Floats,
        end_s: float,
    ) -> Columns:
        columns: Columns = {"time_s": times}
        machine = self.machine
        k, force = machine.axis.wave_number_1_m, machine.axis.pull_out_force_N
        current = machine.drive.phase_current_A
        for axis in axes:
            n = axis.number
            position, velocity = axis.advance(times, end_s)
            command = axis.command_m(times)
            columns[f"command_{n}_m"] = command
            columns[f"position_{n}_m"] = position
            columns[f"velocity_{n}_m_s"] = velocity
            columns[f"phase_a_{n}_A"] = current * np.cos(k * command)
            columns[f"phase_b_{n}_A"] = current * np.sin(k * command)
            columns[f"force_{n}_N"] = force * np.sin(k * (command - position))
        columns["temperature_C"] = heat.temperature_C(times)
        columns["line"] = _lines(schedule, times)
        return columns

    def _report(self, schedule: Schedule, axes: list[EmulatedAxis]) -> Run:
        by_number = {axis.number: axis for axis in axes}
        return Run(
            program=schedule.program.name,
            machine=self.machine.name,
            duration_s=schedule.duration_s,
            loops_forever=schedule.program.loops_forever,
            complete=schedule.complete,
            moves=tuple(self._move_report(move, schedule, by_number) for move in schedule.moves),
        )

    def _move_report(
        self, move: PlannedMove, schedule: Schedule, axes: dict[int, EmulatedAxis]
    ) -> MoveReport:
        fates = [axes[number].fates.of(move) for number in move.axes]
        metres_per_uu = move.microsteps_per_uu * Fraction(
            self.machine.microstep_m
        ).limit_denominator(10**9)
        return MoveReport(
            line=move.span.line,
            axes=list(move.axes),
            profile=str(move.profile.shape),
            distance=move.distance_uu,
            unit=length_unit_name(metres_per_uu),
            set_velocity=move.in_uu(move.profile.velocity),
            peak_velocity=move.in_uu(move.profile.peak_velocity),
            acceleration=move.in_uu(move.profile.acceleration),
            start_s=move.start_s,
            duration_s=move.profile.duration_s,
            max_lag=move.in_uu(max(fate.max_lag_m for fate in fates) / self.machine.microstep_m),
            stall_margin=min(fate.stall_margin for fate in fates),
            lost_pitches=max((fate.lost_pitches for fate in fates), key=abs),
            slipped=any(fate.slipped for fate in fates),
            complete=move.end_s <= schedule.duration_s,
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
) -> Recording:
    """Run `program` on an emulated machine and keep the recording in memory.

    `machine` is a built-in name, a machine file's path or a `Machine`; for the rest see
    `Emulator`. Raises MotionError, ModelError.
    """
    if isinstance(machine, str):
        machine = load_machine(machine)
    emulator = Emulator(machine, payload_kg, rate_hz, seed, resolved, max_step_s)
    sink = MemorySink()
    run = emulator.run(program, sink, for_s)
    return sink.recording(emulator.header(program), run)


def _lines(schedule: Schedule, times: Floats) -> np.ndarray[tuple[int], np.dtype[np.int32]]:
    """The running source line at each time; before anything takes time, the first one."""
    if not schedule.activity:
        return np.full(len(times), schedule.program.ops[0].span.line, dtype=np.int32)
    starts, lines = zip(*schedule.activity, strict=True)
    at = np.searchsorted(np.array(starts), times, side="right") - 1
    return np.array(lines, dtype=np.int32)[np.maximum(at, 0)]
