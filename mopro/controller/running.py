"""The run of a stored program on the emulated machine, advanced in steps of time.

The command is planned ahead, but the machine is integrated only up to the present, on the
emulator's own grid of samples: a stop can change all that is to come, and a run without a
stop gives the emulator's numbers to the bit. Times are seconds from the start of the run,
`_u` microsteps from its first position.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mopro.emulator.backend import DEFAULT_RATE_HZ, Emulator
from mopro.motion import PlannedMove, Schedule, Stopping
from mopro.plant import Simulation
from mopro.program import AXES, Program
from mopro.recording import MoveOutcome

_HORIZON_S = 60.0
_CHUNK = 4096
_REST_M = 2e-6
_MOST_RINGING_S = 2.0


class Motion:
    """One run of `program`, for at most `for_s` seconds.

    `travel_u` has each axis' limit switches, in microsteps from the start of this run.
    """

    def __init__(
        self,
        emulator: Emulator,
        program: Program,
        travel_u: Mapping[int, tuple[float, float]],
        for_s: float | None = None,
    ) -> None:
        self._emulator = emulator
        self.program = program
        self._travel_u = travel_u
        self._for_s = for_s
        self._horizon_s = for_s
        if for_s is None and program.loops_forever:
            self._horizon_s = _HORIZON_S
        self.schedule = self._planned()
        self._simulation: Simulation | None = None
        self._samples = 0
        self._ended = False
        self._cut_s = math.inf
        self._accounts: list[MoveOutcome] = []
        self._slips: list[tuple[float, int, int]] = []
        self.now_s = 0.0
        self.seen_u = dict.fromkeys(AXES, 0.0)
        self._calm_u = dict.fromkeys(AXES, 0.0)
        self.temperature_C = emulator.machine.heat.ambient_C

    # -- the command -----------------------------------------------------------

    def _planned(self) -> Schedule:
        schedule = self._emulator.plan(self.program, self._horizon_s)
        self.limit_s = min(
            schedule.tracks[axis].leaves_s(math.floor(low), math.ceil(high))
            for axis, (low, high) in self._travel_u.items()
        )
        return schedule

    def look_ahead(self, now_s: float) -> None:
        """Extend the plan of a loop before its end is reached."""
        while (
            self._for_s is None
            and self._horizon_s is not None
            and math.isinf(self._cut_s)
            and now_s > self._horizon_s / 2
        ):
            self._horizon_s *= 2
            self.schedule = self._planned()
            if self._simulation:
                self._simulation.change(self.schedule)

    @property
    def end_s(self) -> float:
        """The time (s) at which the planned command ends."""
        return self.schedule.duration_s

    @property
    def sampled_s(self) -> float:
        """The time (s) of the last sample, at which the axes were at `seen_u`."""
        return max(0, self._samples - 1) / DEFAULT_RATE_HZ

    @property
    def cut(self) -> bool:
        return not math.isinf(self._cut_s)

    def tick_after(self, now_s: float) -> float:
        """The first sample at or after `now_s`: when a change of the command takes effect."""
        return math.ceil(now_s * DEFAULT_RATE_HZ - 1e-6) / DEFAULT_RATE_HZ

    def stop(self, at_s: float, abruptly: bool = False) -> None:
        """Brake at the set accelerations from `at_s` on, or hold where the command is then."""
        self._follow(at_s)
        self.schedule = self.schedule.stopped(at_s, Stopping.HOLD if abruptly else Stopping.BRAKE)
        self._cut_s = min(self._cut_s, at_s)
        if self._simulation:
            self._simulation.change(self.schedule)

    def command_u(self, axis: int, at_s: float) -> int:
        at_s = min(at_s, self.end_s)
        return round(self.schedule.tracks[axis].state(at_s).position)

    def commanded_to_move(self, axis: int, at_s: float) -> bool:
        return at_s < self.end_s and self.schedule.tracks[axis].state(at_s).velocity != 0

    def statements(self, at_s: float) -> tuple[int, int]:
        """The statement under way and the one completed before, 0 for none.

        Stored programs have a statement a line.
        """
        under_way, completed = self.schedule.lines_at(min(at_s, self._cut_s))
        return under_way or 0, completed or 0

    # -- the machine -----------------------------------------------------------

    def slip_at(self, at_s: float, axis: int, pitches: int) -> None:
        """Make `axis` lose whole pitches at `at_s`."""
        self._slips.append((at_s, axis, pitches))

    def advance(self, now_s: float) -> None:
        """Integrate the machine up to the last sample before `now_s`."""
        self.now_s = max(self.now_s, now_s)
        for slip in sorted(s for s in self._slips if s[0] <= now_s):
            self._slips.remove(slip)
            self._follow(slip[0])
            self._begun().slip(slip[1], slip[2])
        self._follow(now_s)

    def _begun(self) -> Simulation:
        if self._simulation is None:
            self._simulation = self._emulator.begin(self.schedule)
        return self._simulation

    def _follow(self, to_s: float) -> None:
        """Integrate the samples up to `to_s`, and not beyond what is commanded."""
        if self._ended:
            return
        simulation = self._begun()
        last = int(to_s * DEFAULT_RATE_HZ + 1e-6) + 1
        whole = int(self.end_s * DEFAULT_RATE_HZ + 1e-6) + 1
        if not self.cut:
            last = min(last, whole)
        while self._samples < last:
            upto = min(self._samples + _CHUNK, last)
            times = np.arange(self._samples, upto) / DEFAULT_RATE_HZ
            columns = simulation.advance(times, float(times[-1]))
            self._samples = upto
            step_u = self._emulator.machine.microstep_m
            for axis in AXES:
                self.seen_u[axis] = float(columns[f"position_{axis}_m"][-1]) / step_u
                self._calm_u[axis] = max(
                    abs(
                        float(columns[f"position_{axis}_m"][-1] - columns[f"command_{axis}_m"][-1])
                    ),
                    abs(float(columns[f"velocity_{axis}_m_s"][-1])) * _CALM_S,
                )
            self.temperature_C = float(columns["temperature_C"][-1])

    def calm(self) -> bool:
        """True once every axis is within 2 µm of its command and at standstill.

        Velocity counts as the distance still travelled in 2 ms. Becomes true after 2 s in
        any case: an axis that lost steps rests a whole number of pitches away.
        """
        if self.now_s > self.end_s + _MOST_RINGING_S:
            return True
        return all(value < _REST_M for value in self._calm_u.values())

    def finish(self) -> None:
        """End the run at the end of the command: outcomes are final, positions are at rest."""
        if self._ended:
            return
        self._close()
        self._ended = True
        pitch_u = self._emulator.machine.axis.pitch_m / self._emulator.machine.microstep_m
        for axis in AXES:
            # An axis that still rings comes to rest in the tooth that it is in.
            command_u = self.command_u(axis, self.end_s)
            seen_u = self._begun().position_m(axis) / self._emulator.machine.microstep_m
            self.seen_u[axis] = command_u - round((command_u - seen_u) / pitch_u) * pitch_u

    def expire(self) -> None:
        """End the time given: outcomes are final, axes that still move brake."""
        self._close()
        self._accounts = [self.outcome(move) for move in self.schedule.moves]
        self.stop(self.end_s)

    def _close(self) -> None:
        self._follow(self.end_s)
        simulation = self._begun()
        if not self.cut:
            simulation.advance(np.array([self.end_s]), self.end_s)
        simulation.settle()

    def finished_moves(self) -> list[PlannedMove]:
        """The leading moves whose outcomes are final: each of their axes has a later move."""
        moves = list(self.schedule.moves)
        if self._ended:
            return moves
        reached = (self._samples - 2) / DEFAULT_RATE_HZ
        count = bisect_right(moves, reached, key=lambda move: move.start_s)
        later: set[int] = set()
        final = count
        for index in range(count - 1, -1, -1):
            if not later.issuperset(moves[index].axes):
                final = index
            later.update(moves[index].axes)
        return moves[:final]

    def outcome(self, move: PlannedMove) -> MoveOutcome:
        end_s = min(self._cut_s, self.end_s)
        return replace(self._begun().outcome(move), complete=move.end_s <= end_s)

    def account(self, first: int, most: int) -> list[tuple[int, MoveOutcome]]:
        """Up to `most` finished moves from number `first` (counted from 1) on."""
        moves = self.finished_moves()[first - 1 : first - 1 + most]
        numbered = list(enumerate(moves, start=first))
        return [
            (n, self._accounts[n - 1] if self._accounts else self.outcome(move))
            for n, move in numbered
        ]


# A velocity counts as the distance travelled in this time.
_CALM_S = 2e-3
