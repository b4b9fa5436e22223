"""Specification of one case: effects, sizes, sensors and kind of program."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mopro.blind.cases.hidden_effects import HIDDEN_EFFECTS
from mopro.blind.reference.motor import INCH_M
from mopro.blind.reference.sensors import Instrument

LASER, ENCODER, LVDT, THERMOCOUPLE = "laser", "encoder", "lvdt", "thermocouple"

# Effects large enough for an LVDT: profile errors, scale, clock, hum, delays, lost pitches.
COARSE = (
    "acceleration_scale", "velocity_scale", "profile_tick", "controller_clock", "start_delay",
    "lost_steps", "sensor_gain", "sensor_nonlinearity", "sensor_bandwidth", "trigger_delay",
    "sample_clock", "hum",
)  # fmt: skip
# Effects that pairs and triples are drawn from: large enough for a laser.
PAIRABLE = (
    "payload_mass", "viscous_drag", "quadratic_drag", "coulomb_friction", "umbilical_spring",
    "electrical_damping", "force_constant", "detent_force", "phase_gain_imbalance",
    "quadrature_error", "phase_current_offset", "current_third_harmonic", "current_loop_lag",
    "acceleration_scale", "velocity_scale", "profile_tick", "controller_clock", "start_delay",
    "pitch_scale", "backlash", "periodic_error", "sensor_gain", "sensor_nonlinearity",
    "sensor_bandwidth", "trigger_delay", "sample_clock", "hum",
)  # fmt: skip


@dataclass(frozen=True)
class CaseSpec:
    """Specification of one case.

    `effects` are pairs of a name and a class of size (`sizes.SIZE_CLASSES`, or "ends" for an
    end of the plausible range); `style` is the kind of program; there are `runs` of about
    `run_s` seconds. If the effects are `deleted`, the question leaves them out.
    `foreign` is a kind of physics or fault that is in no catalogue.
    Recordings that are `cut` end before their program. The experiment states the sensors' noise
    times `noise_factor`. With `base` the machine's numbers are off within their tolerance.
    Effects that are `stated` are those of a user's file. With `constants` what the effects assume
    is anywhere in its plausible range.
    """

    group: str
    sensor: str
    effects: tuple[tuple[str, str], ...] = ()
    disturbance: str = ""
    style: str = "strokes"
    runs: int = 5
    run_s: float = 5.0
    deleted: bool = False
    foreign: str = ""
    cut: bool = False
    noise_factor: float = 1.0
    base: bool = False
    stated: bool = False
    constants: bool = False


def single(
    name: str,
    size: str,
    sensor: str,
    runs: int = 5,
    run_s: float = 5.0,
    group: str = "single",
    deleted: bool = False,
) -> CaseSpec:
    """A case with one effect; a thermal one has a thermocouple and runs of its own."""
    if HIDDEN_EFFECTS[name].thermal:
        return replace(warm(group, (name, size)), deleted=deleted)
    style = "two axes" if name == "cross_axis_coupling" else "strokes"
    hidden = ((name, size),)
    return CaseSpec(group, sensor, hidden, style=style, runs=runs, run_s=run_s, deleted=deleted)


def warm(group: str, *effects: tuple[str, str], runs: int = 2, run_s: float = 3600.0) -> CaseSpec:
    """A case with a thermocouple."""
    return CaseSpec(group, THERMOCOUPLE, effects, style="cycles", runs=runs, run_s=run_s)


def case_instruments(sensor: str, style: str) -> list[Instrument]:
    """The sensors of a case: one, or for the style "two axes" one on each axis."""
    if sensor == THERMOCOUPLE:
        return [Instrument(sensor, "temperature", 1, "temperature_C", 1.0, 1.0, 0.1, 0.09765625)]
    rate, noise, step = {
        LASER: (2000.0, 2e-5, 0.0), ENCODER: (1000.0, 2e-4, 1e-4), LVDT: (800.0, 0.025, 0.004883),
    }[sensor]  # fmt: skip
    axes = (1, 2) if style == "two axes" else (1,)
    names = {1: sensor} if len(axes) == 1 else {n: f"{sensor}_{n}" for n in axes}
    return [
        Instrument(names[n], "position", n, f"position_{n}_in", INCH_M, rate, noise, step)
        for n in axes
    ]
