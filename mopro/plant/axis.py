"""One emulated axis: its motion in chunks, and the outcome of each of its moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.machine.constants import PlantConstants
from mopro.motion import PlannedMove
from mopro.plant.command_table import CommandTable, Floats
from mopro.plant.integration import Integration, Trace
from mopro.plant.repetition import Course
from mopro.recording import MoveOutcome

_SETTLING_S = 0.05
MOST_SETTLING_S = 10.0
# An axis that stays this close to its command has settled: five microsteps. Halved or doubled, the
# time changes by what the ringing takes to decay by half, 44 ms on the built-in machine.
SETTLED_M = 10e-6


class NotFinite(ArithmeticError):
    """Motion of an axis that is not finite any more; `time_s` is when."""

    def __init__(self, axis: int, time_s: float) -> None:
        super().__init__(f"the motion of axis {axis} is not finite")
        self.time_s = time_s


@dataclass(frozen=True)
class Samples:
    """One axis at the times asked for; currents in A, volts only of a full drive."""

    command_m: Floats
    position_m: Floats
    velocity_m_s: Floats
    phase_a_A: Floats
    phase_b_A: Floats
    force_N: Floats
    voltage_a_V: Floats | None = None
    voltage_b_V: Floats | None = None


class EmulatedAxis:
    """Advances once through time; `advance` returns the motion at given samples.

    `corners_s` are times that no step may straddle besides those of the command, `jumps`
    times at which the axis falls behind by a number of pitches.
    """

    def __init__(
        self,
        number: int,
        plant: PlantConstants,
        command: CommandTable,
        integration: Integration,
        moves: Sequence[PlannedMove],
        resolved: bool = True,
        corners_s: Sequence[float] = (),
        jumps: Sequence[tuple[float, float]] = (),
        has_voltage: bool = False,
    ) -> None:
        self.number = number
        self._plant = plant
        self._command = command
        self._integration = integration
        self._resolved = resolved
        self._corners_s = np.array(sorted(corners_s))
        self._jumps = sorted(jumps)
        self._has_voltage = has_voltage
        self._now_s = 0.0
        self.outcomes = _MoveOutcomes([m for m in moves if number in m.axes], plant)

    def advance(self, samples_s: Floats, end_s: float) -> Samples:
        """The axis at `samples_s`; it goes on to `end_s`.

        Samples ascend and lie between the time reached before and `end_s`. Raises NotFinite.
        """
        parts = [
            self._advance(part, stop_s) for part, stop_s in self._between_jumps(samples_s, end_s)
        ]
        return _joined(parts) if len(parts) > 1 else parts[0]

    def follow(self, samples_s: Floats, end_s: float) -> None:
        """As `advance`, for the outcomes of the moves alone; without a move no sample is needed."""
        if not self.outcomes.any:
            samples_s = samples_s[:0]
        for part, stop_s in self._between_jumps(samples_s, end_s):
            self._watched(part, stop_s, recorded=False)

    def positions_m(self, samples_s: Floats, end_s: float) -> Floats:
        """As `advance`, but positions only, and without recording the outcomes of moves."""
        parts = []
        for part, stop_s in self._between_jumps(samples_s, end_s):
            knots, at = self._knots(part, stop_s)
            trace = self._through(knots, recorded=False)
            parts.append(trace.position[at])
        return np.concatenate(parts)

    def _between_jumps(self, samples_s: Floats, end_s: float) -> Iterator[tuple[Floats, float]]:
        """The samples up to each jump, which comes when their motion is worked out."""
        for stop_s, pitches in self._stops(end_s):
            last = np.searchsorted(samples_s, stop_s, side="left" if pitches else "right")
            yield samples_s[:last], stop_s
            samples_s = samples_s[last:]
            self._integration.x -= pitches * self._plant.pitch_m

    def _stops(self, end_s: float) -> list[tuple[float, float]]:
        """The jumps up to `end_s`, and then the end."""
        due = [jump for jump in self._jumps if jump[0] < end_s]
        self._jumps = self._jumps[len(due) :]
        return [*due, (end_s, 0.0)]

    def _knots(self, samples_s: Floats, end_s: float) -> tuple[Floats, NDArray[np.intp]]:
        """The times up to `end_s` at which an integration step must end, and the samples' rows."""
        corners = self._command.corners_s(self._now_s, end_s)
        own = self._corners_s[(self._corners_s > self._now_s) & (self._corners_s < end_s)]
        ends = np.array([self._now_s, max(end_s, self._now_s)])
        # The samples ascend: the few others are inserted, where a union would sort them all.
        others = np.unique(np.concatenate((ends, corners, own)))
        at = np.searchsorted(samples_s, others)
        new = at == len(samples_s)
        new[~new] = samples_s[at[~new]] != others[~new]
        inserted = at[new]
        before = np.diff(inserted, prepend=0, append=len(samples_s))
        rows = np.arange(len(samples_s)) + np.repeat(np.arange(len(inserted) + 1), before)
        return np.insert(samples_s, inserted, others[new]), rows

    def _through(self, knots: Floats, recorded: bool = True) -> Trace:
        trace = self._integration.through(knots, recorded)
        self._now_s = float(knots[-1])
        return trace

    def _watched(
        self, samples_s: Floats, end_s: float, recorded: bool
    ) -> tuple[Trace, NDArray[np.intp]]:
        """The motion up to `end_s`, seen by the outcomes, and the rows of the samples in it."""
        knots, at = self._knots(samples_s, end_s)
        trace = self._through(knots, recorded)
        self._check_finite(knots, trace)
        begun = self.outcomes.begun(knots)
        lags = self._lags(knots[begun], trace.position[begun])
        self.outcomes.watch(knots, lags, trace.low, trace.high)
        return trace, at

    def _advance(self, samples_s: Floats, end_s: float) -> Samples:
        trace, at = self._watched(samples_s, end_s, recorded=True)
        position, velocity = trace.position[at], trace.velocity[at]
        electrical = None if trace.electrical is None else trace.electrical.take(at, axis=1)
        return self._samples(self.command_m(samples_s), position, velocity, electrical)

    def _samples(
        self, command: Floats, position: Floats, velocity: Floats, electrical: Floats | None
    ) -> Samples:
        k, current = self._plant.wave_number_1_m, self._plant.phase_current_A
        if electrical is None:
            force = self._plant.pull_out_force_N * np.sin(k * (command - position))
            a, b = current * np.cos(k * command), current * np.sin(k * command)
            return Samples(command, position, velocity, a, b, force)
        a, b, va, vb, force = electrical
        volts = (va, vb) if self._has_voltage else (None, None)
        return Samples(command, position, velocity, current * a, current * b, force, *volts)

    def take_over(self, other: EmulatedAxis) -> None:
        """Take over the state of `other`, which has followed the same command so far."""
        self._now_s = other._now_s
        self._integration.take_over(other._integration)
        self._jumps = [jump for jump in self._jumps if jump[0] >= self._now_s]
        self.outcomes.take_over(other.outcomes)

    @property
    def courses(self) -> list[Course]:
        """All that drives the axis."""
        jumps = [(0.0, 0.0), *self._jumps]
        times_s, pitches = map(np.array, zip(*jumps, strict=True))
        return [*self._integration.courses, Course(times_s, pitches[:, None])]

    def state(self) -> Floats:
        """The state at the time reached: see `Integration.state`."""
        return self._integration.state()

    def compile_after(self, steps: float) -> None:
        """Compile the kernel when it has made so many steps."""
        self._integration.compile_after = steps

    @property
    def decay_s(self) -> float:
        """The time (s) in which its free oscillation decays by e; infinite without damping."""
        damping = self._plant.damping_N_s_m
        return 2 * self._plant.mass_kg / damping if damping > 0 else math.inf

    def skip(self, period_s: float, count: int, to_s: float) -> None:
        """Go on to `to_s`, `count` periods on, in which the axis does as in the one before now."""
        self.outcomes.repeat(period_s, count, self._now_s, to_s)
        self._now_s = to_s

    @property
    def position_m(self) -> float:
        """Position (m) at the time reached."""
        return self._integration.x

    def slip(self, pitches: float) -> None:
        """Displace the axis back by whole pitches at once."""
        self._integration.x -= pitches * self._plant.pitch_m

    def settle(self) -> None:
        """Advance under a command at rest until the axis cannot leave its tooth any more."""
        deadline_s = self._now_s + MOST_SETTLING_S
        while not self.settled() and self._now_s < deadline_s:
            knots = np.array([self._now_s, self._now_s + _SETTLING_S])
            self._check_finite(knots, self._through(knots, recorded=False))
        self.outcomes.finish(self._lag_m())

    def settled(self) -> bool:
        """True unless the command is at rest and the axis may still leave its tooth."""
        return self._captured() or not self._command.at_rest(self._now_s)

    def _check_finite(self, knots: Floats, trace: Trace) -> None:
        if not math.isfinite(trace.position[-1] + trace.velocity[-1]):
            first = np.argmin(np.isfinite(trace.position + trace.velocity))
            raise NotFinite(self.number, float(knots[first]))

    def command_m(self, time_s: Floats) -> Floats:
        """Position of the drive's command: whole microsteps where they are resolved."""
        command = self._command.position_u(time_s)
        if self._resolved:
            command = np.floor(command + 0.5)
        return command * self._plant.microstep_m

    def _lags(self, time_s: Floats, position: Floats) -> Floats:
        return self._command.position_u(time_s) * self._plant.microstep_m - position

    def _lag_m(self) -> float:
        """The lag now."""
        return float(self._lags(np.array([self._now_s]), np.array([self._integration.x]))[0])

    def _captured(self) -> bool:
        """True if the energy is too small to reach another tooth."""
        plant = self._plant
        depth = plant.pull_out_m_s2 / plant.wave_number_1_m
        energy = self._integration.v**2 / 2 + depth * (
            1 - math.cos(plant.wave_number_1_m * self._lag_m())
        )
        return energy < 2 * depth


