"""Loss of whole pitches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.effects.search import Values, residual_m, step
from mopro.engine.candidate import RUN, Candidate, ResidualView, Role
from mopro.engine.candidate import Parameter as Fitted
from mopro.motion import PlannedMove

# Largest difference from a whole number of pitches, in pitches or as a share of the step.
_WHOLE_TOLERANCE = 0.25


class LostSteps(Effect):
    """The axis falls whole pitches behind, as after a stall, and stays there.

    x := x - n p at the share `at` of the axis' move number `move`; n counts pitches.
    The force has period p, so nothing else changes. Source: chapter 4.4, "the motor
    would simply stall"; the figures are assumed.
    """

    name = "lost_steps"
    domain = Domain.COMMAND
    parameters = (
        Parameter("n", "1", "ratio", 1.0, (-50, 50), -1000.0, 1000.0, "pitches lost", whole=True),
        Parameter(
            "move", "1", "ratio", 1.0, (1, 100), 1.0, 1e9,
            "in which of the axis' moves", null=1.0, whole=True,
        ),
        Parameter("at", "1", "ratio", 0.5, (0.0, 1.0), 0.0, 1.0, "share of that move", null=0.5),
    )  # fmt: skip

    def jumps(self, moves: list[PlannedMove], *p: float) -> list[tuple[float, float]]:
        index = int(p[1]) - 1
        if index >= len(moves):
            return []
        move = moves[index]
        return [(move.start_s + p[2] * move.profile.duration_s, p[0])]

    def forms(self, view: View) -> Iterator[Candidate]:
        """None for a logged command, which has no moves to count."""
        if any(run.program is None for run in view.runs):
            return
        numbers = (
            Fitted(name, "1", -1e9, 1e9, role=Role.SEARCHED) for name in ("n", "move", "at", RUN)
        )
        yield self.form(*numbers, flexible=True, find_starts=lambda fit: _steps(view, fit))


def _steps(view: View, fit: ResidualView) -> Iterator[Values]:
    """Starting values for lasting steps of whole pitches, in one run or in the same move of all.

    A run of fewer moves has no such move, and shows none.
    """
    steps: list[dict[str, float]] = []
    counts: list[int] = []
    begun, over = 0.0, 1.0
    for row, (run, reading) in view.positions().items():
        here = step(fit.residuals[row], residual_m(view, fit, row), reading.time_s)
        moves = [m for m in view.schedule(run).moves if reading.sensor.axis in m.axes]
        counts.append(len(moves))
        if here is None or not moves:
            continue
        before_s, after_s, height_m = here
        pitches = _whole_pitches(-height_m / view.machine.axis.pitch_m)
        if not pitches:
            continue
        index, share = _place(moves, (before_s + after_s) / 2)
        steps.append({"n": float(pitches), "move": index + 1.0, "at": share, RUN: float(run)})
        begun = max(begun, _share(moves[index], before_s))
        over = min(over, _share(moves[index], after_s))
    yield from steps
    alike = {(f["n"], f["move"]) for f in steps}
    able = sum(count >= own["move"] for own in steps[:1] for count in counts)
    if len(steps) > 1 and len(steps) == able and len(alike) == 1:
        # Each run bounds the time by two samples; their intersection is the narrowest.
        yield {**steps[0], "at": (begun + over) / 2, RUN: -1.0}


def _whole_pitches(pitches: float) -> int:
    """The whole number that `pitches` is close to, else 0."""
    whole = round(pitches)
    return whole if abs(pitches - whole) <= _WHOLE_TOLERANCE * max(1, abs(whole)) else 0


def _place(moves: Sequence[PlannedMove], time_s: float) -> tuple[int, float]:
    """Index of the move at `time_s`, and the share of its duration that has passed."""
    begun = [i for i, move in enumerate(moves) if move.start_s <= time_s]
    index = begun[-1] if begun else 0
    return index, _share(moves[index], time_s)


def _share(move: PlannedMove, time_s: float) -> float:
    """Share of the move's duration that has passed at `time_s`, 0 to 1."""
    return min(max((time_s - move.start_s) / move.profile.duration_s, 0.0), 1.0)
