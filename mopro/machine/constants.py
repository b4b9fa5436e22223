"""The constants of one axis' equation of motion."""

from __future__ import annotations

from dataclasses import dataclass

from mopro.machine.model import Machine


@dataclass(frozen=True)
class PlantConstants:
    """Constants from the machine, which effects of the dynamics may change.

    `damping_N_s_m` is c_s, `critical_N_s_m` the one that damps the bare motor at ζ = 1.
    """

    wave_number_1_m: float
    pitch_m: float
    pull_out_force_N: float
    mass_kg: float
    damping_N_s_m: float
    critical_N_s_m: float
    microstep_m: float
    phase_current_A: float
    coil_resistance_ohm: float
    coil_inductance_H: float

    @classmethod
    def of(cls, machine: Machine, payload_kg: float) -> PlantConstants:
        axis, drive, forcers = machine.axis, machine.drive, machine.forcers
        share = (forcers.strength_1 + forcers.strength_2) / 2 if forcers else 1.0
        return cls(
            wave_number_1_m=axis.wave_number_1_m,
            pitch_m=axis.pitch_m,
            pull_out_force_N=axis.pull_out_force_N * share,
            mass_kg=axis.moving_mass_kg + payload_kg,
            damping_N_s_m=axis.drive_damping_N_s_m,
            critical_N_s_m=axis.critical_damping_N_s_m,
            microstep_m=machine.microstep_m,
            phase_current_A=drive.phase_current_A,
            coil_resistance_ohm=drive.coil_resistance_ohm,
            coil_inductance_H=drive.coil_inductance_H,
        )

    @property
    def pull_out_m_s2(self) -> float:
        """F0/m."""
        return self.pull_out_force_N / self.mass_kg

    @property
    def damping_1_s(self) -> float:
        """c_s/m."""
        return self.damping_N_s_m / self.mass_kg
