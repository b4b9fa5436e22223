"""Noise of an input's measurement counts as noise of what the model makes of it."""

import math

import numpy as np
import pytest

from helpers.stated import write
from mopro.engine import reconcile
from mopro.experiment.opened import open_experiment

MASS, DAMPING, SPRING = 1.2, 3.0, 40.0
MACHINE = """\
kind = "axis"
name = "stage"
unit = "m"
acceleration = "(force - c * v - k * x) / m"

[base]
m = { value = 1.2, unit = "kg" }
c = { value = 3.0, unit = "N s/m" }
k = { value = 40, unit = "N/m" }
"""
LOGGED = """\
machine = "machine.toml"

[inputs]
force = { column = "force_N"STATED }

[[sensor]]
name = "position"
quantity = "position"
column = "position_mm"
noise_rms = 0.2
zero = 0

[[run]]
data = "one.csv"

[[run]]
data = "two.csv"
"""


def axis(force, step_s, drag=0.0, within=10):
    """Places (m) of the axis at rows under a force that is linear between them, by midpoints."""
    x = v = 0.0
    places, h = [], step_s / within

    def rate(x, v, push):
        return (push - DAMPING * v - drag * abs(v) * v - SPRING * x) / MASS

    for row, (push, after) in enumerate(zip(force, np.append(force[1:], force[-1]), strict=True)):
        places.append(x)
        for part in range(within if row < len(force) - 1 else 0):
            at = push + (part + 0.5) / within * (after - push)
            middle = v + h / 2 * rate(x, v, at)
            v, x = v + h * rate(x + h / 2 * v, middle, at), x + h * middle
    return np.array(places)


def logged(folder, *, seed, noise=0.08, drag=0.0, shaken=0.0, stated="", fastest_Hz=3.0):
    """An experiment of two runs: the force is logged with `noise` (N), and shakes by `shaken`."""
    rng = np.random.default_rng(seed)
    t = 0.008 * np.arange(500)
    for name in ("one", "two"):
        rates = rng.uniform(0.3, fastest_Hz, 4)
        waves = zip(rng.uniform(2, 5, 4), rates, rng.uniform(0, 6, 4), strict=True)
        force = sum(a * np.sin(2 * math.pi * f * t + p) for a, f, p in waves)
        force = force + shaken * rng.standard_normal(len(t))
        measured = 1e3 * axis(force.tolist(), 0.008, drag) + 0.2 * rng.standard_normal(len(t))
        seen = force + noise * rng.standard_normal(len(t))
        write(folder / f"{name}.csv", {"time_s": t, "force_N": seen, "position_mm": measured})
    (folder / "machine.toml").write_text(MACHINE, encoding="utf-8")
    text = LOGGED.replace("STATED", f", noise_rms = {stated}" if stated else "")
    (folder / "experiment.toml").write_text(text, encoding="utf-8")
    return open_experiment(folder / "experiment.toml")


def told(conclusion):
    return any("row to row" in note for note in conclusion.system.notes)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_noisy_force_is_no_effect(tmp_path, seed):
    found = logged(tmp_path, seed=seed).conclude()
    assert found.verdict.verdict == "none"
    assert told(found)


def test_what_is_hidden_beside_a_noisy_force_is_named_alone(tmp_path):
    found = logged(tmp_path, seed=3, drag=6.0).conclude()
    (effect,) = found.verdict.effects
    size = effect.parameters["d"]
    assert effect.name == "quadratic_drag"
    assert size.ci95[0] < 6.0 / MASS < size.ci95[1]


def test_a_stated_noise_is_not_told_again(tmp_path):
    found = logged(tmp_path, seed=1, stated="0.08").conclude()
    assert found.verdict.verdict == "none"
    assert not told(found)


def test_a_force_that_is_stated_exact_leaves_its_noise_to_explain(tmp_path):
    assert logged(tmp_path, seed=1, stated="0").conclude().verdict.verdict != "none"


def test_a_force_that_does_shake_is_no_noise(tmp_path):
    found = logged(tmp_path, seed=4, noise=0.0, shaken=0.08, drag=6.0).conclude()
    assert [effect.name for effect in found.verdict.effects] == ["quadratic_drag"]
    assert not told(found)


def test_noise_that_no_reading_shows_is_asked_about_once(tmp_path):
    """Of a slow force without noise polynomials through its rows leave next to nothing."""
    opened, questions = logged(tmp_path, seed=3, noise=0.0, drag=6.0, fastest_Hz=0.8), []

    def asked(own):
        questions.append(own)
        return reconcile(**vars(own.question(own.effects - {"quadratic_drag"})))

    _, verdict = opened.system.judged(asked, ())
    assert [effect.name for effect in verdict.effects] == ["quadratic_drag"]
    assert len(questions) == 1


def test_the_readings_vary_as_a_noisy_force_makes_them(tmp_path):
    opened = logged(tmp_path, seed=1, stated="0.08")
    series = opened.system.series[0]
    rng = np.random.default_rng(7)
    drawn = [axis((0.08 * rng.standard_normal(500)).tolist(), 0.008, within=4) for _ in range(60)]
    expected = 1e3 * math.sqrt(np.mean(np.square(drawn)))
    terms = series.of_inputs
    assert math.sqrt(np.sum(terms**2) / len(terms)) == pytest.approx(expected, rel=0.1)
