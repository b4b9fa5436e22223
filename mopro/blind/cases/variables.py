"""The variables that an effect's response depends on, by physics: the right words for a residual.

A remaining residual is described by one of `v`, `sgn v`, `x`, `x mod` (periodic in position),
`a`, `t`, `T` (temperature), `command` and `sensor` (the reading itself).
"""

from __future__ import annotations

import re

# Several are right where one motion makes them proportional: a late reading is off by v times
# the delay, and a clock that is fast by v times the time that has passed.
EFFECT_VARIABLES: dict[str, tuple[str, ...]] = {
    # Forces: the lag is the force over the stiffness.
    "payload_mass": ("a",),
    "viscous_drag": ("v",),
    "quadratic_drag": ("v",),
    "coulomb_friction": ("sgn v",),
    "stribeck_friction": ("sgn v", "v"),
    "load_dependent_friction": ("sgn v", "a"),
    "umbilical_spring": ("x",),
    "constant_force": ("command", "sensor"),
    "electrical_damping": ("a", "v", "command"),
    "force_constant": ("a",),
    "force_constant_temperature": ("T", "a", "t"),
    "detent_force": ("x mod",),
    # Currents: their errors repeat with the pitch, or follow the field's speed.
    "phase_gain_imbalance": ("x mod",),
    "quadrature_error": ("x mod",),
    "phase_current_offset": ("x mod",),
    "current_third_harmonic": ("x mod",),
    "current_loop_lag": ("v", "command", "t"),
    "voltage_saturation": ("v", "command"),
    "hold_current_reduction": ("command", "t"),
    # The command.
    "acceleration_scale": ("command", "a"),
    "velocity_scale": ("command", "v"),
    "profile_tick": ("command", "v", "t"),
    "controller_clock": ("command", "v", "t"),
    "start_delay": ("command", "v", "t"),
    "lost_steps": ("command", "x", "t"),
    # The measurement.
    "pitch_scale": ("x", "sensor"),
    "platen_expansion": ("x", "sensor", "T"),
    "backlash": ("sgn v",),
    "periodic_error": ("x mod", "sensor"),
    "cross_axis_coupling": ("x", "command", "sensor"),
    "sensor_gain": ("sensor", "x"),
    "sensor_offset": ("sensor",),
    "sensor_nonlinearity": ("sensor", "x"),
    "sensor_bandwidth": ("sensor", "v", "t"),
    "trigger_delay": ("t", "v", "command", "sensor"),
    "sample_clock": ("t", "v", "sensor"),
    "hum": ("t",),
    # Heat.
    "platen_conduction": ("T",),
    "speed_dependent_heat": ("v",),
    "convection_scale": ("T", "v"),
    "resistance_tempco": ("T",),
    "radiation": ("T",),
    "ambient_drift": ("t", "T"),
    "thermocouple_lag": ("sensor", "t", "T"),
}


def said(variable: str) -> str:
    """`variable` in the form of the table: without spaces at its ends, one space within."""
    return re.sub(r"\s+", " ", variable.strip())
