"""Nodes that exchange heat, by thermometers of unknown and of known zero."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helpers.commands import run_here

K, NOISE_C, AMBIENT_C = 2e-3, 0.1, 21.0
MACHINE = """kind = "thermal"
name = "blocks"
[nodes]
one = "a * duty - U * (T - ambient)"
two = "-U * (T - ambient)"
[base]
a = { value = 0.3, unit = "K/s" }
U = { value = 0.005, unit = "1/s" }
"""
SENSOR = """[[sensor]]
name = "{0}"
column = "{0}_C"
quantity = "temperature"
noise_rms = 0.1
{1}
"""


def readings(begin, zeros, seed):
    """Time (s), duty and what both thermometers show; the duty changes every 200 s."""
    t = np.arange(0.0, 1200.0, 8.0)
    duty = np.array([0.0, 1.0, 0.3, 0.8, 0.1, 0.6])[(t // 200).astype(int)]

    def rates(time, at):
        pushed = 0.3 * duty[min(int(time // 8), len(t) - 1)]
        return [pushed, 0.0] - 0.005 * (at - AMBIENT_C) + K * (at[::-1] - at)

    course = solve_ivp(rates, (0.0, t[-1]), begin, t_eval=t, max_step=8.0, rtol=1e-8).y
    noise = np.random.default_rng(seed).normal(0.0, NOISE_C, (2, len(t)))
    return np.vstack([t, duty, course + np.array(zeros)[:, None] + noise])


def verdict(folder, runs, extra):
    """The answer on `runs` of (where the nodes begin, zeros of the thermometers)."""
    (folder / "machine.toml").write_text(MACHINE)
    text = 'machine = "machine.toml"\n[inputs]\n'
    text += 'duty = { column = "duty", unit = "1", hold = true }\n' + extra["inputs"]
    text += SENSOR.format("one", extra["sensor"]) + SENSOR.format("two", extra["sensor"])
    for number, (begin, zeros) in enumerate(runs):
        table = readings(begin, zeros, number)
        if extra["inputs"]:
            table = np.vstack([table, np.full(table.shape[1], AMBIENT_C)])
        header = "time_s,duty,one_C,two_C" + (",ambient_C" if extra["inputs"] else "")
        np.savetxt(folder / f"{number}.csv", table.T, "%.6g", ",", header=header, comments="")
        text += f'[[run]]\ndata = "{number}.csv"\n'
    (folder / "experiment.toml").write_text(text)
    return json.loads(run_here(folder, "reconcile", "experiment.toml", "--json").stdout)


@pytest.mark.parametrize("zeros", [(0.0, 0.0), (-12.0, 7.0), (6.0, -1.0)])
def test_what_thermometers_of_free_zero_show_apart_at_first_drives_no_heat(tmp_path, zeros):
    runs = [((AMBIENT_C, AMBIENT_C), zeros), ((AMBIENT_C, AMBIENT_C), zeros[::-1])]
    found = verdict(tmp_path, runs, {"sensor": "", "inputs": ""})
    (effect,) = found["effects"]
    assert (found["verdict"], effect["name"]) == ("named", "coupling")
    low, high = effect["parameters"]["k"]["ci95"]
    assert low <= K <= high < 1.1 * K


def test_what_exact_thermometers_show_apart_at_first_drives_heat(tmp_path):
    exact = {"sensor": "zero = 0", "inputs": 'ambient = { column = "ambient_C" }\n'}
    runs = [((60.0, AMBIENT_C), (0.0, 0.0)), ((30.0, 50.0), (0.0, 0.0))]
    found = verdict(tmp_path, runs, exact)
    (effect,) = found["effects"]
    assert (found["verdict"], effect["name"]) == ("named", "coupling")
    low, high = effect["parameters"]["k"]["ci95"]
    assert low <= K <= high < 1.1 * K
