"""Temperature of the forcer under a program (chapter 3.1 with its errata), by SciPy's LSODA.

    m c_p dT/dt = P - h A (T - T_air) + hidden effects

P = 2 R I² for the two coil pairs of each axis and R I2² for each moving axis (eq. 3.12);
h is that of a flat plate (eq. 3.16, 3.17); the length in the Reynolds number is the length of
the path, at rest the side of the forcer. Conduction to the platen depends on the same path.
A move counts with its peak speed (eq. 3.18). Payloads are thermally insulated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.integrate import odeint

from mopro.blind.reference.listing import Stroke, Timeline
from mopro.blind.reference.motor import THESIS, Floats, Hidden, Nominal, of

_SIGMA = 5.670374419e-8
_KELVIN = 273.15
_AXES = (1, 2)
_APART_S = 1e-7


@dataclass(frozen=True)
class HeatInterval:
    """An interval of constant heating that ends at `until_s`."""

    until_s: float
    coil_W: float
    loss_W_K: float
    conduction_W_K: float
    platen_C: float
    core_W: float


def temperature_C(
    timeline: Timeline,
    times_s: Floats,
    hidden: Hidden,
    n: Nominal = THESIS,
) -> Floats:
    """Temperature of the forcer (°C) at ascending times (s); it starts at that of the air."""
    found, here_C, now_s, done = np.empty(len(times_s)), n.air_C, 0.0, 0
    for interval in heat_intervals(timeline, max(float(times_s[-1]), 0.0), hidden, n):
        last = int(np.searchsorted(times_s, interval.until_s, side="right"))
        inside = np.maximum(times_s[done:last], now_s)
        marks = np.concatenate(([now_s], inside, [interval.until_s]))
        curve = _curve(here_C, marks, interval, hidden, n)
        found[done:last] = curve[1:-1]
        here_C, now_s, done = float(curve[-1]), interval.until_s, last
    return found


def _curve(
    start_C: float,
    marks: Floats,
    interval: HeatInterval,
    hidden: Hidden,
    n: Nominal,
) -> Floats:
    """Temperature (°C) at ascending times; LSODA needs those that nearly coincide merged."""
    apart = np.concatenate(([True], np.diff(marks) > _APART_S))
    distinct = marks[apart]
    if len(distinct) == 1:
        return np.full(len(marks), start_C)
    copper = hidden.get("resistance_tempco", {})
    numbers = (
        interval.coil_W,
        copper.get("alpha", 0.0),
        copper.get("T0", n.air_C),
        interval.core_W,
        interval.loss_W_K,
        of(hidden, "ambient_drift", "r"),
        interval.conduction_W_K,
        interval.platen_C,
        of(hidden, "radiation", "eps") * (n.side_area_m2 + n.top_area_m2),
        n.air_C,
        n.capacity_J_K,
    )
    curve = odeint(_slope, start_C, distinct, args=numbers, rtol=1e-9, atol=1e-9, tfirst=True)
    found: Floats = curve[np.cumsum(apart) - 1, 0]
    return found


@njit(cache=True)
def _slope(  # type: ignore[no-untyped-def]
    t, y, coil_W, tempco, copper_C, core_W, loss, drift, conduction, platen_C, grey_m2, air_C,
    capacity_J_K,
):  # fmt: skip
    temperature, air = y[0], air_C + drift * t
    flow = coil_W * (1 + tempco * (temperature - copper_C)) + core_W
    flow -= loss * (temperature - air) + conduction * (temperature - platen_C)
    hot, cold = temperature + _KELVIN, air + _KELVIN
    flow -= grey_m2 * _SIGMA * (hot**4 - cold**4)
    return flow / capacity_J_K


def heat_intervals(
    timeline: Timeline,
    until_s: float,
    hidden: Hidden,
    n: Nominal = THESIS,
) -> list[HeatInterval]:
    """The intervals of constant heating from the start of the program to `until_s`."""
    until_s += 1e-6
    held = {axis: _held_times(timeline, axis, until_s, hidden) for axis in _AXES}
    marks = {until_s}
    for stroke in timeline.strokes:
        marks |= {stroke.start_s, stroke.start_s + stroke.duration_s}
    for times in held.values():
        marks.update(times.ravel().tolist())
    ends = sorted(mark for mark in marks if 0 < mark <= until_s)
    found, start_s, at = [], 0.0, 0
    moving: list[Stroke] = []
    for end in ends:
        middle = (start_s + end) / 2
        while at < len(timeline.strokes) and timeline.strokes[at].start_s < middle:
            moving.append(timeline.strokes[at])
            at += 1
        moving = [s for s in moving if s.start_s + s.duration_s > middle]
        shares = [_share(held[axis], middle, hidden) for axis in _AXES]
        found.append(_interval(end, moving, shares, hidden, n))
        start_s = end
    return found


def _interval(
    until_s: float,
    moving: list[Stroke],
    shares: list[float],
    hidden: Hidden,
    n: Nominal,
) -> HeatInterval:
    speeds = [s.peak_m_s for s in moving]
    paths_m = [abs(s.displacement_m) for s in moving]
    squares = [share**2 for share in shares]
    rest_W = 2 * n.coil_ohm * n.current_A**2 * sum(squares)
    moving_W = len(moving) * n.coil_ohm * n.moving_current_A**2 * max(squares)
    scale = 1 + of(hidden, "convection_scale", "e")
    platen = hidden.get("platen_conduction", {})
    core = hidden.get("speed_dependent_heat", {})
    steps_Hz = [speed / n.pitch_m for speed in speeds]
    return HeatInterval(
        until_s,
        rest_W + moving_W,
        scale * convection_W_K(math.hypot(*speeds), math.hypot(*paths_m) or n.side_m, n),
        platen.get("G", 0.0) + platen.get("g", 0.0) * math.hypot(*paths_m),
        platen.get("T_p", n.air_C),
        sum(core.get("kh", 0.0) * f + core.get("ke", 0.0) * f * f for f in steps_Hz),
    )


def convection_W_K(speed_m_s: float, length_m: float, n: Nominal = THESIS) -> float:
    """h A (W/K) of the sides and, with the flow of the air bearing, the top."""
    return (
        _film(speed_m_s, length_m, n) * n.side_area_m2
        + _film(speed_m_s + n.bearing_m_s, length_m, n) * n.top_area_m2
    )


def _film(air_m_s: float, length_m: float, n: Nominal) -> float:
    reynolds = air_m_s * length_m / n.air_viscosity_m2_s
    nusselt = 0.664 * math.sqrt(reynolds) * math.cbrt(n.prandtl)
    return nusselt * n.air_conductivity_W_m_K / n.side_m


def _held_times(timeline: Timeline, axis: int, until_s: float, hidden: Hidden) -> Floats:
    """Start and end (s) of each time with reduced current of an axis, shape (rests, 2)."""
    if "hold_current_reduction" not in hidden:
        return np.empty((0, 2))
    after_s = hidden["hold_current_reduction"]["t_h"]
    own = [s for s in timeline.strokes if s.axis == axis]
    starts = np.array([0.0, *(s.start_s + s.duration_s for s in own)])
    ends = np.array([*(s.start_s for s in own), until_s])
    long = ends - starts > after_s
    return np.column_stack((starts[long] + after_s, ends[long]))


def _share(held: Floats, when_s: float, hidden: Hidden) -> float:
    """Share of the current of an axis at a time."""
    at = int(np.searchsorted(held[:, 0], when_s)) - 1
    if at < 0 or when_s > held[at, 1]:
        return 1.0
    return float(hidden["hold_current_reduction"]["h"])
