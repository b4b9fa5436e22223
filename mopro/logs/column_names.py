"""Headings of columns: name, unit and quantity, as people and loggers write them."""

from __future__ import annotations

import re
from dataclasses import dataclass

# Unit as written, in lower case unless the case tells two apart -> suffix of a column.
_UNITS = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms", "msec": "ms",
    "millisecond": "ms", "milliseconds": "ms", "millis": "ms", "us": "us", "µs": "us", "μs": "us",
    "usec": "us", "usecs": "us", "microseconds": "us", "micros": "us", "ns": "ns", "nsec": "ns",
    "nsecs": "ns", "nanosec": "ns", "nanoseconds": "ns", "nanos": "ns", "min": "min", "h": "h",
    "m": "m", "meter": "m", "metre": "m", "cm": "cm", "mm": "mm", "millimeter": "mm", "um": "um",
    "µm": "um", "μm": "um", "micron": "um", "microns": "um", "in": "in", "inch": "in",
    "inches": "in", "mil": "mil", "mils": "mil", "thou": "mil",
    "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg", "rad": "rad",
    "radian": "rad", "radians": "rad", "mrad": "mrad", "arcmin": "arcmin", "arcsec": "arcsec",
    '"': "arcsec", "rev": "rev", "revs": "rev", "revolutions": "rev", "turn": "turn",
    "turns": "turn", "umdr": "rev", "count": "count", "counts": "count", "cnt": "count",
    "ticks": "count", "inc": "count", "pulses": "count", "step": "step", "steps": "step",
    "m/s": "m_s", "m_s": "m_s", "mps": "m_s", "mm/s": "mm_s", "mm_s": "mm_s", "um/s": "um_s",
    "um_s": "um_s", "in/s": "in_s", "in_s": "in_s", "rad/s": "rad_s", "rad_s": "rad_s",
    "rad_per_s": "rad_s", "deg/s": "deg_s", "deg_s": "deg_s", "°/s": "deg_s", "dps": "deg_s",
    "rpm": "rpm", "u/min": "rpm", "rev/s": "rev_s", "rev_s": "rev_s", "count/s": "count_s",
    "counts/s": "count_s", "count_s": "count_s", "counts_s": "count_s", "step/s": "step_s",
    "steps/s": "step_s", "step_s": "step_s", "steps_s": "step_s", "n": "N", "newton": "N",
    "mn": "mN", "kn": "kN", "lbf": "lbf", "nm": "Nm", "n m": "Nm", "n*m": "Nm", "n·m": "Nm",
    "mnm": "mNm", "a": "A", "amp": "A", "amps": "A", "ampere": "A", "ma": "mA", "v": "V",
    "volt": "V", "volts": "V", "mv": "mV", "%": "%", "percent": "%", "pct": "%", "duty": "duty",
    "c": "C", "°c": "C", "degc": "C", "deg_c": "C", "deg c": "C", "celsius": "C", "k": "K",
    "kelvin": "K", "f": "F", "°f": "F", "degf": "F", "deg_f": "F", "deg f": "F",
    "fahrenheit": "F", "kg": "kg", "hz": "Hz", "w": "W", "watt": "W", "watts": "W", "mw": "mW",
    "kw": "kW", "raw": "raw",
}  # fmt: skip
_BRACKETED = re.compile(r"^(.*?)\s*[\[({<]\s*([^\[\](){}<>]*?)\s*[\])}>]\s*$")
# Letters that are units only in brackets, in their own row or as `_C`: `point_a` is no current.
_ONLY_UPPER = {"a", "c", "n", "v", "k", "w", "f"}

