"""Stage M: what lies between the true position and what an instrument shows."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from mopro.effects.base import Effect, Floats, Parameter, Scene, Stage

_STEEL_1_K = 11.35e-6
_LVDT_HALF_RANGE_M = 0.254
# From this many samples on, importing a compiler pays.
_LONG = 20_000


def _play(x: Floats, half: float, followed: Floats) -> None:
    """What is dragged along with `half` of play to either side, from the first place on."""
    at = x[0] if len(x) else 0.0
    for i in range(len(x)):
        at = min(max(at, x[i] - half), x[i] + half)
        followed[i] = at


@functools.cache
def _compiled_play() -> Callable[[Floats, float, Floats], None]:
    import numba

    compiled: Callable[[Floats, float, Floats], None] = numba.njit(cache=True, nogil=True)(_play)
    return compiled


class PitchScale(Effect):
    """The platen's pitch is not what it is said to be.

    x' = x (1 + e); e is a ratio. Source: assumed.
    """

    name = "pitch_scale"
    stage = Stage.MEASUREMENT
    families = ("scale",)
    parameters = (Parameter("e", "1", "ratio", 2e-4, (-5e-4, 5e-4), -0.1, 0.1, "relative excess"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x * (1 + p[0])


class PlatenExpansion(Effect):
    """The platen has grown with its temperature.

    x' = x (1 + alpha ΔT), ΔT = dT + share (T - T_air): dT in K is how much warmer than
    when it was made the platen is, `share` how much of the forcer's rise it takes (1 is
    the worst case of chapter 3.1.2); alpha in 1/K. Source: eq. 3.29, 3.53, 3.54.
    """

    name = "platen_expansion"
    stage = Stage.MEASUREMENT
    families = ("scale",)
    parameters = (
        Parameter(
            "dT", "K", "temperature difference", 20.0, (0.0, 40.0), -100.0, 100.0, "warmer by"
        ),
        Parameter("share", "1", "ratio", 0.0, (0.0, 1.0), 0.0, 1.0, "of the forcer's rise"),
        Parameter(
            "alpha", "1/K", "expansion", _STEEL_1_K, (9.9e-6, 12.8e-6), 0.0, 1e-4,
            "expansion of steel", null=_STEEL_1_K,
        ),
    )  # fmt: skip

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        warmer = p[0] + p[1] * (scene.temperature_C - scene.air_C)
        grown: Floats = x * (1 + p[2] * warmer)
        return grown


class Backlash(Effect):
    """The sensor's coupling has play.

    x' = x - B/2 sgn(direction of the last motion), B in m: a play that the motion
    crosses before the sensor follows, centred where it starts. Source: assumed.
    """

    name = "backlash"
    stage = Stage.MEASUREMENT
    parameters = (Parameter("B", "m", "length", 2e-5, (1e-6, 1e-4), 0.0, 0.01, "reversal step"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        followed = np.empty_like(x)
        play = _compiled_play() if len(x) >= _LONG else _play
        play(x, p[0] / 2, followed)
        return followed


class PeriodicError(Effect):
    """A cyclic error of the teeth or of the sensor's scale.

    x' = x + A sin(2πx/lambda + phi); A and lambda in m, phi in rad. Source: assumed.
    """

    name = "periodic_error"
    stage = Stage.MEASUREMENT
    parameters = (
        Parameter("A", "m", "length", 5e-6, (1e-6, 1e-4), 0.0, 0.01, "amplitude"),
        Parameter(
            "lambda", "m", "length", 1.016e-3, (1e-4, 0.1), 1e-6, 10.0, "period", null=1.016e-3
        ),
        Parameter("phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase"),
    )

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        ripple: Floats = x + p[0] * np.sin(2 * math.pi * x / p[1] + p[2])
        return ripple


class CrossAxisCoupling(Effect):
    """The sensor is not square to the other axis.

    y' = y + gamma x with x the other axis; gamma in rad. Source: assumed.
    """

    name = "cross_axis_coupling"
    stage = Stage.MEASUREMENT
    parameters = (Parameter("gamma", "rad", "angle", 3e-4, (-1e-3, 1e-3), -0.1, 0.1, "angle"),)

    def geometry(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x + p[0] * scene.other_m


class SensorGain(Effect):
    """The sensor's gain is off.

    x' = x (1 + g); g is a ratio. Source: appendix D; figures assumed.
    """

    name = "sensor_gain"
    stage = Stage.MEASUREMENT
    families = ("scale",)
    parameters = (Parameter("g", "1", "ratio", 2e-3, (-0.01, 0.01), -0.5, 0.5, "excess"),)

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x * (1 + p[0])


class SensorOffset(Effect):
    """The sensor's zero is off.

    x' = x + o, in m. Source: assumed.
    """

    name = "sensor_offset"
    stage = Stage.MEASUREMENT
    parameters = (Parameter("o", "m", "length", 1e-4, (-1e-3, 1e-3), -1.0, 1.0, "offset"),)

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        return x + p[0]


class SensorNonlinearity(Effect):
    """The sensor bends towards the ends of its range.

    x' = x + 2 half (c3 u³ + c5 u⁵), u = (x - mid)/half: c3 and c5 are shares of the full
    range 2 half, mid and half in m. Source: appendix D.1, "at the ends of the core
    travel, the linearity decreases"; 0.25 % of the range.
    """

    name = "sensor_nonlinearity"
    stage = Stage.MEASUREMENT
    parameters = (
        Parameter("c3", "1", "ratio", 2.5e-3, (-0.01, 0.01), -0.5, 0.5, "cubic, of full range"),
        Parameter("c5", "1", "ratio", 0.0, (-0.01, 0.01), -0.5, 0.5, "quintic, of full range"),
        Parameter("mid", "m", "length", 0.0, (-0.3, 0.3), -2.0, 2.0, "middle of the range"),
        Parameter(
            "half", "m", "length", _LVDT_HALF_RANGE_M, (0.01, 1.0), 1e-4, 10.0, "half the range",
            null=_LVDT_HALF_RANGE_M,
        ),
    )  # fmt: skip

    def reading(self, x: Floats, scene: Scene, *p: float) -> Floats:
        c3, c5, mid, half = p
        u = (x - mid) / half
        square = u * u
        bent: Floats = x + 2 * half * u * square * (c3 + c5 * square)
        return bent


class SensorBandwidth(Effect):
    """The sensor follows with a first-order lag.

    x' + (1/(2π f_c)) dx'/dt = x, f_c in Hz. Source: carrier filters of DC-LVDTs;
    figures assumed.
    """

    name = "sensor_bandwidth"
    stage = Stage.MEASUREMENT
    families = ("delay",)
    parameters = (
        Parameter("f_c", "Hz", "frequency", 200.0, (50.0, 1000.0), 0.01, 1e9, "corner", null=1e9),
    )

    def bandwidth_s(self, quantity: str, *p: float) -> float:
        return 1 / (2 * math.pi * p[0]) if quantity == "position" else 0.0


class TriggerDelay(Effect):
    """The data begin late against the program's clock.

    x'(t) = x(t - t_d), t_d in s. Source: assumed.
    """

    name = "trigger_delay"
    stage = Stage.MEASUREMENT
    families = ("delay",)
    parameters = (Parameter("t_d", "s", "time", 2e-3, (0.0, 0.01), -1.0, 1.0, "delay"),)

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        return time_s - p[0]


class SampleClock(Effect):
    """The sampling clock runs slow, so that samples are taken later than labelled.

    x'(t) = x(t (1 + e)); e is a ratio. Source: assumed.
    """

    name = "sample_clock"
    stage = Stage.MEASUREMENT
    families = ("clock",)
    parameters = (Parameter("e", "1", "ratio", 5e-4, (-5e-3, 5e-3), -0.1, 0.1, "relative excess"),)

    def sampled_at(self, time_s: Floats, *p: float) -> Floats:
        return time_s * (1 + p[0])


class Hum(Effect):
    """The mains get into the sensor's line.

    x' = x + Σ A_n sin(2π n f t + phi_n): A in m for the mains frequency f (Hz), A2 and A3
    in m for its second (a rectifier's) and its third harmonic (a transformer's). On the
    thesis's LVDT 1 mV is 25.4 µm. Source: assumed.
    """

    name = "hum"
    stage = Stage.MEASUREMENT
    parameters = (
        Parameter("A", "m", "length", 1e-4, (2.54e-5, 5.08e-4), 0.0, 0.1, "amplitude"),
        Parameter("f", "Hz", "frequency", 60.0, (50.0, 60.0), 1.0, 1000.0, "mains", null=60.0),
        Parameter("phi", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "phase"),
        Parameter("A3", "m", "length", 0.0, (0.0, 2e-4), 0.0, 0.1, "third harmonic's amplitude"),
        Parameter("phi3", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "its phase"),
        Parameter("A2", "m", "length", 0.0, (0.0, 2e-4), 0.0, 0.1, "second harmonic's amplitude"),
        Parameter("phi2", "rad", "angle", 0.0, (-math.pi, math.pi), -7.0, 7.0, "its phase"),
    )

    def electronics(self, x: Floats, time_s: Floats, *p: float) -> Floats:
        amplitude, mains, phi, third, phi3, second, phi2 = p
        angle = 2 * math.pi * mains * time_s
        noisy: Floats = x + amplitude * np.sin(angle + phi)
        noisy += second * np.sin(2 * angle + phi2) + third * np.sin(3 * angle + phi3)
        return noisy
