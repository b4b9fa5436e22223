"""What a sensor may measure: each quantity is one object that tells all that code asks of it.

A further quantity is one object here and its place in QUANTITIES, if a recording has its
column already.
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

    One that `follows_motion` is simulated sample by sample, so its run may not be too long
    and its samples are labelled by the moves; any other is slow, made by heat alone. A
    sensor that `sees_place` looks at the place of the forcer: data can be held against the
    command, and geometry, transducer and electronics act on its readings. `regular` samples
    come at one rate, others now and then.

    `under_load(x, k)` is how far off, in SI, it is where a steady force deflects an axis of
    stiffness k (N/m) by x (m); None if it does not change.
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
        """Whether each axis has one of its own."""
        return _AXIS in self.recorded

    @property
    def slow(self) -> bool:
        """Whether heat alone makes it."""
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
# Of the motor on the forcer: with friction or drag it is not what accelerates the mass.
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

# By name, as an experiment file has it. A proposed experiment is for the first that it can be.
QUANTITIES = {quantity.name: quantity for quantity in (POSITION, FORCE, TEMPERATURE)}
