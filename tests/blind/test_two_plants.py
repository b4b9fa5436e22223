"""Each effect of heat: the reference plant and the emulator, written apart, agree."""

import numpy as np
import pytest

import mopro
from mopro.blind.cases import hidden_effects as hidden
from mopro.blind.cases.random_programs import ProgramWriter
from mopro.blind.cases.spec import THERMOCOUPLE, case_instruments
from mopro.blind.reference.motor import THESIS
from mopro.blind.reference.plant import ProgramRun, ReferencePlant
from mopro.experiment.sawyer.forward_model import ForwardModel
from mopro.experiment.sawyer.trials import Experiment, Reading
from mopro.experiment.sawyer.trials import Trial as Measured
from mopro.instruments.quantity import TEMPERATURE
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.source import Source

SEEN = Sensor("thermocouple", TEMPERATURE, "temperature_C", 1.0, 1, 0.1)


@pytest.mark.parametrize("two_axes", [False, True], ids=["one axis", "two axes"])
@pytest.mark.parametrize("name", hidden.THERMAL)
def test_they_warm_alike(name, two_axes):
    """Within a hundredth of a degree over ten minutes; the effect does twice that and more."""
    draw = np.random.default_rng(6)
    text = ProgramWriter().cycles(draw, two_axes)
    effects = {name: hidden.HIDDEN_EFFECTS[name].draw(draw, THESIS)(1.0)}
    (thermocouple,) = case_instruments(THERMOCOUPLE, "cycles")
    times, (usual,) = ReferencePlant({}).readings(
        ProgramRun(text, 0.0, 600.0), [thermocouple], draw
    )
    _, (warm,) = ReferencePlant(effects).readings(
        ProgramRun(text, 0.0, 600.0), [thermocouple], draw
    )
    reading = Reading(SEEN, times, np.zeros(len(times)))
    run = Measured("run.DAT", mopro.compile(text), None, 0.0, (reading,))
    motor = ForwardModel(
        Experiment(Source("experiment.toml", ""), load_machine("chow1992"), (run,), ())
    )
    (predicted,) = motor(effects)
    assert predicted == pytest.approx(warm, abs=0.01)
    assert np.abs(warm - usual).max() > 0.02
