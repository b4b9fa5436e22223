"""Temperatures: taken now and then, and diagnosed like positions."""

import numpy as np
import pytest

import mopro
from helpers.diagnosis import diagnose
from mopro.emulator import Emulator
from mopro.experiment import load_experiment
from mopro.instruments import Thermocouple
from mopro.machine import load_machine

PROGRAM = (
    "UU012500/1\nVEL2 {}\nACC2 0.2\n:B1\nMRI2 {}\nWX2\nWT4000\nMRI2 -{}\nWX2\nWT4000\nJUMP B1\n"
)
EXPERIMENT = """
machine = "chow1992"

[[sensor]]
name = "thermocouple"
quantity = "temperature"
column = "temperature_C"
rate_hz = 1.0
noise_rms = 0.2
"""
RUN = '\n[[run]]\nprogram = "{0}.CMD"\ndata = "{0}.csv"\n'


def laboratory(folder, effects, seed=0):
    """Two motions of forty minutes each, measured as in 1992: every second, then every 15 s."""
    rng = np.random.default_rng(seed)
    stamps = Thermocouple().times_s(2400.0)
    text = EXPERIMENT
    for name, speed, stroke in (("slow", 2.0, 20.0), ("fast", 24.0, 20.0)):
        (folder / f"{name}.CMD").write_text(PROGRAM.format(speed, stroke, stroke))
        emulator = Emulator(load_machine("chow1992"), effects=effects)
        schedule = emulator.plan(mopro.compile((folder / f"{name}.CMD").read_text()), 2401.0)
        seen = emulator.begin(schedule).temperature_C(stamps)
        seen = seen + 0.2 * rng.standard_normal(len(stamps))
        rows = np.column_stack([stamps, seen])
        header = "time_s,temperature_C"
        np.savetxt(folder / f"{name}.csv", rows, "%.6f", ",", header=header, comments="")
        text += RUN.format(name)
    (folder / "experiment.toml").write_text(text)
    return load_experiment(folder / "experiment.toml")


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("speed_dependent_heat", {"kh": 0.05, "ke": 0.0}),
        ("platen_conduction", {"G": 2.0, "g": 0.0}),
        ("ambient_drift", {"r": 2e-4}),
    ],
)
def test_an_effect_of_heat_is_named(tmp_path, name, values):
    found = diagnose(laboratory(tmp_path, {name: values})).verdict
    family = {n for e in found.effects for n in (e.name, *e.indistinguishable_from)}
    assert len(found.effects) == 1
    assert name in family
    assert found.gap.after_rms < 0.21 < found.gap.before_rms


def test_heat_as_the_machine_has_it_is_none(tmp_path):
    experiment = laboratory(tmp_path, {})
    assert [len(t.readings[0].values) for t in experiment.trials] == [273, 273]
    assert diagnose(experiment).verdict.verdict == "none"
