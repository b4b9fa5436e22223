"""How far an axis can swing about its tooth, bounded from above by its energy.

Seen from the command, the lag e = x_c - x of an axis obeys

    ë = a_c - A sin(k e) - (c_s/m) ė,    A = F0/m

with a_c the commanded acceleration: a pendulum under a steady push. With θ = k e and
α = a_c/A its energy h = θ'²/2 + 1 - cos θ - α θ (in units of A/k) cannot grow while α
stays; at a corner of the command it changes by at most the change of α times the
farthest θ. While h stays below the lower crest of the well, the axis keeps its tooth.
A ramp of α is taken as a staircase of small corners.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

_RAMP_STEPS = 8
_BISECTIONS = 20
# A swing this small has died down: below a hundredth of a radian of the tooth's cycle.
_STILL = 5e-5
# Averaged over a cycle, a swing of up to 0.8 of the crest loses at least this share of
# what a small one does (0.78 at 135 degrees, from the pendulum's action).
_LOSS_SHARE = 0.75
_LARGE = 0.8
# The staircase of microsteps shakes the axis by this much at its worst.
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
    """The largest swing that an axis can be in; `lost` once it may have left its tooth."""

    def __init__(self, pendulum: Pendulum) -> None:
        self._pendulum = pendulum
        self._push = 0.0
        self._energy = 0.0
        self.lost = False
        self.largest = 0.0

    @property
    def still(self) -> bool:
        return not self.lost and self._push == 0 and self._energy < _STILL

    def push(self, acceleration_m_s2: float, end_m_s2: float, duration_s: float) -> None:
        """Live through one segment of the command, whose acceleration goes from one to another."""
        start = acceleration_m_s2 / self._pendulum.pull_out_m_s2
        end = end_m_s2 / self._pendulum.pull_out_m_s2
        self._corner(start)
        if start == end:
            self._decay(duration_s)
            return
        for step in range(1, _RAMP_STEPS + 1):
            self._corner(start + (end - start) * step / _RAMP_STEPS)

    def _corner(self, push: float) -> None:
        if self.lost:
            return
        if abs(push) >= 1:
            self.lost = True
            return
        if push != self._push:
            low, high = self._range()
            change = self._push - push
            floor = _bottom(self._push) + self._energy
            self._energy = floor + max(change * low, change * high) - _bottom(push)
            self._push = push
        if self._energy >= _crest(self._push) - _bottom(self._push):
            self.lost = True
            return
        low, high = self._range()
        self.largest = max(self.largest, high + _MICROSTEP_SWING, _MICROSTEP_SWING - low)

    def _decay(self, duration_s: float) -> None:
        """Damping, with one period off in which its share may be small."""
        if self.lost or self._energy > _LARGE * (_crest(self._push) - _bottom(self._push)):
            return
        losing_s = max(0.0, duration_s - self._pendulum.period_s)
        self._energy *= math.exp(-_LOSS_SHARE * self._pendulum.damping_1_s * losing_s)

    def _range(self) -> tuple[float, float]:
        """The least and the greatest θ that the energy allows."""
        return _range(self._push, _three_digits_up(self._energy))


@lru_cache(maxsize=65536)
def _range(push: float, energy: float) -> tuple[float, float]:
    """The least and the greatest θ with `energy` above the bottom of the well."""
    rest = math.asin(push)
    if energy <= 0:
        return rest, rest
    level = _bottom(push) + energy
    low, high = -math.pi - rest, math.pi - rest
    return _where(push, level, rest, low), _where(push, level, rest, high)


def _three_digits_up(energy: float) -> float:
    """No less than `energy`, and one of few values, so that what follows is known already."""
    if energy <= _STILL:
        return 0.0 if energy <= 0 else _STILL
    unit = 10.0 ** (math.floor(math.log10(energy)) - 2)
    return math.ceil(energy / unit) * unit


@lru_cache(maxsize=65536)
def _bottom(push: float) -> float:
    return _potential(push, math.asin(push))


@lru_cache(maxsize=65536)
def _crest(push: float) -> float:
    """The lower of the two crests: on the side to which the push goes."""
    return _potential(abs(push), math.pi - math.asin(abs(push)))


def _potential(push: float, theta: float) -> float:
    return 1 - math.cos(theta) - push * theta


def _where(push: float, level: float, inside: float, outside: float) -> float:
    """The θ between the bottom and a crest at which the potential is `level`."""
    for _ in range(_BISECTIONS):
        middle = (inside + outside) / 2
        if _potential(push, middle) < level:
            inside = middle
        else:
            outside = middle
    return outside


def greatest_step_m_s2(pull_out_m_s2: float, margin: float) -> float:
    """The acceleration whose sudden start leaves `margin` of the force, undamped, from rest.

    From the energy: (a/A) θ = 1 - cos θ at the turning point θ = asin(1 - margin).
    """
    theta = math.asin(1 - margin)
    return pull_out_m_s2 * (1 - math.cos(theta)) / theta
