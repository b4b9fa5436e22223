"""Search for the largest acceleration that a machine follows, against speed.

For each peak velocity, a move of two ramps and a short cruise is emulated with more and
less acceleration until the bracket between following and stalling is narrow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from mopro.effects import catalogue_of
from mopro.effects.resolve import active_effects
from mopro.machine import Machine
from mopro.motion import plan_profile
from mopro.plant import plan_with_effects, simulate
from mopro.program.compile import compile as compile_text
from mopro.units import INCH_M

TRAPEZOID, PARABOLA = "trapezoid", "parabola"
PROFILES = (TRAPEZOID, PARABOLA)
_CRUISE_S = 0.03
_RESOLUTION = 0.02
_LEAST_IN_S2 = 1.0
_MOST_IN_S2 = 100_000.0
_INCH_M = float(INCH_M)
_WATCHED_HZ = 200.0


@dataclass(frozen=True)
class Limit:
    """Largest `acceleration` (in/s²) that is followed up to `velocity` (in/s).

    `peak_force_N` is the force that it needs with the load, `duration_s` the duration of the
    given move with it. Both are None where even the least acceleration stalls.
    """

    profile: str
    velocity: float
    acceleration: float | None
    peak_force_N: float | None
    duration_s: float | None


def with_full_drive(machine: Machine) -> Machine:
    """The machine with the full electrical model, under which pull-out falls with speed."""
    return replace(machine, drive=replace(machine.drive, model="full"))


def find_limits(
    machine: Machine, payload_kg: float, velocities: list[float], distance: float
) -> list[Limit]:
    """The limits of both profiles; `distance` (in) is the move that is timed."""
    return [
        _limit(machine, payload_kg, profile, velocity, distance)
        for velocity in velocities
        for profile in PROFILES
    ]


def _limit(
    machine: Machine, payload_kg: float, profile: str, velocity: float, distance: float
) -> Limit:
    mass = machine.axis.moving_mass_kg + payload_kg
    static = machine.axis.pull_out_force_N / mass / _INCH_M
    low, high = _LEAST_IN_S2, min(1.5 * static, _MOST_IN_S2)
    if not follows(machine, payload_kg, profile, velocity, low):
        return Limit(profile, velocity, None, None, None)
    while high / low > 1 + _RESOLUTION:
        # Geometric while the bracket is wide, so that low limits are found as well.
        middle = (low * high) ** 0.5 if high > 2 * low else (low + high) / 2
        if follows(machine, payload_kg, profile, velocity, middle):
            low = middle
        else:
            high = middle
    duration_s = plan_profile(distance, velocity, low, profile == PARABOLA).duration_s
    return Limit(profile, velocity, low, low * _INCH_M * mass, duration_s)


def follows(
    machine: Machine, payload_kg: float, profile: str, velocity: float, acceleration: float
) -> bool:
    """True if the motor reaches `velocity` at `acceleration`, and stops, without a slip."""
    ramps = (8 / 3 if profile == PARABOLA else 1.0) * velocity**2 / acceleration
    distance = ramps + velocity * _CRUISE_S
    text = (
        f"UU012500/1\nVEL1 {velocity:.5f}\nACC1 {acceleration / 1000:.8f}\n"
        f"PARA1{'+' if profile == PARABOLA else '-'}\nMRI1 {distance:.5f}\nWX1\nWT50\n"
    )
    program = compile_text(text)
    active = active_effects(machine, catalogue_of(machine))
    simulation = simulate(
        plan_with_effects(program, machine, active),
        machine,
        active,
        payload_kg=payload_kg,
        resolved=False,
        compiled=True,
    )
    simulation.follow(_WATCHED_HZ)
    return not any(simulation.outcome(move).slipped for move in simulation.schedule.moves)
