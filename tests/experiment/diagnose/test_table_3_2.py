"""The source's own data: what its model lacks is named, and nothing that it does not lack."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

import mopro
from helpers.thermal_table import AIR, CYCLE_M, MACHINE, offered, table
from mopro.experiment.sawyer.steady import rises
from mopro.experiment.sawyer.steady import series_of_table as series

CANDIDATES = offered()


def verdict_of(rise=None, noise=1.0):
    of_table = table(rise, noise)

    def simulate(settings):
        return [rises(of_table, MACHINE, settings)]

    return mopro.reconcile(simulate, CANDIDATES, [series(of_table)])


@pytest.fixture(scope="module")
def verdict():
    return verdict_of()


def test_conduction_that_grows_with_the_stroke_and_heat_that_grows_with_speed(verdict):
    assert verdict.verdict == "named"
    found = {effect.name: effect for effect in verdict.effects}
    assert set(found) == {"platen_conduction", "speed_dependent_heat"}
    assert set(found["platen_conduction"].parameters) == {"G", "g"}
    assert set(found["speed_dependent_heat"].parameters) == {"kh"}
    for effect in found.values():
        assert effect.held_out
        assert effect.log10_bayes_factor > 2
        for estimate in effect.parameters.values():
            assert 0 < estimate.ci95[0] < estimate.value < estimate.ci95[1]


def test_thirty_kelvins_become_one_and_a_half(verdict):
    assert verdict.gap.before_rms == pytest.approx(30.5, abs=0.1)
    assert verdict.gap.after_rms <= 1.6
    assert verdict.gap.held_out_rms <= 2.7


def test_the_fit_is_the_least_squares_of_the_closed_form(verdict):
    """(P + kh Σf)/(hA + G + g s), worked out here, with every row left out once."""

    of_table = table()
    moving = (of_table.x_m > 0).astype(float) + (of_table.y_m > 0)
    power = (4 * 16 + moving) * 2.0
    film = power / rises(of_table, MACHINE, {})
    path, hertz = np.hypot(of_table.x_m, of_table.y_m), moving * of_table.velocity_m_s / CYCLE_M

    def residual(p, rows=slice(None)):
        model = (power + p[2] * hertz) / (film + p[0] + p[1] * path)
        return (model - of_table.rise_K)[rows]

    best = least_squares(residual, [3.0, 3.0, 0.1]).x
    left_out = []
    for row in range(8):
        rows = [i for i in range(8) if i != row]
        refit = least_squares(residual, best, args=(rows,)).x
        left_out.append(residual(refit, row))
    platen, speed = (verdict.settings[n] for n in ("platen_conduction", "speed_dependent_heat"))
    assert [platen["G"], platen["g"], speed["kh"]] == pytest.approx(best, rel=5e-3)
    assert verdict.gap.after_rms == pytest.approx(math.sqrt(np.mean(residual(best) ** 2)), rel=1e-3)
    assert verdict.gap.held_out_rms == pytest.approx(
        math.sqrt(np.mean(np.square(left_out))), rel=0.01
    )


def test_with_unknown_noise_a_better_film_does_as_well_and_is_said_to():
    verdict = verdict_of(noise=None)
    families = [{e.name, *e.indistinguishable_from} for e in verdict.effects]
    assert verdict.verdict == "ambiguous"
    assert {"platen_conduction", "convection_scale"} in families
    assert {"speed_dependent_heat"} in families


HIDDEN = {
    "nothing": {},
    "more convection": {"convection_scale": {"e": 1.0}},
    "less convection": {"convection_scale": {"e": -0.3}},
    "radiation": {"radiation": {"eps": 0.6}},
    "conduction at rest": {"platen_conduction": {"G": 4.0, "g": 0.0, "T_p": AIR}},
    "conduction along the path": {"platen_conduction": {"G": 2.0, "g": 15.0, "T_p": AIR}},
    "hysteresis": {"speed_dependent_heat": {"kh": 0.1, "ke": 0.0}},
    "eddies": {"speed_dependent_heat": {"kh": 0.0, "ke": 1e-4}},
    "convection and speed": {
        "convection_scale": {"e": 1.5},
        "speed_dependent_heat": {"kh": 0.14, "ke": 0.0},
    },
    "the source's own": {
        "platen_conduction": {"G": 3.5, "g": 4.6, "T_p": AIR},
        "speed_dependent_heat": {"kh": 0.14, "ke": 0.0},
    },
}


@pytest.mark.parametrize("name", HIDDEN)
def test_the_same_eight_rows_with_something_else_hidden_are_not_named_wrongly(name):
    """1 K of noise; who cannot be told apart is given as a family with the truth in it."""
    clean = rises(table(), MACHINE, HIDDEN[name])
    for seed in range(4):
        verdict = verdict_of(clean + np.random.default_rng(seed).normal(0.0, 1.0, 8))
        families = [{e.name, *e.indistinguishable_from} for e in verdict.effects]
        assert verdict.verdict in (("named", "ambiguous") if HIDDEN[name] else ("none",))
        assert len(families) == len(HIDDEN[name])
        assert all(any(hidden in family for family in families) for hidden in HIDDEN[name])
