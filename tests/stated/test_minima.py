"""The first fit of free numbers, of a law with several minima or a range that is too narrow."""

import math

import numpy as np
import pytest

from helpers.stated import write
from mopro.experiment.opened import open_experiment

SERVO = """\
kind = "axis"
unit = "rad"
name = "servo"
acceleration = "{law}"

[base]
"""
SEEN = """\
machine = "machine.toml"

[inputs]
drive = { column = "u_rad", hold = true }

[[sensor]]
name = "encoder"
quantity = "position"
column = "x_rad"
noise_rms = 0.003
zero = 0
"""
CLIPPED = "max(-lim, min(lim, kp * (drive - x) - kd * v)) - c * v"
SWINGING = "k * drive - w2 * sin(x) - c * v"


def moved(law, t, u, x, v):
    """Places (rad) at `t` under a held `u`, by RK4 in ten steps a row."""
    places = [x]
    for i in range(len(t) - 1):
        h = (t[i + 1] - t[i]) / 10
        for _ in range(10):
            a = law(u[i], x, v)
            b = law(u[i], x + h / 2 * v, v + h / 2 * a)
            c = law(u[i], x + h / 2 * (v + h / 2 * a), v + h / 2 * b)
            d = law(u[i], x + h * (v + h / 2 * b), v + h * c)
            x += h * (v + h / 6 * (a + b + c))
            v += h / 6 * (a + 2 * b + 2 * c + d)
        places.append(x)
    return np.array(places)


def fitted(folder, text, ranges, begun, runs):
    """The free numbers, as they fit without effects, and the notes."""
    lines = [
        f'{name} = {{ value = {begun[name]:.4g}, unit = "{unit}", free = true, range = {ends} }}\n'
        for name, (unit, ends) in ranges.items()
    ]
    (folder / "machine.toml").write_text(SERVO.format(law=text) + "".join(lines), encoding="utf-8")
    seen = SEEN
    for i, columns in enumerate(runs):
        write(folder / f"{i}.csv", columns)
        seen += f'\n[[run]]\ndata = "{i}.csv"\n'
    (folder / "experiment.toml").write_text(seen, encoding="utf-8")
    system = open_experiment(folder / "experiment.toml").system
    return system.base.settings["base"], system.experiment.notes


@pytest.mark.parametrize("seed", range(3))
def test_a_stiff_loop_that_clips_is_fitted_from_far_away(tmp_path, seed):
    rng = np.random.default_rng(seed)
    truth = {"kp": 70.0, "kd": 4.0, "lim": 3.0, "c": 0.4}
    t = np.arange(0, 8, 0.02)
    u = np.where((t > 0.5) & (t < 4), 1.0, 0.0) + 0.3 * np.sin(2.5 * t)

    def law(u, x, v):
        drive = truth["kp"] * (u - x) - truth["kd"] * v
        return max(-truth["lim"], min(truth["lim"], drive)) - truth["c"] * v

    x = moved(law, t, u, 0.0, 0.0) + 0.003 * rng.standard_normal(len(t))
    begun = {name: value * math.exp(rng.uniform(-2, 2)) for name, value in truth.items()}
    units = {"kp": "1/s2", "kd": "1/s", "lim": "rad/s2", "c": "1/s"}
    ranges = {name: (units[name], f"[{v / 30}, {v * 30}]") for name, v in truth.items()}
    found, notes = fitted(tmp_path, CLIPPED, ranges, begun, [{"time_s": t, "u_rad": u, "x_rad": x}])
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=0.05)
    assert not notes


