"""What one effect of heat does: the reference plant and the emulator, written apart, agree."""

import numpy as np
import pytest

import mopro
from mopro.benchmark import hidden
from mopro.benchmark.case import instruments
from mopro.benchmark.grid import THERMOCOUPLE
from mopro.benchmark.programs import Author
from mopro.benchmark.reference.experiment import Plant, Trial
from mopro.benchmark.reference.nominal import THESIS
from mopro.experiment.model import Experiment, Reading
from mopro.experiment.model import Trial as Measured
from mopro.experiment.predict.forward_model import ForwardModel
from mopro.instruments.sensor import Sensor
from mopro.machine import load_machine
from mopro.source import Source

SEEN = Sensor("thermocouple", "temperature", "temperature_C", 1.0, 1, 0.1)


@pytest.mark.parametrize("two_axes", [False, True], ids=["one axis", "two axes"])
@pytest.mark.parametrize("name", hidden.THERMAL)
def test_they_warm_alike(name, two_axes):
    """Within a hundredth of a degree over ten minutes; the effect does twice that and more."""
    draw = np.random.default_rng(6)
    text = Author().cycles(draw, two_axes)
    effects = {name: hidden.ENTRIES[name].draw(draw, THESIS)(1.0)}
    (thermocouple,) = instruments(THERMOCOUPLE, "cycles")
    times, (usual,) = Plant({}).readings(Trial(text, 0.0, 600.0), [thermocouple], draw)
    _, (warm,) = Plant(effects).readings(Trial(text, 0.0, 600.0), [thermocouple], draw)
    reading = Reading(SEEN, times, np.zeros(len(times)))
    run = Measured("run.DAT", mopro.compile(text), None, 0.0, (reading,))
    motor = ForwardModel(
        Experiment(Source("experiment.toml", ""), load_machine("chow1992"), (run,), ())
    )
    (predicted,) = motor(effects)
    assert predicted == pytest.approx(warm, abs=0.01)
    assert np.abs(warm - usual).max() > 0.02
