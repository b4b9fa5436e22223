"""An effort read over a known motion: dry friction as sharp, or as rounded, as it is."""

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment

EXPERIMENT = """\
machine = "machine.toml"

[inputs]
command = { column = "angle_rad" }

[[sensor]]
name = "current"
quantity = "current"
column = "current_A"
noise_rms = 0.004
reads = "inertia * a + damping * v"

[[run]]
data = "run.csv"
"""
MACHINE = """\
kind = "kinematic"
name = "joint"
unit = "rad"

[base]
inertia = { value = 0.003, unit = "A s2", free = true, range = [0, 0.05] }
damping = { value = 0.01, unit = "A s", free = true, range = [0, 0.05] }
"""


def read(folder, friction, step_s, seed, machine=MACHINE, only=None):
    """The verdict on a current that drives a known motion against `friction` (A) of its speed."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 1000 * step_s, step_s)
    rates, turns = 2 * np.pi * rng.uniform(0.3, 1.5, 3) / (200 * step_s), rng.uniform(0, 6, 3)
    sizes = 3.0 / rates / np.arange(1, 4)
    angle, speed, acceleration = (
        sum(
            s * w**n * np.sin(w * t + p + n * np.pi / 2)
            for s, w, p in zip(sizes, rates, turns, strict=True)
        )
        for n in range(3)
    )
    current = 2e-3 * acceleration + 7e-3 * speed + friction(speed)
    measured = current + 0.004 * rng.standard_normal(len(t))
    write(folder / "run.csv", {"time_s": t, "angle_rad": angle, "current_A": measured})
    (folder / "machine.toml").write_text(machine, encoding="utf-8")
    (folder / "experiment.toml").write_text(EXPERIMENT, encoding="utf-8")
    opened = open_experiment(folder / "experiment.toml")
    return opened.conclude(left_out=opened.effects - only if only else ()).verdict


@pytest.mark.parametrize(("step_s", "seed"), [(0.002, 1), (0.005, 2), (0.02, 3)])
def test_plain_dry_friction_is_named_with_its_size(tmp_path, step_s, seed):
    verdict = read(tmp_path, lambda v: 0.05 * np.sign(v), step_s, seed)
    (found,) = verdict.effects
    assert found.name == "dry_friction"
    assert found.parameters["Fc"].value == pytest.approx(0.05, rel=0.03)
    assert verdict.base["damping"].value == pytest.approx(7e-3, rel=0.1)


def test_a_friction_that_is_rounded_is_dry_friction_in_a_wider_form(tmp_path):
    verdict = read(tmp_path, lambda v: 0.05 * v / np.sqrt(v**2 + 0.4**2), 0.005, 2)
    (found,) = verdict.effects
    assert found.name == "dry_friction"
    assert "v0" in found.parameters


def test_without_friction_none_is_named(tmp_path):
    verdict = read(tmp_path, lambda v: 0 * v, 0.005, 2)
    assert (verdict.verdict, verdict.effects) == ("none", ())


def test_a_number_beyond_its_tolerance_is_named_where_nothing_is_an_effect(tmp_path):
    known = 'inertia = { value = 0.003, unit = "A s2", tolerance = 0.1 }'
    free = next(line for line in MACHINE.splitlines() if line.startswith("inertia"))
    machine = MACHINE.replace(free, known)
    verdict = read(tmp_path, lambda v: 0 * v, 0.005, 2, machine, {"inertia"})
    (found,) = verdict.effects
    assert found.name == "inertia"
    assert found.parameters["inertia"].value == pytest.approx(2e-3, rel=0.03)


@pytest.mark.parametrize(("start", "seed"), [(0.02, 1), (0.05, 2), (0.05, 5)])
def test_a_friction_that_falls_with_the_speed_is_found_beside_a_delay(tmp_path, start, seed):
    """The law of three numbers is tried from the plain one, at each speed of its fall."""

    def late(v):
        friction = (0.05 + start * np.exp(-((v / 0.5) ** 2))) * np.sign(v)
        return np.interp(np.arange(len(v)) - 2.5, np.arange(len(v)), friction)

    verdict = read(tmp_path, late, 0.005, seed, MACHINE)
    friction = next(e for e in verdict.effects if e.name == "dry_friction")
    assert friction.parameters["Fs"].value == pytest.approx(start, rel=0.1)
