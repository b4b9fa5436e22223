"""Sizes of units in SI, written here a second time; a count is its own, temperatures are in °C."""

import numpy as np

TURN = 2 * np.pi
# Unit -> units of the same kind, with their sizes in SI.
GROUPS = (
    {"mm": 1e-3, "um": 1e-6, "m": 1.0, "cm": 1e-2, "in": 0.0254, "mil": 25.4e-6},
    {"deg": TURN / 360, "rad": 1.0, "mrad": 1e-3, "rev": TURN, "arcmin": TURN / 21_600},
    {"m/s": 1.0, "mm/s": 1e-3, "in/s": 0.0254, "um/s": 1e-6},
    {"rad/s": 1.0, "rpm": TURN / 60, "deg/s": TURN / 360, "rev/s": TURN},
    {"N": 1.0, "mN": 1e-3, "kN": 1e3, "lbf": 4.4482216152605},
    {"Nm": 1.0, "mNm": 1e-3},
    {"A": 1.0, "mA": 1e-3},
    {"V": 1.0, "mV": 1e-3},
    {"W": 1.0, "mW": 1e-3, "kW": 1e3},
    {"duty": 1.0, "%": 0.01},
    {"count": 1.0},
    {"step": 1.0},
)
SIZES = {unit: size for group in GROUPS for unit, size in group.items()} | {
    "turn": TURN, "count/s": 1.0, "1": 1.0, "percent": 0.01, "nm": 1e-9,
}  # fmt: skip
# Temperature -> its number in this unit for one in °C: factor, offset.
WARMTHS = {"C": (1.0, 0.0), "K": (1.0, 273.15), "F": (1.8, 32.0)}


def alike(unit):
    """The units of the same kind."""
    if unit in WARMTHS:
        return list(WARMTHS)
    return next(list(group) for group in GROUPS if unit in group)


def from_si(values, unit):
    if unit in WARMTHS:
        factor, offset = WARMTHS[unit]
        return factor * values + offset
    return values / SIZES[unit]


def to_si(values, unit):
    if unit in WARMTHS:
        factor, offset = WARMTHS[unit]
        return (values - offset) / factor
    return values * SIZES[unit]