def _joined(parts: list[Samples]) -> Samples:
    first, second = parts[0], _joined(parts[1:]) if len(parts) > 2 else parts[1]
    columns: dict[str, Floats] = {}
    for name, values in vars(first).items():
        if values is not None:
            columns[name] = np.concatenate([values, getattr(second, name)])
    return Samples(**columns)


class _MoveOutcomes:
    """The lag of one axis in each of its moves, gathered chunk by chunk.

    `teeth` are the pitches by which the axis is behind its command, before each move
    and at the end; `slip_s` is when it first was more than half a pitch from its tooth,
    inf if it never was; `restless_s` when it last was more than SETTLED_M from it after the
    move, -inf if it never was.
    """

    def __init__(self, moves: Sequence[PlannedMove], plant: PlantConstants) -> None:
        self._pitch_m = plant.pitch_m
        self._wave_number = plant.wave_number_1_m
        self._index = {id(move): i for i, move in enumerate(moves)}
        self._starts_s = np.array([move.start_s for move in moves])
        self._ends_s = np.array([move.end_s for move in moves])
        self._low_m = np.full(len(moves), np.inf)
        self._high_m = np.full(len(moves), -np.inf)
        self._teeth = np.zeros(len(moves) + 1, dtype=np.int64)
        self._slip_s = np.full(len(moves), np.inf)
        self._restless_s = np.full(len(moves), -np.inf)
        self._watched_s = 0.0

    @property
    def any(self) -> bool:
        """True unless the axis makes no move."""
        return bool(self._index)

    def take_over(self, other: _MoveOutcomes) -> None:
        """Take over the outcomes of the moves begun so far, which are the first ones of both."""
        shared = min(len(self._starts_s), len(other._starts_s))
        self._low_m[:shared] = other._low_m[:shared]
        self._high_m[:shared] = other._high_m[:shared]
        self._teeth[:shared] = other._teeth[:shared]
        self._slip_s[:shared] = other._slip_s[:shared]
        self._restless_s[:shared] = other._restless_s[:shared]
        self._watched_s = other._watched_s

    def begun(self, knots: Floats) -> NDArray[np.intp]:
        """Which of `knots` are the starts of moves."""
        return np.searchsorted(knots, self._starts_s[self._among(knots)])

    def watch(self, knots: Floats, lags: Floats, low: Floats, high: Floats) -> None:
        """Take in the lag at the starts among `knots` and its extremes between knots (m)."""
        if not len(self._starts_s):
            return
        self._teeth[:-1][self._among(knots)] = self._tooth(lags)
        move = np.searchsorted(self._starts_s, knots[:-1], side="right") - 1
        inside = (move >= 0) & (knots[:-1] < self._ends_s[move])
        np.minimum.at(self._low_m, move[inside], low[inside])
        np.maximum.at(self._high_m, move[inside], high[inside])
        home = self._teeth[move] * self._pitch_m
        reach = np.where(move >= 0, np.maximum(high - home, home - low), 0.0)
        away = np.flatnonzero(reach > self._pitch_m / 2)
        np.minimum.at(self._slip_s, move[away], knots[away])
        ringing = np.flatnonzero((reach > SETTLED_M) & (knots[1:] > self._ends_s[move]))
        np.maximum.at(self._restless_s, move[ringing], knots[ringing + 1])
        self._watched_s = float(knots[-1])

    def repeat(self, period_s: float, count: int, from_s: float, to_s: float) -> None:
        """Take the moves begun from `from_s` to `to_s` to go as those of the period before.

        So does the move under way at `from_s`, as that one period before it.
        """
        first, end = np.searchsorted(self._starts_s, [from_s, to_s]).tolist()
        length = (end - first) // count
        self._watched_s = to_s
        if not length:
            return
        to = np.arange(first - 1, end)
        rounds, place = np.divmod(to - to[0], length)
        of = to[0] - length + place
        later_s = (1 + rounds) * period_s
        for same in (self._low_m, self._high_m, self._teeth):
            same[to] = same[of]
        for times_s in (self._slip_s, self._restless_s):
            times_s[to] = times_s[of] + later_s

    def _among(self, knots: Floats) -> slice:
        """The moves that begin from the first knot on and before the last."""
        return slice(*np.searchsorted(self._starts_s, [knots[0], knots[-1]]))

    def slip_s(self, move: PlannedMove) -> float:
        return float(self._slip_s[self._index[id(move)]])

    def settling_s(self, move: PlannedMove) -> float:
        """Time (s) after the end of `move` from which the axis stays settled; NaN if it does not.

        As far as it has been watched, and before the next move.
        """
        i = self._index[id(move)]
        until_s = min([self._watched_s, *self._starts_s[i + 1 : i + 2]])
        if self._restless_s[i] >= until_s or until_s <= self._ends_s[i]:
            return math.nan
        return float(max(self._restless_s[i] - self._ends_s[i], 0.0))

    def finish(self, lag_m: float) -> None:
        self._teeth[-1] = self._tooth(np.array([lag_m]))[0]

    def of(self, move: PlannedMove) -> MoveOutcome:
        i = self._index[id(move)]
        lost = int(self._teeth[i + 1] - self._teeth[i])
        if self._low_m[i] > self._high_m[i]:
            return MoveOutcome(0.0, 1.0, lost, bool(lost))
        home = self._teeth[i] * self._pitch_m
        largest = float(max(self._high_m[i] - home, home - self._low_m[i]))
        quarter = self._pitch_m / 4
        margin = 1 - math.sin(self._wave_number * largest) if largest < quarter else 0.0
        return MoveOutcome(largest, margin, lost, bool(lost) or largest > 2 * quarter)

    def _tooth(self, lags: Floats) -> NDArray[np.int64]:
        return np.rint(lags / self._pitch_m).astype(np.int64)
