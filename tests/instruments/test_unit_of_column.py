"""The unit that the name of a column ends in."""

import pytest

from mopro.formula import dimension_of_unit
from mopro.instruments.quantity import MEASURABLES, unit_of_column

PLACES = ("m", "cm", "mm", "um", "nm", "in", "mil", "rad", "mrad", "deg", "arcmin", "arcsec")
PLACES += ("turn", "rev", "count", "step")


@pytest.mark.parametrize("unit", PLACES)
@pytest.mark.parametrize("per", ["_s", "_per_s"])
def test_a_speed_in_every_unit_of_a_place_is_no_time(unit, per):
    found = unit_of_column(f"speed_{unit}{per}")
    assert found == f"{unit}/s"
    speeds = [dimension_of_unit(own) for own in MEASURABLES["speed"].units]
    assert dimension_of_unit(found) in speeds
    assert unit_of_column(f"place_{unit}") == unit


@pytest.mark.parametrize("name", ["time_s", "t_s", "s", "begun_s"])
def test_a_time_is_a_time(name):
    assert unit_of_column(name) == "s"
