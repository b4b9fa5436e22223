"""Searches for starting values: periods, and the time after which current falls at rest."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import lfilter

import mopro
from helpers.one_run import LASER, PROGRAM, of
from mopro.effects.currents import EARLIEST_S
from mopro.engine.fits import least_squares_fit
from mopro.engine.residuals import Residuals
from mopro.engine.search.signature import searched
from mopro.experiment.sawyer.candidates import candidates
from mopro.experiment.sawyer.forward_model import COARSE, FINE, ForwardModel
from mopro.experiment.sawyer.system import series_of


def starts(
    name,
    truth,
    fitted=(),
    seed=0,
    program=PROGRAM,
    noise_in=LASER.noise_rms,
    form="",
    stated=1.0,
    memory=0.0,
):
    """The starts that the search of candidate `name` finds in a run with `truth` in it.

    `stated`: the noise that the sensor states, as a multiple of its own; `memory`: its correlation
    from sample to sample.
    """
    (clean,) = ForwardModel(of(np.zeros(3200), program), FINE)(truth)
    white = noise_in * np.random.default_rng(seed).standard_normal(len(clean))
    noise = lfilter([math.sqrt(1 - memory**2)], [1, -memory], white)
    experiment = of(clean + noise, program)
    (trial,) = experiment.trials
    (reading,) = trial.readings
    sensor = dataclasses.replace(LASER, noise_rms=stated * noise_in)
    seen = dataclasses.replace(reading, sensor=sensor)
    trial = dataclasses.replace(trial, readings=(seen,))
    motor = ForwardModel(dataclasses.replace(experiment, trials=(trial,)), COARSE)
    residuals = Residuals(motor, series_of(motor))
    base = least_squares_fit(residuals, (), [{}])
    base = dataclasses.replace(base, settings={n: truth[n] for n in fitted})
    (candidate,) = [c for c in candidates(motor) if c.name == name and form in ("", c.form)]
    return [group[0].values for group in searched(residuals, base, base, candidate)]


def test_a_period_is_found_under_a_sensor_that_bends():
    """A cyclic error is in the place itself; the bent reading would smear its line."""
    truth = {
        "sensor_nonlinearity": {"c3": 1e-3, "c5": 0.0, "mid": 0.0, "half": 0.254},
        "periodic_error": {"A": 2e-6, "lambda": 4.6e-4, "phi": 1.0},
    }
    found = starts("periodic_error", truth, fitted=["sensor_nonlinearity"])
    strongest = max(found, key=lambda values: values["A"])
    assert strongest["lambda"] == pytest.approx(4.6e-4, rel=1e-3)
    assert strongest["A"] == pytest.approx(2e-6, rel=0.1)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_tick_whose_grid_barely_shows_is_looked_for_closely(seed):
    """A thousandth off, it is soon out of step with the command."""
    tick = {"profile_tick": {"T": 0.01, "interpolate": 1.0}}
    found = starts("profile_tick", tick, seed=seed, noise_in=0.01, form="interpolated")
    assert min(abs(values["T"] - 0.01) for values in found) < 1e-5


@pytest.mark.parametrize(
    ("h", "t_h"), [(0.35, 0.08), (0.4, 0.15), (0.6, 0.11), (0.7, 0.1), (0.75, 0.12)]
)
def test_the_moment_when_current_falls_is_found_from_the_ring(h, t_h):
    """To within a quarter of the tooth's period: further off least squares end elsewhere."""
    found = starts("hold_current_reduction", {"hold_current_reduction": {"h": h, "t_h": t_h}})
    assert max(abs(values["t_h"] - t_h) for values in found) < 0.003


@pytest.mark.parametrize("stated", [0.3, 3.0])
def test_the_moment_when_current_falls_is_found_where_the_noise_is_stated_wrong(stated):
    truth = {"hold_current_reduction": {"h": 0.4, "t_h": 0.15}}
    found = starts("hold_current_reduction", truth, stated=stated)
    assert found, "an excess at rest over the noise that the data show"
    assert max(abs(values["t_h"] - 0.15) for values in found) < 0.003


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_moment_when_current_falls_is_found_where_all_rests_drown_it_in_noise(seed):
    """Four times the noise: the excess shows in the few periods after that moment only."""
    truth = {"hold_current_reduction": {"h": 0.4, "t_h": 0.15}}
    noise_in = 4 * LASER.noise_rms
    found = starts("hold_current_reduction", truth, seed=seed, noise_in=noise_in)
    assert found
    assert max(abs(values["t_h"] - 0.15) for values in found) < 0.003


@pytest.mark.parametrize("memory", [0.5, 0.75, 0.9])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_moment_when_current_falls_is_found_in_noise_with_a_memory(memory, seed):
    """Neighbours differ by less than such noise is: it exceeds them in moves as well."""
    truth = {"hold_current_reduction": {"h": 0.4, "t_h": 0.15}}
    found = starts("hold_current_reduction", truth, seed=seed, memory=memory)
    assert found
    assert max(abs(values["t_h"] - 0.15) for values in found) < 0.003