@pytest.mark.parametrize("seed", range(3))
def test_a_swing_is_fitted_from_another_frequency(tmp_path, seed):
    """Twenty to thirty swings of which the first guess is off by up to a factor of three."""
    rng = np.random.default_rng(seed)
    truth = {"k": 6.0, "w2": 40.0, "c": 0.15}
    t = np.arange(0, 20, 0.04)
    runs = []
    for _ in range(2):
        u = 0.8 * np.sign(np.sin(rng.uniform(1, 5) * t))

        def law(u, x, v):
            return truth["k"] * u - truth["w2"] * math.sin(x) - truth["c"] * v

        x = moved(law, t, u, rng.uniform(-1.2, 1.2), 0.0) + 0.003 * rng.standard_normal(len(t))
        runs.append({"time_s": t, "u_rad": u, "x_rad": x})
    begun = {name: value * math.exp(rng.uniform(-1.1, 1.1)) for name, value in truth.items()}
    ranges = {"k": ("1/s2", "[0.1, 100]"), "w2": ("1/s2", "[1, 1000]"), "c": ("1/s", "[0, 5]")}
    found, notes = fitted(tmp_path, SWINGING, ranges, begun, runs)
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=0.02)
    assert not notes


@pytest.mark.parametrize(("ends", "told"), [("[1, 1000]", False), ("[1, 30]", True)])
def test_a_number_that_an_end_of_its_range_stops_is_told_first(tmp_path, ends, told):
    t = np.arange(0, 4, 0.04)
    u = np.sign(np.sin(3 * t))
    x = moved(lambda u, x, v: 6 * u - 40 * math.sin(x) - 0.15 * v, t, u, 0.5, 0.0)
    ranges = {"k": ("1/s2", "[0.1, 100]"), "w2": ("1/s2", ends), "c": ("1/s", "[0, 5]")}
    begun = {"k": 5, "w2": 28, "c": 0.1}
    _, notes = fitted(tmp_path, SWINGING, ranges, begun, [{"time_s": t, "u_rad": u, "x_rad": x}])
    words = "w2 fits best at the end of its range, 30 1/s2, before effects are looked for"
    assert any(note.startswith(words) for note in notes) == told


@pytest.mark.parametrize("damping", [10.0, 60.0])
def test_a_damping_that_a_free_one_stands_in_for_at_first_is_found(tmp_path, damping):
    """Few large forces: without it the axis goes so much faster in those that less seems enough."""
    rng, step, rate = np.random.default_rng(4), 0.004, 4
    for file in ("one.csv", "two.csv"):
        forces, x, v, places = np.repeat(17 * rng.random(20) ** 5, 100), 0.0, 0.0, []
        for force in forces:
            places.append(x)
            for _ in range(rate):
                half = v + step / rate / 2 * (force - 0.5 * v - damping * v**3) / 1.8
                x += step / rate * half
                v += step / rate * (force - 0.5 * half - damping * half**3) / 1.8
        read = 1e3 * np.array(places) + 3.0 * rng.standard_normal(len(places))
        t = step * np.arange(len(places))
        write(tmp_path / file, {"time_s": t, "force_N": forces, "position_mm": read})
    (tmp_path / "machine.toml").write_text(
        'kind = "axis"\nname = "drive"\nunit = "mm"\n[base]\nmass = { value = 1.8, unit = "kg" }\n'
        'viscous = { value = 20.0, unit = "N s/m", free = true, range = [0.2, 200.0] }\n'
    )
    experiment = (
        'machine = "machine.toml"\n[inputs]\nforce = { column = "force_N", hold = true }\n'
        '[[sensor]]\nname = "scale"\nquantity = "position"\ncolumn = "position_mm"\n'
        "noise_rms = 3.0\nzero = 0\n"
    )
    runs = "".join(
        f'[[run]]\ndata = "{file}"\nstart = {{ x = 0, v = 0 }}\n' for file in ("one.csv", "two.csv")
    )
    (tmp_path / "experiment.toml").write_text(experiment + runs)
    verdict = open_experiment(tmp_path / "experiment.toml").conclude().verdict
    (effect,) = verdict.effects
    assert (verdict.verdict, effect.name) == ("named", "cubic_damping")
    low, high = effect.parameters["b3"].ci95
    assert 0.98 * low < damping < 1.02 * high
