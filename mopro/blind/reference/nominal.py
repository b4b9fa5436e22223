"""The nominal axis in numbers: SI, from the tables of the source and of the plant."""

from __future__ import annotations

import math

INCH_M = 0.0254
PITCH_M = 1.016e-3
WAVE_1_M = 2 * math.pi / PITCH_M
MICROSTEPS_PER_PITCH = 500
MICROSTEP_M = PITCH_M / MICROSTEPS_PER_PITCH
MASS_KG = 2.543
FORCE_N = 111.0
DAMPING_RATIO = 0.03
CURRENT_A = 4.0
COIL_OHM = 2.0
COIL_H = 2e-3
# The current loop brings a current back to its setpoint within this time (assumed).
LOOP_S = 50e-6

AIR_C = 24.87
SPECIFIC_HEAT_J_KG_K = 883.0
MOVING_CURRENT_A = 1.0
SIDE_M = 0.1778
SIDE_AREA_M2 = 0.05148
TOP_AREA_M2 = 0.0316
AIR_CONDUCTIVITY_W_M_K = 0.0263
AIR_VISCOSITY_M2_S = 1.589e-5
PRANDTL = 0.707
BEARING_M_S = 4.719e-4 / 1.445e-5
STEEL_1_K = 11.35e-6
LVDT_HALF_M = 0.254
