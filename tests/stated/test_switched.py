"""What a machine's file switches on: in any unit, by its name, and told where it does nothing."""

import numpy as np
import pytest

from helpers.stated import DRIVE, DRIVEN, FRICTION_OF_PLACE, drive_folder
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment

BASE = {"base": {"viscous": 3.0, "spring": 40.0}}


def system(folder, stated, experiment=DRIVEN):
    path = drive_folder(folder, DRIVE + FRICTION_OF_PLACE + stated, experiment, length_s=4.0)
    return open_experiment(path).system


@pytest.mark.parametrize(
    ("stated", "effect", "values"),
    [
        ('[effects.stiffness]\nk = { value = 0.02, unit = "N/mm" }', "stiffness", {"k": 20.0}),
        ('[effects.stiffness]\nk = { value = 20, unit = "N/m" }', "stiffness", {"k": 20.0}),
        ('[effects.input_lag]\ntau = { value = 25, unit = "ms" }', "input_lag", {"tau": 0.025}),
        (
            '[effects."friction of place"]\nF1 = { value = 0.012, unit = "kN/m" }',
            "friction of place", {"F1": 12.0},
        ),
        (
            '[effects.cogging]\nP = { value = 0.02, unit = "m" }\ns = 0.5\n'
            'c = { value = 300, unit = "mN" }',
            "cogging", {"P": 0.02, "s": 0.5, "c": 0.3},
        ),
    ],
)  # fmt: skip
def test_an_effect_acts_by_the_unit_that_the_file_states(tmp_path, stated, effect, values):
    model = system(tmp_path, "\n" + stated + "\n").model
    factors = {p.name: p.factor for p in model.form(effect, values).parameters}
    own = {name: value / factors[name] for name, value in values.items()}
    (by_file,), (by_settings,) = model(BASE), model({**BASE, effect: own})
    (without,) = model({**BASE, effect: own | dict.fromkeys(own.keys() - {"P"}, 0.0)})
    assert by_file == pytest.approx(by_settings, rel=1e-12)
    assert np.abs(by_file - without).max() > 1e-3


@pytest.mark.parametrize(
    ("stated", "rule", "words"),
    [
        ("[effects.stifness]\nk = 20", "unknown-effect", "there is no effect stifness"),
        ("[effects.stiffness]\nkk = 20", "unknown-parameter", "stiffness has no parameter kk"),
        ('[effects.stiffness]\nk = { value = 20, unit = "N" }', "wrong-unit", "k is stated in N"),
        ('[effects.stiffness]\nk = { value = 20, unit = "lightyear" }', "", "lightyear"),
    ],
)
def test_what_cannot_act_is_told_at_its_line(tmp_path, stated, rule, words):
    with pytest.raises(ModelError, match=words) as found:
        system(tmp_path, "\n" + stated + "\n")
    (finding,) = found.value.diagnostics
    text = DRIVE + FRICTION_OF_PLACE + "\n" + stated
    assert finding.span.line in (text.count("\n"), text.count("\n") + 1)
    assert rule in ("", finding.rule)


GROWING = """\
kind = "kinematic"
name = "stage"
unit = "mm"

[effects.thermal_growth]
g = { value = 12, unit = "1/K" }
"""


def test_an_effect_that_these_data_lack_is_told(tmp_path):
    """Without a temperature nothing grows."""
    text = DRIVEN.replace("start = { x = 0, v = 0 }\n", "")
    text = text.replace('force = { column = "force_N"', 'command = { column = "position_mm"')
    notes = open_experiment(drive_folder(tmp_path, GROWING, text)).system.experiment.notes
    assert "thermal_growth of stage is left out: these data lack what it acts on" in notes
