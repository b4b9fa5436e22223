"""What the machine, as its file describes it, predicts for each reading of an experiment."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from mopro.emulator import Emulator
from mopro.emulator.backend import MAX_STEP_S
from mopro.emulator.effects import Stage
from mopro.emulator.effects.base import Surroundings
from mopro.emulator.heat import heat_balance
from mopro.emulator.measured import POSITION, measured_at
from mopro.emulator.setup import Settings, staged
from mopro.experiment.logged import schedule_of
from mopro.experiment.model import Experiment, Floats, SteadyTable, Trial
from mopro.machine import Machine
from mopro.motion import Schedule
from mopro.recording.record import Columns

_LEAST_RATE_HZ = 4000.0
_HEAT_STEPS = 20_000
_HOTTEST_K = 2000.0


def predict(experiment: Experiment) -> list[list[Floats]]:
    """For each trial, for each of its readings: the values without noise, in its unit."""
    return [_predicted(trial, experiment.machine) for trial in experiment.trials]


def planned(trial: Trial, machine: Machine) -> Schedule:
    """What commands the trial's motion; a program without end lasts as long as the data."""
    if trial.program is None:
        assert trial.command is not None, "a trial has a program or a logged command"
        return schedule_of(trial.command, machine)
    endless = trial.program.loops_forever or trial.partial
    for_s = trial.duration_s if endless else None
    return Emulator(machine, trial.payload_kg).plan(trial.program, for_s)


def _predicted(trial: Trial, machine: Machine) -> list[Floats]:
    emulator = Emulator(machine, trial.payload_kg)
    schedule = planned(trial, machine)
    schedule = replace(schedule, duration_s=max(schedule.duration_s, trial.duration_s))
    rates = [r.sensor.rate_hz for r in trial.readings if r.sensor.quantity == POSITION]
    columns = (
        _moved(emulator, schedule, trial, max(rates))
        if rates
        else _warmed(emulator, schedule, trial)
    )
    return [
        measured_at(columns, r.sensor, machine, emulator.active, r.time_s) for r in trial.readings
    ]


def _moved(emulator: Emulator, schedule: Schedule, trial: Trial, sensor_hz: float) -> Columns:
    """The run at a rate that has every regular sample of the fastest sensor."""
    rate_hz = sensor_hz * math.ceil(_LEAST_RATE_HZ / sensor_hz)
    times = np.arange(math.ceil(trial.duration_s * rate_hz) + 1) / rate_hz
    return emulator.begin(schedule).advance(times, float(times[-1]))


def _warmed(emulator: Emulator, schedule: Schedule, trial: Trial) -> Columns:
    """The forcer's temperature alone, which needs no equation of motion."""
    times = np.linspace(0.0, trial.duration_s, _HEAT_STEPS)
    settings = Settings(emulator.machine, trial.payload_kg, True, MAX_STEP_S, compiled=False)
    heat = staged(schedule, settings, emulator.active).heat
    return {"time_s": times, "temperature_C": heat.temperature_C(times)}


def predict_table(table: SteadyTable, machine: Machine) -> Floats:
    """The rise (K) of each row at which as much heat leaves the forcer as comes in.

    On a diagonal the path's speed and length count, as in `mopro thesis 3.2`.
    """
    rows = zip(table.velocity_m_s, table.x_m, table.y_m, strict=True)
    return np.array([_steady_rise_K(machine, *map(float, row)) for row in rows])


def _steady_rise_K(machine: Machine, velocity: float, x: float, y: float) -> float:
    lengths = tuple(way for way in (x, y) if way)
    speeds = tuple(velocity * way / max(lengths) for way in lengths)
    balance = heat_balance(machine, len(lengths), math.hypot(*speeds), math.hypot(*lengths))
    effects = [a for a in Emulator(machine).active if a.effect.stage is Stage.HEAT]

    def surplus_W(rise_K: float) -> float:
        air_C = machine.heat.ambient_C
        here = Surroundings(
            0.0, air_C + rise_K, air_C, balance.power_W, balance.conductance_W_K,
            speeds, lengths, machine,
        )  # fmt: skip
        for a in effects:
            a.effect.heat(here, *a.values)
        return here.flow_W

    rise: float = brentq(surplus_W, 0.0, _HOTTEST_K, xtol=1e-9)
    return rise
