"""The tolerance that a number of a machine's file is known with."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal

from mopro.assumed import LEAST_SHARE
from mopro.formula import dimension_of_unit
from mopro.formula.dimension import factor_of
from mopro.formula.entry import inline, read_unit
from mopro.tomlfile import Value
from mopro.tomlfile.schema import number_in

# A tolerance is no share of its number if it would be so much finer than the number's last digit.
_FINEST = LEAST_SHARE**2
_DOUBT = (
    "a tolerance of {0:g} is taken in {1}, {2:.3g} of the number, as a share would be finer than "
    'its digits: state tolerance = {2:.3g}, or {{ value = {0:g}, unit = "{1}" }}'
)


def tolerance_of(number: float, unit: str) -> Callable[[Value], tuple[float, str]]:
    """Reader of the tolerance of `number`: as a share of it, and a note on a doubtful one."""

    def read(value: Value) -> tuple[float, str]:
        if isinstance(value.data, dict):
            return _in_its_unit(value, number, unit), ""
        stated = number_in(value.data)
        share = math.inf if stated is None or stated < 0 else stated
        if share < 1 and (share == 0 or share > _FINEST * _rounding(number)):
            return share, ""
        of_number = share / abs(number) if number else math.inf
        if not of_number < 1:
            if share < 1:
                return share, ""
            raise value.refused(f"expected {value.key} as a share, such as 0.1")
        return of_number, _DOUBT.format(stated, unit, of_number)

    return read


def _in_its_unit(value: Value, number: float, unit: str) -> float:
    """The share of `number` that a tolerance with a unit of its own is."""
    table = inline(value, f'{{ value = 0.1, unit = "{unit}" }}')
    table.only({"value", "unit"})
    stated, own = number_in(table.data.get("value")), table.need("unit", read_unit, "no unit")
    if stated is None or stated < 0 or own is None:
        raise value.refused(f'expected {{ value = 0.1, unit = "{unit}" }}')
    if dimension_of_unit(own) != dimension_of_unit(unit):
        raise value.refused(f"the number is in {unit}, and its tolerance in {own}", "wrong-unit")
    share = stated * factor_of(own) / (abs(number) * factor_of(unit)) if number else math.inf
    if not share < 1:
        raise value.refused("the tolerance is as large as the number: state it free")
    return share


def _rounding(number: float) -> float:
    """Half a unit of the last digit that a number is stated with, as a share of it."""
    exponent = Decimal(repr(number)).as_tuple().exponent
    return 10.0 ** int(exponent) / 2 / abs(number) if number else 0.0
