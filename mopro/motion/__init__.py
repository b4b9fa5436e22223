"""From IR to a command in time: closed-form profiles and the schedule made of them."""

from mopro.motion import assumed as assumed
from mopro.motion.planner import plan
from mopro.motion.profile import Profile, Segment, Shape, plan_profile
from mopro.motion.schedule import PlannedMove, Schedule, Stroke

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
