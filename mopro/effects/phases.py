"""Stage D: what the drive does to the phase currents.

Currents are counted in units of the set current I. The nominal setpoints are
i_a = cos θ, i_b = sin θ with θ = k x_c.
"""

from __future__ import annotations

import math

from mopro.effects.base import Effect, Parameter, Stage


class PhaseGainImbalance(Effect):
    """The two phases' gains differ.

    i_a' = i_a (1 + eps/2), i_b' = i_b (1 - eps/2); eps is a ratio. At low speed
    Δx = -eps/(2k) sin 2θ. Source: assumed.
    """

    name = "phase_gain_imbalance"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("eps", "1", "ratio", 0.04, (-0.1, 0.1), -1.0, 1.0, "relative difference"),
    )

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, eps: float) -> tuple[float, float]:
        return ia * (1.0 + eps / 2.0), ib * (1.0 - eps / 2.0)


class QuadratureError(Effect):
    """The phases are not a quarter turn apart.

    i_b' = sin(θ + phi), phi in rad. At low speed Δx = phi/(2k) (1 + cos 2θ) for small
    phi. Source: assumed.
    """

    name = "quadrature_error"
    stage = Stage.DYNAMICS
    parameters = (Parameter("phi", "rad", "angle", 0.035, (-0.0873, 0.0873), -1.0, 1.0, "angle"),)

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, phi: float) -> tuple[float, float]:
        return ia, ib + math.sin(theta + phi) - math.sin(theta)


class PhaseCurrentOffset(Effect):
    """The phase currents have an offset.

    i_a' = i_a + o_a, i_b' = i_b + o_b, in units of I. At low speed
    Δx = (o_b cos θ - o_a sin θ)/k. Source: assumed.
    """

    name = "phase_current_offset"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("o_a", "1", "ratio", 0.02, (-0.05, 0.05), -1.0, 1.0, "of phase a over I"),
        Parameter("o_b", "1", "ratio", 0.0, (-0.05, 0.05), -1.0, 1.0, "of phase b over I"),
    )

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, oa: float, ob: float) -> tuple[float, float]:
        return ia + oa, ib + ob


class CurrentThirdHarmonic(Effect):
    """The phase currents are no pure sines.

    i_b' = i_b + s sin 3θ, and i_a' = i_a - s cos 3θ, the same shape a quarter turn
    earlier; s is a ratio. At low speed Δx = s/k sin 4θ. Source: assumed.
    """

    name = "current_third_harmonic"
    stage = Stage.DYNAMICS
    parameters = (Parameter("s", "1", "ratio", 0.02, (-0.05, 0.05), -1.0, 1.0, "over I"),)

    @staticmethod
    def setpoint(theta: float, ia: float, ib: float, s: float) -> tuple[float, float]:
        return ia - s * math.cos(3.0 * theta), ib + s * math.sin(3.0 * theta)


class CurrentLoopLag(Effect):
    """Each phase current follows its setpoint with a first-order lag.

    tau di/dt = i_set - i, tau in s. At a steady speed ω = k ẋ: amplitude
    1/√(1 + ω² tau²) and angle atan(ω tau), so Δx = -atan(ω tau)/k. Source: assumed.
    """

    name = "current_loop_lag"
    stage = Stage.DYNAMICS
    families = ("delay",)
    parameters = (Parameter("tau", "s", "time", 1e-4, (2e-5, 5e-4), 0.0, 0.01, "time constant"),)
    current_loop = "lag"


class VoltageSaturation(Effect):
    """The drive runs out of voltage: the full electrical model of each phase.

    v_a = R i_a + L di_a/dt - Kf ẋ sin kx, v_b = R i_b + L di_b/dt + Kf ẋ cos kx, with
    Kf = F0/I and |v| <= Vb (V). The current loop asks for what keeps the current on its
    setpoint, and brings it back within 50 µs, as long as Vb suffices. Source: R is eq.
    3.45; L and supply are assumed.
    """

    name = "voltage_saturation"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("Vb", "V", "voltage", 75.0, (40.0, 150.0), 1.0, 1e6, "supply", null=1e6),
    )
    current_loop = "voltage"


class HoldCurrentReduction(Effect):
    """The drive lowers the current of an axis that has rested for a while.

    I' = h I from t_h (s) after the command has come to rest until it moves again; h is a
    ratio. The coils heat by h² then. Source: common practice; figures assumed.
    """

    name = "hold_current_reduction"
    stage = Stage.DYNAMICS
    parameters = (
        Parameter("h", "1", "ratio", 0.5, (0.3, 0.75), 0.0, 1.0, "share of current", null=1.0),
        Parameter("t_h", "s", "time", 0.5, (0.05, 5.0), 0.0, 3600.0, "time at rest", null=0.5),
    )

    def hold(self, *p: float) -> tuple[float, float]:
        return p[1], p[0]
