"""A frame that swings: what a draft tells of it can be written as an effect, and is named then."""

import numpy as np
import pytest

from helpers.stated import follows, write
from mopro.engine.swing import swing
from mopro.experiment.opened import open_experiment

FRAME = (
    follows(0.002, "run.csv")
    + """\
[[effect]]
name = "frame that gives way"
enters = "measurement"
formula = "c * swing(a, f, zeta)"
c = { unit = "s2" }
f = { unit = "Hz", role = "shape", range = [1, 8] }
zeta = { unit = "1", role = "shape", range = [0.01, 0.5] }
"""
)


@pytest.mark.parametrize("size", [1e-4, 0.0])
def test_a_frame_that_gives_way_is_named_as_the_user_wrote_it(tmp_path, size):
    t = np.arange(0, 30, 0.02)
    waves = [(20.0, 2.0, 0.0), (8.0, 5.0, 1.0), (1.0, 13.0, 0.0)]
    x = sum(a * np.sin(w * t + p) for a, w, p in waves)
    pushed = sum(-a * w * w * np.sin(w * t + p) for a, w, p in waves)
    noise = 0.002 * np.random.default_rng(1).standard_normal(len(t))
    read = x + size * swing(t, pushed, 3.0, 0.1) + noise
    write(tmp_path / "run.csv", {"time_s": t, "target_mm": x, "position_mm": read})
    (tmp_path / "experiment.toml").write_text(FRAME, encoding="utf-8")
    verdict = open_experiment(tmp_path / "experiment.toml").conclude().verdict
    if not size:
        assert verdict.verdict == "none"
        return
    (effect,) = verdict.effects
    values = {name: own.value for name, own in effect.parameters.items()}
    assert (verdict.verdict, effect.name) == ("named", "frame that gives way")
    assert values == pytest.approx({"c": 1e-4, "f": 3.0, "zeta": 0.1}, rel=0.02)
