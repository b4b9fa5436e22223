"""What can be varied, over which values, in which units; and what is refused."""

from fractions import Fraction

import numpy as np
import pytest

import mopro
from mopro.machine import load_machine
from mopro.program.statements import canonical
from mopro.sweeps.targets import Variant, VaryError
from mopro.sweeps.varied import all_varied

TEXT = "UU012500/1\nVEL1 10.0\nACC1 0.5\nPARA1+\nMRI1 3.0\nWX1\nVEL1 20.0\nMRI1 -3.0\nWX1\n"
PROGRAM = mopro.compile(TEXT, "P.CMD")
MACHINE = load_machine("chow1992")
BASE = Variant(PROGRAM, MACHINE, 0.0)


def varied(text, machine=MACHINE):
    name, _, values = text.partition("=")
    (found,) = all_varied([(name, values)], PROGRAM, machine)
    return found


@pytest.mark.parametrize(
    ("text", "levels", "column"),
    [
        ("VEL1=10:60:25", [10, 35, 60], "VEL1_in_s"),
        ("VEL1=10:60:20", [10, 30, 50], "VEL1_in_s"),
        ("VEL1=3:1:-1in/s", [3, 2, 1], "VEL1_in_s"),
        ("VEL1@7=1,2.5", [1, 2.5], "VEL1@7_in_s"),
        ("ACC1=0.2, 0.4", [0.2, 0.4], "ACC1_1000_in_s2"),
        ("ACC1=200,400in/s2", [200, 400], "ACC1_in_s2"),
        ("PARA1=+,-", ["+", "-"], "PARA1"),
        ("payload=0:1:0.5lb", [0, 0.5, 1], "payload_lb"),
        ("payload=1", [1], "payload_kg"),
        ("axis.moving_mass=2000,3000g", [2000, 3000], "axis.moving_mass_g"),
        ("axis.damping_ratio=5,10%", [5, 10], "axis.damping_ratio_percent"),
        ("axis.damping_ratio=0.05", [0.05], "axis.damping_ratio"),
        ("drive.model=full", ["full"], "drive.model"),
        ("effects.viscous_drag.b=0:2:1 N s/m", [0, 1, 2], "effects.viscous_drag.b_N_s_m"),
    ],
)
def test_values_and_columns(text, levels, column):
    found = varied(text)
    assert [v if isinstance(v, str) else float(v) for v in found.levels] == levels
    assert found.column == column


def test_a_tenth_is_met_exactly():
    found = varied("payload=0:5:0.1kg")
    assert len(found.levels) == 51
    assert found.levels[-1] == 5


def test_a_variant_has_what_is_named():
    for text, seen in (
        ("VEL1=30", lambda v: canonical(v.program).count("VEL1 30.0") == 2),
        ("VEL1@7=30", lambda v: canonical(v.program) == TEXT.replace("20.0", "30.0")),
        ("ACC1=400in/s2", lambda v: "ACC1 0.4\n" in canonical(v.program)),
        ("PARA1=-", lambda v: "PARA1-\n" in canonical(v.program)),
        ("payload=2lb", lambda v: v.payload_kg == pytest.approx(0.90718474)),
        ("axis.pitch=1.5mm", lambda v: v.machine.axis.pitch_m == pytest.approx(1.5e-3)),
        ("effects.backlash.B=2mm", lambda v: v.machine.effects[0].values["B"].number == 2e-3),
    ):  # fmt: skip
        found = varied(text)
        assert seen(found.changed(BASE, found.levels[0])), text


def test_values_may_be_a_sequence():
    (found,) = all_varied([("VEL1", np.arange(10, 40, 10))], PROGRAM, MACHINE)
    assert found.levels == (10, 20, 30)
    (found,) = all_varied([("payload", ["1lb", "2lb"])], PROGRAM, MACHINE)
    assert (found.levels, found.unit) == ((1, 2), "lb")


def test_a_drawn_number_can_be_typed_again():
    found = varied("VEL1=1:3")
    assert found.at(1 / 3) == Fraction("1.66667")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("VEL2=1", "P.CMD has no statement VEL2: it has VEL1, ACC1, PARA1"),
        ("VEL1@3=1", "no statement VEL1@3"),
        ("VEL1=1:2:0", "STEP must lead"),
        ("VEL1=3:2:1", "the range is empty"),
        ("VEL1=2:1", "the range is empty"),
        ("VEL1=1:2:3:4", "START:STOP:STEP"),
        ("VEL1=", "'' is no number"),
        ("VEL1=1,,2", "'' is no number"),
        ("VEL1=1e3", "is not its unit"),
        ("VEL1=nan", "'nan' is no number"),
        ("VEL1=1,2,1.0", "1 stands there twice"),
        ("VEL1=0,1", "0 must be greater than 0"),
        ("VEL1=1mm/s", "'mm/s' is not its unit: expected one of in/s"),
        ("VEL1=0.001:1000:0.001", "it has 1000000 values: expected at most 200000"),
        ("PARA1=on", "'on' is none of its values: expected + and -"),
        ("drive.model=half", "expected ideal and full"),
        ("payload=1kg,2lb", "several units, kg, lb"),
        ("payload=-1", "a payload must be from 0 to"),
        ("axis.moving_mas=1", "did you mean `axis.moving_mass`?"),
        ("axis.moving_mass=0", "moving_mass must be from"),
        ("nothing=1", "expected payload, VEL, ACC or PARA of an axis"),
        ("forcers.arm=1m", "it cannot be varied"),
        ("effects.viscous=1", "did you mean `viscous_drag`?"),
        ("effects.viscous_drag=1", "no parameter (none given): it has b"),
        ("effects.lost_steps.n=0.5", "must be a whole number"),
        ("effects.viscous_drag.b=1e9", "is not its unit"),
        ("effects.radiation.eps=2", "eps = 2 is out of bounds"),
        ("VEL1=" + "1," * 6000, "more than 10000 characters"),
    ],
)
def test_what_cannot_be_varied_is_told(text, expected):
    with pytest.raises(VaryError) as refused:
        varied(text)
    assert expected in str(refused.value)
    assert str(refused.value).startswith(f"vary {text.partition('=')[0]}=")


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([], "nothing is varied"),
        (["VEL1", "VEL1"], "VEL1 is varied twice"),
        (["VEL1", "VEL1@7"], "VEL1@7 is varied by VEL1 and by VEL1@7"),
        (["VEL0", "VEL1"], "VEL1 is varied by VEL0 and by VEL1"),
        (["payload"] * 17, "17 quantities"),
    ],
)
def test_a_thing_is_varied_once(names, expected):
    with pytest.raises(VaryError, match=expected):
        all_varied([(name, "1,2") for name in names], PROGRAM, MACHINE)


def test_statements_of_several_lines_are_varied_apart():
    found = all_varied([("VEL1@2", "1"), ("VEL1@7", "2")], PROGRAM, MACHINE)
    variant = BASE
    for each in found:
        variant = each.changed(variant, each.levels[0])
    changed = TEXT.replace("VEL1 10.0", "VEL1 1.0").replace("VEL1 20.0", "VEL1 2.0")
    assert canonical(variant.program) == changed
