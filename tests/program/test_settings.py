"""Settings of a program, named and changed on the IR."""

from fractions import Fraction

import pytest

import mopro
from mopro.program.settings import Setting, microsteps_per_uu, settings_of
from mopro.program.statements import canonical

TEXT = "UU012500/1\nVEL0 10.0\nACC1 0.5\nPARA1+\nMRI1 3.0\nWX1\nVEL1 20.0\nMRI1 -3.0\nWX1\n"
PROGRAM = mopro.compile(TEXT)


@pytest.mark.parametrize(
    ("name", "value", "before", "after"),
    [
        ("VEL1@7", Fraction(7), "VEL1 20.0\n", "VEL1 7.0\n"),
        ("VEL2", Fraction(7), "VEL0 10.0\n", "VEL1 10.0\nVEL2 7.0\n"),
        ("ACC1", Fraction(1, 4), "ACC1 0.5\n", "ACC1 0.25\n"),
        ("PARA0", False, "PARA1+\n", "PARA1-\n"),
    ],
)
def test_a_setting_changes_its_statements_and_no_other(name, value, before, after):
    changed = Setting.named(name).changed(PROGRAM, value)
    assert canonical(changed) == TEXT.replace(before, after)


def test_without_a_line_all_statements_of_the_axis_change():
    changed = canonical(Setting.named("VEL1").changed(PROGRAM, Fraction(5, 2)))
    assert changed == TEXT.replace("VEL0 10.0", "VEL2 10.0\nVEL1 2.5").replace("20.0", "2.5")


@pytest.mark.parametrize("name", ["VEL", "VEL3", "VEL1@0", "vel1", "MRI1", "VEL1@", "VEL1@2x", ""])
def test_what_is_no_setting_has_no_name(name):
    assert Setting.named(name) is None


@pytest.mark.parametrize("name", ["VEL1", "ACC0", "PARA2@14"])
def test_a_setting_is_written_as_it_is_read(name):
    assert str(Setting.named(name)) == name


def test_the_settings_and_the_unit_of_a_program():
    assert settings_of(PROGRAM) == ["VEL1", "ACC1", "PARA1", "VEL2"]
    assert microsteps_per_uu(PROGRAM, (1,)) == 12500
    two = mopro.compile(TEXT + "UU11/1\n")
    assert (microsteps_per_uu(two, (1,)), microsteps_per_uu(two, (2,))) == (None, 12500)
