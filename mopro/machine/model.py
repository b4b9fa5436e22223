"""A machine's numbers in SI, as a machine file states them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from mopro.program import AXES
from mopro.source import Source, Span
from mopro.units import units_of

if TYPE_CHECKING:
    from mopro.formula.written import WrittenEffect

FULL_STEPS_PER_PITCH = 4
_SECTIONS = ("axis", "drive", "platen", "heat", "forcers", "limits")
# The fastest rate (1/s) that the emulator's steps of 50 µs resolve: RK4 is stable up to 2.78
# per step, and some is left for effects.
FASTEST_1_S = 40_000.0
# Bounds of a quantity in SI. No product that a formula makes of such numbers overflows.
_LEAST, _MOST = 1e-9, 1e9
_COLDEST_C, _HOTTEST_C = -273.15, 1e4


def _quantity(
    key: str,
    dimension: str,
    low: float = _LEAST,
    high: float = _MOST,
    default: float | None = None,
    tolerated: bool = False,
) -> Any:
    """A field that a machine file states under `key`, from `low` to `high` (SI).

    One with a default may be left out; one that is `tolerated` may have a tolerance.
    """
    metadata = {
        "key": key, "dimension": dimension, "low": low, "high": high, "tolerated": tolerated,
    }  # fmt: skip
    if default is None:
        return field(metadata=metadata)
    return field(default=default, metadata=metadata)


def _choice(key: str, *choices: str) -> Any:
    """A field that a machine file states as one of `choices`; the first is the default."""
    return field(default=choices[0], metadata={"key": key, "choices": choices})


@dataclass(frozen=True)
class Place:
    """The place of a quantity in a machine file, `section.key`, with its dimension and bounds.

    `dimension` is one of units.py; `low` and `high` are in SI. A quantity that is one
    of `choices` has neither.
    """

    section: str
    key: str
    attribute: str
    dimension: str | None
    low: float
    high: float
    choices: tuple[str, ...]

    @classmethod
    def all_of(cls, section: str, kind: type[Any]) -> Iterator[Place]:
        """The places of a section whose content is a `kind`."""
        for own in fields(kind):
            about = own.metadata
            bounds = about.get("low", 0.0), about.get("high", 0.0)
            dimension, choices = about.get("dimension"), about.get("choices", ())
            yield cls(section, about["key"], own.name, dimension, *bounds, choices)

    @property
    def name(self) -> str:
        return f"{self.section}.{self.key}"

    @property
    def unit(self) -> str:
        """The SI unit; empty for a choice."""
        return units_of(self.dimension)[0] if self.dimension else ""

    def fault(self, value: float) -> str | None:
        """Error message for a `value` (SI) out of bounds; None if it is valid."""
        if self.low <= value <= self.high:
            return None
        return f"{self.key} must be from {self.low:g} to {self.high:g} {self.unit}"

    def of(self, machine: Machine) -> Any:
        """The value (SI, or a choice) in `machine`."""
        return getattr(getattr(machine, self.section), self.attribute)

    def changed(self, machine: Machine, value: Any) -> Machine:
        """`machine` with another value here; the result has no source file."""
        part = replace(getattr(machine, self.section), **{self.attribute: value})
        return replace(machine, source=None, **{self.section: part})


@dataclass(frozen=True)
class Provenance:
    """Origin of a value (thesis, derived, assumed or measured) and its place.

    `tolerance` is the relative deviation that the true value may have.
    """

    origin: str
    place: str
    tolerance: float = 0.0


@dataclass(frozen=True)
class Axis:
    """One axis; both are alike.

    `pull_out_force_N` is the peak static force F0; `damping_ratio` is that of the
    drive's electrical damping with the bare motor.
    """

    pitch_m: float = _quantity("pitch", "length")
    moving_mass_kg: float = _quantity("moving_mass", "mass")
    pull_out_force_N: float = _quantity("pull_out_force", "force", tolerated=True)
    damping_ratio: float = _quantity("damping_ratio", "ratio", 0.0, tolerated=True)

    @property
    def wave_number_1_m(self) -> float:
        """k = 2π/p."""
        return 2 * math.pi / self.pitch_m

    @property
    def stiffness_N_m(self) -> float:
        """K = k F0, for a small displacement from a tooth."""
        return self.wave_number_1_m * self.pull_out_force_N

    @property
    def drive_damping_N_s_m(self) -> float:
        """c_s = 2 ζ √(K m) with the bare mass: a payload does not change the drive."""
        return 2 * self.damping_ratio * math.sqrt(self.stiffness_N_m * self.moving_mass_kg)

    @property
    def critical_damping_N_s_m(self) -> float:
        """2 √(K m) of the bare motor."""
        return 2 * math.sqrt(self.stiffness_N_m * self.moving_mass_kg)

    @property
    def natural_rate_1_s(self) -> float:
        """√(K/m) of the bare motor."""
        return math.sqrt(self.stiffness_N_m / self.moving_mass_kg)

    @property
    def fastest_rate_1_s(self) -> float:
        """The largest rate of the bare motor's free motion: ω, or that of the faster decay."""
        excess = math.sqrt(max(0.0, self.damping_ratio**2 - 1))
        return self.natural_rate_1_s * max(1.0, self.damping_ratio + excess)


