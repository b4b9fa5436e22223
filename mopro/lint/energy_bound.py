"""Upper bound, from energy, on the oscillation of an axis about its tooth.

Seen from the command, the lag e = x_c - x of an axis obeys

    ë = a_c - A sin(k e) - (c_s/m) ė,    A = F0/m

with a_c the commanded acceleration: a pendulum under a constant torque. With θ = k e and
α = a_c/A its energy h = θ'²/2 + 1 - cos θ - α θ (in units of A/k) cannot grow while α is
constant; a step of α changes it by at most that step times the largest |θ|. While h is
below the lower maximum of the potential, the axis does not slip. A ramp of α is taken as
a staircase of small steps.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

_RAMP_STEPS = 8
_BISECTIONS = 20
# Energy below which the axis is at rest: an amplitude of a hundredth of a radian in θ.
_REST_ENERGY = 5e-5
# Damping of a large oscillation as a share of that of a small one, averaged over a cycle: at
# least this up to _MOST_DAMPED of the maximum (0.78 at 135 degrees, from the pendulum's action).
_LOSS_SHARE = 0.75
_MOST_DAMPED = 0.8
# Largest oscillation (rad in θ) that the staircase of microsteps excites.
_MICROSTEP_SWING = 0.02


class Pendulum(NamedTuple):
    """The constants of one axis: A in m/s², c_s/m in 1/s, k in 1/m."""

    pull_out_m_s2: float
    damping_1_s: float
    wave_number_1_m: float

    @property
    def period_s(self) -> float:
        return 2 * math.pi / math.sqrt(self.wave_number_1_m * self.pull_out_m_s2)


class EnergyBound:
    """Bound on the oscillation of one axis; `lost` once it may have left its tooth."""

    def __init__(self, pendulum: Pendulum) -> None:
        self._pull_out_m_s2 = pendulum.pull_out_m_s2
        self._period_s = pendulum.period_s
        self._loss_1_s = _LOSS_SHARE * pendulum.damping_1_s
        self._push = 0.0
        self._energy = 0.0
        self._bottom, self._height = _well(0.0)
        self.lost = False
        self.largest = 0.0

    @property
    def still(self) -> bool:
        return not self.lost and self._push == 0 and self._energy < _REST_ENERGY

    def push(self, acceleration_m_s2: float, end_m_s2: float, duration_s: float) -> None:
        """Apply a segment of the command, over which the acceleration changes linearly."""
        start = acceleration_m_s2 / self._pull_out_m_s2
        end = end_m_s2 / self._pull_out_m_s2
        self._corner(start)
        if start == end:
            self._decay(duration_s)
            return
        for step in range(1, _RAMP_STEPS + 1):
            self._corner(start + (end - start) * step / _RAMP_STEPS)

    def rest(self, duration_s: float) -> None:
        """End the acceleration, and let the axis rest."""
        self._change(0.0)
        self._decay(duration_s)

    def _corner(self, push: float) -> None:
        self._change(push)
        if not self.lost:
            low, high = _range(push, _three_digits_up(self._energy))
            self.largest = max(self.largest, high + _MICROSTEP_SWING, _MICROSTEP_SWING - low)

    def _change(self, push: float) -> None:
        if self.lost:
            return
        if abs(push) >= 1:
            self.lost = True
            return
        if push != self._push:
            low, high = _range(self._push, _three_digits_up(self._energy))
            change = self._push - push
            floor = self._bottom + self._energy
            self._bottom, self._height = _well(push)
            self._energy = floor + max(change * low, change * high) - self._bottom
            self._push = push
        if self._energy >= self._height:
            self.lost = True

    def _decay(self, duration_s: float) -> None:
        """Apply damping, except over one period, in which it may be small."""
        if self.lost or self._energy > _MOST_DAMPED * self._height:
            return
        losing_s = duration_s - self._period_s
        if losing_s > 0:
            self._energy *= math.exp(-self._loss_1_s * losing_s)


@lru_cache(maxsize=65536)
def _range(push: float, energy: float) -> tuple[float, float]:
    """Least and greatest θ (rad) with `energy` above the minimum of the potential."""
    rest = math.asin(push)
    if energy <= 0:
        return rest, rest
    level = _well(push)[0] + energy
    low, high = -math.pi - rest, math.pi - rest
    return _theta_at(push, level, rest, low), _theta_at(push, level, rest, high)


def _three_digits_up(energy: float) -> float:
    """`energy` rounded up to three digits, so that results are found in the caches."""
    if energy <= _REST_ENERGY:
        return 0.0 if energy <= 0 else _REST_ENERGY
    unit = 10.0 ** (math.floor(math.log10(energy)) - 2)
    return math.ceil(energy / unit) * unit


@lru_cache(maxsize=65536)
def _well(push: float) -> tuple[float, float]:
    """The minimum of the potential, and how far above it the lower of the two maxima is.

    That one is on the side to which the acceleration pushes.
    """
    bottom = _potential(push, math.asin(push))
    return bottom, _potential(abs(push), math.pi - math.asin(abs(push))) - bottom


def _potential(push: float, theta: float) -> float:
    return 1 - math.cos(theta) - push * theta


def _theta_at(push: float, level: float, inside: float, outside: float) -> float:
    """θ between the minimum (`inside`) and a maximum (`outside`) where the potential is `level`."""
    for _ in range(_BISECTIONS):
        middle = (inside + outside) / 2
        if _potential(push, middle) < level:
            inside = middle
        else:
            outside = middle
    return outside


def greatest_step_m_s2(pull_out_m_s2: float, margin: float) -> float:
    """Largest step of acceleration (m/s²) from rest that leaves `margin` of the force, undamped.

    From the energy: (a/A) θ = 1 - cos θ at the turning point θ = asin(1 - margin).
    """
    theta = math.asin(1 - margin)
    return pull_out_m_s2 * (1 - math.cos(theta)) / theta
