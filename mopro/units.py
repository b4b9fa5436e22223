"""The only conversions between units.

Every quantity inside mopro is in SI (temperatures in °C) except where a name says
otherwise: `_u` for microsteps, `_uu` for a program's user units.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction

INCH_M = Fraction(254, 10000)
POUND_KG = Fraction(45359237, 100000000)
STANDARD_GRAVITY = Fraction(980665, 100000)
MS_PER_S = 1000

# unit -> (dimension, factor to the SI unit of that dimension)
UNITS: dict[str, tuple[str, Fraction]] = {
    "1": ("ratio", Fraction(1)),
    "%": ("ratio", Fraction(1, 100)),
    "ppm": ("ratio", Fraction(1, 10**6)),
    "rad": ("angle", Fraction(1)),
    "deg": ("angle", Fraction(math.pi) / 180),
    "mrad": ("angle", Fraction(1, 1000)),
    "arcmin": ("angle", Fraction(math.pi) / (180 * 60)),
    "arcsec": ("angle", Fraction(math.pi) / (180 * 3600)),
    "turn": ("angle", 2 * Fraction(math.pi)),
    "rev": ("angle", 2 * Fraction(math.pi)),
    "rpm": ("angular velocity", 2 * Fraction(math.pi) / 60),
    "krpm": ("angular velocity", 2000 * Fraction(math.pi) / 60),
    "count": ("count", Fraction(1)),
    "step": ("count", Fraction(1)),
    "s": ("time", Fraction(1)),
    "ms": ("time", Fraction(1, 1000)),
    "us": ("time", Fraction(1, 10**6)),
    "min": ("time", Fraction(60)),
    "h": ("time", Fraction(3600)),
    "d": ("time", Fraction(86400)),
    "Hz": ("frequency", Fraction(1)),
    "kHz": ("frequency", Fraction(1000)),
    "m": ("length", Fraction(1)),
    "cm": ("length", Fraction(1, 100)),
    "mm": ("length", Fraction(1, 1000)),
    "um": ("length", Fraction(1, 10**6)),
    "nm": ("length", Fraction(1, 10**9)),
    "in": ("length", INCH_M),
    "mil": ("length", INCH_M / 1000),
    "m/s": ("velocity", Fraction(1)),
    "mm/s": ("velocity", Fraction(1, 1000)),
    "in/s": ("velocity", INCH_M),
    "kg": ("mass", Fraction(1)),
    "g": ("mass", Fraction(1, 1000)),
    "lb": ("mass", POUND_KG),
    "N": ("force", Fraction(1)),
    "mN": ("force", Fraction(1, 1000)),
    "kN": ("force", Fraction(1000)),
    "lbf": ("force", POUND_KG * STANDARD_GRAVITY),
    "A": ("current", Fraction(1)),
    "mA": ("current", Fraction(1, 1000)),
    "J": ("energy", Fraction(1)),
    "V": ("voltage", Fraction(1)),
    "mV": ("voltage", Fraction(1, 1000)),
    "ohm": ("resistance", Fraction(1)),
    "mohm": ("resistance", Fraction(1, 1000)),
    "kohm": ("resistance", Fraction(1000)),
    "H": ("inductance", Fraction(1)),
    "mH": ("inductance", Fraction(1, 1000)),
    "C": ("temperature", Fraction(1)),
    "m2": ("area", Fraction(1)),
    "m3/s": ("flow", Fraction(1)),
    "m2/s": ("kinematic viscosity", Fraction(1)),
    "J/(kg K)": ("specific heat", Fraction(1)),
    "1/K": ("expansion", Fraction(1)),
    "%/K": ("expansion", Fraction(1, 100)),
    "ppm/K": ("expansion", Fraction(1, 10**6)),
    "K": ("temperature difference", Fraction(1)),
    "K/s": ("temperature rate", Fraction(1)),
    "K/h": ("temperature rate", Fraction(1, 3600)),
    "N s/m": ("drag", Fraction(1)),
    "N s2/m2": ("quadratic drag", Fraction(1)),
    "N/m": ("stiffness", Fraction(1)),
    "W": ("power", Fraction(1)),
    "mW": ("power", Fraction(1, 1000)),
    "kW": ("power", Fraction(1000)),
    "W/K": ("thermal conductance", Fraction(1)),
    "W/(m K)": ("thermal conductivity", Fraction(1)),
    "W/Hz": ("energy per cycle", Fraction(1)),
    "W/kHz": ("energy per cycle", Fraction(1, 1000)),
    "W/Hz2": ("eddy loss", Fraction(1)),
    "W/kHz2": ("eddy loss", Fraction(1, 10**6)),
}

# Other spellings of units, and of what they are written with.
_SPELLINGS = {
    "Ohm": "ohm", "Ohms": "ohm", "ohms": "ohm", "mOhm": "mohm", "kOhm": "kohm", "RPM": "rpm",
    "degC": "C", "degree": "deg", "degrees": "deg", "counts": "count", "ticks": "count",
    "steps": "step", "turns": "turn", "revs": "rev", "sec": "s", "lbs": "lb", "inch": "in",
    "inches": "in", "micron": "um", "microns": "um", "Nm": "N m", "mNm": "mN m", "Nmm": "N mm",
    "Nms": "N m s", "kgm": "kg m", "kgcm": "kg cm", "gcm": "g cm", "Vs": "V s", "Ws": "W s",
    "As": "A s",
}  # fmt: skip
_CHARACTERS = {
    "°C": "C", "°": "deg", "Ω": "ohm", "\N{OHM SIGN}": "ohm", "µ": "u", "μ": "u", "⁻": "-",
    "¹": "1", "²": "2", "³": "3", "⁴": "4", "·": " ", "⋅": " ", "*": " ",
}  # fmt: skip
_WORD = re.compile(r"[A-Za-z]+")
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*([A-Za-z%]\S*)?\s*", re.ASCII)


def spelled(unit: str) -> str:
    """`unit` in the spelling of `UNITS`: `N m/ohm` of `Nm/Ω`; a word that is none stays."""
    for character, own in _CHARACTERS.items():
        unit = unit.replace(character, own)
    return _WORD.sub(lambda word: _SPELLINGS.get(word[0], word[0]), unit)


def units_of(dimension: str) -> list[str]:
    """The units that measure `dimension`."""
    return [unit for unit, (kind, _) in UNITS.items() if kind == dimension]


def to_si(value: float, unit: str, dimension: str) -> float:
    """`value` in `unit` as the SI number; ValueError if the unit does not measure it."""
    kind, factor = UNITS.get(spelled(unit), ("", Fraction(0)))
    if kind != dimension:
        known = ", ".join(units_of(dimension))
        raise ValueError(f"'{unit}' is not a unit of {dimension}: expected one of {known}")
    return value * factor.numerator / factor.denominator


def parse_quantity(text: str, dimension: str, default_unit: str) -> float:
    """A quantity as typed (`5lb`, `2 min`, `0.5`) in SI; a bare number has `default_unit`."""
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(f"'{text}' is not a number with a unit, such as 1.5{default_unit}")
    quantity = to_si(float(match[1]), match[2] or default_unit, dimension)
    if not math.isfinite(quantity):
        raise ValueError(f"'{text[:20]}…' is too large a number")
    return quantity


def is_number_without_unit(text: str) -> bool:
    """True for a number other than 0 without a unit."""
    match = _QUANTITY.fullmatch(text)
    return match is not None and match[2] is None and float(match[1]) != 0


def residual_unit(unit: str) -> str:
    """The unit of a difference of two values in `unit`."""
    return "K" if unit == "C" else unit


def length_unit_name(metres: Fraction) -> str:
    """The name of the unit that is exactly `metres` long, or `uu` (user unit)."""
    for unit in ("in", "mm", "cm", "m", "um"):
        if UNITS[unit][1] == metres:
            return unit
    return "uu"
