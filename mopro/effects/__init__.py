"""Everything that a model can lack: the catalogue of effects, one line each.

An effect from outside joins through the entry-point group `mopro.effects`, whose targets
are `Effect` subclasses.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points

from mopro.effects import command, forces, measurement, phases, thermal
from mopro.effects.base import Active, Effect, Parameter, Stage, on_axis
from mopro.errors import MoproError

OWN: tuple[type[Effect], ...] = (
    forces.PayloadMass,
    forces.ViscousDrag,
    forces.QuadraticDrag,
    forces.CoulombFriction,
    forces.UmbilicalSpring,
    forces.ConstantForce,
    forces.ElectricalDamping,
    forces.ForceConstant,
    forces.ForceConstantTemperature,
    forces.DetentForce,
    phases.PhaseGainImbalance,
    phases.QuadratureError,
    phases.PhaseCurrentOffset,
    phases.CurrentThirdHarmonic,
    phases.CurrentLoopLag,
    phases.VoltageSaturation,
    phases.HoldCurrentReduction,
    command.AccelerationScale,
    command.VelocityScale,
    command.ProfileTick,
    command.ControllerClock,
    command.StartDelay,
    command.LostSteps,
    measurement.PitchScale,
    measurement.PlatenExpansion,
    measurement.Backlash,
    measurement.PeriodicError,
    measurement.CrossAxisCoupling,
    measurement.SensorGain,
    measurement.SensorOffset,
    measurement.SensorNonlinearity,
    measurement.SensorBandwidth,
    measurement.TriggerDelay,
    measurement.SampleClock,
    measurement.Hum,
    thermal.AmbientDrift,
    thermal.PlatenConduction,
    thermal.SpeedDependentHeat,
    thermal.ConvectionScale,
    thermal.ResistanceTempco,
    thermal.Radiation,
    thermal.ThermocoupleLag,
)

ENTRY_POINTS = "mopro.effects"


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by name: mopro's own, then those of installed packages.

    Raises MoproError for an entry point that is no effect or takes a name twice.
    """
    effects = {kind.name: kind() for kind in OWN}
    for point in entry_points(group=ENTRY_POINTS):
        kind = point.load()
        if not (isinstance(kind, type) and issubclass(kind, Effect)):
            message = f"entry point {point.name} = {point.value}: expected a subclass of Effect"
            raise MoproError(message, "bad-effect")
        if kind.name in effects:
            message = f"entry point {point.name} = {point.value}: {kind.name} exists already"
            raise MoproError(message, "bad-effect")
        effects[kind.name] = kind()
    return effects


__all__ = ["OWN", "Active", "Effect", "Parameter", "Stage", "catalogue", "on_axis"]
