"""Labels of each sample: source line, phase, direction and move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mopro.experiment.sawyer.trials import Floats, Reading
from mopro.motion import Schedule, Segment
from mopro.plant import CommandTable
from mopro.program import AXES

ACCELERATE, CRUISE, DECELERATE, SETTLE, DWELL = PHASES = (
    "accelerate", "cruise", "decelerate", "settle", "dwell",
)  # fmt: skip
# An oscillation that decays at 15.6 1/s is then below a hundredth of its amplitude.
SETTLE_S = 0.3
# Share of the move's largest acceleration below which the axis cruises; a spline through a
# log is never quite straight.
_CRUISE_PLANNED, _CRUISE_LOGGED = 1e-9, 0.05


@dataclass(frozen=True)
class Labels:
    """One element a sample, for one axis.

    `line` is the source line (of the move while the axis moves or settles, else the one
    that runs; 0 for a logged command), `phase` one of PHASES, `direction` the sign of the
    present or last motion (0 before the first). `move` numbers the fold in which the sample
    is held out: from the start of a move to the start of the next; samples before the first
    move belong to its fold. The command is in m, m/s and m/s².
    """

    line: NDArray[np.int32]
    phase: NDArray[np.str_]
    direction: NDArray[np.int8]
    move: NDArray[np.int64]
    command_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats

    def __len__(self) -> int:
        return len(self.line)


def labels_of(reading: Reading, schedule: Schedule, microstep_m: float) -> Labels:
    """The labels of a reading's samples; for a temperature those of the axis that moves most."""
    axis = reading.sensor.axis
    if not reading.sensor.quantity.of_axis:
        axis = max(AXES, key=lambda n: sum(n in move.axes for move in schedule.moves))
    return labels(schedule, axis, reading.time_s, microstep_m)


def labels(
    schedule: Schedule,
    axis: int,
    time_s: Floats,
    microstep_m: float,
    settle_s: float = SETTLE_S,
) -> Labels:
    """The labels of samples at `time_s` on `axis`, whose moves are those of `schedule`."""
    u, v, a = (microstep_m * x for x in _state(schedule, axis, time_s))
    moves = sorted(
        ((m, s) for m in schedule.moves for s in m.strokes if s.axis == axis and s.length_u),
        key=lambda pair: pair[0].start_s,
    )
    starts = np.array([move.start_s for move, _ in moves])
    ends = np.array([move.end_s for move, _ in moves])
    lines = np.array([move.span.line for move, _ in moves], dtype=np.int32)
    directions = np.array([np.sign(stroke.length_u) for _, stroke in moves], dtype=np.int8)
    running = _running_line(schedule, time_s)
    steady = _CRUISE_PLANNED if schedule.program.ops else _CRUISE_LOGGED
    begun = np.searchsorted(starts, time_s, side="right") - 1
    at = np.maximum(begun, 0)
    if not len(moves):
        still = np.zeros(len(time_s))
        dwell = np.full(len(time_s), DWELL)
        return Labels(running, dwell, still.astype(np.int8), at, u, v, a)
    moving = (begun >= 0) & (time_s < ends[at])
    hardest = _hardest(schedule, axis, starts, microstep_m)
    settling = (begun >= 0) & ~moving & (time_s < ends[at] + settle_s)
    return Labels(
        line=np.where(moving | settling, lines[at], running).astype(np.int32),
        phase=_phases(moving, settling, v, a, steady * hardest[at]),
        direction=np.where(begun >= 0, directions[at], 0).astype(np.int8),
        move=at,
        command_m=u,
        velocity_m_s=v,
        acceleration_m_s2=a,
    )


def _state(schedule: Schedule, axis: int, time_s: Floats) -> tuple[Floats, Floats, Floats]:
    """Position, velocity and acceleration of the command, in microsteps."""
    table = CommandTable(schedule.tracks[axis])
    anchor, x, v, a, j = table.coefficients[:, table.rows_at(np.maximum(time_s, 0.0))]
    tau = time_s - anchor
    return x + tau * (v + tau * (a / 2 + tau * j / 6)), v + tau * (a + tau * j / 2), a + tau * j


def _hardest(schedule: Schedule, axis: int, starts: Floats, microstep_m: float) -> Floats:
    """The largest acceleration (m/s²) of each move."""
    segments = schedule.tracks[axis].segments
    of = np.searchsorted(starts, [s.start_s for s in segments], side="right") - 1
    hardest = np.zeros(len(starts))
    rates = [max(abs(s.state(t).acceleration) for t in _ends(s, schedule)) for s in segments]
    inside = of >= 0
    np.maximum.at(hardest, of[inside], np.array(rates)[inside])
    return hardest * microstep_m


def _ends(segment: Segment, schedule: Schedule) -> tuple[float, float]:
    return segment.start_s, min(segment.end_s, schedule.duration_s)


def _phases(
    moving: NDArray[np.bool_],
    settling: NDArray[np.bool_],
    v: Floats,
    a: Floats,
    least: Floats,
) -> NDArray[np.str_]:
    steady = np.abs(a) <= least
    return np.select(
        [moving & steady, moving & (v * a < 0), moving, settling],
        [CRUISE, DECELERATE, ACCELERATE, SETTLE],
        DWELL,
    )


def _running_line(schedule: Schedule, time_s: Floats) -> NDArray[np.int32]:
    """Source line that the controller executes at each time; 0 for a logged command."""
    if not schedule.activity:
        first = schedule.program.ops[0].span.line if schedule.program.ops else 0
        return np.full(len(time_s), first, dtype=np.int32)
    starts, lines = zip(*schedule.activity, strict=True)
    at = np.searchsorted(np.array(starts), time_s, side="right") - 1
    return np.array(lines, dtype=np.int32)[np.maximum(at, 0)]
