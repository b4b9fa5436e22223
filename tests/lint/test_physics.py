"""Findings of lint on the machine, against the emulator and closed forms."""

import re

import pytest

import mopro
from helpers.lint_agreement import agreement
from mopro.lint import Settings, lint
from mopro.lint.check import subject_of
from mopro.lint.energy_bound import EnergyBound, Pendulum, greatest_step_m_s2
from mopro.machine import load_machine
from mopro.plant import heat_balance
from mopro.source import Source

MACHINE = load_machine("chow1992")


def of(text, **settings):
    return Source("x.CMD", text), Settings(**settings)


def only(text, **settings):
    (finding,) = lint(*of(text, **settings))
    return finding


@pytest.mark.parametrize("seed", [1992, 1993, 1994, 1995])
def test_lint_agrees_with_the_emulator(seed):
    outcomes, wrong = agreement(50, seed)
    assert len(wrong) <= 0.01 * outcomes.total(), [v.text for v in wrong]
    assert min(outcomes["stall, stalls"], outcomes["safe, does not"]) > 5


def test_the_acceleration_proposed_works_and_a_tenth_more_does_not():
    text = "UU012500/1\nVEL1 40.0\nACC1 {}\nMRI1 15.0\nWX1\n"
    hint = only(text.format("1.5")).hint
    acc = float(re.search(r"`ACC1 ([0-9.]+)`", hint)[1])
    margins = [
        mopro.emulate(mopro.compile(text.format(f"{acc * k:.5f}"))).run.moves[0].stall_margin
        for k in (1.0, 1.1)
    ]
    assert margins[0] >= 0.05 > margins[1]
    assert f"{margins[0]:.0%}" in hint


def test_bound_of_the_swing_is_the_pull_out_of_an_undamped_step():
    """PHYSICS: a step of 0.7246 F0/m pulls out, and none below."""
    pendulum = Pendulum(43.65, 0.0, 6184.0)
    for share, lost in ((0.7245, False), (0.7247, True)):
        bound = EnergyBound(pendulum)
        bound.push(share * 43.65, share * 43.65, 1.0)
        assert bound.lost is lost


@pytest.mark.parametrize("margin", [0.05, 0.3, 0.7])
def test_greatest_step_leaves_its_margin(margin):
    acceleration = greatest_step_m_s2(MACHINE.axis.pull_out_force_N / 2.543, margin) / 0.0254
    text = f"UU012500/1\nVEL1 40.0\nACC1 {acceleration / 1000:.5f}\nMRI1 15.0\nWX1\n"
    move = mopro.emulate(mopro.compile(text)).run.moves[0]
    assert margin - 0.02 < move.stall_margin < margin + 0.1


def test_margins_without_the_emulator_are_lower_bounds(programs_folder):
    for program in ("LVDT1", "LVDT2", "LVDT3", "LVDT4"):
        text = (programs_folder / f"{program}.CMD").read_text("ascii")
        subject = subject_of(*of(text))
        moves = mopro.emulate(subject.program).run.moves
        for found, move in zip(subject.stall_margins.each, moves, strict=True):
            assert not found.emulated
            assert found.margin <= move.stall_margin


def test_temperature_in_the_long_run_is_that_of_steady_motion():
    """At a cruise that fills the round, the final temperature is eq. 3.26's."""
    text = "UU012500/1\nVEL1 1.0\nACC1 1.0\n:B1\nMRI1 0.5\nWX1\nMRI1 -0.5\nWX1\nJUMP B1\n"
    message = only(text).message
    balance = heat_balance(MACHINE, 1, 0.0254, 0.0127)
    final = MACHINE.heat.ambient_C + balance.rise_K
    assert float(re.search(r"to ([0-9.]+) °C", message)[1]) == pytest.approx(final, abs=0.1)
    capacity = MACHINE.axis.moving_mass_kg * MACHINE.heat.specific_heat_J_kg_K
    import math

    cold = MACHINE.heat.ambient_C
    minutes = -math.log((final - 110.0) / (final - cold)) * capacity / balance.conductance_W_K / 60
    assert float(re.search(r"after ([0-9.]+) min", message)[1]) == pytest.approx(minutes, rel=0.01)


def test_round_in_which_a_drift_leaves_the_travel():
    """22.5 in to the switch; each round goes 8 in forth and 7 in back."""
    text = "UU012500/1\nVEL0 40.0\nACC0 0.25\n:B1\nMRI1 8.0\nWX1\nMRI1 -7.0\nWX1\nJUMP B1\n"
    finding = only(text, ignore=frozenset({"limit-switch"}))
    rounds = next(n for n in range(1, 99) if (n - 1) * 1.0 + 8.0 > 22.5)
    assert f"in round {rounds}" in finding.message
    assert "axis 1 1 in further on" in finding.message


def test_a_rest_in_a_loop_stops_no_one_for_long():
    """A wait of eleven days is not lived through."""
    loop = ":B1\nMRI1 15.0\nWX1\nWT1000000000\nMRI1 -15.0\nWX1\nJUMP B1\n"
    text = "UU012500/1\nVEL0 40.0\nACC0 1.9\n" + loop
    assert {f.rule for f in lint(*of(text))} == {"stall"}
