"""Invariants of velocity profiles of any shape."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from itertools import pairwise

from mopro.motion import Profile
from mopro.motion.profile import State

# Rounding of a few operations on numbers of the profile's own size, and of a time.
_ROUNDING = 1e-9
_TIME_ROUNDING = 4 * sys.float_info.epsilon


def check_profile(profile: Profile, fractions: Iterable[float] = (0.1, 0.37, 0.5, 0.81)) -> None:
    """Raise AssertionError naming the invariant that `profile` breaks.

    A profile ends exactly on its target and at rest, exceeds neither its velocity nor its
    acceleration nor its peak, is continuous where its segments join, and is symmetric in time.
    `fractions` are the times at which this is checked, as parts of the duration.
    """
    end = profile.state(profile.duration_s)
    _hold(end.position == profile.distance, "does not end on its target")
    _hold(end.velocity == 0, "does not end at rest")
    _hold(profile.state(0.0).position == 0, "does not begin at 0")
    segments = profile.segments()
    for before, after in pairwise(segments):
        _hold(before.end_s == after.start_s, "has a gap in time")
        left, right = before.state(before.end_s), after.state(after.start_s)
        _hold(_close(left.position, right.position, profile.distance), "jumps in position")
        _hold(_same_velocity(profile, left, right), "jumps in velocity")
    for fraction in fractions:
        _check_at(profile, fraction * profile.duration_s)


def _check_at(profile: Profile, t: float) -> None:
    state, mirrored = profile.state(t), profile.state(profile.duration_s - t)
    v_most, a_most = profile.velocity, profile.acceleration
    _hold(-_ROUNDING * v_most <= state.velocity <= v_most * (1 + _ROUNDING), "exceeds its velocity")
    _hold(state.velocity <= profile.peak_velocity * (1 + _ROUNDING), "exceeds its peak velocity")
    _hold(abs(state.acceleration) <= a_most * (1 + _ROUNDING), "exceeds its acceleration")
    whole = state.position + mirrored.position
    _hold(_close(whole, profile.distance, profile.distance), "is not symmetric in position")
    _hold(_same_velocity(profile, state, mirrored), "is not symmetric in velocity")


def _same_velocity(profile: Profile, one: State, other: State) -> bool:
    rounding = profile.acceleration * profile.duration_s * _TIME_ROUNDING
    rounding += _ROUNDING * profile.peak_velocity
    return abs(one.velocity - other.velocity) <= rounding


def _close(a: float, b: float, scale: float) -> bool:
    return math.isclose(a, b, rel_tol=0, abs_tol=_ROUNDING * max(abs(scale), abs(a)))


def _hold(holds: bool, broken: str) -> None:
    if not holds:
        raise AssertionError(f"the profile {broken}")
