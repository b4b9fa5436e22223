"""The machine of all cases: a machine file, converted to the numbers of the reference plant.

The reference plant itself gets plain numbers; it knows no machine file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, replace
from pathlib import Path

from mopro import Machine, load_machine
from mopro.blind.cases.stated_effects import StatedEffects
from mopro.blind.reference.motor import INCH_M, THESIS, Nominal
from mopro.errors import DataError
from mopro.inputs import read_bytes

_MACHINE = "machine.toml"
# Programs of the grids stay within this distance of their start, the platen's middle.
_TRAVEL_IN = 15.0
_TRAVEL_TOLERANCE_IN = 1e-6
_FULL_STEPS_PER_PITCH = 4
# The fields of the reference plant's numbers, by the key of the machine file.
_BASE = {
    "moving_mass": "mass_kg", "pull_out_force": "force_N", "damping_ratio": "damping_ratio",
}  # fmt: skip


@dataclass(frozen=True)
class BenchmarkMachine:
    """The machine of all cases: its numbers, and the name that experiment files state.

    `text` is the content of its file, copied to each experiment; None for a built-in machine.
    `tolerated` are the fields of `nominal` for which the file states a tolerance. `effects` are
    those of a user's file, candidates in all cases and hidden in some.
    """

    nominal: Nominal = THESIS
    stated: str = "chow1992"
    text: bytes | None = None
    tolerated: tuple[str, ...] = ()
    effects: StatedEffects | None = None

    @classmethod
    def of_file(
        cls, nominal: Nominal, text: bytes, tolerated: tuple[str, ...] = ()
    ) -> BenchmarkMachine:
        """A machine with a file of its own."""
        return cls(nominal, _MACHINE, text, tolerated)


DEFAULT_MACHINE = BenchmarkMachine()


def read_machine(name: str, tolerance: float = 0.0, effects: str | None = None) -> BenchmarkMachine:
    """The built-in machine `name`, or the one in the file of that name.

    `effects`: the file with the effects of a user, if there is one.

    With a `tolerance` its file states this share for each number of the axis that may have one.
    Raises ModelError for a bad machine file, DataError for a machine with something that the
    reference plant does not simulate.
    """
    made = _read(name, tolerance)
    if effects is None:
        return made
    text = name if made.text is None else made.text.decode("utf-8")
    return replace(made, effects=StatedEffects.read(effects, text))


def _read(name: str, tolerance: float) -> BenchmarkMachine:
    machine = load_machine(name)
    if reason := _unsupported(machine):
        raise DataError(f"{name}: {reason}", "unsupported-machine")
    assert machine.source is not None, "it was read from a file"
    builtin = machine.source.name != name
    if builtin and not tolerance:
        return BenchmarkMachine(_nominal(machine), name)
    try:
        text = machine.source.text.encode() if builtin else read_bytes(Path(name))
    except OSError as error:
        raise DataError(f"{name}: cannot be read: {error.strerror}", "unreadable") from error
    if not tolerance:
        return BenchmarkMachine.of_file(_nominal(machine), text)
    keys = [f.metadata["key"] for f in fields(machine.axis) if f.metadata.get("tolerated")]
    text = _with_tolerance(name, text.decode("utf-8"), keys, tolerance).encode()
    tolerated = tuple(number for key, number in _BASE.items() if key in keys)
    return BenchmarkMachine.of_file(_nominal(machine), text, tolerated)


def _with_tolerance(name: str, text: str, keys: list[str], tolerance: float) -> str:
    """`text` with the tolerance of each key, which must be stated on one line of its own."""
    for key in keys:
        stated = re.compile(rf"(?m)^(\s*{key}\s*=\s*{{[^}}\n]*?)(?:,\s*tolerance\s*=[^,}}]*)?\s*}}")
        text, count = stated.subn(rf"\1, tolerance = {tolerance} }}", text)
        if count != 1:
            message = f"{name}: expected `{key} = {{ value = ..., ... }}` on one line"
            raise DataError(message, "unsupported-machine")
    return text


def _unsupported(machine: Machine) -> str | None:
    """The first thing that the reference plant does not simulate, as a message; None if none."""
    if machine.effects:
        return f"it has {machine.effects[0].name} already; expected a machine without effects"
    if machine.drive.model != "ideal":
        return f"its drive is {machine.drive.model}; expected an ideal drive"
    if machine.forcers:
        return "expected no [forcers]: the reference axis does not yaw"
    travel_in = min(high for _, high in machine.travel_u().values()) * machine.microstep_m
    travel_in /= INCH_M
    if travel_in < _TRAVEL_IN - _TRAVEL_TOLERANCE_IN:
        return f"programs go {_TRAVEL_IN:g} in to either side, and it has {travel_in:.3g} in"
    return None


def _nominal(machine: Machine) -> Nominal:
    axis, drive, heat = machine.axis, machine.drive, machine.heat
    return Nominal(
        pitch_m=axis.pitch_m,
        microsteps_per_pitch=_FULL_STEPS_PER_PITCH * drive.microsteps_per_full_step,
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
