"""A machine file as the numbers of the reference plant, which shares no code with it."""

from __future__ import annotations

from pathlib import Path

import click

from mopro.benchmark.make import Machine
from mopro.benchmark.reference.nominal import Nominal
from mopro.machine import builtin_machines, load_machine
from mopro.machine.model import FULL_STEPS_PER_PITCH
from mopro.machine.model import Machine as Stated
from mopro.units import INCH_M

# As far as the grids' programs go from where they start, the platen's middle.
_REACH_IN = 15.0
_HAIR_IN = 1e-6


def numbers_of(name: str) -> Machine:
    """The built-in machine `name`, or the one in that file.

    ModelError for a file that is no machine's; BadParameter for a machine that the
    reference plant cannot be.
    """
    stated = load_machine(name)
    if doubt := _beyond(stated):
        raise click.BadParameter(f"{name}: {doubt}", param_hint="--machine")
    known = name in builtin_machines()
    if known:
        return Machine(_nominal(stated), name)
    return Machine.of_file(_nominal(stated), Path(name).read_bytes())


def _beyond(stated: Stated) -> str | None:
    """What of a machine the reference plant does not have."""
    if stated.effects:
        return f"it has {stated.effects[0].name} already; expected what is known, without effects"
    if stated.drive.model != "ideal":
        return "expected an ideal drive"
    if stated.forcers:
        return "expected no [forcers]: the reference axis does not yaw"
    reach_in = min(high for _, high in stated.travel_u().values()) * stated.microstep_m
    reach_in /= float(INCH_M)
    if reach_in < _REACH_IN - _HAIR_IN:
        return f"programs go {_REACH_IN:g} in either way, and it has {reach_in:.3g} in"
    return None


def _nominal(stated: Stated) -> Nominal:
    axis, drive, heat = stated.axis, stated.drive, stated.heat
    return Nominal(
        pitch_m=axis.pitch_m,
        microsteps_per_pitch=FULL_STEPS_PER_PITCH * drive.microsteps_per_full_step,
        mass_kg=axis.moving_mass_kg,
        force_N=axis.pull_out_force_N,
        damping_ratio=axis.damping_ratio,
        current_A=drive.phase_current_A,
        coil_ohm=drive.coil_resistance_ohm,
        coil_H=drive.coil_inductance_H,
        air_C=heat.ambient_C,
        specific_heat_J_kg_K=heat.specific_heat_J_kg_K,
        moving_current_A=heat.moving_current_A,
        side_m=heat.forcer_side_m,
        side_area_m2=heat.side_area_m2,
        top_area_m2=heat.top_area_m2,
        air_conductivity_W_m_K=heat.air_conductivity_W_m_K,
        air_viscosity_m2_s=heat.air_viscosity_m2_s,
        prandtl=heat.prandtl_number,
        bearing_m_s=heat.bearing_flow_m3_s / heat.bearing_area_m2,
    )
