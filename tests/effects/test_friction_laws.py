"""Friction that falls with the speed, and friction that the motor's force presses on."""

import math

import numpy as np
import pytest

import mopro
from helpers.diagnosis import OTHER_THAN_FORCES, diagnose
from helpers.laboratory import Lab
from mopro.experiment import load_experiment
from mopro.machine import load_machine

AXIS = load_machine("chow1992").axis
STRIBECK = {"Fc": 2.0, "Fs": 6.0, "vs": 0.05, "delta": 5e-6}
RAMP_S, CRUISE_S = 0.15, 0.2


def emulated(velocity_in_s, effects=None):
    """One trapezoid of RAMP_S up and down with CRUISE_S between, the drive without microsteps."""
    distance = velocity_in_s * (RAMP_S + CRUISE_S)
    acceleration = velocity_in_s / RAMP_S / 1000
    text = f"UU012500/1\nVEL1 {velocity_in_s}\nACC1 {acceleration:.6f}\nMRI1 {distance:.4f}\nWX1\n"
    return mopro.emulate(mopro.compile(text), resolved=False, effects=effects)


def mean(recording, column, start_s, end_s):
    inside = (recording["time_s"] > start_s) & (recording["time_s"] < end_s)
    return float(recording[column][inside].mean())


@pytest.mark.parametrize("velocity_in_s", [1.0, 2.0, 4.0, 20.0])
def test_the_motor_overcomes_stribeck_s_curve_at_every_speed(velocity_in_s):
    v = velocity_in_s * 0.0254
    expected = 2.0 + 4.0 * math.exp(-((v / 0.05) ** 2))
    span = (RAMP_S + 0.05, RAMP_S + CRUISE_S)
    force = mean(emulated(velocity_in_s, {"stribeck_friction": STRIBECK}), "force_1_N", *span)
    force -= mean(emulated(velocity_in_s), "force_1_N", *span)
    # The friction falls with the speed, so that the ring decays more slowly than without.
    assert force == pytest.approx(expected, rel=0.05)


def test_stribeck_friction_of_one_size_is_coulomb_friction():
    plain = emulated(2.0, {"coulomb_friction": {"Fc": 3.0}})
    same = emulated(2.0, {"stribeck_friction": {"Fc": 3.0, "Fs": 3.0}})
    assert np.abs(plain["position_1_m"] - same["position_1_m"]).max() < 1e-12


@pytest.mark.parametrize("mu", [0.05, 0.2])
def test_the_motor_gives_more_while_it_accelerates_and_less_while_it_brakes(mu):
    velocity = 15.0
    inertia_N = AXIS.moving_mass_kg * velocity * 0.0254 / RAMP_S
    on = emulated(velocity, {"load_dependent_friction": {"mu": mu}})
    up = mean(on, "force_1_N", 0.02, RAMP_S - 0.01)
    begun_s = RAMP_S + CRUISE_S
    down = mean(on, "force_1_N", begun_s + 0.02, begun_s + RAMP_S - 0.01)
    assert up == pytest.approx(inertia_N / (1 - mu), rel=0.02)
    assert down == pytest.approx(-inertia_N / (1 + mu), rel=0.02)


@pytest.mark.parametrize(
    ("name", "values", "parameter"),
    [
        ("stribeck_friction", STRIBECK, "Fs"),
        ("load_dependent_friction", {"mu": 0.1, "delta": 5e-6}, "mu"),
    ],
)
def test_each_is_named_with_its_size_where_it_is_hidden(tmp_path, name, values, parameter):
    lab = Lab(tmp_path)
    for program in ("fast", "slow"):
        lab.record(f"{program}.CMD", f"{program}.csv", {name: values})
    runs = [f'program = "{n}.CMD"\ndata = "{n}.csv"' for n in ("fast", "slow")]
    verdict = diagnose(load_experiment(lab.experiment(runs))).verdict
    assert (verdict.verdict, [e.name for e in verdict.effects]) == ("named", [name])
    low, high = verdict.effects[0].parameters[parameter].ci95
    assert low < values[parameter] < high


def test_a_static_friction_that_nobody_listed_is_no_coulomb_friction(tmp_path):
    """Its sliding part is Coulomb's law, and its static part shows that the law is another one."""
    lab = Lab(tmp_path)
    hidden = {"Fc": 0.5, "Fs": 1.0, "vs": 0.05, "delta": 1e-5}
    for program in ("fast", "slow"):
        lab.record(f"{program}.CMD", f"{program}.csv", {"stribeck_friction": hidden})
    runs = [f'program = "{n}.CMD"\ndata = "{n}.csv"' for n in ("fast", "slow")]
    left_out = OTHER_THAN_FORCES | {"stribeck_friction"}
    verdict = diagnose(load_experiment(lab.experiment(runs)), left_out=left_out).verdict
    assert (verdict.verdict, verdict.effects) == ("unexplained", ())
    assert {draft.enters for draft in verdict.drafts} == {"force"}
    assert "sgn v" in {draft.of for draft in verdict.drafts}
