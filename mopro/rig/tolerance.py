"""The tolerance that a number of a machine's file is known with."""

from __future__ import annotations

import math
from collections.abc import Callable

from mopro.formula import dimension_of_unit
from mopro.formula.dimension import factor_of
from mopro.formula.entry import inline, read_unit
from mopro.tomlfile import Value
from mopro.tomlfile.schema import number_in

# Assumed: no number of a machine is known to better than this share of it. A tolerance that is
# less as a share, and more in the unit of the number, is in that unit.
_FINEST = 1e-3
_DOUBT = (
    "a tolerance of {0:g} is taken in {1}, {2:.3g} of the number, as hardly any is known to such a "
    'share: state tolerance = {2:.3g}, or {{ value = {0:g}, unit = "{1}" }}'
)
_EXPECTED = "expected {} as a share, such as 0.1"


def tolerance_of(number: float, unit: str) -> Callable[[Value], tuple[float, str]]:
    """Reader of the tolerance of `number`: as a share of it, and a note on a doubtful one."""

    def read(value: Value) -> tuple[float, str]:
        if isinstance(value.data, dict):
            return _in_its_unit(value, number, unit), ""
        stated = number_in(value.data)
        if stated is None or stated < 0:
            raise value.refused(_EXPECTED.format(value.key))
        of_number = stated / abs(number) if number else math.inf
        if stated < 1 and not (0 < stated < _FINEST <= of_number < 1):
            return stated, ""
        if not of_number < 1:
            raise value.refused(_EXPECTED.format(value.key))
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
