"""A spring that stiffens one way, which nobody listed, beside a cubic one and a bias, which are."""

import json

import numpy as np
import pytest

from helpers.commands import run_here

MASS, DRAG, SPRING, NOISE_MM, STEP_S = 2.9, 15.0, 320.0, 2.4, 0.008
MACHINE = """kind = "axis"
unit = "mm"
name = "bent"
[base]
mass = { value = 3.05, unit = "kg", tolerance = 0.1 }
viscous = { value = 14.0, unit = "N s/m", free = true, range = [0.5, 450] }
spring = { value = 355.0, unit = "N/m", free = true, range = [10, 9500] }
"""
EXPERIMENT = """machine = "machine.toml"
[inputs]
force = { column = "force_N", hold = true }
[[sensor]]
name = "position"
column = "position_mm"
quantity = "position"
noise_rms = 2.4
[[run]]
data = "run0.csv"
[[run]]
data = "run1.csv"
"""


def places(force, bend):
    """Places (m) under a force (N) that holds from row to row, by steps of Runge and Kutta."""
    state, found, h = np.zeros(2), [], STEP_S / 12

    def rate(at, push):
        pull = SPRING * at[0] + bend * at[0] ** 2
        return np.array([at[1], (push - DRAG * at[1] - pull) / MASS])

    for push in force:
        found.append(state[0])
        for _ in range(12):
            one = rate(state, push)
            two = rate(state + h / 2 * one, push)
            three = rate(state + h / 2 * two, push)
            four = rate(state + h * three, push)
            state = state + h / 6 * (one + 2 * two + 2 * three + four)
    return np.array(found)


@pytest.mark.parametrize("seed", [22, 23])
def test_a_bent_spring_is_drafted_and_no_cubic_spring_about_a_far_point_named(tmp_path, seed):
    """The noise has a memory of a sample, which takes up what two listed effects leave."""
    g = np.random.default_rng(seed)
    bend = g.uniform(400, 700)
    for number in range(2):
        t = np.arange(450) * STEP_S
        waves = zip(g.uniform(8, 25, 4), g.uniform(0.3, 3.0, 4), g.uniform(0, 6, 4), strict=True)
        force = sum(size * np.sin(2 * np.pi * f * t + phase) for size, f, phase in waves)
        noise = g.standard_normal(len(t))
        for row in range(1, len(t)):
            noise[row] = 0.5 * noise[row - 1] + np.sqrt(0.75) * noise[row]
        columns = np.column_stack([t, force, 1e3 * places(force, bend) + NOISE_MM * noise])
        header = "time_s,force_N,position_mm"
        file = tmp_path / f"run{number}.csv"
        np.savetxt(file, columns, "%.7g", ",", header=header, comments="")
    (tmp_path / "machine.toml").write_text(MACHINE)
    (tmp_path / "experiment.toml").write_text(EXPERIMENT)
    only = [w for name in ("mass", "cubic_stiffness", "bias_force") for w in ("--only", name)]
    done = run_here(tmp_path, "reconcile", "experiment.toml", *only, "--json")
    answer = json.loads(done.stdout)
    assert (answer["verdict"], answer["effects"]) == ("unexplained", [])
    (draft,) = answer["drafts"]
    size, _, law = draft["law"].partition(" * ")
    assert (draft["of"], law) == ("x", "x**2")
    assert float(size) == pytest.approx(-bend, rel=0.05)