@dataclass(frozen=True)
class Drive:
    """The drive of each axis.

    `model` is `ideal` (currents are what they are set to) or `full` (R, L, back-EMF and
    a limited supply); `full` makes pull-out fall with speed.
    """

    microsteps_per_full_step: float = _quantity("microsteps_per_full_step", "ratio", 1.0)
    phase_current_A: float = _quantity("phase_current", "current")
    coil_resistance_ohm: float = _quantity("coil_resistance", "resistance")
    coil_inductance_H: float = _quantity("coil_inductance", "inductance")
    supply_V: float = _quantity("supply", "voltage")
    model: str = _choice("model", "ideal", "full")


@dataclass(frozen=True)
class Platen:
    length_m: float = _quantity("length", "length")
    width_m: float = _quantity("width", "length")
    expansion_low_1_K: float = _quantity("expansion_low", "expansion", default=9.9e-6)
    expansion_high_1_K: float = _quantity("expansion_high", "expansion", default=12.8e-6)


@dataclass(frozen=True)
class Forcers:
    """The two forcers of each axis, `arm_m` to either side of its middle.

    Strengths are shares of half the axis' pull-out force. A machine that states them has
    its yaw recorded.
    """

    arm_m: float = _quantity("arm", "length", default=0.06)
    strength_1: float = _quantity("strength_1", "ratio", low=0.0, default=1.0)
    strength_2: float = _quantity("strength_2", "ratio", low=0.0, default=1.0)


@dataclass(frozen=True)
class Limits:
    """Distance from the limit switch to the hard stop."""

    overtravel_m: float = _quantity("overtravel", "length", low=0.0, default=0.0127)


@dataclass(frozen=True)
class Heat:
    """Quantities of the heat balance of chapter 3.1."""

    forcer_side_m: float = _quantity("forcer_side", "length")
    specific_heat_J_kg_K: float = _quantity("specific_heat", "specific heat")
    moving_current_A: float = _quantity("moving_current", "current", low=0.0)
    side_area_m2: float = _quantity("side_area", "area")
    top_area_m2: float = _quantity("top_area", "area")
    air_conductivity_W_m_K: float = _quantity("air_conductivity", "thermal conductivity")
    air_viscosity_m2_s: float = _quantity("air_viscosity", "kinematic viscosity")
    bearing_flow_m3_s: float = _quantity("bearing_flow", "flow")
    bearing_area_m2: float = _quantity("bearing_area", "area")
    prandtl_number: float = _quantity("prandtl_number", "ratio")
    ambient_C: float = _quantity("ambient", "temperature", _COLDEST_C, _HOTTEST_C)
    rated_C: float = _quantity("rated", "temperature", _COLDEST_C, _HOTTEST_C)


@dataclass(frozen=True)
class StatedValue:
    """A number as written, with its unit unless it is bare."""

    number: float
    unit: str | None = None
    span: Span = field(default=Span(1, 1, 1), compare=False)


@dataclass(frozen=True)
class StatedEffect:
    """An effect as a machine file switches it on; its names are checked by the emulator.

    `runs`: data files of the runs that alone have it, each with its checksum; empty if all have it.
    """

    name: str
    values: Mapping[str, StatedValue] = field(hash=False)
    axes: tuple[int, ...] = AXES
    span: Span = field(default=Span(1, 1, 1), compare=False)
    runs: Mapping[str, str] = field(default_factory=dict, hash=False)


def rate_fault(axis: Axis) -> tuple[str, str] | None:
    """Message and hint for an axis whose free motion is too fast for the emulator's steps."""
    if axis.fastest_rate_1_s <= FASTEST_1_S:
        return None
    natural_Hz, most_Hz = (rate / (2 * math.pi) for rate in (axis.natural_rate_1_s, FASTEST_1_S))
    message = (
        f"pitch, pull_out_force and moving_mass give a natural frequency of {natural_Hz:.4g} "
        f"Hz at a damping ratio of {axis.damping_ratio:g}, too fast for the emulator's steps"
    )
    return message, f"expected at most {most_Hz:.4g} Hz, divided by twice a large damping ratio"


def travel_faults(platen: Platen, forcer_side_m: float) -> dict[str, str]:
    """A message for each size of the platen (by its key) that leaves the forcer no travel."""
    sizes = {"length": platen.length_m, "width": platen.width_m}
    return {
        key: f"the platen's {key} leaves no travel to a forcer of {forcer_side_m:g} m"
        for key, size_m in sizes.items()
        if size_m <= forcer_side_m
    }


