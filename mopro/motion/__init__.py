"""From IR to a command in time: closed-form profiles and the schedule made of them."""

from mopro.motion import assumed_statements as assumed_statements
from mopro.motion.planner import LONGEST_RUN_S, plan
from mopro.motion.profile import Profile, Segment, Shape, plan_profile
from mopro.motion.schedule import PlannedMove, Schedule, Stopping, Stroke
from mopro.motion.survey import Lap, Survey, survey

__all__ = [
    "LONGEST_RUN_S",
    "Lap",
    "PlannedMove",
    "Profile",
    "Schedule",
    "Segment",
    "Shape",
    "Stopping",
    "Stroke",
    "Survey",
    "plan",
    "plan_profile",
    "survey",
]
