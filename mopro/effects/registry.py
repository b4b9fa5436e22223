"""The catalogue of effects: one line for each, mopro's own before those of installed packages.

Entries are `module:class`, as the target of an entry point. Effects are tried, listed and
applied in this order, except those that act last.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from mopro.effects.effect import Active, Effect
from mopro.errors import MoproError

if TYPE_CHECKING:
    from mopro.formula.written import WrittenEffect
    from mopro.machine import Machine

ENTRY_POINTS = "mopro.effects"

OWN = (
    "forces:PayloadMass",
    "forces:ViscousDrag",
    "forces:QuadraticDrag",
    "forces:CoulombFriction",
    "forces:StribeckFriction",
    "forces:LoadDependentFriction",
    "forces:UmbilicalSpring",
    "forces:ConstantForce",
    "forces:ElectricalDamping",
    "forces:ForceConstant",
    "forces:ForceConstantTemperature",
    "forces:DetentForce",
    "currents:PhaseGainImbalance",
    "currents:QuadratureError",
    "currents:PhaseCurrentOffset",
    "currents:CurrentThirdHarmonic",
    "currents:CurrentLoopLag",
    "currents:VoltageSaturation",
    "currents:HoldCurrentReduction",
    "command:ControllerClock",
    "command:ProfileTick",
    "command:AccelerationScale",
    "command:VelocityScale",
    "command:StartDelay",
    "command:LostSteps",
    "measurement:PitchScale",
    "measurement:PlatenExpansion",
    "measurement:SensorGain",
    "measurement:SensorOffset",
    "measurement:CrossAxisCoupling",
    "measurement:Backlash",
    "measurement:SensorBandwidth",
    "measurement:TriggerDelay",
    "measurement:SampleClock",
    "measurement:SensorNonlinearity",
    "measurement:PeriodicError",
    "measurement:Hum",
    "heat:AmbientDrift",
    "heat:PlatenConduction",
    "heat:SpeedDependentHeat",
    "heat:ConvectionScale",
    "heat:ResistanceTempco",
    "heat:Radiation",
    "heat:ThermocoupleLag",
)

# What importing and making somebody else's class may raise.
_LOADING_ERRORS = (
    ArithmeticError, AssertionError, AttributeError, ImportError, LookupError, NameError, OSError,
    RuntimeError, SyntaxError, TypeError, ValueError,
)  # fmt: skip


def _name_of(target: str) -> str:
    """The name of an effect by that of its class: `viscous_drag` of `ViscousDrag`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", target.partition(":")[2]).lower()


_TARGETS = {_name_of(target): target for target in OWN}

# Those of mopro's own effects that have a `stated_by`.
STATED_ELSEWHERE = ("voltage_saturation",)


class Catalogue(Mapping[str, Effect]):
    """Effects by name: mopro's own, each loaded when first asked for, then `packaged` ones.

    To load all takes a good part of the time of a short run, which needs few or none.
    """

    def __init__(self, packaged: Mapping[str, Effect]) -> None:
        self._effects: dict[str, Effect | None] = {**dict.fromkeys(_TARGETS), **packaged}

    def __getitem__(self, name: str) -> Effect:
        effect = self._effects[name]
        if effect is None:
            point = EntryPoint(name, f"mopro.effects.{_TARGETS[name]}", ENTRY_POINTS)
            effect = self._effects[name] = _effect(point)
        return effect

    def __contains__(self, name: object) -> bool:
        return name in self._effects

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def beside(self, effects: Iterable[Effect]) -> Catalogue:
        """This catalogue with `effects`, which take the place of others of their names."""
        made = Catalogue({})
        made._effects = {**self._effects, **{effect.name: effect for effect in effects}}
        return made

    def stated_elsewhere(self) -> list[Effect]:
        """The effects that a machine file may state outside of `[effects]`."""
        return [self[name] for name in self if name not in _TARGETS or name in STATED_ELSEWHERE]


@cache
def catalogue() -> Catalogue:
    """All effects by name: mopro's own, then those of installed packages.

    Raises MoproError for an entry point that is no effect or takes a name twice.
    """
    packaged: dict[str, Effect] = {}
    for point in entry_points(group=ENTRY_POINTS):
        effect = _effect(point)
        if effect.name in _TARGETS or effect.name in packaged:
            message = f"entry point {point.name} = {point.value}: {effect.name} exists already"
            raise MoproError(message, "bad-effect")
        packaged[effect.name] = effect
    return Catalogue(packaged)


def catalogue_of(machine: Machine) -> Catalogue:
    """All effects by name, with those that the machine's file states as formulas.

    Raises MoproError as `catalogue` does.
    """
    return _with_formulas(machine.formulas) if machine.formulas else catalogue()


@cache
def _with_formulas(formulas: tuple[WrittenEffect, ...]) -> Catalogue:
    from mopro.effects.formula_effects import effect_of  # few machines have any

    return catalogue().beside(map(effect_of, formulas))


def own_effects() -> Catalogue:
    """Effects of mopro itself, by name."""
    return Catalogue({})


def _effect(point: EntryPoint) -> Effect:
    try:
        kind = point.load()
        if isinstance(kind, type) and issubclass(kind, Effect):
            return kind()
    except _LOADING_ERRORS as error:
        package = f"the package {point.dist.name}" if point.dist else "a package"
        why = f"cannot be loaded: {type(error).__name__}: {error}"
        message = f"entry point {point.name} = {point.value} of {package} {why}"
        raise MoproError(f"{message}; mend or uninstall it", "bad-effect") from error
    message = f"entry point {point.name} = {point.value}: expected a subclass of Effect"
    raise MoproError(message, "bad-effect")


def in_order(active: Iterable[Active], effects: Mapping[str, Effect]) -> tuple[Active, ...]:
    """`active` in the order in which they act, with the catalogue `effects`."""
    order = {name: i for i, name in enumerate(effects)}
    return tuple(sorted(active, key=lambda a: (a.effect.acts_last, order[a.name])))
