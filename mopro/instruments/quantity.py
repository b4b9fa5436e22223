"""Measurable quantities of a run: one object for each, with all properties that code needs.

To add a quantity that a recording has as a column, add its object here and to QUANTITIES.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

_AXIS = "{axis}"


@dataclass(frozen=True)
class Quantity:
    """One measurable quantity of a run.

    `dimension` is the units.py dimension of its columns, `suffixes` the units that messages
    suggest. `recorded` is the column of a recording that carries it, in SI (`{axis}` stands
    for the number of an axis).

    A quantity that `follows_motion` is simulated sample by sample, which limits the duration of
    its run, and its samples are labelled by the moves; any other is slow and depends on heat
    only. A sensor that `sees_place` measures the position of the forcer: its data can be
    compared with the command, and geometry, transducer and electronics act on its readings.
    `regular` samples have a fixed rate.

    `under_load(x, k)` is its change, in SI, for a steady force that deflects an axis of
    stiffness k (N/m) by x (m); None if there is none.
    """

    name: str
    plural: str
    dimension: str
    suffixes: tuple[str, ...]
    recorded: str
    follows_motion: bool
    sees_place: bool
    regular: bool
    under_load: Callable[[float, float], float] | None = None

    def __str__(self) -> str:
        return self.name

    @property
    def of_axis(self) -> bool:
        """True if each axis has its own column."""
        return _AXIS in self.recorded

    @property
    def slow(self) -> bool:
        """True if it depends on heat only."""
        return not self.follows_motion

    def recorded_column(self, axis: int) -> str:
        """The column of a recording that carries it for `axis`."""
        return self.recorded.format(axis=axis)


def _deflection_m(deflection_m: float, stiffness_N_m: float) -> float:
    return deflection_m


def _holding_force_N(deflection_m: float, stiffness_N_m: float) -> float:
    return deflection_m * stiffness_N_m


POSITION = Quantity(
    name="position",
    plural="positions",
    dimension="length",
    suffixes=("in", "mm", "um", "m"),
    recorded="position_{axis}_m",
    follows_motion=True,
    sees_place=True,
    regular=True,
    under_load=_deflection_m,
)
# The force of the motor on the forcer, before friction and drag.
FORCE = Quantity(
    name="force",
    plural="forces",
    dimension="force",
    suffixes=("N", "lbf"),
    recorded="force_{axis}_N",
    follows_motion=True,
    sees_place=False,
    regular=True,
    under_load=_holding_force_N,
)
TEMPERATURE = Quantity(
    name="temperature",
    plural="temperatures",
    dimension="temperature",
    suffixes=("C",),
    recorded="temperature_C",
    follows_motion=False,
    sees_place=False,
    regular=False,
)

# By name in an experiment file, in the order in which an experiment is designed for them.
QUANTITIES = {quantity.name: quantity for quantity in (POSITION, FORCE, TEMPERATURE)}


@dataclass(frozen=True)
class Measurable:
    """A quantity that sensors of any machine measure.

    `units`: one of each dimension that it may have. `reads`: the state of an axis that such a
    sensor reads (`x` or `v`), "" for the input of the quantity's name. `of_node`: it is read
    from a thermal node, where there are such.
    """

    name: str
    units: tuple[str, ...]
    reads: str = ""
    of_node: bool = False

    @property
    def tells_place(self) -> bool:
        """True if it tells where an axis is."""
        return self.reads == "x"

    @property
    def tells_speed(self) -> bool:
        """True if it tells how fast an axis moves, and not where it is."""
        return self.reads == "v"


# One unit of each dimension of a place, and of what may stand for that of an axis: the output of an
# oscillator, or of a converter.
PLACE_UNITS = ("m", "rad", "count")
AXIS_UNITS = (*PLACE_UNITS, "V")
MEASURABLES = {
    measurable.name: measurable
    for measurable in (
        Measurable("position", AXIS_UNITS, reads="x"),
        Measurable("angle", ("rad", "count"), reads="x"),
        Measurable("speed", tuple(f"{unit}/s" for unit in AXIS_UNITS), reads="v"),
        Measurable("force", ("N",)),
        Measurable("torque", ("N m",)),
        Measurable("current", ("A",)),
        Measurable("voltage", ("V",)),
        Measurable("duty", ("1",)),
        Measurable("temperature", ("C",), of_node=True),
    )
}
_OF_A_PLACE = (
    "m", "cm", "mm", "um", "nm", "in", "mil", "rad", "mrad", "deg", "arcmin", "arcsec", "turn",
    "rev", "count", "step",
)  # fmt: skip
# What the name of a column may end in, and the unit that it stands for; the longest counts.
_SUFFIXES = {
    **{f"{unit}{per}": f"{unit}/s" for unit in _OF_A_PLACE for per in ("_s", "_per_s")},
    **{unit: unit for unit in _OF_A_PLACE},
    "percent": "%", "duty": "1", "Nm": "N m", "mNm": "mN m",
    **{unit: unit for unit in (
        "rpm", "N", "mN", "kN", "lbf", "A", "mA", "V", "mV", "C", "K", "s", "ms", "us", "min", "h",
        "kg", "W", "mW", "kW",
    )},
}  # fmt: skip


def unit_of_column(column: str) -> str | None:
    """The unit that the name of a column ends in, such as N m of `motor_Nm`; None without one."""
    for suffix in sorted(_SUFFIXES, key=len, reverse=True):
        if column == suffix or column.endswith(f"_{suffix}"):
            return _SUFFIXES[suffix]
    return None
