"""A controller whose clock is off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from mopro.effects.base import Domain, Effect, Parameter, View
from mopro.engine.candidate import Candidate
from mopro.motion import PlannedMove, Schedule
from mopro.motion.track import Track


class ControllerClock(Effect):
    """The controller's clock runs fast.

    x_c'(t) = x_c(t (1 + e)); e is a ratio. Motions and waits shorten alike. Source:
    assumed; crystals are within 100 ppm.
    """

    name = "controller_clock"
    domain = Domain.COMMAND
    families = ("clock",)
    parameters = (
        Parameter("e", "1", "ratio", 5e-4, (-5e-3, 5e-3), -0.1, 0.1, "relative excess of rate"),
    )

    def schedule(self, schedule: Schedule, *p: float) -> Schedule:
        rate = 1 + p[0]
        return replace(
            schedule,
            duration_s=schedule.duration_s / rate,
            moves=tuple(_faster_move(move, rate) for move in schedule.moves),
            tracks={n: _faster_track(track, rate) for n, track in schedule.tracks.items()},
            activity=[(t / rate, line) for t, line in schedule.activity],
        )

    def forms(self, view: View) -> Iterator[Candidate]:
        yield self.form(self.fitted("e", 3e-4))


def _faster_move(move: PlannedMove, rate: float) -> PlannedMove:
    profile = replace(
        move.profile,
        velocity=move.profile.velocity * rate,
        acceleration=move.profile.acceleration * rate**2,
        peak_velocity=move.profile.peak_velocity * rate,
        ramp_s=move.profile.ramp_s / rate,
        cruise_s=move.profile.cruise_s / rate,
    )
    return replace(move, profile=profile, start_s=move.start_s / rate)


def _faster_track(track: Track, rate: float) -> Track:
    faster = Track()
    faster.add(
        replace(
            s,
            start_s=s.start_s / rate,
            end_s=s.end_s / rate,
            anchor_s=s.anchor_s / rate,
            v=s.v * rate,
            a=s.a * rate**2,
            j=s.j * rate**3,
        )
        for s in track.segments
    )
    return faster
