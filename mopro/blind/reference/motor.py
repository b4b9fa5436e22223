"""Nominal numbers of a machine, and what is hidden in it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Generator = np.random.Generator
# Effects by name with their parameters in SI, as in a machine file; one that is not given is off.
Hidden = Mapping[str, Mapping[str, float]]

INCH_M = 0.0254
# The current loop brings a current back to its setpoint within this time (assumed).
LOOP_S = 50e-6
STEEL_1_K = 11.35e-6
LVDT_HALF_M = 0.254


@dataclass(frozen=True)
class Nominal:
    """Two equal axes and their forcer, in SI; the defaults are from the thesis' tables."""

    pitch_m: float = 1.016e-3
    microsteps_per_pitch: float = 500.0
    mass_kg: float = 2.543
    force_N: float = 111.0
    damping_ratio: float = 0.03
    current_A: float = 4.0
    coil_ohm: float = 2.0
    coil_H: float = 2e-3
    air_C: float = 24.87
    specific_heat_J_kg_K: float = 883.0
    moving_current_A: float = 1.0
    side_m: float = 0.1778
    side_area_m2: float = 0.05148
    top_area_m2: float = 0.0316
    air_conductivity_W_m_K: float = 0.0263
    air_viscosity_m2_s: float = 1.589e-5
    prandtl: float = 0.707
    bearing_m_s: float = 4.719e-4 / 1.445e-5

    @property
    def wave_1_m(self) -> float:
        """k = 2π/p."""
        return 2 * math.pi / self.pitch_m

    @property
    def microstep_m(self) -> float:
        return self.pitch_m / self.microsteps_per_pitch

    @property
    def microsteps_per_inch(self) -> int:
        """Microsteps per inch as programs state them, rounded."""
        return round(INCH_M / self.microstep_m)

    @property
    def agility(self) -> float:
        """Largest acceleration (m/s²): force over mass."""
        return self.force_N / self.mass_kg

    @property
    def capacity_J_K(self) -> float:
        return self.mass_kg * self.specific_heat_J_kg_K


THESIS = Nominal()


def of(hidden: Hidden, effect: str, parameter: str, otherwise: float = 0.0) -> float:
    """The parameter of a hidden effect, or `otherwise` where that is off."""
    return float(hidden.get(effect, {}).get(parameter, otherwise))