# Words of a name -> quantity; the first that occurs, in this order.
_QUANTITIES = (
    ("temperature", ("temperature", "temp", "celsius", "therm", "tc")),
    ("torque", ("torque", "moment", "trq", "tau")),
    ("current", ("current", "amps", "iq", "id", "amp")),
    ("voltage", ("voltage", "volts", "volt")),
    ("force", ("force", "load", "thrust")),
    ("duty", ("duty", "pwm", "heater", "power", "throttle")),
    ("speed", ("velocity", "speed", "vel", "omega", "rate")),
    ("angle", ("angle", "theta", "phi", "rotation", "yaw", "pitch", "roll", "joint")),
    ("position", ("position", "pos", "displacement", "place", "encoder", "enc", "laser", "lvdt",
                  "x", "y", "z", "target", "setpoint", "actual", "axis")),
)  # fmt: skip
_OF_UNIT = {
    **dict.fromkeys(["m", "cm", "mm", "um", "nm", "in", "mil"], "position"),
    **dict.fromkeys(["deg", "rad", "mrad", "arcmin", "arcsec", "turn", "rev"], "angle"),
    **dict.fromkeys(["m_s", "mm_s", "um_s", "in_s", "rad_s", "deg_s", "rev_s", "rpm", "count_s",
                     "step_s"], "speed"),
    **dict.fromkeys(["N", "mN", "kN", "lbf"], "force"), "Nm": "torque", "mNm": "torque",
    "A": "current", "mA": "current", "V": "voltage", "mV": "voltage", "duty": "duty", "%": "duty",
    "W": "power", "mW": "power", "kW": "power",
    "C": "temperature", "K": "temperature", "F": "temperature",
}  # fmt: skip
_TIMES = ("time", "timestamp", "t", "stamp", "zeit", "clock", "datetime", "date", "uptime", "ts")
_COMMANDS = (
    "command", "commanded", "cmd", "target", "setpoint", "set", "reference", "ref", "desired",
    "demand", "goal", "sp", "input", "soll", "sollwert", "vorgabe", "consigne", "request",
    "requested", "heater", "duty",
)  # fmt: skip
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")


@dataclass(frozen=True)
class Heading:
    """A heading taken apart; `reason` says where the unit comes from."""

    name: str
    unit: str | None
    reason: str


def unit_of(word: str) -> str | None:
    """The suffix that a unit is written with; None for what is no unit."""
    word = word.strip()
    if not word or (len(word) == 1 and word == word.upper() and word.lower() == "m"):
        return None
    return _UNITS.get(word) or _UNITS.get(word.lower())


def known_units() -> list[str]:
    """The suffixes of all units that are known, each once."""
    return list(dict.fromkeys(_UNITS.values()))


def heading(raw: str, units_row: str | None = None) -> Heading:
    """Name and unit of a column by its heading and the cell below it in a row of units."""
    raw = raw.strip()
    if units_row is not None and (unit := _meant(units_row.strip("[](){}<> "), raw)):
        return Heading(raw, unit, f"the row of units says {units_row.strip()}")
    if (match := _BRACKETED.match(raw)) and (unit := _meant(match[2], match[1])):
        return Heading(match[1], unit, f"the heading says [{match[2]}]")
    parts = re.split(r"[_\s]+", raw)
    for taken in (3, 2, 1):
        name = "_".join(parts[:-taken])
        if len(parts) > taken and (unit := _suffix("_".join(parts[-taken:]), name)):
            return Heading(name, unit, f"the heading ends in {unit}")
    return Heading(raw, None, "the log states no unit")


def _suffix(word: str, name: str) -> str | None:
    if word.lower() in _ONLY_UPPER and word != word.upper():
        return None
    return None if word.lower() == "duty" else _meant(word, name)


def _meant(word: str, name: str) -> str | None:
    """The unit of a column: `nm` are nanometres, unless the name is that of a torque."""
    unit = unit_of(word)
    return "nm" if word == "nm" and quantity_of(name, None) != "torque" else unit


def words_of(name: str) -> list[str]:
    """The words of a name, in lower case: `ActPos_X1` is act, pos, x, 1."""
    return [word.lower() for word in _WORDS.findall(name)]


def quantity_of(name: str, unit: str | None) -> str | None:
    """The quantity that a column holds, by its unit or else by its name."""
    if unit in _OF_UNIT:
        return _OF_UNIT[unit]
    words = set(words_of(name))
    return next((q for q, known in _QUANTITIES if words & set(known)), None)


def is_time(name: str) -> bool:
    """True if a column of this name may hold times."""
    words = words_of(name)
    if words == ["x", "value"]:  # LabVIEW's
        return True
    return bool(words) and (words[0] in _TIMES or words[-1] in _TIMES)


def is_command(name: str) -> bool:
    """True if the name says that the column is what the machine was told, not what it did."""
    return bool(set(words_of(name)) & set(_COMMANDS))
