"""Temperatures: taken now and then, and diagnosed like positions."""

import numpy as np
import pytest

import mopro
from helpers.diagnosis import diagnose
from mopro.blind.reference import heat
from mopro.blind.reference.listing import timeline
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


def emulated(text, effects, stamps):
    emulator = Emulator(load_machine("chow1992"), effects=effects)
    return emulator.begin(emulator.plan(mopro.compile(text), 2401.0)).temperature_C(stamps)


def of_the_reference(text, effects, stamps):
    """Of a plant that shares no code with the emulator."""
    return heat.temperature_C(timeline(text, until_s=2401.0), stamps, effects)


def laboratory(folder, effects, seed=0, plant=emulated):
    """Two motions of forty minutes each, measured as in 1992: every second, then every 15 s."""
    rng = np.random.default_rng(seed)
    stamps = Thermocouple().times_s(2400.0)
    text = EXPERIMENT
    for name, speed, stroke in (("slow", 2.0, 20.0), ("fast", 24.0, 20.0)):
        program = PROGRAM.format(speed, stroke, stroke)
        (folder / f"{name}.CMD").write_text(program)
        seen = plant(program, effects, stamps) + 0.2 * rng.standard_normal(len(stamps))
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


@pytest.mark.parametrize("size", [40.0, 4.0])
def test_conduction_to_a_platen_of_another_temperature_has_its_size(tmp_path, size):
    """The temperature of the platen is assumed, and known to a range only."""
    hidden = {"platen_conduction": {"G": size, "g": 0.0, "T_p": 32.0}}
    found = diagnose(laboratory(tmp_path, hidden, plant=of_the_reference)).verdict
    (effect,) = found.effects
    assert (found.verdict, effect.name) == ("named", "platen_conduction")
    for name, value in (("G", size), ("T_p", 32.0)):
        low, high = effect.parameters[name].ci95
        assert low < value < high < 1.05 * low


def test_heat_as_the_machine_has_it_is_none(tmp_path):
    experiment = laboratory(tmp_path, {})
    assert [len(t.readings[0].values) for t in experiment.trials] == [273, 273]
    assert diagnose(experiment).verdict.verdict == "none"
