"""Hours of short moves: the cost is the hours', and the temperature the exact one."""

import math

import numpy as np
import pytest

import mopro
from helpers.paths import PROGRAMS
from mopro.effects import Active, Domain, Effect, catalogue
from mopro.effects.unlisted import with_unlisted
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.plant.drive_scaling import DriveScaling
from mopro.plant.heat import heat_intervals
from mopro.plant.stepped_heat import SteppedHeat
from mopro.program.compile import compile_file

MACHINE = load_machine("chow1992")
CAPACITY_J_K = MACHINE.axis.moving_mass_kg * MACHINE.heat.specific_heat_J_kg_K
FULL = {1: DriveScaling.full(), 2: DriveScaling.full()}
HOUR_S = 3600.0
MIXED = (
    "UU012500/1\nVEL0 15.0\nACC0 0.2\n:A\nMR1 8.0\nMR2 6.0\nGO\nWX0\nWT700\n"
    "MRI1 -8.0\nWX1\nMRI2 -6.0\nWX2\nWT300\nJUMP A\n"
)


def active(**parameters):
    effects = catalogue()
    return [
        Active(effects[name], tuple(values.get(p.name, p.null) for p in effects[name].parameters),
               (1, 2))
        for name, values in parameters.items()
    ]  # fmt: skip


def exact_C(moves, conductance, per_metre, per_hertz, until_s, times):
    """Piecewise exponentials with the platen at the air's temperature."""
    intervals = heat_intervals(MACHINE, moves)
    starts = intervals.starts_s.tolist()
    balances = [intervals.balances[i] for i in intervals.number]
    air = temperature = MACHINE.heat.ambient_C
    found = np.empty(len(times))
    for balance, start, end in zip(balances, starts, [*starts[1:], until_s], strict=True):
        out = balance.conductance_W_K + conductance + per_metre * math.hypot(*balance.lengths_m)
        hertz = sum(balance.speeds_m_s) / MACHINE.axis.pitch_m
        final, rate = air + (balance.power_W + per_hertz * hertz) / out, out / CAPACITY_J_K
        here = (times >= start) & (times <= end)
        found[here] = final + (temperature - final) * np.exp(-rate * (times[here] - start))
        temperature = final + (temperature - final) * np.exp(-rate * (end - start))
    return found


@pytest.mark.parametrize("name", ["TEMP1", "mixed"])
def test_an_hour_of_short_moves_is_exact_to_millikelvins(name):
    program = compile_file(PROGRAMS / "TEMP1.CMD") if name == "TEMP1" else mopro.compile(MIXED)
    schedule = plan(program, HOUR_S)
    assert len(schedule.moves) > 1000
    effects = active(platen_conduction={"G": 1.0, "g": 10.0}, speed_dependent_heat={"kh": 0.2})
    # Within the steps and at their ends, close to the moves' starts and far from them.
    times = np.sort(np.random.default_rng(1).uniform(0.0, HOUR_S, 3000))
    heat = SteppedHeat(MACHINE, schedule.moves, effects, FULL, HOUR_S)
    expected = exact_C(schedule.moves, 1.0, 10.0, 0.2, HOUR_S, times)
    assert heat.temperature_C(times) == pytest.approx(expected, abs=2e-3)


def test_less_current_at_rest_is_met_within_a_step():
    """Every second at rest with half the current, as long as the moves are many."""
    times = np.arange(0.0, HOUR_S, 1.0)
    gain = np.where(np.arange(len(times)) % 2, 0.5, 1.0)
    saving = {n: DriveScaling(times, gain, np.ones(len(times))) for n in (1, 2)}
    mean = SteppedHeat(MACHINE, [], [], saving, HOUR_S).temperature_C(np.array([HOUR_S]))
    power = heat_intervals(MACHINE, []).balances[0].power_W
    conductance = heat_intervals(MACHINE, []).balances[0].conductance_W_K
    final = (power * (1 + 0.25) / 2) / conductance
    rise = final * (1 - np.exp(-HOUR_S * conductance / CAPACITY_J_K))
    assert mean - MACHINE.heat.ambient_C == pytest.approx(rise, abs=0.02)


def test_the_work_does_not_grow_with_the_moves():
    class Counted(Effect):
        """Nothing, counted. Source: test."""

        name = "counted"
        domain = Domain.HEAT
        parameters = ()
        calls = 0

        def heat(self, here, *p):
            type(self).calls += 1

    calls = []
    for body in ("MRI2 15.0\nWX2\nMRI2 -15.0\nWX2\n", "MRI2 1.0\nWX2\nMRI2 -1.0\nWX2\n"):
        text = f"UU012500/1\nVEL0 15.0\nACC0 0.2\n:A\n{body}JUMP A\n"
        moves = plan(mopro.compile(text), HOUR_S).moves
        before = Counted.calls
        SteppedHeat(MACHINE, moves, [Active(Counted(), (), (1, 2))], FULL, HOUR_S)
        calls.append(Counted.calls - before)
    assert calls[0] == calls[1] < 12 * HOUR_S / 10


@pytest.mark.parametrize("name", ["heat of T", "heat of T²", "radiation"])
def test_a_temperature_that_runs_away_has_no_number_from_there_on(name):
    """And a finite one before: numpy has nothing to warn of."""
    effect = with_unlisted(catalogue())[name]
    sizes = {"heat of T": 1e5, "heat of T²": 10.0, "radiation": -1e5}
    effects = [Active(effect, (sizes[name],), (1, 2))]
    schedule = plan(compile_file(PROGRAMS / "TEMP1.CMD"), HOUR_S)
    heat = SteppedHeat(MACHINE, schedule.moves, effects, FULL, HOUR_S)
    seen = heat.temperature_C(np.linspace(0.0, HOUR_S, 3601))
    first = int(np.argmax(np.isnan(seen)))
    assert seen[0] == MACHINE.heat.ambient_C
    assert 0 < first < 3600
    assert np.isfinite(seen[:first]).all()
    assert np.isnan(seen[first:]).all()
