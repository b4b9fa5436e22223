"""The motor as the diagnosis runs it, in steps that are as long as can be."""

import math

import numpy as np
import pytest

import mopro
from helpers.one_run import of
from mopro.experiment.predict import forward_model
from mopro.experiment.predict.forward_model import COARSE, ForwardModel
from mopro.machine import load_machine
from mopro.plant import Stepping, simulate

SHORTEST = Stepping(5e-6)


def positions_um(settings, stepping):
    (seen,) = ForwardModel(of(np.zeros(3200)), stepping)(settings)
    return seen * 25400


def test_a_motion_is_simulated_once_for_all_effects_of_its_sensor(monkeypatch):
    made = []

    def counted(*arguments, **options):
        made.append(arguments)
        return simulate(*arguments, **options)

    monkeypatch.setattr(forward_model, "simulate", counted)
    model = ForwardModel(of(np.zeros(3200)))
    (plain,), (offset,) = model({}), model({"sensor_offset": {"o": 1e-3}})
    assert len(made) == 1
    assert offset - plain == pytest.approx(1e-3 / 0.0254)
    model({"viscous_drag": {"b": 5.0}})
    assert len(made) == 2


@pytest.mark.parametrize(
    "settings",
    [
        {"detent_force": {"Fd": 2.0, "phi": 0.0}},
        {"current_third_harmonic": {"s": 0.02}},
        {"coulomb_friction": {"Fc": 2.0}},
        {"current_loop_lag": {"tau": 5e-5}},
        {"voltage_saturation": {"Vb": 45.0}},
        {"voltage_saturation": {"Vb": 60.0}, "phase_gain_imbalance": {"eps": 0.05}},
        {"voltage_saturation": {"Vb": 50.0}, "hold_current_reduction": {"h": 0.5, "t_h": 0.1}},
        {"voltage_saturation": {"Vb": 45.0}, "current_loop_lag": {"tau": 2e-5}},
        {
            "voltage_saturation": {"Vb": 55.0},
            "current_loop_lag": {"tau": 3e-4},
            "phase_gain_imbalance": {"eps": 0.05},
        },
    ],
    ids=lambda settings: next(iter(settings)),
)
def test_long_steps_are_within_a_tenth_of_a_micrometre(settings):
    long, short = (positions_um(settings, stepping) for stepping in (COARSE, SHORTEST))
    assert 0 < np.abs(long - short).max() < 0.1
    assert np.abs(short - positions_um({}, SHORTEST)).max() > 1.0


@pytest.mark.parametrize(
    "beside",
    [{}, {"phase_gain_imbalance": {"eps": 0.05}}, {"coulomb_friction": {"Fc": 2.0}}],
    ids=lambda settings: next(iter(settings), "alone"),
)
@pytest.mark.parametrize("supply_V", [42.0, 60.0, 400.0])
def test_a_drive_free_to_set_its_currents_moves_as_one_that_is_integrated(supply_V, beside):
    """Beside a lag of no length currents are integrated in short steps throughout."""
    settings = {"voltage_saturation": {"Vb": supply_V}, **beside}
    integrated = positions_um(settings | {"current_loop_lag": {"tau": 0.0}}, COARSE)
    assert np.abs(positions_um(settings, COARSE) - integrated).max() < 0.1


@pytest.mark.parametrize("tau_s", [1e-5, 3e-4])
def test_a_drive_with_volts_to_spare_adds_nothing_to_a_lag(tau_s):
    """Its loop knows how the currents behind the lag change, and has no reason to be off."""
    lag = {"current_loop_lag": {"tau": tau_s}}
    ample = positions_um({"voltage_saturation": {"Vb": 400.0}, **lag}, COARSE)
    assert np.abs(ample - positions_um(lag, COARSE)).max() < 0.01


@pytest.mark.parametrize("tau_s", [1e-6, 5e-5, 5e-4])
def test_a_lag_of_any_length_is_followed_in_long_steps(tau_s):
    """Behind by atan(ω tau)/k at a steady speed, ω = k ẋ; the source is the effect's own."""
    cruise = slice(480, 600)
    k = load_machine("chow1992").axis.wave_number_1_m
    expected_um = math.atan(k * 39.37 * 0.0254 * tau_s) / k * 1e6
    lag_um = positions_um({}, COARSE) - positions_um({"current_loop_lag": {"tau": tau_s}}, COARSE)
    assert lag_um[cruise].mean() == pytest.approx(expected_um, rel=0.01)


def test_currents_behind_a_lag_go_half_as_far_in_a_step():
    """At 20 in/s the command goes 0.127 mm in the longest time of a step: 0.07 µm off, not 0.01."""
    program = mopro.compile("UU012500/1\nVEL1 20.0\nACC1 0.06\nMRI1 7.5\nWX1\nWT200\n")
    settings = {"current_loop_lag": {"tau": 5e-5}}
    long, short = (
        ForwardModel(of(np.zeros(1600), program), stepping)(settings)[0] * 25400
        for stepping in (COARSE, SHORTEST)
    )
    assert np.abs(long - short).max() < 0.02
