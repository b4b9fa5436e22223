"""A machine that moves a known factor as far as its file says is not of a wrong scale for that.

What the law lacks makes it move so far, and the readings are right.
"""

import re

import numpy as np
import pytest
from scipy.optimize import brentq

from helpers.stated import DRIVE, DRIVEN, driven, write
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment
from mopro.stated.base import slope_of

STATED = {"viscous": 3.0, "spring": 40.0, "dry": 0.0}
# Of each number of the drive the most that it may be: with it the drive hardly moves.
MOST = {"viscous": 3e3, "spring": 3e4, "dry": 6.9}
FACTORS = (0.5, 0.25, 0.2, 0.1, 1 / 25.4)
KNOWN = [(name, factor) for name in MOST for factor in FACTORS]
# A drive that moves farther has less of a number than its file; a friction is in no file.
KNOWN += [(name, 1 / factor) for name in ("viscous", "spring") for factor in FACTORS]


def noisy(places, share):
    noise = share * float(np.ptp(places))
    return places + noise * np.random.default_rng(1).standard_normal(len(places)), noise


def drive(folder, numbers, places, more=""):
    """The files of a drive of known numbers, with readings (mm) that have a noise of 0.1 %."""
    seen, noise = noisy(places, 1e-3)
    machine = re.sub("2.0, unit = .N s/m.*", f'{numbers["viscous"]}, unit = "N s/m" }}', DRIVE)
    machine = re.sub("50, unit = .N/m.*", f'{numbers["spring"]}, unit = "N/m" }}', machine)
    (folder / "machine.toml").write_text(machine, encoding="utf-8")
    experiment = DRIVEN.replace("noise_rms = 0.2", f"noise_rms = {noise}\n{more}")
    (folder / "experiment.toml").write_text(experiment, encoding="utf-8")
    write(folder / "run.csv", driven() | {"position_mm": seen})
    return folder / "experiment.toml"


def places_with(numbers):
    return driven(noise=0.0, **numbers)["position_mm"]


def size_of(factor, least, most, moved):
    """The size in the range with which the places `moved` go `factor` as far as with the least."""
    plain = moved(least)
    return brentq(lambda s: abs(slope_of(moved(s), plain)) - factor, least, most, rtol=1e-3)


@pytest.mark.parametrize(("name", "factor"), KNOWN)
def test_a_drive_that_moves_so_far_is_not_refused(tmp_path, name, factor):
    less = min(factor, 1 / factor)
    size = size_of(less, STATED[name], MOST[name], lambda s: places_with({**STATED, name: s}))
    other = {**STATED, name: size}
    told, true = (STATED, other) if factor < 1 else (other, STATED)
    assert open_experiment(drive(tmp_path, told, places_with(true)))


NODE = """\
kind = "thermal"
name = "node"

[nodes]
block = "a * power - U * (T - ambient)"

[base]
a = { value = 0.02, unit = "K/s/W" }
U = { value = 0.005, unit = "1/s" }
"""
HEATED = """\
machine = "machine.toml"

[inputs]
power = { column = "power_W", hold = true }

[[sensor]]
name = "block"
quantity = "temperature"
column = "block_C"
noise_rms = 0.001
zero = 0

[[run]]
data = "run.csv"
"""


def warmed(power, step_s, cooled):
    """Temperatures (C) of the node, with `cooled` (K/s) beside its loss, of T (C)."""
    temperature, places = 22.0, []
    for own in power.tolist():
        places.append(temperature)
        for _ in range(10):
            rate = 0.02 * own - 0.005 * (temperature - 22.0) - cooled(temperature)
            temperature += step_s / 10 * rate
    return np.array(places)


def radiated(size):
    return lambda T: size * ((T + 273.15) ** 4 - 295.15**4) / (4 * 295.15**3)


def convected(size):
    return lambda T: size * (T - 22.0) * abs(T - 22.0) ** 0.25


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("law", [radiated, convected])
def test_a_node_that_warms_so_little_is_not_refused(tmp_path, law, factor):
    power = np.repeat(np.random.default_rng(2).uniform(0.0, 30.0, 12), 40)
    power[:40] = 0.0
    size = size_of(factor, 0.0, 3.0, lambda s: warmed(power, 3.0, law(s)))
    seen, noise = noisy(warmed(power, 3.0, law(size)), 1e-3)
    (tmp_path / "machine.toml").write_text(NODE, encoding="utf-8")
    (tmp_path / "experiment.toml").write_text(HEATED.replace("0.001", f"{noise}"), encoding="utf-8")
    columns = {"time_s": 3.0 * np.arange(len(power)), "power_W": power, "block_C": seen}
    write(tmp_path / "run.csv", columns)
    assert open_experiment(tmp_path / "experiment.toml")


@pytest.mark.parametrize(("factor", "key"), [(5.0, "scale"), (0.1, "scale"), (-1.0, "sign")])
def test_a_sensor_that_states_its_scale_is_told_of_it_and_not_refused(tmp_path, factor, key):
    places = factor * places_with(STATED)
    with pytest.raises(ModelError, match=f"if the readings are right, state {key} = 1"):
        open_experiment(drive(tmp_path, STATED, places))
    (note,) = open_experiment(drive(tmp_path, STATED, places, f"{key} = 1")).notes
    assert "are as simulated if they are" in note
