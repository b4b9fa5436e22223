"""What a sweep can vary: settings of the program, numbers of the machine and its effects, payload.

A target takes its numbers in one of its `units`, each with the factor that `changed` wants.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, Protocol

from mopro.effects import Parameter, catalogue_of
from mopro.effects.resolve import suggestion
from mopro.errors import MoproError
from mopro.machine import Machine
from mopro.machine.model import Place
from mopro.program import Program, ir
from mopro.program.settings import Setting, microsteps_per_uu, settings_of
from mopro.units import MS_PER_S, UNITS, length_unit_name, units_of

Value = Fraction | str
_HEAVIEST_KG = 1e6
_SWITCH = {"+": True, "-": False}
PAYLOAD = "payload"


class VaryError(MoproError):
    """Something that cannot be varied, or not so; its text says what was expected."""

    rule = "bad-vary"


class Variant(NamedTuple):
    """What one run is done with."""

    program: Program
    machine: Machine
    payload_kg: float


class Target(Protocol):
    """One thing that can be varied.

    `units`: names and factors, the first is that of bare numbers; empty where it is one of
    `choices`. `places` are what it changes, which no other target of a sweep may.
    """

    @property
    def units(self) -> Mapping[str, Fraction]: ...
    @property
    def choices(self) -> tuple[str, ...]: ...
    @property
    def places(self) -> frozenset[Hashable]: ...
    def fault(self, value: Fraction) -> str | None:
        """Error message for a number that is out of bounds; None if it is valid."""

    def changed(self, variant: Variant, value: Value) -> Variant: ...


@dataclass(frozen=True)
class SettingTarget:
    """VEL, ACC or PARA of an axis, in numbers as the statement has them."""

    setting: Setting
    units: Mapping[str, Fraction]
    places: frozenset[Hashable]

    @classmethod
    def of(cls, setting: Setting, program: Program, machine: Machine) -> SettingTarget:
        """Raises VaryError for a setting that the program does not state."""
        places = setting.places(program)
        if not places:
            stated = ", ".join(settings_of(program)) or "none"
            raise VaryError(
                f"{program.name} has no statement {setting}: it has {stated}; of several, "
                "NAME@LINE is the one in that line"
            )
        return cls(setting, _units_of(setting, program, machine), frozenset(places))

    @property
    def choices(self) -> tuple[str, ...]:
        return () if self.units else tuple(_SWITCH)

    def fault(self, value: Fraction) -> str | None:
        return None if value > 0 else f"{float(value):g} must be greater than 0"

    def changed(self, variant: Variant, value: Value) -> Variant:
        stated = _SWITCH[value] if isinstance(value, str) else value
        return variant._replace(program=self.setting.changed(variant.program, stated))


def _units_of(setting: Setting, program: Program, machine: Machine) -> dict[str, Fraction]:
    """Units of a setting's numbers, by the user unit; ACC is written in thousands of them."""
    if setting.kind is ir.SetProfile:
        return {}
    microsteps = microsteps_per_uu(program, setting.axes)
    microstep_m = Fraction(machine.microstep_m).limit_denominator(10**9)
    length = "uu" if microsteps is None else length_unit_name(microsteps * microstep_m)
    if setting.kind is ir.SetVelocity:
        return {f"{length}/s": Fraction(1)}
    return {f"{MS_PER_S} {length}/s2": Fraction(1), f"{length}/s2": Fraction(1, MS_PER_S)}


@dataclass(frozen=True)
class MachineTarget:
    """A quantity of the machine file, `section.key`."""

    place: Place

    @property
    def units(self) -> Mapping[str, Fraction]:
        return {} if self.place.dimension is None else _factors(self.place.dimension)

    @property
    def choices(self) -> tuple[str, ...]:
        return self.place.choices

    @property
    def places(self) -> frozenset[Hashable]:
        return frozenset([self.place.name])

    @property
    def range(self) -> tuple[float, float]:
        """The least and the greatest valid value (SI)."""
        return self.place.low, self.place.high

    def fault(self, value: Fraction) -> str | None:
        return self.place.fault(float(value))

    def changed(self, variant: Variant, value: Value) -> Variant:
        stated = value if isinstance(value, str) else float(value)
        return variant._replace(machine=self.place.changed(variant.machine, stated))


@dataclass(frozen=True)
class EffectTarget:
    """A parameter of an effect, `effects.name.parameter`; the effect is switched on by it."""

    effect: str
    parameter: Parameter
    choices: tuple[str, ...] = ()

    @property
    def units(self) -> Mapping[str, Fraction]:
        own = self.parameter.unit
        factors = _factors(self.parameter.dimension)
        return {own: factors.pop(own, Fraction(1)), **factors}

    @property
    def places(self) -> frozenset[Hashable]:
        return frozenset([(self.effect, self.parameter.name)])

    @property
    def range(self) -> tuple[float, float]:
        """The least and the greatest valid value (SI)."""
        return self.parameter.low, self.parameter.high

    def fault(self, value: Fraction) -> str | None:
        return self.parameter.fault(float(value))

    def changed(self, variant: Variant, value: Value) -> Variant:
        machine = variant.machine.with_parameter(self.effect, self.parameter.name, float(value))
        return variant._replace(machine=machine)


@dataclass(frozen=True)
class PayloadTarget:
    """The mass that the motor carries."""

    choices: tuple[str, ...] = ()

    @property
    def units(self) -> Mapping[str, Fraction]:
        return _factors("mass")

    @property
    def places(self) -> frozenset[Hashable]:
        return frozenset([PAYLOAD])

    def fault(self, value: Fraction) -> str | None:
        if 0 <= value <= _HEAVIEST_KG:
            return None
        return f"a payload must be from 0 to {_HEAVIEST_KG:g} kg"

    def changed(self, variant: Variant, value: Value) -> Variant:
        return variant._replace(payload_kg=float(value))


def target_named(name: str, program: Program, machine: Machine) -> Target:
    """The target of that name; VaryError if there is none."""
    if name == PAYLOAD:
        return PayloadTarget()
    if (setting := Setting.named(name)) is not None:
        return SettingTarget.of(setting, program, machine)
    if name.startswith("effects."):
        return _effect_target(name, machine)
    places = {place.name: place for place in machine.places()}
    if name not in places:
        raise _unknown(name, [PAYLOAD, *settings_of(program), *places])
    return MachineTarget(places[name])


def _effect_target(name: str, machine: Machine) -> EffectTarget:
    catalogue = catalogue_of(machine)
    named, _, key = name.removeprefix("effects.").partition(".")
    effect = catalogue.get(named)
    if effect is None:
        raise VaryError(f"there is no effect {named}: {suggestion(named, catalogue)}")
    parameters = {p.name: p for p in effect.parameters}
    if key not in parameters:
        known = ", ".join(parameters) or "none"
        raise VaryError(f"{named} has no parameter {key or '(none given)'}: it has {known}")
    return EffectTarget(named, parameters[key])


def _unknown(name: str, known: Iterable[str]) -> VaryError:
    kinds = (
        "expected payload, VEL, ACC or PARA of an axis (VEL1), a key that `mopro machine show` "
        "prints (axis.moving_mass), or effects.NAME.PARAMETER"
    )
    near = suggestion(name, known)
    return VaryError(f"it cannot be varied: {near if '`' in near else kinds}")


def _factors(dimension: str) -> dict[str, Fraction]:
    return {unit: UNITS[unit][1] for unit in units_of(dimension)}
