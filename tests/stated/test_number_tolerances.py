"""The tolerance of a number: a share, or in a unit; within it a correction is a calibration."""

import pytest

from helpers.stated import DRIVE, DRIVEN, drive_folder
from mopro.errors import ModelError
from mopro.experiment.opened import open_experiment
from mopro.source import Source
from mopro.stated.file import read_stated

MASS = 'mass = { value = 2.0, unit = "kg", tolerance = 0.05 }'


def mass(stated):
    text = DRIVE.replace(MASS, f"mass = {stated}")
    assert MASS in DRIVE
    return read_stated(Source("machine.toml", text)).numbers["mass"]


@pytest.mark.parametrize(
    ("stated", "share", "doubtful"),
    [
        ('{ value = 2.0, unit = "kg", tolerance = 0.05 }', 0.05, False),
        ('{ value = 50, unit = "kg", tolerance = 0.05 }', 0.05, False),
        ('{ value = 0.2, unit = "kg", tolerance = 0.1 }', 0.1, False),
        ('{ value = 2.0, unit = "kg", tolerance = 0 }', 0.0, False),
        ('{ value = 2.0, unit = "kg", tolerance = 0.999 }', 0.999, False),
        ('{ value = 2.0001, unit = "kg", tolerance = 1e-5 }', 1e-5, False),
        ('{ value = 2.0, unit = "kg", tolerance = { value = 100, unit = "g" } }', 0.05, False),
        ('{ value = 2.0, unit = "kg", tolerance = { value = 0.1, unit = "kg" } }', 0.05, False),
        ('{ value = 0.000132, unit = "kg", tolerance = 1.44e-05 }', 0.109, True),
        ('{ value = 1.32e-4, unit = "kg", tolerance = 0.0000144 }', 0.109, True),
        ('{ value = 0.00011042, unit = "kg", tolerance = 1.44e-05 }', 0.1304, True),
        ('{ value = 0.1, unit = "kg", tolerance = 0.02 }', 0.02, False),
        ('{ value = 0.01, unit = "kg", tolerance = 0.005 }', 0.005, False),
        ('{ value = 0.0, unit = "kg", tolerance = 1e-5 }', 1e-5, False),
        ('{ value = 50, unit = "kg", tolerance = 4 }', 0.08, True),
        ('{ value = 50, unit = "kg", tolerance = 1 }', 0.02, True),
    ],
)
def test_a_tolerance_is_a_share_unless_it_cannot_be_one(stated, share, doubtful):
    number = mass(stated)
    assert number.tolerance == pytest.approx(share, rel=1e-2)
    assert bool(number.note) == doubtful


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ('{ value = 2.0, unit = "kg", tolerance = 2.0 }', "as a share, such as 0.1"),
        ('{ value = 2.0, unit = "kg", tolerance = -0.1 }', "as a share, such as 0.1"),
        ('{ value = 2.0, unit = "kg", tolerance = "5 %" }', "as a share, such as 0.1"),
        ('{ value = 0.0, unit = "kg", tolerance = 3 }', "as a share, such as 0.1"),
        ('{ value = 2.0, unit = "kg", tolerance = { value = 1, unit = "mm" } }', "in mm"),
        ('{ value = 2.0, unit = "kg", tolerance = { value = 3, unit = "kg" } }', "as large as"),
        ('{ value = 2.0, unit = "kg", tolerance = { value = 3 } }', "no unit"),
        ('{ value = 2.0, unit = "kg", tolerance = { share = 3 } }', "share"),
    ],
)
def test_what_is_no_tolerance_is_told_at_its_place(stated, words):
    with pytest.raises(ModelError, match=words):
        mass(stated)


@pytest.mark.parametrize(
    "tolerance", ["0.12", "24", '{ value = 24, unit = "g" }', '{ value = 0.024, unit = "kg" }']
)
def test_a_number_within_its_tolerance_is_calibrated_however_that_is_stated(tmp_path, tolerance):
    """The mass is 0.2 kg; nothing else is off."""
    value, unit = ("220", "g") if tolerance == "24" else ("0.22", "kg")
    own = f'mass = {{ value = {value}, unit = "{unit}", tolerance = {tolerance} }}'
    path = drive_folder(tmp_path, DRIVE.replace(MASS, own), DRIVEN, mass=0.2)
    verdict = open_experiment(path).conclude().verdict
    assert (verdict.verdict, verdict.effects) == ("none", ())
    (calibrated,) = verdict.calibration
    factor = 1e3 if unit == "g" else 1.0
    assert calibrated.parameters["mass"].value == pytest.approx(0.2 * factor, rel=0.02)
