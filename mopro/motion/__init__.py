"""From IR to a command in time: closed-form profiles and the schedule made of them."""

from mopro.motion.profile import Profile, Segment, Shape, plan_profile
from mopro.motion.schedule import PlannedMove, Schedule, Stroke, plan

__all__ = [
    "PlannedMove",
    "Profile",
    "Schedule",
    "Segment",
    "Shape",
    "Stroke",
    "plan",
    "plan_profile",
]
