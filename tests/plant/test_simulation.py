"""The one way into the plant: a schedule and a machine, taken through time by the caller."""

import subprocess
import sys

import numpy as np
import pytest

import mopro
from mopro import plant
from mopro.effects import Active, catalogue_of
from mopro.machine import load_machine
from mopro.motion import Stopping, plan
from mopro.plant import simulate

MACHINE = load_machine("chow1992")
SETUP = "UU012500/1\nVEL0 20\nACC0 0.25\n"
SCHEDULE = plan(mopro.compile(SETUP + "MRI1 1\nWX1\nWT50\nMRI2 -1\nWX2\nWT50\n"))
RATE_HZ = 1000.0


def grid(from_s, to_s):
    return np.arange(round(from_s * RATE_HZ), round(to_s * RATE_HZ)) / RATE_HZ


def test_several_advances_give_what_one_gives():
    whole = simulate(SCHEDULE, MACHINE).advance(grid(0.0, 0.3), 0.3)
    simulation = simulate(SCHEDULE, MACHINE)
    parts = [simulation.advance(grid(a, b), b) for a, b in ((0.0, 0.1), (0.1, 0.123), (0.123, 0.3))]
    for name, values in whole.items():
        assert np.allclose(np.concatenate([p[name] for p in parts]), values, rtol=0, atol=1e-12)


def active(name, *values):
    """One effect on both axes; at its nulls unless it has values."""
    effect = catalogue_of(MACHINE)[name]
    return Active(effect, values or tuple(p.null for p in effect.parameters), (1, 2))


@pytest.mark.parametrize("effects", [(), (active("coulomb_friction", 5.0, 5e-6),)], ids=len)
def test_positions_alone_are_those_of_the_columns(effects):
    columns = simulate(SCHEDULE, MACHINE, effects).advance(grid(0.0, 0.3), 0.3)
    simulation = simulate(SCHEDULE, MACHINE, effects)
    for axis in (1, 2):
        alone = simulation.positions_m(axis, grid(0.0, 0.3), 0.3)
        assert np.array_equal(alone, columns[f"position_{axis}_m"])
        assert simulation.position_m(axis) == pytest.approx(alone[-1], abs=2e-5)


def test_an_effect_at_its_nulls_changes_no_bit_of_the_motion():
    present = active("stribeck_friction", 2.0, 5e-6, 4.0, 0.05)
    groups = {present.effect.kernel_group}
    absent = [
        active(name)
        for name, effect in catalogue_of(MACHINE).items()
        if effect.kernel_group in groups and name != present.name
    ]
    assert len(absent) > 5
    times = grid(0.0, 0.3)
    alone, among = (
        simulate(SCHEDULE, MACHINE, effects, compiled=True).positions_m(1, times, 0.3)
        for effects in ((present,), (*absent, present))
    )
    assert np.array_equal(alone, among)


def test_a_changed_schedule_leaves_the_past_and_changes_what_comes():
    untouched = simulate(SCHEDULE, MACHINE).advance(grid(0.0, 0.3), 0.3)
    simulation = simulate(SCHEDULE, MACHINE)
    before = simulation.advance(grid(0.0, 0.05), 0.05)
    stopped = SCHEDULE.stopped(0.05, Stopping.HOLD)
    simulation.change(stopped)
    after = simulation.advance(grid(0.05, 0.3), 0.3)
    for name, values in before.items():
        assert np.array_equal(values, untouched[name][: len(values)]), name
    assert simulation.schedule is stopped
    held = stopped.final_u(1) * MACHINE.microstep_m
    assert set(after["command_1_m"].tolist()) == {held}
    simulation.settle()
    pitches = (simulation.position_m(1) - held) / MACHINE.axis.pitch_m
    assert pitches == pytest.approx(round(pitches), abs=0.05)
    assert pitches > 1


def test_the_outcome_of_a_move_does_not_depend_on_how_often_it_is_looked_at():
    rarely, often = (simulate(SCHEDULE, MACHINE) for _ in range(2))
    rarely.follow(50.0)
    often.follow(2000.0)
    for simulation in (rarely, often):
        simulation.settle()
    for move in SCHEDULE.moves:
        seen, wanted = rarely.outcome(move), often.outcome(move)
        assert seen.stall_margin == pytest.approx(wanted.stall_margin, abs=1e-4)
        assert (seen.lost_pitches, seen.slipped) == (0, False)


def test_a_blow_costs_whole_pitches():
    simulation = simulate(SCHEDULE, MACHINE)
    simulation.follow(RATE_HZ, 0.05)
    simulation.slip(1, 2)
    simulation.advance(grid(0.05, 0.1), SCHEDULE.duration_s)
    simulation.settle()
    assert simulation.outcome(SCHEDULE.moves[0]).lost_pitches == 2


def test_trips_are_the_callers_unless_asked_for():
    beyond = plan(mopro.compile(SETUP + "MRI2 31.0\nWX2\n"))
    assert simulate(beyond, MACHINE).schedule is beyond
    tripped = simulate(beyond, MACHINE, trips=True)
    assert tripped.trip is not None
    assert tripped.schedule.final_u(2) < beyond.final_u(2)
    assert not tripped.schedule.complete


def test_a_temperature_needs_no_equation_of_motion(monkeypatch):
    def refuse(*arguments):
        raise AssertionError("an axis was made")

    monkeypatch.setattr("mopro.plant.simulation.EmulatedAxis", refuse)
    warmer = simulate(SCHEDULE, MACHINE).temperature_C(np.array([0.0, 0.3]))
    assert warmer[0] == pytest.approx(MACHINE.heat.ambient_C)
    assert warmer[1] > warmer[0] + 1e-3


def test_the_front_door_offers_what_it_says():
    assert {name for name in plant.__all__ if getattr(plant, name) is None} == set()
    assert set(plant.__all__) == set(plant._HOMES)
    with pytest.raises(AttributeError, match="no attribute 'stage'"):
        _ = plant.stage


def test_a_heat_balance_loads_no_kernel():
    code = "import sys; from mopro.plant import heat_balance; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "mopro.plant.heat" in loaded
    assert not loaded & {"mopro.plant.simulation", "scipy", "numba"}


@pytest.mark.parametrize("effects", [(), (active("coulomb_friction", 5.0, 5e-6),)], ids=len)
def test_to_follow_is_to_advance_without_columns(effects, monkeypatch):
    """The outcomes of the moves have the same bits, in however many parts it goes."""
    monkeypatch.setattr("mopro.plant.simulation._CHUNK", 100)
    followed, advanced = (simulate(SCHEDULE, MACHINE, effects) for _ in range(2))
    followed.follow(RATE_HZ)
    advanced.advance(grid(0.0, SCHEDULE.duration_s + 1e-3)[:-1], SCHEDULE.duration_s)
    for simulation in (followed, advanced):
        simulation.settle()
    for move in SCHEDULE.moves:
        assert followed.outcome(move) == advanced.outcome(move)
        assert followed.settling_s(move) == advanced.settling_s(move)