def test_an_axis_that_never_moves_shows_no_moment():
    program = mopro.compile("UU012500/1\nACC2 0.2\nVEL2 10.0\nMRI2 6.0\nWX2\nWT400\n")
    assert starts("hold_current_reduction", {}, program=program) == []


def test_a_rest_may_be_too_short_for_the_current_to_fall():
    """Then a later one shows when it does."""
    move = "MRI1 6.0\nWX1\n"
    program = mopro.compile(f"UU012500/1\nACC1 0.2\nVEL1 39.37\n{move}WT50\n{move}WT400\n")
    truth = {"hold_current_reduction": {"h": 0.35, "t_h": 0.08}}
    found = starts("hold_current_reduction", truth, program=program)
    assert min(abs(values["t_h"] - 0.08) for values in found) < 0.003


def test_what_begins_as_soon_as_a_move_ends_is_sought_from_the_earliest_moment_on():
    (clean,) = ForwardModel(of(np.zeros(3200)), FINE)({})
    (move, _) = ForwardModel(of(clean), FINE).schedule(0).moves
    first = int(move.end_s * LASER.rate_hz) + 1
    noise = LASER.noise_rms * np.random.default_rng(0).standard_normal(len(clean))
    noise[first : first + 8] += 20 * LASER.noise_rms
    motor = ForwardModel(of(clean + noise), COARSE)
    (candidate,) = [c for c in candidates(motor) if c.name == "hold_current_reduction"]
    residuals = Residuals(motor, series_of(motor))
    null = least_squares_fit(residuals, (), [{}])
    found = searched(residuals, null, null, candidate)
    assert found
    assert all(group[0].values["t_h"] >= EARLIEST_S for group in found)


def test_the_search_for_a_moment_ends_early_where_none_is_any_better():
    """A frame that sways long after a move shows at rest, and is no ring of the tooth."""
    (clean,) = ForwardModel(of(np.zeros(3200)), FINE)({})
    (move, _) = ForwardModel(of(clean), FINE).schedule(0).moves
    rested_s = np.arange(len(clean)) / LASER.rate_hz - move.end_s
    sway = np.where(rested_s > 0, np.exp(-rested_s) * np.sin(20 * rested_s), 0.0)
    noise = LASER.noise_rms * np.random.default_rng(0).standard_normal(len(clean))
    motor = ForwardModel(of(clean + 2 * LASER.noise_rms * sway + noise), COARSE)
    (candidate,) = [c for c in candidates(motor) if c.name == "hold_current_reduction"]
    asked = []

    def simulate(settings):
        asked.append(settings)
        return motor(settings)

    residuals = Residuals(simulate, series_of(motor))
    null = least_squares_fit(residuals, (), [{}])
    assert searched(residuals, null, null, candidate)
    assert len(asked) < 80


@pytest.mark.parametrize("truth", [{}, {"viscous_drag": {"b": 8.0}}], ids=["nothing", "drag"])
def test_where_nothing_begins_at_rest_no_moment_is_sought(truth):
    assert starts("hold_current_reduction", truth) == []


MOVE, BACK = "MRI1 3.0\nWX1\nWT200\n", "MRI1 -2.0\nWX1\nWT300\n"


@pytest.mark.parametrize("moves", [(2, 1, 2), (2, 2), (1, 3, 2, 3), (3, 1, 1, 3)])
def test_pitches_lost_in_one_move_of_all_are_found_where_some_runs_end_before_it(moves):
    lost, trials = {"n": 1.0, "move": float(max(moves)), "at": 0.5}, []
    for nth, count in enumerate(moves):
        head = "UU012500/1\nACC1 0.2\nVEL1 20.0\n"
        program = mopro.compile(head + "".join([MOVE, BACK, MOVE][:count]))
        (clean,) = ForwardModel(of(np.zeros(2400), program), FINE)({"lost_steps": lost})
        noise = LASER.noise_rms * np.random.default_rng(nth).standard_normal(len(clean))
        (trial,) = of(clean + noise, program).trials
        trials.append(dataclasses.replace(trial, name=f"run{nth}.csv"))
    motor = ForwardModel(dataclasses.replace(of(clean), trials=tuple(trials)), COARSE)
    (candidate,) = [c for c in candidates(motor) if c.name == "lost_steps"]
    residuals = Residuals(motor, series_of(motor))
    null = least_squares_fit(residuals, (), [{}])
    found = [group[0].values for group in searched(residuals, null, null, candidate)]
    (of_all,) = [values for values in found if values["run"] == -1.0]
    assert (of_all["n"], of_all["move"]) == (lost["n"], lost["move"])
