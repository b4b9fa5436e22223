"""The motor as the diagnosis runs it, in steps that are as long as can be."""

import math

import numpy as np
import pytest

import mopro
from helpers.one_run import of
from mopro.experiment.sawyer import forward_model
from mopro.experiment.sawyer.candidates import candidates, unlisted
from mopro.experiment.sawyer.forward_model import COARSE, ROUGH, ForwardModel
from mopro.machine import load_machine
from mopro.plant import Stepping, simulate

SHORTEST = Stepping(5e-6)


def positions_um(settings, stepping):
    (seen,) = ForwardModel(of(np.zeros(3200)), stepping)(settings)
    return seen * 25400


def test_a_motion_is_simulated_once_for_all_effects_of_its_sensor(monkeypatch):
    """And a temperature once for all effects that leave it as it is."""
    made = []

    def counted(*arguments, **options):
        made.append(arguments)
        return simulate(*arguments, **options)

    monkeypatch.setattr(forward_model, "simulate", counted)
    model = ForwardModel(of(np.zeros(3200)))
    (plain,), (offset,) = model({}), model({"sensor_offset": {"o": 1e-3}})
    assert len(made) == 2, "a motion and a temperature"
    assert offset - plain == pytest.approx(1e-3 / 0.0254)
    model({"viscous_drag": {"b": 5.0}})
    assert len(made) == 3, "another motion"


def _first_starts(candidate):
    values = {p.name: p.starts[0] if p.starts else p.null for p in candidate.parameters}
    return candidate.settings(values)


def test_rough_steps_tell_the_change_by_any_effect_within_two_percent():
    """Of 1 nm (RMS) and more: what changes less is seen by no sensor."""
    normal, rough = (ForwardModel(of(np.zeros(3200)), stepping) for stepping in (COARSE, ROUGH))
    off, seen = {}, 0
    every = [*candidates(normal), *unlisted(normal)]
    for candidate in (c for c in every if c.find_starts is None):
        own = _first_starts(candidate)
        change_um, rough_um = (25400 * (m(own)[0] - m({})[0]) for m in (normal, rough))
        size_um = float(np.sqrt(np.mean(change_um**2)))
        seen += size_um > 1e-3
        error_um = float(np.sqrt(np.mean((rough_um - change_um) ** 2)))
        if error_um > max(0.02 * size_um, 2e-5):
            off[candidate.key] = (size_um, error_um)
    assert seen > 30
    assert off == {}


@pytest.mark.parametrize(
    "settings",
    [
        {"detent_force": {"Fd": 2.0, "phi": 0.0}},
        {"current_third_harmonic": {"s": 0.02}},
        {"coulomb_friction": {"Fc": 2.0}},
        {"current_loop_lag": {"tau": 5e-5}},
        {"profile_tick": {"T": 1e-3, "interpolate": 1.0}},
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