@dataclass(frozen=True)
class Machine:
    """A machine file's content; `provenance` is keyed by `section.key`.

    `formulas` are effects of its own, beside those of the catalogue; `effects` switches on
    any of them. `verdict`: that of the diagnosis which wrote the file; None for any other file.
    """

    name: str
    axis: Axis
    drive: Drive
    platen: Platen
    heat: Heat
    provenance: Mapping[str, Provenance] = field(compare=False, repr=False)
    forcers: Forcers | None = None
    limits: Limits = Limits()
    effects: tuple[StatedEffect, ...] = ()
    formulas: tuple[WrittenEffect, ...] = ()
    verdict: str | None = field(default=None, compare=False)
    source: Source | None = field(default=None, compare=False, repr=False)

    def quantities(self) -> list[dict[str, Any]]:
        """A row for each number: key, value (SI), unit, origin, place and tolerance."""
        rows = []
        for place in self.places():
            source = self.provenance.get(place.name)
            rows.append(
                {
                    "key": place.name,
                    "value": place.of(self),
                    "unit": place.unit,
                    "origin": source.origin if source else "assumed",
                    "place": source.place if source else "default",
                    "tolerance": source.tolerance if source else 0.0,
                }
            )
        return rows

    def places(self) -> Iterator[Place]:
        """The places of all its quantities, in the order of the file."""
        for section in _SECTIONS:
            part = getattr(self, section)
            if part is not None:
                yield from Place.all_of(section, type(part))

    def fault(self) -> str | None:
        """Why no run can be done on it, though each of its numbers is within its bound."""
        rate = rate_fault(self.axis)
        faults = [rate[0]] if rate else []
        faults += travel_faults(self.platen, self.heat.forcer_side_m).values()
        return faults[0] if faults else None

    def _repr_html_(self) -> str:
        """Name, effects, and all numbers with their origins."""
        from mopro import markup

        keys = ("key", "value", "unit", "origin", "place")
        rows = [[row[key] for key in keys] for row in self.quantities()]
        effects = [
            (effect.name, key, value.number, value.unit or "")
            for effect in self.effects
            for key, value in effect.values.items()
        ]
        parts = [
            markup.table(("effect", "parameter", "value", "unit"), effects, most=markup.MOST_ROWS)
        ]
        return markup.fragment(
            f"Machine {self.name}",
            [*(parts if effects else []), markup.table(keys, rows)],
        )

    def with_effects(self, effects: Mapping[str, Mapping[str, float]]) -> Machine:
        """This machine with these effects as well, numbers in the effects' own units.

        An effect that the machine has already is replaced. The result has no source file, as
        faults of the added effects are not faults of that file.
        """
        if not effects:
            return self
        others = tuple(e for e in self.effects if e.name not in effects)
        added = tuple(
            StatedEffect(name, {key: StatedValue(float(v)) for key, v in values.items()})
            for name, values in effects.items()
        )
        return replace(self, effects=others + added, source=None)

    def with_parameter(self, effect: str, parameter: str, value: float) -> Machine:
        """This machine with one parameter of an effect, in the effect's own unit.

        The others stay as stated; an effect that it does not have is switched on in all runs.
        """
        own = next((e for e in self.effects if e.name == effect), StatedEffect(effect, {}))
        values = {**own.values, parameter: StatedValue(float(value))}
        others = tuple(e for e in self.effects if e.name != effect)
        changed = replace(own, values=values, runs={})
        return replace(self, effects=(*others, changed), source=None)

    @property
    def runs(self) -> dict[str, Mapping[str, str]]:
        """The runs of each effect that belongs to certain runs alone."""
        return {effect.name: effect.runs for effect in self.effects if effect.runs}

    def beside(self, formulas: Iterable[WrittenEffect]) -> Machine:
        """This machine with `formulas`, which take the place of its own of the same names."""
        added = tuple(formulas)
        names = {effect.name for effect in added}
        kept = tuple(effect for effect in self.formulas if effect.name not in names)
        return replace(self, formulas=kept + added)

    @property
    def microstep_m(self) -> float:
        steps = FULL_STEPS_PER_PITCH * self.drive.microsteps_per_full_step
        return self.axis.pitch_m / steps

    def travel_u(self) -> dict[int, tuple[float, float]]:
        """Each axis' limit switches in microsteps from the platen's middle (assumed).

        They are where the forcer reaches the platen's edges; axis 1 is along the length.
        """
        sizes = (self.platen.length_m, self.platen.width_m)
        reach = [(size - self.heat.forcer_side_m) / 2 / self.microstep_m for size in sizes]
        return {axis: (-half, half) for axis, half in enumerate(reach, start=1)}
