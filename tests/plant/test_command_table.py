"""The command of an axis as a table of its segments, and the rows that hold at given times."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mopro
from mopro.effects import Active, catalogue_of
from mopro.machine import load_machine
from mopro.motion import plan
from mopro.plant import CommandTable
from mopro.plant.command_table import rows_along

MOMENTS = st.lists(st.integers(-3, 30).map(lambda i: i / 4), max_size=12).map(sorted)
TICK_S = 1e-3
PROGRAM = mopro.compile("UU012500/1\nVEL1 20.0\nACC1 0.06\nPARA1+\nMRI1 7.5\nWX1\nWT20\n")


@given(MOMENTS, MOMENTS)
def test_the_row_along_ascending_times_is_the_last_that_began(
    starts: list[float], times: list[float]
) -> None:
    rows = rows_along(np.array(starts), np.array(times))
    assert rows.tolist() == [sum(start <= time for start in starts) - 1 for time in times]


def tables(interpolate):
    """The commands of a tick, as it is and where ticks so short are averaged."""
    machine = load_machine("chow1992")
    effect = catalogue_of(machine)["profile_tick"]
    tick, schedule = Active(effect, (TICK_S, interpolate), (1,)), plan(PROGRAM)
    return [
        CommandTable.of(schedule, 1, (tick,), machine.microstep_m, longest_s)
        for longest_s in (0.0, TICK_S)
    ]


def test_a_fast_tick_is_as_far_as_its_average():
    """In each tick, but those in which the acceleration steps."""
    ticked, averaged = tables(1.0)
    ticks = TICK_S * np.arange(2, 400)
    places = np.linspace(0.0, TICK_S, 101)[:-1] + TICK_S / 200
    apart = [averaged.position_u(t + places) - ticked.position_u(t + places) for t in ticks]
    sway, off = np.ptp(apart, axis=1).max(), np.abs(np.mean(apart, axis=1))
    assert sway > 0.05
    assert np.median(off) < 1e-4 * sway
    assert np.mean(off > 1e-2 * sway) < 0.05
    assert len(averaged.starts_s) < len(ticked.starts_s) / 20


@pytest.mark.parametrize("time_s", [0.0, TICK_S / 2, 10.0])
def test_before_the_first_tick_and_after_the_last_it_rests(time_s):
    ticked, averaged = tables(1.0)
    at = np.array([time_s])
    assert averaged.position_u(at) == pytest.approx(ticked.position_u(at), abs=1e-6)


def test_a_command_that_is_held_between_ticks_is_no_average():
    held, averaged = tables(0.0)
    assert (averaged.starts_s == held.starts_s).all()
