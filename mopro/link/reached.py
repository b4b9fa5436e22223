"""Time in the schedule at which a run ended early, by the controller's last status."""

from __future__ import annotations

import math
from itertools import pairwise

from mopro.link.watch import Watch
from mopro.motion import Schedule


def reached_s(schedule: Schedule, watch: Watch) -> float:
    """The time (s) in `schedule` at which a run was left, for the moves that nobody tells of.

    Of the times at which the lines are under way and completed that the controller told last,
    that nearest to when it was last seen running.
    """
    if watch.state == "done":
        return schedule.duration_s
    near_s = watch.running_s * watch.speed
    told = watch.line(watch.statement), watch.line(watch.completed)
    ends_s = (t for m in schedule.moves for t in (m.start_s, m.end_s))
    times_s = sorted({*ends_s, *(t for t, _ in schedule.activity)})
    fitting = (
        min(max(near_s, begin_s), math.nextafter(end_s, -math.inf))
        for begin_s, end_s in pairwise([*times_s, math.inf])
        if schedule.lines_at(begin_s) == told
    )
    return min(fitting, key=lambda at_s: abs(at_s - near_s), default=near_s)
